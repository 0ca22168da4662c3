"""The errors of the line beyond its noise ("wander"), estimated from rings with known errors."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.artefacts.measured import RingSamples, RingValidity
from stages.rings.wander import wander_of

RINGS, AZIMUTHS = 60, 720
RADIUS_PX, WIDTH_PX, STATED_PX = 220.0, 1.2, 0.05
AZIMUTH = np.linspace(-np.pi, np.pi, AZIMUTHS, endpoint=False)
HEIGHTS = (40.0, 200.0)


def rings(even_px: float, slope_px: float, seed: int, count: int = RINGS) -> RingSamples:
    """Return round rings of lines of any brightness, with errors as stated and a wander."""
    draw = np.random.default_rng(seed)
    amplitude = np.repeat(np.exp(draw.uniform(*np.log(HEIGHTS), (count, AZIMUTHS // 90))), 90, axis=1)
    sigma = np.hypot(STATED_PX, np.hypot(even_px, slope_px / amplitude))
    radius = RADIUS_PX + sigma * draw.standard_normal((count, AZIMUTHS))
    plain = np.ones_like(radius, np.float32)
    return RingSamples(
        np.arange(count), AZIMUTH, np.zeros(2), radius.astype(np.float32), STATED_PX * plain,
        WIDTH_PX * plain, amplitude.astype(np.float32), np.zeros(radius.shape, np.uint8),
    )  # fmt: skip


@pytest.mark.parametrize(("even_px", "slope_px"), [(0.1, 0.0), (0.0, 12.0), (0.08, 12.0)])
def test_faint_and_bright_lines_each_get_their_wander(even_px: float, slope_px: float) -> None:
    heights = np.array(HEIGHTS)
    true: Float = np.hypot(even_px, slope_px / heights)
    found = np.mean([wander_of(rings(even_px, slope_px, seed)).at(heights) for seed in range(8)], 0)
    np.testing.assert_allclose(found, true, rtol=0.08)


def test_rings_with_right_sigma_have_nearly_no_wander() -> None:
    assert wander_of(rings(0.0, 0.0, 1)).at(np.array(HEIGHTS)).max() < STATED_PX / 2


def test_few_samples_give_one_wander_for_all_brightnesses() -> None:
    found = wander_of(rings(0.1, 0.0, 2, count=1))
    assert found.slope_px == 0.0
    assert found.even_px == pytest.approx(0.1, rel=0.25)


def test_rings_without_a_sample_have_no_wander() -> None:
    empty = rings(0.1, 0.0, 3)
    empty.validity[:] = RingValidity.NO_LINE
    assert wander_of(empty).at(100.0) == 0.0
