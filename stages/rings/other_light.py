"""Rejects samples far off the ring's course that may be other light of the image than the line.

Where the line is too faint to be seen, a ray shows only texture of the lit wall, the end of the light far
down the pipe or a reflection. The rays on which the line is seen show how bright such light is, and where it
lies.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from pipeline.adjustment.robust import basis_of, ring_harmonics
from pipeline.arrays import Bool, Float, Int
from stages.rings.picture import Image
from stages.rings.search import BAND_WIDTHS, Candidates, search_band
from stages.rings.sectors import Sectors

# The brightest of the many spots on a ray follows Gumbel's distribution: its .99 quantile lies this many
# times the distance of median and lower quartile above the median, (4.60 - .37) / (.37 + .33). So the
# quantile is estimated from the darker half of the rays, and a glint or a reflection, which few rays show,
# does not move it.
_GUMBEL_99 = 6.11
# Of the sectors that show the line on its course, one in four is used: neighbours share pixels.
_USED_EVERY = 4
# Sectors of the running median, as for outliers (`stages.rings.validity`): five or more that leave it are
# wall.
_SMOOTH_SECTORS = 9
# Neighbours in one arc differ by less than the width of the line, two σ. An arc is longer than 30 σ (chosen):
# ten spots as small as the line in a row by chance, each with a probability of 1 in 50.
_STEP_WIDTHS, _ARC_WIDTHS = 2.0, 30.0
# Light that continues beyond an arc, in most of the rays there and at least half as bright, is not the line.
_SAME_LIGHT = 0.5


@dataclass(frozen=True)
class _Rays:
    """Light on the rays of an image, on and beside the course of its ring.

    Attributes
    ----------
    on_course, off_course : (A,) bool
        Rays whose sample lies on the course, of which one in four is used, and rays whose sample lies off it.
    score : (A,)
        Matched filter's response at the samples over its noise; 0 on unused rays.
    beside : Candidates
        The brightest peaks of each ray; those on the course have a score of 0.
    band_px : float
        Largest distance from the course, px, of light that counts as on it.
    """

    on_course: Bool
    off_course: Bool
    score: Float
    beside: Candidates
    band_px: float


def other_light(radius_px: Float, width_px: float, noise: float, image: Image, sectors: Sectors) -> Bool:
    """Return which samples (A,) lie off the ring's course and may be other light than the line.

    These are the samples that are no brighter than the light beside the line on all but one in a hundred
    rays. Long arcs are the line however bright other light is, unless light continues beyond their ends on
    rays that also show the line on its course.

    Parameters
    ----------
    radius_px : (A,)
        Radius of valid samples, px; NaN elsewhere.
    width_px
        1 σ of the line, px.
    noise
        1 σ of the dark image, grey levels.
    image
        The picture.
    sectors
        The image cut into A sectors.
    """
    basis = basis_of(sectors.azimuth_rad)
    if _surely_on_course(radius_px, basis, BAND_WIDTHS * width_px):
        return np.zeros(len(radius_px), bool)
    course = ring_harmonics(radius_px[None], basis)[0] @ basis.T
    rays = _rays(radius_px, course, width_px, noise, image, sectors)
    if rays is None:
        return np.zeros(len(radius_px), bool)
    rejected = rays.off_course & (rays.score <= _brightest(rays.beside.score[rays.on_course].max(1)))
    smooth = median_filter(np.where(rays.off_course, radius_px, course), _SMOOTH_SECTORS, mode="wrap")
    for arc in _arcs(smooth, np.abs(smooth - course) > rays.band_px, width_px):
        if not _continues(arc, smooth, rays):
            rejected[arc] &= np.abs(radius_px - smooth)[arc] > _STEP_WIDTHS * width_px
    return np.asarray(rejected)


def _surely_on_course(radius_px: Float, basis: Float, band_px: float) -> bool:
    """Return whether all samples (A,) lie within a quarter of the band of their plain mean course.

    Then none lies outside of the band around a course that follows most of them, which takes ten times as
    long to find.
    """
    seen = np.isfinite(radius_px)
    mean = np.linalg.lstsq(basis[seen], radius_px[seen])[0]
    return bool(np.abs(radius_px[seen] - basis[seen] @ mean).max(initial=0.0) <= band_px / 4)


def _rays(
    radius_px: Float, course_px: Float, width_px: float, noise: float, image: Image, sectors: Sectors
) -> _Rays | None:
    """Return the light on the rays of an image; None if no sample lies off, or none on, the course (A,)."""
    band = BAND_WIDTHS * width_px
    off, on = np.abs(radius_px - course_px) > band, np.abs(radius_px - course_px) <= band
    if not off.any() or not on.any():
        return None
    on[np.flatnonzero(on)[np.arange(on.sum()) % _USED_EVERY > 0]] = False
    low = np.where(off | on, 4 * width_px, np.nan)
    high = np.where(off | on, float(sectors.radius_px.max()), np.nan)
    peaks = search_band(image, sectors, low, high, width_px, noise)
    at_sample = np.abs(peaks.radius_px - radius_px[:, None]) <= width_px
    is_beside = np.abs(peaks.radius_px - course_px[:, None]) > band
    beside = Candidates(peaks.radius_px, np.where(is_beside, peaks.score, 0.0))
    return _Rays(on, off, np.where(at_sample, peaks.score, 0.0).max(1), beside, band)


def _brightest(score: Float) -> float:
    """Return the .99 quantile of the scores (K,) of the brightest spots on rays."""
    quartile, median = np.quantile(score, [0.25, 0.5])
    return float(median + _GUMBEL_99 * (median - quartile))


def _arcs(smooth_px: Float, off: Bool, width_px: float) -> Iterator[Int]:
    """Yield the sectors of each long unbroken arc of a smoothed ring (A,) that is ``off`` the course (A,)."""
    step = np.abs(np.diff(smooth_px, prepend=smooth_px[-1]))
    breaks = np.flatnonzero(~off | ~np.roll(off, 1) | (step > _STEP_WIDTHS * width_px))
    for first, end in zip(breaks, np.r_[breaks[1:], breaks[:1] + len(off)], strict=True):
        arc = np.arange(first, end) % len(off)
        long = smooth_px[arc].sum() * 2 * np.pi / len(off) > _ARC_WIDTHS * width_px
        if off[arc[0]] and long:
            yield arc


def _continues(arc: Int, smooth_px: Float, rays: _Rays) -> bool:
    """Return whether light at the radius of an ``arc`` continues beyond either end, as far as it is long."""
    for end, onward in ((arc[0], -1), (arc[-1], 1)):
        beyond = (end + onward * np.arange(1, len(arc) + 1)) % len(smooth_px)
        beyond = beyond[rays.on_course[beyond]]
        near = np.abs(rays.beside.radius_px[beyond] - smooth_px[end]) <= rays.band_px
        shown = np.where(near, rays.beside.score[beyond], 0.0).max(1, initial=0.0)
        if len(beyond) and (shown > _SAME_LIGHT * np.median(rays.score[arc])).mean() > 0.5:
            return True
    return False
