"""Pictures whose odd and even rows were taken at different times."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.arrays import Image
from pipeline.recording.base import Recording
from stages.premises.pictures import combing
from tests.premises_run import checked, good_recording, steady_run
from tests.ring_images import MemorySource


def interlaced(recording: Recording) -> Recording:
    """Return a recording whose odd rows are those of the next picture in like light."""
    images = recording.source.images
    woven = {f: image.copy() for f, image in images.items()}
    for frame, image in woven.items():
        image[1::2] = images.get(frame + 2, images[frame])[1::2]
    return replace(recording, source=MemorySource(woven, recording.source.image_size))


def test_interlaced_pictures_are_told() -> None:
    probe = steady_run().probe
    assert not [w for w in checked(good_recording(), probe)[1] if "interlaced" in w]
    assert [w for w in checked(interlaced(good_recording()), probe)[1] if "interlaced" in w]


@pytest.mark.parametrize("row_noise", [0.0, 8.0])
def test_noise_is_not_taken_for_interlacing(row_noise: float) -> None:
    random = np.random.default_rng(3)
    noise = 3 * random.standard_normal((480, 640)) + row_noise * random.standard_normal((480, 1))
    image: Image = np.clip(40 + noise, 0, 255).astype(np.uint8)
    assert combing(image) == pytest.approx(1.0, abs=0.08)


def test_a_black_picture_tells_nothing() -> None:
    assert np.isnan(combing(np.zeros((48, 64), np.uint8)))
