"""Which samples far off the ring's own course may as well be other light of the image.

Where the line is too faint to be seen, texture of the lit wall, the end of the light far down the pipe or a
reflection is all that a ray shows. The rays that show the line tell how bright such light is, and where.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.ndimage import median_filter

from pipeline.adjustment.robust import basis_of, ring_harmonics
from pipeline.arrays import Bool, Float, Int
from stages.rings.search import BAND_WIDTHS, Candidates, Image, search_band
from stages.rings.sectors import Sectors

# The brightest of the many spots that a ray shows follows Gumbel's distribution: its .99 quantile lies so
# many times the distance of median and lower quartile above the median, (4.60 - .37) / (.37 + .33). So the
# quantile is told by the darker half of the rays, and a glint or a reflection, which few rays show, does not
# move it.
_GUMBEL_99 = 6.11
# One sector in four that show the line is looked at: beside each other they share pixels.
_TOLD_EVERY = 4
# Sectors of the running median, as for outliers (`stages.rings.validity`): five or more that leave it are
# wall.
_SMOOTH_SECTORS = 9
# Neighbours of one arc differ by less than the width of the line, two σ. An arc is longer than 30 σ (chosen):
# ten spots as small as the line that lie in one row by chance, each in one case of fifty.
_STEP_WIDTHS, _ARC_WIDTHS = 2.0, 30.0
# Light that goes on beyond an arc, in most of the rays there and at least half as bright, is no line.
_LIKE = 0.5


def other_light(radius_px: Float, width_px: float, noise: float, image: Image, sectors: Sectors) -> Bool:
    """Return which samples (A,) lie off the ring's course and may be light that is not the line's.

    These are the samples no brighter than what all but one in a hundred rays show beside the line. Long arcs
    are the line however bright other light is, unless light goes on beyond their ends where rays do show the
    line on its course.

    Parameters
    ----------
    radius_px : (A,)
        Radius of valid samples, px; NaN elsewhere.
    width_px
        1 σ of the line, px.
    noise
        1 σ of the dark image, grey levels.
    image, sectors
    """
    basis, band = basis_of(sectors.azimuth_rad), BAND_WIDTHS * width_px
    course = ring_harmonics(radius_px[None], basis)[0] @ basis.T
    aside, told = np.abs(radius_px - course) > band, np.abs(radius_px - course) <= band
    if not aside.any() or not told.any():
        return np.zeros_like(aside)
    told[np.flatnonzero(told)[np.arange(told.sum()) % _TOLD_EVERY > 0]] = False
    low = np.where(aside | told, 4 * width_px, np.nan)
    high = np.where(aside | told, float(sectors.radius_px.max()), np.nan)
    peaks = search_band(image, sectors, low, high, width_px, noise)
    score = np.where(np.abs(peaks.radius_px - radius_px[:, None]) <= width_px, peaks.score, 0.0).max(1)
    off_course = np.abs(peaks.radius_px - course[:, None]) > band
    beside = Candidates(peaks.radius_px, np.where(off_course, peaks.score, 0.0))
    lost = aside & (score <= _brightest(beside.score[told].max(1)))
    smooth = median_filter(np.where(aside, radius_px, course), _SMOOTH_SECTORS, mode="wrap")
    for arc in _arcs(smooth, np.abs(smooth - course) > band, width_px):
        if not _goes_on(arc, smooth, score, beside, told, band):
            lost[arc] &= np.abs(radius_px - smooth)[arc] > _STEP_WIDTHS * width_px
    return np.asarray(lost)


def _brightest(score: Float) -> float:
    """Return the score that all but one in a hundred rays stay below, of the brightest spots of rays (K,)."""
    quartile, median = np.quantile(score, [0.25, 0.5])
    return float(median + _GUMBEL_99 * (median - quartile))


def _arcs(smooth_px: Float, off: Bool, width_px: float) -> Iterator[Int]:
    """Return the sectors of each long arc of a smoothed ring (A,) that is ``off`` the course and unbroken."""
    step = np.abs(np.diff(smooth_px, prepend=smooth_px[-1]))
    breaks = np.flatnonzero(~off | ~np.roll(off, 1) | (step > _STEP_WIDTHS * width_px))
    for first, end in zip(breaks, np.r_[breaks[1:], breaks[:1] + len(off)], strict=True):
        arc = np.arange(first, end) % len(off)
        long = smooth_px[arc].sum() * 2 * np.pi / len(off) > _ARC_WIDTHS * width_px
        if off[arc[0]] and long:
            yield arc


def _goes_on(
    arc: Int, smooth_px: Float, score: Float, beside: Candidates, told: Bool, reach_px: float
) -> bool:
    """Whether light at an arc's radius goes on beyond either end, as far as the arc is long."""
    for end, onward in ((arc[0], -1), (arc[-1], 1)):
        rays = (end + onward * np.arange(1, len(arc) + 1)) % len(told)
        rays = rays[told[rays]]
        near = np.abs(beside.radius_px[rays] - smooth_px[end]) <= reach_px
        shown = np.where(near, beside.score[rays], 0.0).max(1, initial=0.0)
        if len(rays) and (shown > _LIKE * np.median(score[arc])).mean() > 0.5:
            return True
    return False
