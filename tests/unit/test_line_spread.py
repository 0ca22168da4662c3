"""The line's shape gets the name whose shape fits it, and none where no shape fits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import exponnorm

from pipeline.arrays import Float
from stages.diagnose.profile.cells import Cells, LineGeometry, fit_gaussians
from stages.diagnose.profile.line_spread import Shape, explanations, line_spread
from stages.diagnose.profile.naming import shape_findings
from tests.profile_lines import probe

OFFSET = np.arange(-59.75, 60.0, 0.5)
WIDTH_PX, SCALES = 1.3, (5.5, 6.5, 7.0)


def cells(light: Callable[[Float, float], Float], seed: int = 0) -> Cells:
    """Three blocks at three distances to the wall, each of 72 sectors; ``light`` of px and px per mm."""
    random = np.random.default_rng(seed)
    block, sector = np.repeat(np.arange(3), 72), np.tile(np.arange(72), 3)
    profile = np.array([light(OFFSET, s) for s in SCALES])[block]
    profile = profile + 0.006 * np.exp(-0.5 * (OFFSET / 4) ** 2) + random.normal(0, 2e-3, profile.shape)
    centre, width, peak = fit_gaussians(profile, OFFSET)
    gauss = np.exp(-0.5 * ((OFFSET - centre[:, None]) / width[:, None]) ** 2)
    ones = np.ones(len(block))
    return Cells(
        OFFSET, block, sector, profile, centre, width, profile / peak[:, None] - gauss, ones > 0, 0 * ones,
        np.array(SCALES)[block], 40 * ones, 100 * ones, tuple(np.arange(12) + 12 * b for b in range(3)),
    )  # fmt: skip


def bell(x: Float, width: float = WIDTH_PX) -> Float:
    return np.asarray(np.exp(-0.5 * (x / width) ** 2))


def tail(x: Float, scale: float) -> Float:
    return np.asarray(exponnorm.pdf(-x, 0.25 * scale / WIDTH_PX, scale=WIDTH_PX) * 3)


def copy(x: Float, scale: float) -> Float:
    return bell(x) + 0.1 * bell(x + 0.8 * scale)


def halo(x: Float, scale: float) -> Float:
    return bell(x) + 0.2 * bell(x + 0.4 * scale, float(np.hypot(WIDTH_PX, 0.5 * scale)))


def shelf(x: Float, scale: float) -> Float:
    """A flat step of light on one side, which ends sharply: no shape of the library."""
    return bell(x) + 0.1 * ((x < 0) & (x > -1.5 * scale))


@pytest.mark.parametrize(
    ("light", "shape", "way_mm"),
    [(tail, Shape.TAIL, 0.25), (copy, Shape.COPY, 0.8), (halo, Shape.HALO, 0.4)],
)
def test_a_shape_is_told_from_the_others_and_measured(
    light: Callable[[Float, float], Float], shape: Shape, way_mm: float
) -> None:
    (found,) = explanations(line_spread(cells(light)))
    assert found.shape is shape
    assert found.way_mm == pytest.approx(way_mm, rel=0.1)
    assert found.left < 0.03


def test_a_shape_that_nobody_knows_gets_no_name() -> None:
    assert explanations(line_spread(cells(shelf))) == ()


SHEET_MM, BLUR_PX = 0.2, 0.65


def geometry_of(of: Cells) -> LineGeometry:
    """Return the geometry of frames that all look as their block does."""
    width, scale = (np.repeat(v.reshape(3, -1), 12, axis=0) for v in (of.width_px, of.px_per_mm))
    ones = np.ones_like(width)
    return LineGeometry(
        of.azimuth_rad[:72], 200 * ones, width, 100 * ones, 40 * ones, ones, scale, 0 * ones, ones[:, 0] > 0
    )


@pytest.mark.parametrize(
    ("sheet_mm", "tail_mm", "name", "size"),
    [
        (np.sqrt(SHEET_MM**2 - 0.17**2), 0.17, "line_skew", 2 * (0.17 / SHEET_MM) ** 3),
        (SHEET_MM, 0.2, "subsurface", 0.2),
    ],
)
def test_the_width_without_a_tail_tells_whether_sheet_or_wall_makes_it(
    sheet_mm: float, tail_mm: float, name: str, size: float
) -> None:
    """The variance of the whole line had left both names for the tail of a skewed sheet."""

    def light(x: Float, scale: float) -> Float:
        normal = float(np.hypot(BLUR_PX, sheet_mm * scale))
        density = exponnorm.pdf(-x, tail_mm * scale / normal, scale=normal)
        return np.asarray(density * normal * np.sqrt(2 * np.pi))

    of, stated = cells(light), probe()
    stated = replace(stated, laser=replace(stated.laser, line_sigma_mm=SHEET_MM))
    (found,) = (f for f in shape_findings(of, geometry_of(of), stated) if f.found)
    assert (found.effect, found.alike) == (name, ())
    assert found.sizes[0].value == pytest.approx(size, abs=2 * found.sizes[0].sigma)
