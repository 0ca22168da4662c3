"""What lies beyond the end of the pipe does not steer the motion."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.recording.base import Encoder, Illumination
from stages.motion.estimate import estimate_motion
from stages.motion.measuring import measure_run
from stages.motion.parameters import MotionParameters
from stages.motion.pipe_end import end_in_view, last_on_wall, without_pictures_behind
from stages.motion.tracking.strips import NEVER, Hidden
from tests.drawn_run import BASELINE, DrawnRun, drawn_run, wall_hits
from tests.quiet import quiet_context
from tests.ring_images import MemorySource

COUNT, LAST = 44, 20
PARAMETERS = MotionParameters()


@pytest.fixture(scope="module")
def run() -> DrawnRun:
    """Return a run whose last ring on the wall is that of frame 20; beyond, all pictures show one picture."""
    z_mm = 0.5 * np.arange(COUNT)
    whole = drawn_run(z_mm, np.zeros(COUNT))
    end_mm = z_mm[LAST] + BASELINE + 0.3
    width, height = whole.probe.camera.image_size
    noise = np.random.default_rng(2).uniform(20, 90, (height // 6, width // 6)).astype(np.float32)
    outside = cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC).clip(10, 200)
    images = {
        k: np.where(wall_hits(whole.probe, whole.T_pc[k])[..., 2] > end_mm, outside, image).astype(np.uint8)
        for k, image in whole.recording.source.images.items()
    }
    lost = whole.points.frame > LAST
    xyz, noise_mm = (
        np.where(lost[:, None, None], np.float32(np.nan), a)
        for a in (whole.points.xyz_c, whole.points.noise_direction)
    )
    points = replace(whole.points, xyz_c=xyz, noise_direction=noise_mm)
    recording = replace(whole.recording, source=MemorySource(images, (width, height)))
    return replace(whole, recording=recording, points=points)


def test_distances_are_right_where_the_pipe_ends_in_view(run):
    """The picture beyond the end stands still: the encoder was thrown away, the way a third too short."""
    told: list[str] = []
    context = replace(quiet_context(), warn=told.append)
    got = estimate_motion(run.recording, run.probe, run.rings, run.points, PARAMETERS, context)
    wrong = got.T_pc[:, 2, 3] - run.T_pc[:, 2, 3]
    assert np.abs(wrong - wrong[0]).max() < 0.1
    assert f"last seen on the wall in frame {LAST}" in told[0]
    assert not any("the encoder is not used" in words for words in told)


def test_without_the_mend_the_picture_beyond_the_end_is_followed(run):
    """Control: the drawn end does mislead."""
    told: list[str] = []
    context = replace(quiet_context(), warn=told.append)
    measure_run(run.recording, run.probe, run.rings, run.points, PARAMETERS, context)
    assert any("the encoder is not used" in words for words in told)


def test_the_last_ring_on_the_wall_is_found(run):
    assert last_on_wall(run.recording, run.points, 0) == LAST
    whole = replace(run.points, xyz_c=np.nan_to_num(run.points.xyz_c))
    assert last_on_wall(run.recording, whole, 0) is None
    assert last_on_wall(run.recording, whole, 9) == COUNT - 2, "pictures without a line were left out"
    begins = replace(run.points, xyz_c=run.points.xyz_c[::-1])
    assert last_on_wall(run.recording, begins, 0) is None


def test_pictures_behind_it_are_not_lit(run):
    lit = without_pictures_behind(run.recording, LAST).frames.of(Illumination.LED)
    assert lit.tolist() == list(range(1, LAST, 2))
    assert without_pictures_behind(run.recording, None) is run.recording


def test_the_encoder_tells_from_where_the_end_is_in_view(run):
    told: list[str] = []
    context = replace(quiet_context(), warn=told.append)
    assert end_in_view(run.recording, LAST, 2.65, context) == LAST - 5
    assert end_in_view(run.recording, None, 5.0, context) == NEVER
    encoder = run.recording.encoder
    back = replace(run.recording, encoder=Encoder(encoder.time_s, -encoder.distance_mm))
    assert end_in_view(back, LAST, 5.0, context) == NEVER
    assert len(told) == 1
    assert end_in_view(replace(run.recording, encoder=None), LAST, 5.0, context) == NEVER
    assert "Without an encoder it is not known" in told[1]


def test_from_there_on_wall_beyond_the_line_is_hidden():
    hidden = Hidden((21.0, 23.0), None, 7)
    assert hidden.at(6) is hidden
    assert hidden.at(7).line_mm == (21.0, np.inf)
