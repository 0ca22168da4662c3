"""Where dirt or drops on the window, at places that a twin found, displace the line.

The twin finds places in blocks of pixels, which are larger than the dirt: in the rest of a block the line is
as good as elsewhere. Dirt that bends light displaces the line at an azimuth of the image by the same amount
in all rings, or magnifies its motion when the probe moves. Both show against the smooth ring that is fitted
through all clear azimuths.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from pipeline.adjustment.robust import basis_of, ring_harmonics, spread_about_median
from pipeline.arrays import Bool, Float
from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.geometry.image_places import ImagePlaces, clear_of

_HARMONICS, _MOST = 4, 3.0
"""A round pipe seen askew, an oval one and an instrument that errs give a ring up to the fourth harmonic.
Usual departures by which a dent that passes by counts at most."""
_FEWEST_RINGS, _ENOUGH_RINGS, _BESIDE = 16, 128, 9
"""Rings that must show an azimuth for its median to be known to a third of their spread, and as many as are
looked at; azimuths about one that must follow the ring as well, as many as tell an outlier."""
_SURE, _ROUGH = 3.0, 2.0
"""Spreads of the clear azimuths from which one departs steadily, and times their usual scatter that it may
scatter, as a line beside glints does. Chosen; of sixteen rings noise changes it by a fifth."""
_OF_DEPTH, _KNOWN = 0.1, 0.05
"""By how much of its way a line may be magnified, and so a depth; 1 σ to which that must be known. Chosen."""


@dataclass(frozen=True)
class _Azimuths:
    """What the line does behind dirt at azimuths (A,).

    ``measured`` tells where it is as good as elsewhere but for a steady departure ``aside_px`` (0 where that
    is no larger than elsewhere).
    """

    measured: Bool
    aside_px: Float


def set_right(rings: RingSamples, places: ImagePlaces) -> None:
    """Leave out the samples at places of the image where they do not follow their ring.

    Samples that are displaced alike in all rings, and otherwise move with them, are moved back. A groove
    along the whole way would look the same, so the whole displacement is added to their σ.
    """
    hidden = ~clear_of(places, np.nan_to_num(rings.pixels()))
    if not hidden.any():
        return
    some = slice(None, None, max(len(rings.frame) // _ENOUGH_RINGS, 1))
    told = replace(rings, radius_px=rings.radius_px[some], validity=rings.validity[some])
    behind = _behind(told, hidden[some])
    rings.validity[hidden & ~behind.measured] = RingValidity.OUT_OF_VIEW
    aside = np.where(hidden & behind.measured, behind.aside_px, 0.0)
    rings.radius_px[:] -= aside
    np.hypot(rings.sigma_px, aside, out=rings.sigma_px, casting="same_kind")


def _behind(rings: RingSamples, hidden: Bool) -> _Azimuths:
    """Return what azimuths of rings (F, A) are like where they are ``hidden``, beside clear azimuths."""
    clear = np.asarray(~hidden.any(0))
    radius = np.where(rings.validity == RingValidity.VALID, rings.radius_px, np.nan).astype(float)
    basis = basis_of(rings.azimuth_rad, _HARMONICS)
    smooth = ring_harmonics(np.where(hidden, np.nan, radius), basis) @ basis.T
    departure = np.where(hidden | clear, radius - smooth, np.nan)
    enough = np.isfinite(departure).sum(0) >= _FEWEST_RINGS
    of_clear = clear & enough
    if not of_clear.any():
        return _Azimuths(clear, np.zeros(len(clear)))
    steady, gain, scatter = (np.full(len(clear), np.nan) for _ in range(3))
    steady[enough], gain[enough], scatter[enough] = _of_azimuths(departure[:, enough], smooth[:, enough])
    follows = (np.abs(gain) < _OF_DEPTH) & (spread_about_median(gain[of_clear]) < _KNOWN)
    follows &= scatter < _ROUGH * np.median(scatter[of_clear])
    lost = maximum_filter1d(enough & ~follows & ~clear, _BESIDE, mode="wrap")
    usual = np.abs(steady) < _SURE * spread_about_median(steady[of_clear])
    return _Azimuths(clear | (follows & ~lost), np.where(enough & ~usual, steady, 0.0))


def _of_azimuths(departure: Float, smooth: Float) -> tuple[Float, Float, Float]:
    """Return of azimuths (A,) the steady departure from the smooth ring, its gain on the ring's way, scatter.

    A dent that passes by moves the gain by no more than three usual departures do.
    """
    steady = np.nanmedian(departure, axis=0)
    rest = departure - steady
    most = _MOST * float(np.nanmedian(np.nanmedian(np.abs(rest), axis=0)))
    known = np.isfinite(rest)
    way = np.where(known, smooth - np.nanmean(np.where(known, smooth, np.nan), axis=0), 0.0)
    rest = np.where(known, np.clip(rest, -most, most), 0.0)
    gain = (way * rest).sum(0) / np.maximum((way**2).sum(0), 1e-12)
    return steady, gain, np.nanstd(departure, axis=0)
