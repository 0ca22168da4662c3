"""One ring in one image: search, fit, judge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.artefacts import Byte, Float, RingValidity
from stages.rings.profile import ProfileFit, Response, fit_line
from stages.rings.search import (
    BAND_WIDTHS,
    Image,
    Peaks,
    detection_limit,
    find_ring,
    search_band,
)
from stages.rings.sectors import Sectors

_LEAST_FLANK_PIXELS = 2
_WIDTH_SIGMAS = 6.0
_HALF_OF_SECTORS = 0.5


@dataclass(frozen=True)
class RingTrace:
    """The ring of one image: profiles, `RingValidity` (A,), and the line's median width in px."""

    fit: ProfileFit
    validity: Byte
    width_px: float

    @property
    def valid(self) -> NDArray[np.bool_]:
        """(A,) true where the sample may be used."""
        return np.asarray(self.validity == RingValidity.VALID)

    def radius_everywhere(self) -> Float:
        """Return the radius (A,) with rejected sectors bridged around the circle."""
        good = np.flatnonzero(self.valid)
        sectors = len(self.validity)
        radius = self.fit.radius_px[good]
        return np.interp(np.arange(sectors), good, radius, period=sectors)


def trace_ring(
    image: Image, sectors: Sectors, response: Response, before: RingTrace | None = None
) -> RingTrace | None:
    """Find and fit the laser ring in ``image`` (H, W); None when there is none.

    Parameters
    ----------
    image
        Luma plane, or a mixture of channels, in grey levels.
    before
        The ring of the frame before; without it, or when most of the ring left its band, the whole image is
        searched.
    """
    noise = float(np.sqrt(response.variance))
    peaks = None if before is None else _follow(image, sectors, noise, before)
    width = before.width_px if before is not None else np.nan
    if peaks is None:
        peaks, width = _discover(image, sectors, noise)
    if peaks is None:
        return None
    seen = peaks.score > _limit(sectors, BAND_WIDTHS * width)
    seed = np.where(seen, peaks.radius_px, np.nan)
    fit = fit_line(image, sectors, seed, width, response)
    if before is None:
        width = float(np.nanmedian(fit.width_px))
        fit = fit_line(image, sectors, seed, width, response)
    return RingTrace(fit, _judge(fit, peaks, seen, sectors, width), float(np.nanmedian(fit.width_px)))


def _limit(sectors: Sectors, positions: float) -> float:
    return detection_limit(len(sectors.azimuth_rad) * positions)


def _follow(image: Image, sectors: Sectors, noise: float, before: RingTrace) -> Peaks | None:
    """Search the band about the ring seen last, and the whole ray where it is empty; None when it is lost."""
    expected, band = before.radius_everywhere(), BAND_WIDTHS * before.width_px
    peaks = search_band(image, sectors, expected - band, expected + band, before.width_px, noise)
    missing = ~(peaks.score > _limit(sectors, 2 * band))
    if missing.mean() > _HALF_OF_SECTORS:
        return None
    if not missing.any():
        return peaks
    far = float(sectors.radius_px.max())
    low, high = np.where(missing, before.width_px, np.nan), np.where(missing, far, np.nan)
    wide = search_band(image, sectors, low, high, before.width_px, noise)
    found = missing & (wide.score > _limit(sectors, far))
    return Peaks(*(np.where(found, w, p) for w, p in zip(wide, peaks, strict=True)))


def _discover(image: Image, sectors: Sectors, noise: float) -> tuple[Peaks | None, float]:
    """Find the ring anywhere, then its peaks; None when hardly any sector shows a line."""
    radius, width = find_ring(image, sectors, noise)
    if np.isfinite(radius).sum() < 2:
        return None, width
    band = BAND_WIDTHS * width
    return search_band(image, sectors, radius - band, radius + band, width, noise), width


def _judge(fit: ProfileFit, peaks: Peaks, seen: NDArray[np.bool_], sectors: Sectors, width_px: float) -> Byte:
    """Return `RingValidity` (A,) as far as a single sector's own profile tells."""
    v = RingValidity
    out = np.full(len(seen), v.VALID, np.uint8)
    fitted = np.isfinite(fit.radius_px)
    clipped = fit.clipped > 0
    thin = np.minimum(fit.unclipped_below, fit.unclipped_above) < _LEAST_FLANK_PIXELS
    out[_odd_width(fit)] = v.WIDTH
    out[peaks.rival_score > peaks.score] = v.GHOST
    out[~(fit.amplitude > _limit(sectors, BAND_WIDTHS * width_px) * fit.amplitude_sigma)] = v.LOW_CONTRAST
    out[clipped & thin] = v.SATURATED
    out[~clipped & thin] = v.OUT_OF_VIEW
    out[seen & ~fitted] = v.OUT_OF_VIEW
    out[~seen] = v.NO_LINE
    return out


def _odd_width(fit: ProfileFit) -> NDArray[np.bool_]:
    """(A,) where the line width lies far outside of the ring's own spread of widths."""
    log_width = np.log(fit.width_px)
    middle = np.nanmedian(log_width)
    spread = 1.4826 * np.nanmedian(np.abs(log_width - middle))
    return np.asarray(np.abs(log_width - middle) > _WIDTH_SIGMAS * max(spread, 1e-3))
