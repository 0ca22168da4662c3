"""A second line beside the first: a ghost of window or lens, a second laser sheet, or a mirror image.

It is light that is separate from the line: darkness lies between the two. A glow about the line, as of light
from wall to wall, only fades with distance and is none. A wall that reflects like a mirror shows the line at
a distance from the line that differs from direction to direction where the probe is askew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from scipy.ndimage import grey_opening, uniform_filter1d

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.cells import chance_of
from stages.twin.gate import Suspected
from stages.twin.locate import FALSE_ALARM
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Ring
from stages.twin.switched import STEP, second_line, share_of_second

_SURE, _FEWEST_FRAMES, _QUADRANTS = 3.0, 6, 4
_RATIOS, _REACH, _FAR_WIDTHS, LEAST_SECOND, _BESIDE_PEAK = 400, 0.8, 14.0, 0.01, 3
"""Number of bins and largest ln(radius over the line's radius); width about the line, px, that belongs to it;
least share of a second line that is told; bins beside a peak that still belong to it. Sound recordings of two
renderers leave up to .002 of the line."""
_WIDEST, _SMOOTH, _ALIKE, _OF_HEIGHT, _OF_NOISE = 65, 3, 2, 0.2, 8.0
"""Bins of the widest band that is searched for (a quarter of the line's radius), bins over which profiles are
smoothed, bins by which the quadrants of one ring may differ, and share of a band's height from which a bin
counts; all chosen. σ of one bin by which light must stand out: noise alone spans 5.5 σ from its lowest to its
highest of two hundred bins, and 8 σ in 3 of 10 000 quadrants."""
_ROUNDING = 1.0
"""Grey levels by which rounding lifts one place over another in a picture without noise."""
_EITHER = "ghost_ring or second_line"
"""Light apart from the line whose course is not known: the wall mirrors the line, or glass does."""
_OF_QUADRANT = float(np.sinc(1 / _QUADRANTS))
"""Share of a cosine around the picture that its means over quadrants keep."""


def ring_profile(ring: Ring, above: Float32, twin: TwinFrame, use: Bool) -> Float | None:
    """Return grey levels (4, R) over ln(radius / line radius) by quadrants; None without a line."""
    at = _beside_line(ring, twin)
    if at is None:
        return None
    few = use[::STEP, ::STEP]
    smooth = cv2.medianBlur(above, 3)  # a hot pixel would make a ring of the few pixels at its radius
    grey, (quadrant, ratio) = smooth[::STEP, ::STEP][few], (a[few] for a in at)
    cell = np.floor((ratio / _REACH + 1) / 2 * _RATIOS).astype(int)
    inside = (cell >= 0) & (cell < _RATIOS)
    cell = quadrant[inside].astype(int) % _QUADRANTS * _RATIOS + cell[inside]
    total, pixels = (np.bincount(cell, w, _QUADRANTS * _RATIOS) for w in (grey[inside], None))
    mean = np.where(pixels > 3, total / np.maximum(pixels, 1), np.nan)
    return np.asarray(mean.reshape(_QUADRANTS, _RATIOS))


def _beside_line(ring: Ring, twin: TwinFrame) -> tuple[Float32, Float32] | None:
    """Return azimuth in quadrants from −π on, and ln(radius / line radius); None without a line.

    Both are those of every `STEP`-th row and column.
    """
    rows, columns = np.nonzero(twin.region == Region.LINE_CORE)
    u, v = ring.centre_px
    degree = np.floor(np.degrees(np.arctan2(rows - v, columns - u)) + 180).astype(int) % 360
    count = np.bincount(degree, minlength=360)
    if (count == 0).mean() > 0.5:
        return None
    radius = np.bincount(degree, np.hypot(rows - v, columns - u), 360) / np.maximum(count, 1)
    radius = np.interp(np.arange(360), np.flatnonzero(count), radius[count > 0], period=360)
    row, column = np.mgrid[: twin.level.shape[0] : STEP, : twin.level.shape[1] : STEP].astype(np.float32)
    turn = (np.degrees(np.arctan2(row - v, column - u)) + 180) % 360
    ratio = np.log(np.maximum(np.hypot(row - v, column - u), 1) / radius[turn.astype(int) % 360])
    return np.asarray(turn / 90, np.float32), np.asarray(ratio, np.float32)


def second_ring(ring: Ring, profiles: Sequence[Float], frame: Int) -> Suspected | None:
    """Return light beside the line on which the profiles of frames (F,) agree in three quadrants."""
    if len(profiles) < _FEWEST_FRAMES:
        return None
    stack = np.apply_along_axis(_without_gaps, -1, np.stack(profiles))
    ratio = (np.arange(_RATIOS) + 0.5) / _RATIOS * 2 * _REACH - _REACH
    line = float(np.where(np.abs(ratio) < 0.02, stack, 0).max((1, 2)).mean())  # the line is within 2 %
    away = np.abs(ratio) * ring.radius_px > _FAR_WIDTHS
    mean = uniform_filter1d(stack.mean(0), _SMOOTH, axis=-1)
    found = (_band(stack, mean, away & side, line) for side in (ratio < 0, ratio > 0))
    best = max((f for f in found if f is not None), key=lambda f: float(f.each.mean()), default=None)
    if best is None:
        return None
    chance = min(1.0, _RATIOS * chance_of(best.each))
    if chance > FALSE_ALARM or best.each.mean() < LEAST_SECOND:
        return None
    return _suspected(ring, best, ratio, chance, frame)


def _suspected(ring: Ring, band: _Band, ratio: Float, chance: float, frame: Int) -> Suspected:
    """Return a second line whose radius varies once around the picture at most."""
    around = np.array([_middle(band.more[q], ratio, int(band.peak[q])) for q in np.flatnonzero(band.seen)])
    phi = (np.flatnonzero(band.seen) + 0.5) * 2 * np.pi / _QUADRANTS - np.pi
    basis = np.stack([np.ones(len(phi)), *(f(phi) / _OF_QUADRANT for f in (np.cos, np.sin))], 1)
    if np.ptp(around) <= _ALIKE * 2 * _REACH / _RATIOS:
        basis = basis[:, :1]
    place = np.zeros(3)
    place[: basis.shape[1]] = np.linalg.lstsq(basis, around, rcond=None)[0]
    sizes = np.column_stack([band.each, np.tile(place, (len(band.each), 1))])
    at = np.exp(around if place[1:].any() else place[:1])
    # A mirror image moves on the wall from frame to frame: it need not stay at one place beside the line.
    return Suspected(
        _told(ring, band, at, chance, frame), second_line, frame, sizes,
        measured=share_of_second, said=partial(_said, at), least=float(band.each.mean()),
        otherwise=_EITHER if place[1:].any() else "",
    )  # fmt: skip


def _middle(more: Float, ratio: Float, peak: int) -> float:
    """Return the mean of a quadrant's ``ratio`` (R,) about its peak, weighted by how much stands out (R,)."""
    near = np.where(np.abs(np.arange(_RATIOS) - peak) <= _BESIDE_PEAK, more, 0)
    return float((ratio * near).sum() / near.sum())


def _told(ring: Ring, band: _Band, at: Float, chance: float, frame: Int) -> Mismatch:
    """Return what is reported of a second line ``at`` one ratio of radii, or one for each quadrant.

    Within a quadrant its radius may vary, which lowers its height in the mean: that has no σ.
    """
    share = float(band.each.mean())
    figure = NamedFigure("share", share, np.inf, "of the line")
    radius = NamedFigure(
        "radius", float(at.mean()), max(_REACH / _RATIOS, float(np.ptp(at)) / 2), "of the line's"
    )
    said = _said(at, share, " in means over quarters of the picture, within which it may be brighter,")
    return Mismatch(
        "second_line", "line", "line", (radius,), (figure,), chance, np.nan, np.nan, said,
        ring.whole(int(frame[0])),
    )  # fmt: skip


def _said(at: Float, share: float, but: str = "") -> str:
    """Return the sentence on a second line ``at`` one ratio of radii, or one for each quadrant."""
    if len(at) == 1:
        return (
            f"A second ring lies at {at[0]:.2f} radii of the line, {100 * share:.0f} % as bright{but}: a "
            "ghost of window or lens, or a second sheet."
        )
    return (
        f"Light {100 * share:.0f} % as bright as the line{but} lies apart from it, at {at.min():.2f} to "
        f"{at.max():.2f} of its radius around the picture: a mirror image of the line on the wall, or a "
        "ghost of window or lens. What to do: record in a bore of another diameter: a mirror image then lies "
        "elsewhere beside the line, a ghost does not."
    )


@dataclass(frozen=True)
class _Band:
    """Light that stands out on one side of the line.

    Attributes
    ----------
    more : (4, R)
        Grey levels by which it stands out, by quadrants and bins of the ratio of radii.
    peak, seen : (4,)
        Bin of the brightest light, and whether it is certain.
    each : (F,)
        Its height in every frame, by the light in all of its bins, over that of the line.
    """

    more: Float
    peak: Int
    seen: Bool
    each: Float


def _band(stack: Float, mean: Float, use: Bool, line: float) -> _Band | None:
    """Return what stands out beside the line in bins ``use`` (R,) of profiles (F, 4, R); None without any."""
    more = np.zeros_like(mean)
    more[:, use] = _standing_out(mean[:, use], bool(np.flatnonzero(use)[0] == 0))
    peak, height = more.argmax(1), more.max(1)
    # The place of a mirror image differs between frames: all of the band's light counts in each.
    inside = np.where(more > _OF_HEIGHT * height[:, None], more, 0.0)
    inside *= (height / np.maximum((inside * more).sum(1), 1e-12))[:, None]
    each = ((stack - (mean - more)) * inside).sum(-1)
    sd = each.std(0) / np.sqrt(len(stack))
    noise = np.maximum(_OF_NOISE * _noise(stack[..., use], mean[:, use]), _ROUNDING)
    seen = (height > _SURE * sd) & (height > LEAST_SECOND * line) & (height > noise)
    if seen.sum() < 3:  # a glint is in one quadrant, at most two
        return None
    return _Band(more, peak, seen, each[:, seen].mean(1) / line)


def _noise(stack: Float, mean: Float) -> Float:
    """Return 1 σ (4,) of a bin of mean profiles (4, N), from those of frames (F, 4, N) and from bin to bin.

    The larger one counts: constant offsets of pixels are alike in all frames, and differ from bin to bin.
    """
    over_frames = np.median(stack.std(0, ddof=1), axis=-1) / np.sqrt(len(stack) * _SMOOTH)
    bend = mean[:, : -2 * _SMOOTH] - 2 * mean[:, _SMOOTH:-_SMOOTH] + mean[:, 2 * _SMOOTH :]
    along = [robust_spread(b) / np.sqrt(6) for b in bend]
    return np.asarray(np.maximum(over_frames, along))


def _standing_out(mean: Float, line_after: bool) -> Float:
    """Return by how much profiles (4, N) exceed what is left without bumps: their opening (J. Serra, 1982).

    The line lies after their last bin or before the first one: light that only fades from there is no bump.
    """
    high, low = (np.full((len(mean), _WIDEST), v) for v in (np.inf, 0.0))
    whole = np.concatenate([low, mean, high] if line_after else [high, mean, low], 1)
    opened = grey_opening(np.minimum(whole, mean.max() + 1), (1, _WIDEST))
    return np.asarray(mean - opened[:, _WIDEST:-_WIDEST])


def _without_gaps(values: Float) -> Float:
    """Return values (N,) with NaN interpolated."""
    known = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(len(values)), known, values[known]) if len(known) else np.zeros(len(values))
