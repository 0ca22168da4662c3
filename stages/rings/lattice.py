"""Removes errors of the line that repeat with rows and columns: coarse pixels, blocks of a codec.

If pictures were enlarged from fewer pixels, or a codec works in blocks, the line is drawn towards the same
part of each of them. Where the ring runs along rows or columns, this error is the same from ring to ring and
as broad as a defect: neither the rings' scatter nor their number distinguishes it from the wall. Its period
does, because the wall has no relation to the picture's rows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import rfft, rfftfreq
from scipy.special import stdtr

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float
from pipeline.artefacts.measured import RingSamples
from pipeline.machine.stage import Context

# Harmonics of a ring's own smooth shape, number of times it is fitted, spreads at which values are cut off.
_HARMONICS, _ROUNDS, _MOST = 6, 5, 4.0
# Periods that are searched, px: finer ones are the pixels' own, and codecs work in blocks of 16 at most.
_SHORTEST, _LONGEST = 1.5, 17.0
# Steps of place, px, and of frequency, 1/px: rows at either end of a picture of 1000 px are in step by it.
_PLACE, _STEP = 0.1, 1e-4
# The line runs along rows or columns where this component of its normal is as large as this (chosen).
_ALONG = 0.9
# Share of the line's variance that repeats. In open-1 and open-3 as they are, half as large, with a temporal
# filter, by VP9 and by HEVC it is .003 to .029; .037 to .22 by MPEG-2 and JPEG, .11 to .47 enlarged.
_REPEATS = 0.033
# Degrees from a row or column between which the error has one size, and overtones of its period.
_SLANTS_DEG = np.array([0.0, 3.0, 6.0, 10.0, 15.0, 21.0, 28.0, 36.0, 45.0])
_OVERTONES = 3
# Periods that are removed from one axis: pixels enlarged by 5/2 repeat every pixel and every two of them.
_PERIODS = 3
# Rings that are examined, and corrected at a time: 27 000 samples along rows show a share of .001. Then the
# fewest samples of which a size is fitted.
_RINGS = 96
_FEWEST = 200
# Length of the parts of a ring that must agree on what repeats, rad, their least number, and the largest
# chance of their agreeing by accident: of some 6000 periods tried, one may do so in one recording of a
# hundred.
_PART_RAD, _FEWEST_PARTS, _BY_CHANCE = np.radians(4.0), 12, 1e-6
# Waves that the samples determine less than this share as well as others are left out: the line stood still.
_KNOWN = 0.1


@dataclass(frozen=True)
class Lattice:
    """An error of the line's position that repeats along one axis of the picture.

    Attributes
    ----------
    axis : int
        0 with columns, 1 with rows.
    period_px : float
    share : float
        Share of the line's variance, where it runs along columns or rows.
    size_px : (2 T, 2 K)
        Amplitudes of cosine and sine of K overtones, px, for T directions of the line on either side of the
        picture.
    """

    axis: int
    period_px: float
    share: float
    size_px: Float

    def error_px(self, samples: RingSamples, rings: slice) -> Float:
        """Return the error (n, A), px, of the radii of some rings; positive: too large."""
        across = _across(samples, self.axis)
        waves = _waves(_place(samples, self.axis, rings), self.period_px)
        error = np.sign(across) * np.einsum("fak,ak->fa", waves, self.size_px[_slant(across)])
        return np.where(np.isfinite(error), error, 0.0)

    @property
    def most_px(self) -> Float:
        """Largest shift of the line (2 T,) in each of its directions or in one farther from the axis.

        Few samples run along the picture's rows themselves, where the error is largest.
        """
        size = np.hypot(self.size_px[:, 0], self.size_px[:, _OVERTONES]).reshape(2, -1)
        return np.asarray(np.maximum.accumulate(size[:, ::-1], axis=1)[:, ::-1].ravel())

    def left_px(self, samples: RingSamples) -> Float:
        """Return 1 σ (A,) of what is left of the error once it is taken out, px.

        The line is drawn towards the middle of each period. If the error's slope reaches 1, all lines of a
        period come out at one place, and nothing tells any more where they were.
        """
        size = self.most_px[_slant(_across(samples, self.axis))]
        return np.asarray(size * np.minimum(2 * np.pi * size / self.period_px, 1.0))


def lattices_of(samples: RingSamples) -> tuple[Lattice, ...]:
    """Return the errors that repeat with columns and with rows, if they exceed those of sound recordings."""
    count = len(samples.frame)
    some = slice(None, None, max(count // _RINGS, 1))
    if not samples.valid[some].any():
        return ()
    off, found = _off_smooth(samples, some), []
    for axis in (0, 1):
        for _ in range(_PERIODS):
            lattice = _lattice(samples, some, off, axis)
            if lattice is None:
                break
            found.append(lattice)
            off = off - lattice.error_px(samples, some)
    return tuple(found)


def take_out(lattices: tuple[Lattice, ...], samples: RingSamples) -> RingSamples:
    """Subtract the repeating errors from the radii of all rings, in place, some rings at a time.

    Their σ includes the part that cannot be removed. Rings that lie at the same place of the picture share
    it, so that the returned rings hand it on as shared; neighbouring azimuths share it in part, which σ of
    means over azimuths does not include. Only the returned rings carry ``shared_px``.
    """
    if not lattices:
        return samples
    left = np.linalg.norm([each.left_px(samples) for each in lattices], axis=0).astype(np.float32)
    for first in range(0, len(samples.frame), _RINGS):
        rings = slice(first, first + _RINGS)
        for each in lattices:
            samples.radius_px[rings] -= each.error_px(samples, rings).astype(np.float32)
        samples.sigma_px[rings] = np.hypot(samples.sigma_px[rings], left)
    return replace(samples, shared_px=left)


def warn_of_lattices(lattices: tuple[Lattice, ...], context: Context) -> None:
    """Warn of pictures that were enlarged or coded in blocks."""
    if not lattices:
        return
    most = max(lattices, key=lambda each: each.share)
    size_px = float(most.most_px.max())
    context.warn(
        f"the line's position has an error that repeats every {most.period_px:.3g} px along the picture's "
        f"{('rows', 'columns')[most.axis]}, by {size_px:.2f} px to either side: the pictures were enlarged "
        "from fewer pixels, or a codec works in blocks of that size. What can be removed of it is removed, "
        "σ includes the rest, and fine detail is lost: small defects may be missed, and those along the "
        "picture's rows or columns may be false. What to do: export the pictures in the size in which the "
        "camera took them, with less compression"
    )


def _lattice(samples: RingSamples, rings: slice, off: Float, axis: int) -> Lattice | None:
    """Return the repeating error along an axis of the distances ``off`` (n, A), px, from the smooth shape."""
    across, place = _across(samples, axis), _place(samples, axis, rings)
    signed = off * np.sign(across)
    along = (np.abs(across) > _ALONG) & np.isfinite(signed)
    if along.sum() < _FEWEST:
        return None
    period, share = _period(place[along], signed[along])
    part = np.broadcast_to(np.floor(samples.azimuth_rad / _PART_RAD), off.shape)[along]
    if share < _REPEATS or not _borne_out(_waves(place[along], period), signed[along], part):
        return None
    waves, slant = _waves(place, period), np.broadcast_to(_slant(across), off.shape)
    known = np.isfinite(signed)
    sizes = [_fitted(waves, signed, known & (slant == k)) for k in range(2 * len(_SLANTS_DEG))]
    return Lattice(axis, period, share, np.array(sizes))


def _borne_out(waves: Float, value: Float, part: Float) -> bool:
    """Return whether each part of the ring repeats with ``waves`` (n, 2 K) in the same way as all others.

    A groove along the pipe, or the wall's roughness where the probe stands, can be fitted with some period,
    but the parts of the ring do not agree on it.
    """
    parts, number = np.unique(part, return_inverse=True)
    if len(parts) < _FEWEST_PARTS:
        return False
    wave, value = waves[:, [0, _OVERTONES]], value - value.mean()
    products = [np.bincount(number, wave[:, i] * wave[:, j]) for i, j in ((0, 0), (0, 1), (0, 1), (1, 1))]
    normal = np.array(products).T.reshape(-1, 2, 2)
    right = np.array([np.bincount(number, w * value) for w in wave.T]).T
    others = np.linalg.solve(normal.sum(0) - normal + 1e-9 * np.eye(2), (right.sum(0) - right)[..., None])
    expected = np.einsum("bi,bij,bj->b", others[..., 0], normal, others[..., 0])
    shown = (others[..., 0] * right).sum(1)
    rest = shown - expected * shown.sum() / expected.sum()
    # Student's t: the scatter between parts is known by as many
    chance = stdtr(len(parts) - 1, -shown.sum() / (np.linalg.norm(rest) + 1e-12))
    return bool(chance < _BY_CHANCE)


def _fitted(waves: Float, signed: Float, use: Bool) -> Float:
    """Return the sizes (2 K,) of waves (F, A, 2 K) in the samples to ``use`` (F, A), beside a constant.

    0 with too few samples.
    """
    if use.sum() < _FEWEST:
        return np.zeros(waves.shape[-1])
    design = np.column_stack([waves[use], np.ones(int(use.sum()))])
    return np.asarray(np.linalg.lstsq(design, signed[use], rcond=_KNOWN)[0][:-1])


def _period(place: Float, value: Float) -> tuple[float, float]:
    """Return the period by which values (n,) at places (n,) repeat most, and its share of their variance."""
    first = float(place.min())
    cell = np.rint((place - first) / _PLACE).astype(np.int64)
    total = np.bincount(cell, value - value.mean())
    size = max(round(1 / (_PLACE * _STEP)), len(total))
    frequency = rfftfreq(size, _PLACE)
    looked = (frequency > 1 / _LONGEST) & (frequency < 1 / _SHORTEST)
    power = np.where(looked, np.abs(rfft(total, size)) ** 2, 0.0)
    best = int(power.argmax())
    return float(1 / frequency[best]), float(2 * power[best] / len(value) ** 2 / value.var())


def _waves(place: Float, period: float) -> Float:
    """Return cosines and sines (..., 2 K) of a place (...), in overtones of a period."""
    turn = 2 * np.pi * place[..., None] / period * np.arange(1, _OVERTONES + 1)
    return np.concatenate([np.cos(turn), np.sin(turn)], -1)


def _place(samples: RingSamples, axis: int, rings: slice) -> Float:
    """Return the column (axis 0) or row of some rings' samples (n, A)."""
    radius = samples.radius_px[rings].astype(float)
    return np.asarray(samples.centre_px[axis] + radius * _across(samples, axis))


def _across(samples: RingSamples, axis: int) -> Float:
    """Return the component (A,) of a ring's outward direction along an axis of the picture."""
    return np.asarray((np.cos, np.sin)[axis](samples.azimuth_rad))


def _slant(across: Float) -> Float:
    """Return the index (A,) of the line's direction, beyond 45° the last, and of its side of the picture.

    Sides are far apart: a period with a small error is out of phase between them.
    """
    slant = np.degrees(np.arccos(np.minimum(np.abs(across), 1.0)))
    number = np.searchsorted(_SLANTS_DEG, slant, side="right") - 1
    return np.asarray(number + len(_SLANTS_DEG) * (across > 0))


def _off_smooth(samples: RingSamples, rings: slice) -> Float:
    """Return the distance (n, A), px, of some rings from their smooth shape, cut off at `_MOST` spreads."""
    n, azimuth = np.arange(1, _HARMONICS + 1), samples.azimuth_rad[:, None]
    shape = np.concatenate([np.ones_like(azimuth), np.cos(n * azimuth), np.sin(n * azimuth)], 1)
    inverse = np.linalg.pinv(shape)
    radius = np.where(samples.valid, samples.radius_px, np.nan)[rings].astype(float)
    known = np.isfinite(radius)
    filled = np.where(known, radius, np.nanmedian(radius))
    for _ in range(_ROUNDS):
        smooth = filled @ inverse.T @ shape.T
        off = radius - smooth
        most = _MOST * robust_spread(off[known])
        filled = smooth + np.where(known, np.clip(off, -most, most), 0.0)
    return np.where(known, np.clip(off, -most, most), np.nan)
