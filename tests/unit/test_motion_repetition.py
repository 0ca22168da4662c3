"""Texture is followed along walls with printed patterns, with and without marks that do not repeat."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from pipeline.arrays import Float, Image
from stages.motion import MotionParameters
from stages.motion.tracking.overlap import Overlap, StoredStrip, along
from stages.motion.tracking.strips import Hidden, StripGrid, softened
from stages.motion.tracking.tracker import TextureTracker, TrackedTexture
from tests.unit.drawn_pipe import RADIUS, led_light, small_probe, wall_hits

PERIOD_MM, STEP_MM = 10.0, 9.0
PARAMETERS = MotionParameters.model_validate({"patch_half_px": 8})
GRID = StripGrid(RADIUS, 480, RADIUS / np.tan(1.3), RADIUS / np.tan(0.7))
PROBE = small_probe()


def marks(contrast: float) -> Float:
    """Return marks (distance at 0.5 mm, azimuth at 0.5°) that do not repeat, 1 σ ``contrast``."""
    blurred = gaussian_filter(
        np.random.default_rng(3).standard_normal((500, 720)), 3, mode=("nearest", "wrap")
    )
    return contrast * blurred / blurred.std()


def picture(at_mm: float, pattern: float, spots: Float) -> Image:
    """Return the lit wall from a distance: dots 10 mm apart of some contrast, and ``spots``."""
    T_pc = np.eye(4)
    T_pc[2, 3] = at_mm
    xyz = wall_hits(PROBE, T_pc)
    s, psi = xyz[..., 2], np.arctan2(xyz[..., 1], xyz[..., 0])
    dots = np.cos(2 * np.pi * s / PERIOD_MM) * np.cos(16 * psi)
    at = np.clip(2 * s, 0, 499), np.mod(np.degrees(psi) * 2, 720)
    wall = 0.5 * (1 + pattern * dots + map_coordinates(spots, at, order=1, mode="grid-wrap"))
    light = led_light(PROBE, T_pc, xyz)
    image = 200 * wall * light / np.percentile(light, 99)
    image = image + np.random.default_rng(int(at_mm)).normal(0, 0.5, image.shape)
    return softened(np.clip(np.round(image), 0, 255).astype(np.uint8))


def followed(pattern: float, spots: Float, step_mm: float = STEP_MM, frames: int = 4) -> TrackedTexture:
    """Return pictures followed by a predictor that knows nothing but the last pose."""
    tracker, T_pc = TextureTracker(PROBE, GRID, PARAMETERS, Hidden()), np.eye(4)
    with ThreadPoolExecutor(1) as aside:
        for frame in range(frames):
            T_pc = tracker.follow(frame, picture(frame * step_mm, pattern, spots), T_pc, aside)
    return tracker.result()


@pytest.mark.parametrize("contrast", [0.1, 0.15, 0.2])
def test_marks_that_do_not_repeat_decide_between_steps(contrast: float) -> None:
    found = followed(0.25, marks(contrast))
    np.testing.assert_allclose(found.poses.T_pc[:, 2, 3], STEP_MM * np.arange(4), atol=0.5)
    assert not found.ambiguous


def test_where_nothing_else_is_on_the_wall_the_step_is_ambiguous() -> None:
    assert followed(0.3, marks(0.0)).ambiguous == 3


def test_steps_behind_lost_pictures_of_a_wall_that_repeats_are_ambiguous() -> None:
    """Every other picture was lost, each step between found ones was a period short, and nothing was told."""
    found = followed(0.3, marks(0.0), 6.0, 8)
    assert found.poses.lost[2::2].all()
    assert found.ambiguous >= 3


def test_a_wall_that_does_not_repeat_is_not_ambiguous() -> None:
    found = followed(0.0, marks(0.2))
    np.testing.assert_allclose(found.poses.T_pc[:, 2, 3], STEP_MM * np.arange(4), atol=0.5)
    assert not found.ambiguous


@pytest.mark.parametrize("most_turned", [0, 9])
def test_few_turns_correlate_as_they_do_among_all(most_turned: int) -> None:
    drawn = gaussian_filter(np.random.default_rng(5).standard_normal((64, 240)), 2, mode="wrap")
    later = np.roll(drawn, (6, -4), (0, 1))
    drawn[:20, 30:90] = np.nan
    strips = [StoredStrip(first, x.astype(np.float32)) for first, x in ((40, drawn), (48, later))]
    shift, height = along(*strips, most_turned)
    whole = Overlap.of(*strips)
    few, order = np.abs(whole.column[0]) <= most_turned, np.argsort(whole.row[:, 0], kind="stable")
    np.testing.assert_array_equal(shift, whole.row[order, 0])
    np.testing.assert_allclose(height, whole.height[np.ix_(order, few)].max(1), atol=1e-5)
