"""Fit a spot in the image to what lit frames show about a place, and judge it by other frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from pipeline.adjustment.robust import left_out_sd
from pipeline.arrays import Float, Float32, Int
from pipeline.artefacts.twin import NamedFigure
from stages.twin.significance import ratio_over_frames, significance_over_frames

WIDEST_PX = 48.0
"""Half width of the window about a place, px: at least this much, else two radii but at most this much beyond
the radius. A spot is at most twice as wide."""
_FLATNESS = (0.7, 5.0)
"""Bounds of a spot's flatness: 1 is Gaussian, 2 has a flat middle and a steep rim, 5 is a disc."""
_OF_LIGHT = 0.005
"""1 σ of a share of the light because the light about the spot is uncertain: half of a photo's error."""
_LEAST_WIDTH_PX, _MIDDLE = 2.0, 0.25
"""Width of the narrowest spot, 1 σ, px; the middle of a spot extends to where a quarter of its depth is
lost."""
_PATTERN = 4
"""Side of the cells in which brightness may stay in the image, pixels: half a block. Chosen."""
_SETTLED = 1e-6
"""A fit has converged when χ² changes by less than this share: of ten thousand pixels it is .01, where 1 is 1
σ. Without a real spot, a fit that continues wanders off for hundreds of steps."""
_SURELY = 2.0
"""σ by which a share must exceed 1 to be none."""
PARTS = 6
"""Parts of the frames, each left out once for the σ of a spot: consecutive frames are in one part."""


@dataclass(frozen=True)
class FittedLaw:
    """A law's size, and the fall of χ² of each frame (F,) with the size that other frames gave.

    ``shown`` (F,), where known, is the share of the predicted change that each frame shows: 0 up to chance
    without the effect, 1 with it.
    """

    fall: Float
    size: NamedFigure
    shown: Float | None = None

    @property
    def chance(self) -> float:
        """The probability that chance makes frames support the law; consecutive frames see the same wall.

        A law that changes some frames ten times as much as others makes their falls as unequal, which looks
        like chance. The shares that frames show are alike, and are tested instead where they are known.
        """
        if self.shown is None:
            return significance_over_frames(self.fall)[1]
        return significance_over_frames(self.shown)[1] if self.fall.sum() > 0 else 1.0

    @property
    def is_share(self) -> bool:
        """Whether the size may be a share of the light: no more than 1, up to its σ."""
        return self.size.value < 1 + _SURELY * self.size.sd


def fall_of_spot(sums: Float32, start: Float, beyond: float) -> FittedLaw:
    """Return the spot that fits best, with its depth as its size.

    ``sums`` is (F, 2, h, w); ``start`` (K, 6) holds spots from which the search starts. Outside the spot the
    law may act by up to ``beyond``, for example where the photo has less texture: the spot's depth is
    relative to that. The σ includes the changes when parts of the frames are left out, and the difference
    between the spot's middle and the fitted shape.
    """
    frames, fall, shown = np.arange(len(sums)), np.zeros(len(sums)), np.zeros(len(sums))
    whole = sums.sum(0)
    best = _fitted_spot(whole, start, beyond)
    for half in (frames % 2 == 0, frames % 2 == 1):
        shape = _spot(_fitted_spot(sums[half].sum(0), best[None], beyond), sums.shape[2:])
        cross, own = ((shape**k * sums[~half, k - 1]).sum((1, 2)) for k in (1, 2))
        fall[~half], shown[~half] = 2 * cross - own, cross / np.maximum(own, 1e-9)
    parts = np.array_split(frames, min(PARTS, len(frames)))
    fits = np.array([_fitted_spot(whole - sums[p].sum(0), best[None], beyond) for p in parts])
    without = fits[:, 0] / (1 - fits[:, 5])
    spread = float(left_out_sd(without))
    shape = _spot(best, sums.shape[2:])
    inside = (shape - best[5]) / (best[0] or 1e-9)
    middle = np.exp(-0.5 * ((1 - inside) / _MIDDLE) ** 2)
    weight = max(float((middle * whole[1]).sum()), 1e-9)
    off = float((middle * (whole[0] - shape * whole[1])).sum()) / weight
    sd = float(np.hypot(np.hypot(spread, off), _OF_LIGHT))
    return FittedLaw(fall, NamedFigure("share", float(best[0] / (1 - best[5])), sd), shown)


def fall_of_pattern(dirt: Float32) -> float:
    """Return the fall of χ² by any brightness that stays in the image, from the other half of the frames.

    ``dirt`` is (F, 2, h, w). Where wall mirrors the lamps, or the photo has a stain, texture seems displaced;
    but a drop shows other texture in every frame, and no brightness that stays.
    """
    rows, columns = (n // _PATTERN * _PATTERN for n in dirt.shape[2:])
    cells = dirt[:, :, :rows, :columns].reshape(*dirt.shape[:2], rows // _PATTERN, _PATTERN, -1, _PATTERN)
    (cross, own), fall = cells.sum((3, 5), dtype=float).swapaxes(0, 1), 0.0
    for half in (slice(0, None, 2), slice(1, None, 2)):
        other = slice(1 - (half.start or 0), None, 2)
        change = cross[other].sum(0) / np.maximum(own[other].sum(0), 1e-9)
        fall += float((2 * change * cross[half] - change**2 * own[half]).sum())
    return fall


def brighter_within(dirt: Float32, place: Float) -> NamedFigure:
    """Return by how much a place (column, row, radius) is brighter than its twin; dirt is (F, 2, h, w)."""
    row, column = np.mgrid[: dirt.shape[2], : dirt.shape[3]]
    inside = np.hypot(column - place[0], row - place[1]) < place[2]
    cross, own = dirt[:, :, inside].sum(2, dtype=float).T
    change, sd = ratio_over_frames(np.stack([-cross, own], 1), PARTS)
    return NamedFigure("brighter", change, sd, "relative")


def _spot(place: Float, shape: tuple[int, ...]) -> Float:
    """Return a spot (h, w): d exp(−½ (r²/w²)^q) + b about a column and row, depth d, width w, flatness q."""
    return _spot_at(place, *np.mgrid[: shape[0], : shape[1]][::-1])


def _spot_at(place: Float, u: Int, v: Int) -> Float:
    depth, at_u, at_v, width, flat, beside = place
    square = ((u - at_u) ** 2 + (v - at_v) ** 2) / width**2
    return np.asarray(depth * np.exp(-0.5 * square**flat) + beside)


def _slopes_at(place: Float, u: Int, v: Int) -> Float:
    """Return the derivatives (N, 6) of a spot with respect to its six numbers, at columns and rows (N,)."""
    depth, at_u, at_v, width, flat, _ = place
    right, down = u - at_u, v - at_v
    square = np.maximum((right**2 + down**2) / width**2, 1e-12)
    power = square**flat
    height = np.exp(-0.5 * power)
    by_log = -0.5 * depth * height * flat * power  # derivative with respect to ln(r² / w²)
    by_place = -2 * by_log / (square * width**2)
    by_flat = by_log * np.log(square) / flat
    return np.stack(
        [height, by_place * right, by_place * down, -2 * by_log / width, by_flat, np.ones_like(height)], -1
    )


def _fitted_spot(sums: Float32, start: Float, beyond: float) -> Float:
    """Return depth, column, row, width, flatness and offset of the spot that fits; ``sums`` is (2, h, w)."""
    rows, columns = np.nonzero(sums[1] > 0)
    weight = np.sqrt(sums[1][rows, columns].astype(float))
    value = sums[0][rows, columns] / weight

    def rest(p: Float) -> Float:
        return np.asarray(_spot_at(p, columns, rows) * weight - value)

    def slopes(p: Float) -> Float:
        return np.asarray(_slopes_at(p, columns, rows) * weight[:, None])

    reach = start[:, 3].max()
    widest, beside = 2 * max(reach, WIDEST_PX), beyond + 1e-6
    low = np.array([-3.0, *(start[0, 1:3] - reach), _LEAST_WIDTH_PX, _FLATNESS[0], -beside])
    high = np.array([3.0, *(start[0, 1:3] + reach), widest, _FLATNESS[1], beside])
    begin = np.clip(start, low + 1e-3 * (high - low), high - 1e-3 * (high - low))
    scale = [0.1, 1, 1, 3, 0.3, 0.1]
    made = [least_squares(rest, s, slopes, (low, high), ftol=_SETTLED, x_scale=scale) for s in begin]
    return np.asarray(min(made, key=lambda r: r.cost).x)
