"""Searches for the line, to a pixel: in a band around the ring seen last, or in the whole image."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numba
import numpy as np

from pipeline.adjustment.robust import MAD_TO_SIGMA
from pipeline.arrays import Float, Float32, Int
from stages.rings.kernels import FAST, first_at_least, neighbours_joined
from stages.rings.picture import Image, channels, everywhere, grey_at
from stages.rings.sectors import Sectors

BAND_WIDTHS = 10.0
_BELT_WIDTHS = 16.0
_REACH_WIDTHS = 4.0
_SMALLEST_RADIUS_PX = 12
_CREDIT = 6.0
_JUMP = 18.0
_TRIAL_WIDTHS_PX = (1.0, 2.0, 4.0)
_RAYS = 360
# The line, a glint on either side of it and a reflection.
_CANDIDATES = 4


class Candidates(NamedTuple):
    """The strongest candidates of every sector for the line, strongest first; (A, 4) each.

    ``radius_px`` is NaN if there are fewer; ``score`` is the matched filter's response over its noise.
    """

    radius_px: Float
    score: Float

    def above(self, limit: float) -> Candidates:
        """Return those whose score exceeds ``limit``."""
        return Candidates(np.where(self.score > limit, self.radius_px, np.nan), self.score)


def matched_template(width_px: float) -> Float:
    """Return a Gaussian of 1 σ ``width_px``, orthogonal to constant and linear background, of unit norm."""
    reach = max(2, int(np.ceil(_REACH_WIDTHS * width_px)))
    t = np.arange(-reach, reach + 1.0)
    template = np.exp(-0.5 * (t / width_px) ** 2)
    template -= template.mean()
    return np.asarray(template / np.linalg.norm(template))


def detection_limit(positions: float) -> float:
    """Return the score that the largest of ``positions`` Gaussian noise values exceeds once in a hundred."""
    return float(np.sqrt(2 * np.log(100 * max(positions, 2.0))))


def search_band(
    image: Image, sectors: Sectors, low_px: Float, high_px: Float, width_px: float, noise: float
) -> Candidates:
    """Find the matched filter's peaks of every sector between ``low_px`` and ``high_px`` (A,)."""
    radius, score = np.full((len(low_px), _CANDIDATES), np.nan), np.zeros((len(low_px), _CANDIDATES))
    template, widest = matched_template(width_px), int(np.nanmax(high_px - low_px, initial=0))
    _search_sectors(
        *channels(image), sectors.start, sectors.pixel, sectors.radius_px, low_px, high_px, widest, template,
        radius, score,
    )  # fmt: skip
    return Candidates(radius, score / noise)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _radial_profile(image, weights, start, pixel, radius, a, aside, first, bins, total, count):  # type: ignore[no-untyped-def]
    """Compute the mean grey level in bins of one pixel from radius ``first``; return the number seen.

    The pixels are those of sector ``a`` and of ``aside`` sectors on either side, because a sector narrower
    than a pixel has none at some radii. Bins without a pixel take the value of the bin before.
    """
    total[:bins] = 0.0
    count[:bins] = 0
    seen = 0
    for turn in range(-aside, aside + 1):
        s = (a + turn) % (start.size - 1)
        k = first_at_least(radius, start[s], start[s + 1], first - 0.5)
        while k < start[s + 1]:
            b = int(radius[k] - first + 0.5)
            if b >= bins:
                break
            total[b] += grey_at(image, weights, pixel[k])
            count[b] += 1
            seen = max(seen, b + 1)
            k += 1
    level = 0.0
    for b in range(seen - 1, -1, -1):
        if count[b] > 0:
            level = total[b] / count[b]
    for b in range(seen):
        if count[b] > 0:
            level = total[b] / count[b]
        total[b] = level
    return seen


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _correlate(profile, seen, template, response):  # type: ignore[no-untyped-def]
    """Write ``profile`` · ``template`` to ``response`` where it fits."""
    reach = template.size // 2
    for b in range(reach, seen - reach):
        s = 0.0
        for j in range(template.size):
            s += template[j] * profile[b - reach + j]
        response[b] = s


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _keep_peaks(response, low, high, first, radius, score):  # type: ignore[no-untyped-def]
    """Write the largest local maxima of ``response[low:high]`` to ``radius`` and ``score``, largest first."""
    for b in range(low, high):
        before = response[b - 1] if b > low else -np.inf
        after = response[b + 1] if b < high - 1 else -np.inf
        if response[b] <= score[-1] or response[b] < before or response[b] <= after:
            continue
        at = score.size - 1
        while at > 0 and score[at - 1] < response[b]:
            radius[at], score[at] = radius[at - 1], score[at - 1]
            at -= 1
        radius[at], score[at] = first + b, response[b]
        bend = before - 2 * response[b] + after
        if -np.inf < bend < 0:
            radius[at] += 0.5 * (before - after) / bend


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _search_sectors(  # type: ignore[no-untyped-def]
    image, weights, start, pixel, radius, low_px, high_px, widest, template, found_px, score
):
    reach = template.size // 2
    size = widest + 2 * reach + 4
    total, count, response = np.empty(size), np.empty(size, np.int64), np.empty(size)
    for a in range(low_px.size):
        if not np.isfinite(low_px[a]):
            continue
        first = int(np.floor(low_px[a])) - reach
        bins = int(np.ceil(high_px[a])) + reach + 1 - first
        aside = neighbours_joined(start.size - 1, 0.5 * (low_px[a] + high_px[a]))
        seen = _radial_profile(image, weights, start, pixel, radius, a, aside, first, bins, total, count)
        _correlate(total, seen, template, response)
        _keep_peaks(response, reach, seen - reach, first, found_px[a], score[a])


def find_ring(image: Image, sectors: Sectors, noise: float) -> tuple[Float, float]:
    """Find the ring anywhere in the image: radius (A,), NaN where no line stands out, and trial line width.

    The closed path of the largest summed matched-filter score is found by dynamic programming in the polar
    image, for several line widths. Rays are a few sectors apart, which is enough to find the ring.
    """
    sector = np.arange(len(sectors.azimuth_rad))
    ray = sector[:: max(1, len(sector) // _RAYS)]
    nearest = np.searchsorted((ray[1:] + ray[:-1]) / 2, sector)
    polar = _polar_image(image, sectors, ray)
    # Near the centre rays share their pixels: each counts for the part that is its own.
    arc_px = 2 * np.pi / len(ray) * (_SMALLEST_RADIUS_PX + np.arange(polar.shape[1]))
    own = np.minimum(arc_px, 1.0).astype(np.float32)
    best_total, best = -np.inf, (np.full(len(sector), np.nan), _TRIAL_WIDTHS_PX[0])
    for width in _TRIAL_WIDTHS_PX:
        kernel = matched_template(width)[None].astype(np.float32)
        response = np.asarray(cv2.filter2D(polar, cv2.CV_32F, kernel), np.float32)
        score = response / np.maximum(_texture_noise(response, width), noise)
        score[np.isnan(score)] = 0
        credit = _credit(score) * own
        path = _closed_path(credit, _JUMP)
        at_path = score[np.arange(len(path)), path]
        total = float(credit[np.arange(len(path)), path].sum())
        if total > best_total:
            found = at_path > detection_limit(polar.size)
            radius = np.interp(sector, ray, path + float(_SMALLEST_RADIUS_PX), period=len(sector))
            radius[~found[nearest]] = np.nan
            best_total, best = total, (radius, width)
    return best


def _credit(score: Float) -> Float32:
    """Return the evidence of a score for the line: the score up to a limit, its logarithm beyond it.

    Light with a score at the limit is certainly not noise. Beyond the limit, evidence grows slowly with
    brightness: a line ten times as bright as its halo keeps the path over many rays, but a glint ten times as
    bright as the line does not displace the path over a few.
    """
    above = np.maximum(score, _CREDIT)
    return np.asarray(np.clip(score, 0, _CREDIT) + np.log(above / _CREDIT), np.float32)


def _texture_noise(response: Float32, width_px: float) -> Float32:
    """Robust spread (R,) of a filter's response (A, R) over all azimuths in a belt around each radius.

    The belt is much wider than the line, so that a well centred ring does not count as noise.
    """
    belt = int(np.ceil(_BELT_WIDTHS * width_px))
    size = np.nan_to_num(np.abs(response)).T
    spread = [np.median(size[max(0, r - belt) : r + belt + 1]) for r in range(0, len(size), belt)]
    every = np.interp(np.arange(len(size)), np.arange(0, len(size), belt), spread)
    return np.asarray(MAD_TO_SIGMA * every, np.float32)


def _polar_image(image: Image, sectors: Sectors, ray: Int) -> Float32:
    width, height = sectors.image_size
    u, v = sectors.centre_px
    corners = np.hypot(np.array([u, u, width - u, width - u]), np.array([v, height - v, v, height - v]))
    radius = np.arange(_SMALLEST_RADIUS_PX, int(corners.max()))
    map_u = u + radius * np.cos(sectors.azimuth_rad[ray])[:, None]
    map_v = v + radius * np.sin(sectors.azimuth_rad[ray])[:, None]
    out = cv2.remap(
        everywhere(image).astype(np.float32), map_u.astype(np.float32), map_v.astype(np.float32),
        cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=float("nan"),
    )  # fmt: skip
    return np.asarray(out, np.float32)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _moved(value, jump, moved, origin):  # type: ignore[no-untyped-def]
    """Best ``value`` (R,) minus its distance to each radius, px, at most ``jump``; and where it came from."""
    top = np.argmax(value)
    for r in range(value.size):
        moved[r], origin[r] = value[r], r
        if r > 0 and moved[r - 1] - 1 > moved[r]:
            moved[r], origin[r] = moved[r - 1] - 1, origin[r - 1]
    for r in range(value.size - 2, -1, -1):
        if moved[r + 1] - 1 > moved[r]:
            moved[r], origin[r] = moved[r + 1] - 1, origin[r + 1]
    for r in range(value.size):
        if value[top] - jump > moved[r]:
            moved[r], origin[r] = value[top] - jump, top


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _closed_path(credit, jump):  # type: ignore[no-untyped-def]
    """Path (A,) of largest credit (A, R) minus its radial moves around the circle.

    The circle is walked twice; the middle turn is returned, which neither end influences.
    """
    azimuths, radii = credit.shape
    steps = 2 * azimuths
    origin = np.empty((steps, radii), np.int16)
    value, moved = np.zeros(radii, np.float32), np.empty(radii, np.float32)
    for s in range(steps):
        _moved(value, jump, moved, origin[s])
        for r in range(radii):
            value[r] = moved[r] + credit[s % azimuths, r]
    path = np.empty(azimuths, np.int64)
    at = np.argmax(value)
    for s in range(steps - 1, -1, -1):
        if azimuths // 2 <= s < azimuths // 2 + azimuths:
            path[s % azimuths] = at
        at = origin[s, at]
    return path
