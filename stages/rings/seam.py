"""Finds a seam of the picture: two parts of it that sensor or recorder displaced against each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.adjustment.robust import robust_spread, row_median
from pipeline.arrays import Float
from pipeline.artefacts.measured import RingSamples
from pipeline.machine.stage import Context

# Arc over which the line on either side of an azimuth is extrapolated; the line is taken from an arc twice as
# long. 8 px of a ring of 200 px, as broad as seams are blended. Chosen.
_ARC_RAD = np.radians(2.25)
# A step at one azimuth of the picture, in spreads over all azimuths: 5.3 at most in sound recordings, 10.7 at
# one end beside burnt-in text, 100 at both where half of the picture lay 2 px aside.
_STANDS_OUT = 9.0
# Steps at either end of one row or column of pixels differ across it by this part of the ring. Chosen.
_ONE_LINE = 0.02
# Ends of a line that cuts the ring are so far apart, a radius. One that grazes it runs along the line: coarse
# rows, as of interlaced pictures, made steps there that looked like a seam. Chosen.
_LEAST_APART_RAD = np.radians(60.0)
_FEWEST = 5


@dataclass(frozen=True)
class Seam:
    """A straight line across the picture at which the ring steps at both ends.

    Attributes
    ----------
    along : str
        ``column`` or ``row``.
    at_px : float
        Its number.
    step_px : float
        Size of the ring's step there, px, the larger of both ends.
    """

    along: str
    at_px: float
    step_px: float


def seam_of(samples: RingSamples) -> Seam | None:
    """Return the seam at which most rings step; None if no two steps lie on one row or column."""
    ring = np.flatnonzero(samples.valid.any(1))
    if len(ring) < _FEWEST:
        return None
    radius = np.where(samples.valid[ring], samples.radius_px[ring], np.nan).astype(float)
    step = _median(_steps(radius, samples.azimuth_rad))
    known = np.isfinite(step)
    ends = _ends(np.abs(np.where(known, step, 0.0)), _STANDS_OUT * robust_spread(step[known]), samples)
    if len(ends) < 2:
        return None
    place = _median(samples.pixels()[ring][:, ends].reshape(len(ring), -1)).reshape(-1, 2)
    near = _ONE_LINE * 2 * float(np.nanmedian(radius))
    # Ends are in the order of their steps: the first pair on one line is the clearest.
    for later, earlier in ((j, i) for j in range(1, len(ends)) for i in range(j)):
        if np.cos(np.diff(samples.azimuth_rad[ends[[earlier, later]]])[0]) > np.cos(_LEAST_APART_RAD):
            continue
        for axis, along in enumerate(("column", "row")):
            both = place[[earlier, later], axis]
            if abs(both[0] - both[1]) < near:
                return Seam(along, float(both.mean()), float(np.abs(step[ends[earlier]])))
    return None


def warn_of_seam(seam: Seam | None, context: Context) -> None:
    """Warn of a seam of the picture."""
    if seam is not None:
        context.warn(
            f"at both ends of the picture's {seam.along} {seam.at_px:.0f} the line steps by "
            f"{seam.step_px:.1f} px in most rings: the picture has a seam there (a sensor or recorder that "
            "joins two parts), or the edge of standing water or sediment is there. A seam displaces one part "
            "of the wall by as much, so that radii and findings are wrong by more than their σ. What to do: "
            "look at a lit picture there; have the parts aligned, or record with a camera of one sensor"
        )


def _steps(radius: Float, azimuth_rad: Float) -> Float:
    """Return the step (F, A), px, of rings at each azimuth, with the line extrapolated from either side.

    Next to the azimuth itself the line is left out: on a seam it is blurred, or no line at all.
    """
    count = max(round(_ARC_RAD / float(azimuth_rad[1] - azimuth_rad[0])), 2)
    gap, from_side = count // 2, []
    for side in (-1, 1):
        near, far = (
            _mean_known(np.stack([np.roll(radius, side * k, 1) for k in range(first, first + count)]))
            for first in (gap, gap + count)
        )
        from_side.append(near + (near - far) * (gap + (count - 1) / 2) / count)
    return np.asarray(from_side[0] - from_side[1])


def _mean_known(values: Float) -> Float:
    """Return the mean of known values (K, F, A) over the first axis; NaN where fewer than half are known."""
    known = np.isfinite(values)
    count = known.sum(0)
    mean = np.where(known, values, 0.0).sum(0) / np.maximum(count, 1)
    return np.where(2 * count >= len(values), mean, np.nan)


def _median(values: Float) -> Float:
    """Return the medians (A,) of known values (F, A); NaN where fewer than half are known."""
    out, known = np.full(values.shape[1], np.nan), np.isfinite(values).mean(0) >= 0.5
    out[known] = row_median(values[:, known].T)
    return out


def _ends(step: Float, least: float, samples: RingSamples) -> np.ndarray:
    """Return the azimuths (K,) of steps (A,) above ``least``, the largest of those near each other."""
    apart = 4 * _ARC_RAD
    found: list[int] = []
    for k in np.argsort(-step)[: np.count_nonzero(step > least)]:
        away = samples.azimuth_rad[found] - samples.azimuth_rad[k]
        if np.all(np.cos(away) < np.cos(apart)):
            found.append(int(k))
    return np.array(found, np.int64)
