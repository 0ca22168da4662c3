"""Traces one ring in one image: search, fit, validation of the samples."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter

from pipeline.arrays import Bool, Byte, Float
from pipeline.artefacts.measured import RingValidity
from stages.rings.chain import Choice, choose_line
from stages.rings.noise import dark_response, noise_response
from stages.rings.other_light import other_light
from stages.rings.picture import Image, Mixture
from stages.rings.profile import ProfileFit, Response, fit_line
from stages.rings.search import BAND_WIDTHS, Candidates, detection_limit, find_ring, search_band
from stages.rings.sectors import Sectors
from stages.rings.validity import middle_and_spread

_EDGE_WIDTHS = 2.5
_ODD = 6.0
# Below this probability, one in ten of such samples would belong to another curve.
_SURE = 0.9
_LEAST_SPREAD = 0.02
# No wall reflects so evenly that a line a fifth fainter could not be the true one.
_REFLECTANCE_SPREAD = 0.2
_MOST = 0.5
# Brightness of a line over that of the brightest one, from which one image alone cannot decide between them:
# the wall reflects as unevenly as this around the pipe.
_RIVAL = 0.5
# A ring that lost more than this share of its circle from one image to the next may have left the band, or
# the image's noise may no longer be that of the image before. A new search costs time and does no harm.
LOST = 0.1
# Sectors of the running median, as for outliers (`stages.rings.validity`): five or more that leave it are
# wall.
_EXPECTED_SECTORS = 9
# As far as bell and background are told apart; and pixels from which the level without light is taken.
_NEAR_WIDTHS, _BLACK_EVERY = 3.0, 8
# A line is narrower from 2 % on: without coarse colours it changes by up to .6 % between two mixtures (drawn
# bands of wall), with them by 3 to 20 % (open-3 at crf 30 and 28).
_NARROWER = 0.98
# One sector in so many tells first whether it is narrower: medians of the four quarters of 1440 sectors
# scatter by .001 (open-3) and .002 (the same at crf 30).
_WIDTH_EVERY = 4


@dataclass(frozen=True)
class RingTrace:
    """The ring of one image.

    Attributes
    ----------
    fit
        Profiles of all sectors.
    validity : (A,) uint8
        `RingValidity`, as far as one image shows it.
    width_px : float
        Median line width, 1 σ.
    response
        Noise and clipping used in the fit.
    """

    fit: ProfileFit
    validity: Byte
    width_px: float
    response: Response

    @property
    def coverage(self) -> float:
        """Share of sectors with a valid sample."""
        return float((self.validity == RingValidity.VALID).mean())

    def radius_everywhere(self) -> Float:
        """Return the radius (A,) with rejected sectors bridged around the circle."""
        return _bridged(np.where(self.validity == RingValidity.VALID, self.fit.radius_px, np.nan))


def trace_ring(
    image: Image, sectors: Sectors, clip_level: float, before: RingTrace | None = None
) -> RingTrace | None:
    """Find and fit the laser ring in ``image``; None when no sample of one is valid.

    With the ring of the image ``before``, a band around it is searched first. Without it, or if clearly less
    of the ring lies in the band than before, the whole image is searched too, and the more complete ring
    counts. ``clip_level``: grey level at which the line clips. Samples far off the ring's course are kept
    only if they are brighter than other light of the picture.
    """
    found = None if before is None else follow_ring(image, sectors, before)
    if found is None or before is None or found.coverage < before.coverage - LOST:
        anew = discover_ring(image, sectors, clip_level)
        found = max((t for t in (found, anew) if t is not None), key=lambda t: t.coverage, default=None)
    return _without_other_light(found, image, sectors) if found is not None and found.coverage > 0 else None


def follow_ring(image: Image, sectors: Sectors, before: RingTrace) -> RingTrace | None:
    """Fit the ring within a band around the ring seen ``before``; None when most of it is not there.

    The band lies around the running median of that ring. Otherwise a few sectors that were on a reflection
    beside the line would never find the line in their band again. Sectors without a line in the band are
    searched along their whole ray: a step of the bore moves part of the ring from one image to the next.
    """
    if before.coverage < _MOST:
        return None
    width, noise = before.width_px, before.response.dark_noise
    expected = median_filter(before.radius_everywhere(), _EXPECTED_SECTORS, mode="wrap")
    band = BAND_WIDTHS * width
    peaks = search_band(image, sectors, expected - band, expected + band, width, noise)
    peaks = peaks.above(_limit(sectors, 2 * band))
    missing = np.isnan(peaks.radius_px[:, 0])
    if missing.mean() > _MOST:
        return None
    if missing.any():
        peaks = _search_rays(image, sectors, peaks, missing, width, noise)
    choice = choose_line(peaks, expected, width)
    fit = fit_line(image, sectors, choice.radius_px, width, before.response)
    return _judged(fit, choice, sectors, float(np.nanmedian(fit.width_px)), before.response)


def discover_ring(image: Image, sectors: Sectors, clip_level: float) -> RingTrace | None:
    """Find the ring anywhere, and learn its line width and the image's noise from it; None without ring."""
    response = dark_response(image, clip_level)
    radius, width = find_ring(image, sectors, response.dark_noise)
    found = np.isfinite(radius)
    if not found.any():
        return None
    band = BAND_WIDTHS * width
    choice, fit = _fitted_about(radius, band, image, sectors, width, response)
    for _ in range(2):
        if not np.isfinite(fit.width_px).any():
            return None
        width = float(np.nanmedian(fit.width_px))
        response = noise_response(image, sectors, fit, response)
        # Near the image's edge a narrow line is seen where the wider template did not fit.
        radius = _bridged(np.where(found, radius, fit.radius_px))
        choice, fit = _fitted_about(radius, band, image, sectors, width, response)
    return _judged(fit, choice, sectors, width, response)


def fitted_in(image: Mixture, trace: RingTrace, sectors: Sectors) -> RingTrace | None:
    """Return a ring fitted in another mixture ``image`` of its picture; None unless it is narrower.

    What is not the line broadens it: light of the wall, and colours that a codec stores coarsely. It is
    searched so near to the traced ring that the wall's bright bands, wider than the line, form no peak.
    """
    width, traced = trace.width_px, trace.radius_everywhere()
    low, high = traced - _NEAR_WIDTHS * width, traced + _NEAR_WIDTHS * width
    response = trace.response._replace(black=float(np.median(image.everywhere(_BLACK_EVERY))))
    few = fit_line(image, sectors, traced, width, response, every=_WIDTH_EVERY).width_px / trace.fit.width_px
    few = few[np.isfinite(few) & (trace.validity == RingValidity.VALID)]
    if not len(few) or np.median(few) >= _NARROWER:
        return None
    peaks = search_band(image, sectors, low, high, width, response.dark_noise)
    choice = choose_line(peaks, traced, width)
    for _ in range(2):
        fit = fit_line(image, sectors, choice.radius_px, width, response)
        if not np.isfinite(fit.width_px).any():
            return None
        response = noise_response(image, sectors, fit, response)
    anew = _judged(fit, choice, sectors, float(np.nanmedian(fit.width_px)), response)
    lost = trace.validity != RingValidity.VALID
    anew = replace(anew, validity=np.where(lost, trace.validity, anew.validity))
    narrower = anew.width_px < _NARROWER * trace.width_px
    return anew if narrower and anew.coverage > trace.coverage - LOST else None


def _fitted_about(
    radius_px: Float, band: float, image: Image, sectors: Sectors, width_px: float, response: Response
) -> tuple[Choice, ProfileFit]:
    """Search a band, px, around a ring (A,) of this image, and fit the most likely line of this width.

    The ring that defines the band was found in the same image and is no independent evidence: where another
    line is nearly as bright, either may be the ring.
    """
    peaks = search_band(image, sectors, radius_px - band, radius_px + band, width_px, response.dark_noise)
    choice = choose_line(peaks, radius_px, width_px)
    rivalled = peaks.score[:, 1] > _RIVAL * peaks.score[:, 0]
    choice = choice._replace(probability=np.where(rivalled, 0.5, choice.probability))
    return choice, fit_line(image, sectors, choice.radius_px, width_px, response)


def _bridged(radius_px: Float) -> Float:
    """Return radii (A,) with unknown sectors bridged around the circle."""
    known = np.flatnonzero(np.isfinite(radius_px))
    sectors = len(radius_px)
    return np.interp(np.arange(sectors), known, radius_px[known], period=sectors)


def _limit(sectors: Sectors, positions: float) -> float:
    return detection_limit(len(sectors.azimuth_rad) * positions)


def _search_rays(
    image: Image, sectors: Sectors, peaks: Candidates, missing: Bool, width_px: float, noise: float
) -> Candidates:
    """Return ``peaks`` in which the ``missing`` sectors were searched along their whole ray."""
    far = float(sectors.radius_px.max())
    low, high = np.where(missing, 4 * width_px, np.nan), np.where(missing, far, np.nan)
    wide = search_band(image, sectors, low, high, width_px, noise).above(_limit(sectors, far))
    return Candidates(*(np.where(missing[:, None], w, p) for w, p in zip(wide, peaks, strict=True)))


def _without_other_light(trace: RingTrace, image: Image, sectors: Sectors) -> RingTrace:
    """Return a ring without the samples that may be other light of the image."""
    radius = np.where(trace.validity == RingValidity.VALID, trace.fit.radius_px, np.nan)
    lost = other_light(radius, trace.width_px, trace.response.dark_noise, image, sectors)
    return replace(trace, validity=np.where(lost, RingValidity.GHOST, trace.validity))


def _judged(
    fit: ProfileFit, choice: Choice, sectors: Sectors, width_px: float, response: Response
) -> RingTrace:
    """Return the fitted ring with the validity of its samples; σ includes the chance of a wrong candidate."""
    validity = _judge(fit, choice, sectors)
    fit = fit._replace(sigma_px=np.hypot(fit.sigma_px, choice.spread_px))
    return RingTrace(fit, validity, width_px, response)


def _judge(fit: ProfileFit, choice: Choice, sectors: Sectors) -> Byte:
    """Return `RingValidity` (A,) as far as one image shows it; of several reasons the last one below counts.

    Limits come from the ring itself: a sample is an outlier if it leaves the spread of the ring's samples.
    """
    v = RingValidity
    brightness, width, misfit = np.log(fit.amplitude), np.log(fit.width_px), np.log(fit.chi2)
    thin = ~(np.minimum(fit.unclipped_below, fit.unclipped_above) >= 1)
    out = np.full(len(thin), v.VALID, np.uint8)
    out[np.abs(_oddness(width, width)) > _ODD] = v.WIDTH
    out[_oddness(brightness, brightness, _REFLECTANCE_SPREAD) > _ODD] = v.GLINT
    out[_oddness(misfit, misfit) > _ODD] = v.GHOST
    out[choice.probability < _SURE] = v.GHOST
    out[~(fit.amplitude > detection_limit(len(thin)) * fit.amplitude_sigma)] = v.LOW_CONTRAST
    out[thin & (fit.clipped > 0)] = v.SATURATED
    out[fit.radius_px > sectors.outermost_px - _EDGE_WIDTHS * fit.width_px] = v.OUT_OF_VIEW
    out[np.isnan(fit.radius_px)] = v.NO_LINE
    return out


def _oddness(value: Float, ring: Float, least_spread: float = _LEAST_SPREAD) -> Float:
    """Return the excess of each ``value`` (A,) over the median of the ``ring``, in robust σ of the ring."""
    middle, spread = middle_and_spread(ring)
    return np.asarray((value - middle) / max(spread, least_spread))
