"""Pictures whose odd and even rows were taken at different times."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.arrays import Image
from pipeline.errors import UnusableError
from pipeline.recording.base import Recording
from pipeline.recording.one_field import even_rows
from stages.premises.pictures import combing
from tests.premises_run import checked, good_recording, steady_run
from tests.ring_images import MemorySource


def interlaced(recording: Recording, later: int) -> Recording:
    """Return a recording whose odd rows are those of the picture so many ``later``."""
    images = recording.source.images
    woven = {f: image.copy() for f, image in images.items()}
    for frame, image in woven.items():
        image[1::2] = images.get(frame + later, images[frame])[1::2]
    return replace(recording, source=MemorySource(woven, recording.source.image_size))


def test_sound_pictures_are_not_changed() -> None:
    frames, told = checked(good_recording(), steady_run().probe)
    assert not frames.interlaced
    assert not [w for w in told if "interlaced" in w]


@pytest.mark.parametrize("later", [1, 2], ids=["the other light", "the same light"])
def test_of_interlaced_pictures_the_even_rows_are_used(later: int) -> None:
    good, probe = good_recording(), steady_run().probe
    woven = interlaced(good, later)
    frames, told = checked(woven, probe)
    assert [w for w in told if "interlaced" in w]
    assert frames.illumination.tolist() == good.frames.illumination.tolist()
    used = frames.applied_to(woven)
    for (_, seen), (_, meant) in zip(used.read([4, 7], "grey"), good.read([4, 7], "grey"), strict=True):
        np.testing.assert_array_equal(seen[::2], meant[::2])
        assert combing(seen) < 1


def test_interlaced_pictures_end_a_run_without_repair() -> None:
    with pytest.raises(UnusableError, match="interlaced"):
        checked(interlaced(good_recording(), 2), steady_run().probe, mend=False)


@pytest.mark.parametrize("rows", [1, 2, 3, 4])
def test_odd_rows_become_the_mean_of_their_neighbours(rows: int) -> None:
    image = np.array([10, 99, 21, 99], np.uint8)[:rows, None]
    wanted = {1: [10], 2: [10, 10], 3: [10, 16, 21], 4: [10, 16, 21, 21]}[rows]
    assert even_rows(image)[:, 0].tolist() == wanted


@pytest.mark.parametrize("row_noise", [0.0, 8.0])
def test_noise_is_not_taken_for_interlacing(row_noise: float) -> None:
    random = np.random.default_rng(3)
    noise = 3 * random.standard_normal((480, 640)) + row_noise * random.standard_normal((480, 1))
    image: Image = np.clip(40 + noise, 0, 255).astype(np.uint8)
    assert combing(image) == pytest.approx(1.0, abs=0.08)


def test_black_pictures_are_not_called_interlaced() -> None:
    assert np.isnan(combing(np.zeros((48, 64), np.uint8)))
