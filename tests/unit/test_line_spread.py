"""The shape of the line gets the name of the effect whose shape fits, and none where no shape fits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import exponnorm

from pipeline.arrays import Float
from stages.diagnose.profile.cells import Cells, LineGeometry, fit_gaussians
from stages.diagnose.profile.finding import Finding
from stages.diagnose.profile.line_spread import Fitted, Shape, explanations, line_spread
from stages.diagnose.profile.naming import shape_findings, with_systematic
from stages.diagnose.profile.shape import cell_skewness
from tests.profile_lines import probe

OFFSET = np.arange(-59.75, 60.0, 0.5)
WIDTH_PX, SCALES = 1.3, (5.5, 6.5, 7.0)


def cells(
    light: Callable[[Float, float], Float], seed: int = 0, skirt: float = 0.006, noise: float = 2e-3
) -> Cells:
    """Return three blocks at three distances to the wall, each of 72 sectors.

    ``light`` of px and px per mm.
    """
    random = np.random.default_rng(seed)
    block, sector = np.repeat(np.arange(3), 72), np.tile(np.arange(72), 3)
    profile = np.array([light(OFFSET, s) for s in SCALES])[block]
    profile = profile + skirt * np.exp(-0.5 * (OFFSET / 4) ** 2) + random.normal(0, noise, profile.shape)
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
    """Return a step of light on one side with a sharp end: no shape of the library."""
    return bell(x) + 0.1 * ((x < 0) & (x > -1.5 * scale))


@pytest.mark.parametrize(
    ("light", "shape", "way_mm"),
    [(tail, Shape.TAIL, 0.25), (copy, Shape.COPY, 0.8), (halo, Shape.HALO, 0.4)],
)
def test_a_shape_is_recognised_and_measured(
    light: Callable[[Float, float], Float], shape: Shape, way_mm: float
) -> None:
    (found,) = explanations(line_spread(cells(light)))
    assert found.shape is shape
    assert found.way_mm == pytest.approx(way_mm, rel=0.1)
    assert found.left < 0.03


def test_an_unknown_shape_gets_no_name() -> None:
    assert explanations(line_spread(cells(shelf))) == ()


def uneven(x: Float, scale: float) -> Float:
    """Return a sheet whose sides are Gaussians of .13 and .17 mm, blurred by the lens."""
    fine = np.arange(-12, 12, 0.05)
    sheet = bell(fine, 1.0 * scale * np.where(fine < 0, 0.17, 0.13))
    seen = np.convolve(sheet, bell(np.arange(-4, 4.01, 0.05), 0.65), "same")
    return np.asarray(np.interp(x, fine, seen / seen.max(), left=0, right=0))


def many(light: Callable[[Float, float], Float], runs: int = 4) -> Cells:
    """Return blocks enough for the scatter between them to be known."""
    each = [cells(light, seed=k) for k in range(runs)]
    joined = {
        name: np.concatenate([getattr(of, name) for of in each])
        for name, value in vars(each[0]).items()
        if isinstance(value, np.ndarray) and name != "offset_px"
    }
    joined["block"] = np.concatenate([of.block + 3 * k for k, of in enumerate(each)])
    return replace(each[0], **joined, frames=each[0].frames * runs)


def test_a_second_line_that_overlaps_the_first_may_also_be_a_skewed_sheet() -> None:
    """A skewed sheet was named for a copy of the line, with the place of another one of .01 ± .05 %."""
    of = many(uneven)
    assert explanations(line_spread(of))[0].shape is Shape.COPY
    stated = probe()
    found = {f.effect: f for f in shape_findings(of, geometry_of(cells(uneven)), stated) if f.found}
    assert set(found) == {"tube_ghost", "line_skew", "subsurface"}
    assert found["tube_ghost"].sizes == ()
    assert "as sharp as the line" in found["tube_ghost"].statement


SHEET_MM, BLUR_PX = 0.2, 0.65


def geometry_of(of: Cells) -> LineGeometry:
    """Return the geometry of frames that look like their block; the picture is 600 px high."""
    width, scale = (np.repeat(v.reshape(3, -1), 12, axis=0) for v in (of.width_px, of.px_per_mm))
    ones, azimuth = np.ones_like(width), np.radians(np.arange(0, 360, 5.0))
    return LineGeometry(
        azimuth, 300 * place(scale), width, 100 * ones, 40 * ones, ones, scale, 0 * ones, ones[:, 0] > 0
    )


def place(scale: Float | float) -> Float:
    """Return where the line is seen, over half of the picture's height."""
    return np.interp(scale, [5.5, 7.0], [0.6, 0.85])


def line_findings(sheet_mm: float, tail_mm: float, edge_blur: float) -> list[Finding]:
    """Return what is found of a sheet of 1 σ ``sheet_mm`` (stated: `SHEET_MM`) with an exponential tail.

    The variance of the blur grows by ``edge_blur`` towards the edge of the picture.
    """

    def light(x: Float, scale: float) -> Float:
        blur_px2 = BLUR_PX**2 * (1 + edge_blur * float(place(scale)) ** 2)
        normal = float(np.sqrt(blur_px2 + (sheet_mm * scale) ** 2))
        density = exponnorm.pdf(-x, tail_mm * scale / normal, scale=normal)
        return np.asarray(density * normal * np.sqrt(2 * np.pi))

    of, stated = cells(light), probe()
    stated = replace(stated, laser=replace(stated.laser, line_sigma_mm=SHEET_MM))
    return [f for f in shape_findings(of, geometry_of(of), stated) if f.found]


@pytest.mark.parametrize(
    ("sheet_mm", "tail_mm", "edge_blur", "name", "size"),
    [
        (np.sqrt(SHEET_MM**2 - 0.17**2), 0.17, 0.0, "line_skew", 2 * (0.17 / SHEET_MM) ** 3),
        (SHEET_MM, 0.2, 0.0, "subsurface", 0.2),
        (SHEET_MM, 0.2, 2.0, "subsurface", 0.2),
    ],
)
def test_the_width_without_a_tail_decides_between_sheet_and_wall(
    sheet_mm: float, tail_mm: float, edge_blur: float, name: str, size: float
) -> None:
    """With blur that grows towards the picture's edge, the width excluded both, and so both were named."""
    (found,) = line_findings(sheet_mm, tail_mm, edge_blur)
    assert (found.effect, found.alike) == (name, ())
    assert found.sizes[0].value == pytest.approx(size, abs=2 * found.sizes[0].sigma)


@pytest.mark.parametrize(
    ("sheet_mm", "tail_mm", "edge_blur"),
    [
        (np.sqrt(SHEET_MM**2 - 0.1**2), 0.1, 1.0),
        (0.9 * SHEET_MM, 0.1, 0.0),
    ],
)
def test_a_short_tail_leaves_both_names_if_the_width_is_not_known_better(
    sheet_mm: float, tail_mm: float, edge_blur: float
) -> None:
    """Growing blur named the wall for a skewed sheet; a narrow sheet was named for light in the wall."""
    found = line_findings(sheet_mm, tail_mm, edge_blur)
    assert [(f.effect, f.alike) for f in found] == [
        ("line_skew", ("subsurface",)), ("subsurface", ("line_skew",)),
    ]  # fmt: skip


def test_a_shape_with_an_uncertain_size_gives_no_size_and_no_single_name() -> None:
    """A blurred second line .134 ± .436 mm away was reported as light in the wall alone, with that size."""
    found = line_findings(SHEET_MM, 0.08, 0.0)
    assert [(f.effect, f.alike, f.sizes) for f in found] == [
        ("line_skew", ("subsurface",), ()), ("subsurface", ("line_skew",), ()),
    ]  # fmt: skip


@pytest.mark.parametrize("ratio", [0.3, 1.0, 2.0, 3.0])
def test_sigma_of_the_length_of_a_tail_follows_from_that_of_the_skewness(ratio: float) -> None:
    """A third of the relative error of the skewness is right for short tails only."""
    skewness = []
    for one in (0.98 * ratio, 1.02 * ratio):
        drawn = cells(lambda x, _, t=one: exponnorm.pdf(-x, t, scale=WIDTH_PX), skirt=0.0, noise=0.0)
        skewness.append(np.nanmean(cell_skewness(drawn)))
    rate = np.log(1.02 / 0.98) / np.log(skewness[1] / skewness[0])
    shape = Fitted(Shape.TAIL, 1.0, 0.2, 0.0, 0.0, 0.0, 1.0, 0.2 / ratio)
    assert with_systematic(shape, 1.0).way_sigma_mm == pytest.approx(0.2 * rate, rel=0.1)
