"""Corrects or rejects the line where dirt or drops on the window, at places that a twin found, displace it.

The twin finds places in blocks of pixels, which are larger than the dirt: in the rest of a block the line is
as good as elsewhere. Dirt that bends light displaces the line at an azimuth of the image by the same amount
in all rings, or magnifies its motion when the probe moves. Both are measured against the smooth ring that is
fitted through all clear azimuths. Only rings that pass a place show its effect, and only at the radii at
which they pass it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import binary_propagation, maximum_filter1d

from pipeline.adjustment.robust import basis_of, ring_harmonics, spread_about_median
from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.geometry.image_places import ImagePlaces, clear_of
from pipeline.machine.stage import Context

_HARMONICS, _MOST = 4, 3.0
"""A round pipe seen obliquely, an oval one and an error of the instrument give a ring up to the fourth
harmonic. A dent that passes by counts as at most this many usual departures."""
_FEWEST_RINGS, _ENOUGH_RINGS, _BESIDE = 16, 128, 9
"""Rings that must show an azimuth for its median to be known to a third of their spread; rings that are
examined, or up to twice as many; azimuths around one that must follow the ring as well, as in the test for
outliers."""
_SURE, _ROUGH = 3.0, 2.0
"""An azimuth departs steadily from this many spreads of the clear azimuths on, and may scatter by this many
times their usual scatter, as a line beside glints does. Chosen; with sixteen rings, noise changes the scatter
by a fifth."""
_OF_DEPTH, _KNOWN = 0.1, 0.05
"""Largest relative magnification of the line's motion, and so of a depth; largest 1 σ of it. Chosen."""
_ENDS, _BEYOND = 0.1, 0.5
"""Share of the rings outside either end of the radii at which a place counts as examined, and share of the
range between these ends by which radii may lie outside. Chosen: a normal spread of radii keeps 99 %."""
_AT_ONCE = 128
"""Rings processed at a time, to limit memory."""


@dataclass(frozen=True)
class _Azimuths:
    """The line behind dirt at azimuths (A,).

    Attributes
    ----------
    measured : (A,) bool
        Whether the line is as good as elsewhere except for a steady displacement.
    aside_px : (A,)
        That displacement, px; 0 where it is no larger than elsewhere.
    from_px, to_px : (A,)
        Radii, px, between which this holds.
    """

    measured: Bool
    aside_px: Float
    from_px: Float
    to_px: Float

    def shown_by(self, rings: RingSamples) -> Bool:
        """Return where the line of rings (F, A) is as good behind dirt as elsewhere."""
        return self.measured & (rings.radius_px >= self.from_px) & (rings.radius_px <= self.to_px)


def set_right(rings: RingSamples, places: ImagePlaces, context: Context) -> RingSamples:
    """Leave out, in place, the samples at places of the image where they do not follow their ring.

    Samples that are displaced equally in all rings, and otherwise move with them, are moved back. The whole
    displacement is added to their σ and kept in ``moved_px`` of the returned rings. Unless the probe rolls,
    a groove along the whole run would look the same; `pipeline.artefacts.moved_back` leaves it out.
    """
    hides = np.sum([_hidden(some, places).sum(0) for some in _some_at_a_time(rings)], 0)
    if not hides.any():
        return rings
    behind = _behind(*_looked_at(rings, places, hides), hides == 0)
    rings = replace(rings, moved_px=context.scratch.zeros(rings.radius_px.shape, np.float32))
    lost, moved = np.sum([_apply(behind, some, places) for some in _some_at_a_time(rings)], 0).tolist()
    context.report("ring samples left out behind dirt", lost, "samples")
    context.report("ring samples moved back behind dirt", moved, "samples")
    return rings if moved else replace(rings, moved_px=None)


def _apply(behind: _Azimuths, rings: RingSamples, places: ImagePlaces) -> tuple[int, int]:
    """Correct rings in place; return the numbers of samples that were left out and moved back."""
    hidden, shown = _hidden(rings, places), behind.shown_by(rings)
    rings.validity[hidden & ~shown] = RingValidity.OUT_OF_VIEW
    aside = np.where(hidden & shown, behind.aside_px, 0.0)
    rings.radius_px[:] -= aside
    np.hypot(rings.sigma_px, aside, out=rings.sigma_px, casting="same_kind")
    if rings.moved_px is not None:
        rings.moved_px[:] = aside
    return int((hidden & ~shown).sum()), int(np.count_nonzero(aside))


def _some_at_a_time(rings: RingSamples) -> Iterator[RingSamples]:
    for first in range(0, len(rings.frame), _AT_ONCE):
        yield rings.some(slice(first, first + _AT_ONCE))


def _hidden(rings: RingSamples, places: ImagePlaces) -> Bool:
    """Return which valid samples (F, A) lie at the places."""
    return rings.valid & ~clear_of(places, np.nan_to_num(rings.pixels()))


def _looked_at(rings: RingSamples, places: ImagePlaces, hides: Int) -> tuple[Float, Float]:
    """Return departures from the smooth ring, and its radius (N, A), of rings spread evenly over the run.

    At each azimuth they are taken from the ``hides`` (A,) rings in which it is hidden, or from all rings if
    there are none; so the rings in a row are not the same at all azimuths. NaN where there are fewer.
    """
    clear = hides == 0
    every = np.maximum(np.where(clear, len(rings.frame), hides) // _ENOUGH_RINGS, 1)
    departure, smooth = np.full((2, 2 * _ENOUGH_RINGS, len(hides)), np.nan)
    passed = np.zeros(len(hides), np.int64)
    for some in _some_at_a_time(rings):
        hidden = _hidden(some, places)
        wanted = hidden | (clear & some.valid)
        number = passed + np.cumsum(wanted, 0) - 1
        passed += wanted.sum(0)
        taken = wanted & (number % every == 0)
        of_ring = taken.any(1)
        radius, ring = _with_smooth(some, hidden, of_ring)
        row, azimuth = np.nonzero(taken[of_ring])
        place = (number[of_ring] // every)[row, azimuth], azimuth
        departure[place], smooth[place] = (radius - ring)[row, azimuth], ring[row, azimuth]
    return departure, smooth


def _with_smooth(rings: RingSamples, hidden: Bool, which: Bool) -> tuple[Float, Float]:
    """Return the radii of some of the rings, and of the smooth ring through their clear samples, (n, A)."""
    radius = np.where(rings.valid[which], rings.radius_px[which], np.nan).astype(float)
    basis = basis_of(rings.azimuth_rad, _HARMONICS)
    return radius, ring_harmonics(np.where(hidden[which], np.nan, radius), basis) @ basis.T


def _behind(departure: Float, smooth: Float, clear: Bool) -> _Azimuths:
    """Return the line behind dirt, compared with the azimuths (A,) that are ``clear`` in all rings."""
    enough = np.isfinite(departure).sum(0) >= _FEWEST_RINGS
    of_clear = clear & enough
    steady, gain, scatter, first, last = np.full((5, len(clear)), np.nan)
    if not of_clear.any():
        return _Azimuths(clear, np.zeros(len(clear)), first, last)
    steady[enough], gain[enough], scatter[enough] = _of_azimuths(departure[:, enough], smooth[:, enough])
    first[enough], last[enough] = _looked_between((departure + smooth)[:, enough])
    follows = (np.abs(gain) < _OF_DEPTH) & (spread_about_median(gain[of_clear]) < _KNOWN)
    follows &= scatter < _ROUGH * np.median(scatter[of_clear])
    lost = maximum_filter1d(enough & ~follows & ~clear, _BESIDE, mode="wrap")
    departs = enough & (np.abs(steady) >= _SURE * spread_about_median(steady[of_clear]))
    ends_clear = ~_reaches(departs, clear)
    return _Azimuths(follows & ~lost & ends_clear, np.where(departs, steady, 0.0), first, last)


def _reaches(departs: Bool, clear: Bool) -> Bool:
    """Return which azimuths (A,) lie in a stretch that also departs where it is clear.

    A departure that continues beside the dirt is on the wall, or cannot be distinguished from one.
    """
    twice, wall = np.tile(departs, 2), np.tile(departs & clear, 2)
    whole = binary_propagation(wall, mask=twice)
    return np.asarray(whole[: len(clear)] | whole[len(clear) :])


def _looked_between(radius: Float) -> tuple[Float, Float]:
    """Return the smallest and the largest radius (A,) for which the examined rings (N, A) are evidence."""
    first, last = np.nanquantile(radius, (_ENDS, 1 - _ENDS), axis=0)
    return first - _BEYOND * (last - first), last + _BEYOND * (last - first)


def _of_azimuths(departure: Float, smooth: Float) -> tuple[Float, Float, Float]:
    """Return steady departure (A,) from the smooth ring, its gain with the ring's motion, and scatter.

    A dent that passes by changes the gain by no more than three usual departures do.
    """
    steady = np.nanmedian(departure, axis=0)
    rest = departure - steady
    most = _MOST * float(np.nanmedian(np.nanmedian(np.abs(rest), axis=0)))
    known = np.isfinite(rest)
    way = np.where(known, smooth - np.nanmean(np.where(known, smooth, np.nan), axis=0), 0.0)
    rest = np.where(known, np.clip(rest, -most, most), 0.0)
    gain = (way * rest).sum(0) / np.maximum((way**2).sum(0), 1e-12)
    return steady, gain, np.nanstd(departure, axis=0)
