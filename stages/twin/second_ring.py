"""A second line beside the first: a ghost of window or lens, or a second laser sheet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import median_filter

from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.cells import chance_of
from stages.twin.gate import Suspected
from stages.twin.locate import FALSE_ALARM
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Ring
from stages.twin.switched import STEP, second_line, share_of_second

_SURE, _FEWEST_FRAMES = 3.0, 6
_RATIOS, _REACH, _FAR_WIDTHS, _LEAST_LINE, _AROUND, _BESIDE_PEAK = 400, 0.8, 14.0, 0.01, 25, 3
"""Number of bins and largest ln(radius over the line's radius); width about the line, px, that belongs to it;
least share of a second line; bins on each side that give the level it stands out from; bins beside a peak
that still belong to it."""


def ring_profile(ring: Ring, above: Float32, twin: TwinFrame, use: Bool) -> Float | None:
    """Return grey levels (4, R) over ln(radius / line radius) by quadrants; None without a line."""
    rows, columns = np.nonzero(twin.region == Region.LINE_CORE)
    u, v = ring.centre_px
    degree = np.floor(np.degrees(np.arctan2(rows - v, columns - u)) + 180).astype(int) % 360
    count = np.bincount(degree, minlength=360)
    if (count == 0).mean() > 0.5:
        return None
    radius = np.bincount(degree, np.hypot(rows - v, columns - u), 360) / np.maximum(count, 1)
    radius = np.interp(np.arange(360), np.flatnonzero(count), radius[count > 0], period=360)
    row, column = np.nonzero(use[::STEP, ::STEP])
    grey, away = above[::STEP, ::STEP][row, column], (STEP * column - u, STEP * row - v)
    turn = (np.degrees(np.arctan2(away[1], away[0])) + 180) % 360
    ratio = np.log(np.maximum(np.hypot(*away), 1) / radius[turn.astype(int) % 360])
    cell = np.floor((ratio / _REACH + 1) / 2 * _RATIOS).astype(int)
    inside = (cell >= 0) & (cell < _RATIOS)
    cell = (turn[inside] // 90).astype(int) % 4 * _RATIOS + cell[inside]
    total, pixels = (np.bincount(cell, w, 4 * _RATIOS) for w in (grey[inside], None))
    mean = np.where(pixels > 3, total / np.maximum(pixels, 1), np.nan)
    return np.asarray(mean.reshape(4, _RATIOS))


def second_ring(ring: Ring, profiles: Sequence[Float], frame: Int) -> Suspected | None:
    """Return a ring beside the line on which the profiles of frames (F,) agree."""
    if len(profiles) < _FEWEST_FRAMES:
        return None
    stack = np.stack(profiles)
    at = (np.arange(_RATIOS) + 0.5) / _RATIOS * 2 * _REACH - _REACH
    # The line itself is within 2 % of its radius.
    line = float(np.where(np.abs(at) < 0.02, np.nan_to_num(stack), 0).max((1, 2)).mean())
    ground = median_filter(np.apply_along_axis(_without_gaps, -1, stack), (1, 1, _AROUND), mode="nearest")
    far = np.abs(at) * ring.radius_px > _FAR_WIDTHS
    known = np.isfinite(stack) & far
    excess, count = np.where(known, np.nan_to_num(stack) - ground, 0.0), np.maximum(known.sum(0), 1)
    mean = excess.sum(0) / count
    sd = np.sqrt((np.where(known, excess - mean, 0) ** 2).sum(0)) / count
    beyond = (mean > _SURE * sd) & (mean > _LEAST_LINE * line) & (count >= _FEWEST_FRAMES)
    seen = beyond.sum(0) >= 3  # at least three quadrants: a glint is in one, at most two
    if not seen.any():
        return None
    k = int(np.argmax(np.where(seen, mean.mean(0), -1)))
    each = excess[:, :, k].mean(1) / line
    share, chance = float(each.mean()), min(1.0, _RATIOS * chance_of(each))
    if chance > FALSE_ALARM or share < _LEAST_LINE:
        return None
    figure = NamedFigure("share", share, float(each.std()) / np.sqrt(len(each)), "of the line")
    near = np.abs(np.arange(_RATIOS) - k) <= _BESIDE_PEAK
    heights = np.where(near, np.maximum(mean.mean(0), 0), 0)
    ratio = float(np.exp((at * heights).sum() / max(heights.sum(), 1e-9)))
    radius = NamedFigure("radius", ratio, _REACH / _RATIOS, "of the line's")
    found = Mismatch(
        "second_line", "line", "line", (radius,), (figure,), chance, np.nan, np.nan,
        f"A second ring lies at {radius.value:.2f} radii of the line, {100 * share:.0f} % as bright: "
        "a ghost of window or lens, or a second sheet.", ring.whole(int(frame[0])),
    )  # fmt: skip
    sizes = np.stack([each, np.full(len(each), ratio)], 1)
    return Suspected(found, second_line, frame, sizes, measured=share_of_second)


def _without_gaps(values: Float) -> Float:
    """Return values (N,) with NaN interpolated."""
    known = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(len(values)), known, values[known]) if len(known) else np.zeros(len(values))
