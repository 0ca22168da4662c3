"""Estimates the pipe's width along its axis from the rings: steps of the bore, reducers and ribs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.polynomial import Polynomial
from scipy.ndimage import maximum_filter1d, median_filter

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Float, Int
from pipeline.machine.stage import Context

_STEP_MM = 0.5
"""Change of radius, mm, that counts as a step of the bore: five times the relief around the smooth pipe
(`surface_sigma_mm`). A choice."""
_SURE = 5.0
"""σ by which texture must show a step of the bore that no ring reaches (chosen)."""
_LENGTH_RADII, _FEWEST_RINGS_OF_LENGTH = 0.5, 5
"""A length of a bore is at least half its radius long: welds and rings of deposit are shorter. A choice."""
_MOST_RINGS_IN_STEP = 2
"""Rings in a row that may lie between the two bores of a step; with more it is a reducer. The chamfer of a
gauge holds one ring. A choice."""
_SLOW = 4
"""Degree of a polynomial that follows a slow change of width: that of `image_scale`."""
_PLACE_MM = 0.5
"""1 σ of the position of a reducer relative to landmarks on it: half the distance from ring to ring. Without
it, four of five drawn reducers came out .03 to .4 mm too far along the pipe, the fifth .1 mm too near."""


@dataclass(frozen=True)
class Bore:
    """Steps of the bore (k,), and the excess (k + 1,) of the radius between them over the rings' median.

    A pipe of one bore has no steps. When held to one radius, two bores 2 mm apart moved the probe by 20 σ. In
    a reducer the width is that of its rings, linear between them: ``rings_mm`` (r,) and ``rings_wider_mm``
    (r,), which are then given for the whole pipe and hold the steps as well. From ``aside_from_mm`` on, the
    pipe is displaced across by ``aside_mm``, along x and y of its sections. The width depends on the
    instrument: ``by_instrument`` (2, Q) mm per σ, times width and width squared. Rings show the width
    from the first to the last of ``measured_mm``, and nowhere else.
    """

    at_mm: Float
    wider_mm: Float
    aside_from_mm: float = np.inf
    aside_mm: tuple[float, float] = (0.0, 0.0)
    rings_mm: Float = field(default_factory=lambda: np.zeros(1))
    rings_wider_mm: Float = field(default_factory=lambda: np.zeros(1))
    by_instrument: Float = field(default_factory=lambda: np.zeros((2, 0)))
    measured_mm: tuple[float, float] = (-np.inf, np.inf)

    @staticmethod
    def of(radius_mm: Float, at_mm: Float) -> Bore:
        """Return the bore that radii (F,) of rings at distances (F,) show; NaN where a ring has none."""
        order = np.argsort(at_mm, kind="stable")
        order = order[np.isfinite(radius_mm[order])]
        radius_mm, at_mm = radius_mm[order], at_mm[order]
        if not len(at_mm):
            return ONE_BORE
        return replace(_between_rings(radius_mm, at_mm), measured_mm=(float(at_mm[0]), float(at_mm[-1])))

    @property
    def reduces(self) -> bool:
        """Whether the width changes over a length."""
        return len(self.rings_mm) > 1

    def wider_at(self, distance_mm: Float) -> Float:
        """Return the excess of the radius (M,), mm, over the rings' median at distances (M,), mm."""
        stepped = self.wider_mm[np.searchsorted(self.at_mm, distance_mm)]
        return np.asarray(stepped + np.interp(distance_mm, self.rings_mm, self.rings_wider_mm))

    def slope_at(self, distance_mm: Float) -> Float:
        """Return the gradient of the radius (M,), mm/mm, at distances (M,), mm."""
        if not self.reduces:
            return np.zeros(np.shape(distance_mm))
        slope = np.diff(self.rings_wider_mm) / np.maximum(np.diff(self.rings_mm), 1e-9)
        inside = np.searchsorted(self.rings_mm, distance_mm)
        return np.asarray(np.concatenate([[0.0], slope, [0.0]])[inside])

    def sigma_at(self, distance_mm: Float, unmeasured_mm: float) -> Float:
        """Return the 1 σ (M,), mm, of the width for texture at distances (M,), mm.

        A slope may be displaced. Where no ring was, the width is known to ``unmeasured_mm`` only: texture is
        seen farther ahead than the laser reaches, and a step there of 1.5 mm made a distance 2.2 % too short,
        against an encoder that was right.
        """
        first, last = self.measured_mm
        measured = (distance_mm >= first) & (distance_mm <= last)
        return np.where(measured, _PLACE_MM * np.abs(self.slope_at(distance_mm)), unmeasured_mm)

    def steps_beyond(self, distance_mm: Float, off_mm: Float) -> bool:
        """Whether texture before the first ring or beyond the last lies on wall of another width.

        ``off_mm`` (M,) is how far landmarks at distances (M,), mm, lie outside the wall that the rings show,
        if nothing holds them to it. Their median must differ by a step that rings would tell, and surely.
        """
        first, last = self.measured_mm
        sides = (off_mm[side] for side in (distance_mm < first, distance_mm > last))
        return any(abs(float(np.median(off))) > max(_STEP_MM, _noise(off)) for off in sides if len(off))

    def width_by_instrument(self, wider_mm: Float) -> Float:
        """Return the change of widths (M,) per σ of the instrument (M, Q), mm."""
        return np.stack([wider_mm, wider_mm**2], -1) @ self.by_instrument

    def measured_by(self, xyz_c: Float, by_instrument: Float, radius_mm: float) -> Bore:
        """Return the bore with the dependence of its widths on the instrument.

        It follows from rings ``xyz_c`` (M, 3) in C, mm, and their change ``by_instrument`` (M, 3, Q), mm per
        σ. With widths held to the stated instrument, a reducer of 10 mm halved the instrument's σ.
        """
        radius = np.hypot(xyz_c[:, 0], xyz_c[:, 1])
        outward = xyz_c * [1, 1, 0] / radius[:, None]
        change = np.einsum("mi,miq->mq", outward, by_instrument)
        powers = np.vander(radius - radius_mm, 3, increasing=True)
        return replace(self, by_instrument=np.linalg.lstsq(powers, change, rcond=None)[0][1:])

    def counted_from(self, start_mm: float) -> Bore:
        """Return the bore with distance counted from ``start_mm``."""
        aside_from = self.aside_from_mm - start_mm
        at_mm, rings_mm = self.at_mm - start_mm, self.rings_mm - start_mm
        first, last = self.measured_mm
        return replace(
            self, at_mm=at_mm, rings_mm=rings_mm, aside_from_mm=aside_from,
            measured_mm=(first - start_mm, last - start_mm),
        )  # fmt: skip

    def with_joint(self, at_mm: float, aside_mm: tuple[float, float], wider_mm: float) -> Bore:
        """Return the bore with a joint, after which the pipe is displaced by ``aside_mm`` and wider."""
        place = int(np.searchsorted(self.at_mm, at_mm))
        wider = np.insert(self.wider_mm, place, self.wider_mm[place])
        wider[place + 1 :] += wider_mm
        steps = np.insert(self.at_mm, place, at_mm)
        return replace(self, at_mm=steps, wider_mm=wider, aside_from_mm=at_mm, aside_mm=aside_mm)

    def off_at(self, distance_mm: Float, azimuth_rad: Float) -> Float:
        """Return the excess of the wall's distance from the axis (M,), mm, at distances and azimuths (M,)."""
        (x, y), behind = self.aside_mm, distance_mm > self.aside_from_mm
        return self.wider_at(distance_mm) + behind * (x * np.cos(azimuth_rad) + y * np.sin(azimuth_rad))


ONE_BORE = Bore(np.zeros(0), np.zeros(1))


def _noise(off_mm: Float) -> float:
    """Return what the median of values (M,), mm, exceeds by chance once in three million sets of them."""
    return _SURE * float(np.sqrt(np.pi / 2)) * spread_about_median(off_mm) / float(np.sqrt(len(off_mm)))


def _between_rings(radius_mm: Float, at_mm: Float) -> Bore:
    """Return the bore that radii (F,) of rings at ascending distances (F,) show."""
    if len(radius_mm) < 2 * _FEWEST_RINGS_OF_LENGTH + 2:
        return ONE_BORE
    n = min(rings_of_length(radius_mm, at_mm), len(radius_mm) // 2 - 1)
    place = _steps(radius_mm, n)
    usual = np.array([np.median(part) for part in np.split(radius_mm, place)])
    of_length = np.repeat(usual, np.diff(place, prepend=0, append=len(radius_mm)))
    smooth, middle = median_filter(radius_mm, 3), float(np.median(radius_mm))
    reducer = _in_reducers(smooth - of_length, place)
    if _ribbed(smooth - of_length, at_mm):
        reducer[:] = True
    if not reducer.any():
        return Bore(at_mm[place], usual - middle) if len(place) else ONE_BORE
    wider = np.where(reducer, smooth, of_length) - middle
    return replace(ONE_BORE, rings_mm=at_mm, rings_wider_mm=wider)


def warn_of_steps(bore: Bore, context: Context) -> None:
    """Warn of steps of the bore (not of a reducer), and of the results that are unreliable there."""
    if not len(bore.at_mm):
        return
    change = 2 * np.diff(bore.wider_mm)
    steps = ", ".join(f"by {by:+.1f} mm at {at:.0f} mm" for at, by in zip(bore.at_mm, change, strict=True))
    context.warn(
        f"the pipe's diameter steps {steps} (a joint of two sizes, a socket, a gauge). The edge is smeared "
        "over about a tenth of the diameter: radii there may be wrong by more than their σ, and a finding "
        "all around it is the step itself. Texture near it is hidden or matched less well, so that "
        "roll may be wrong, too. What to do: process the lengths of each bore as separate recordings"
    )


def rings_of_length(radius_mm: Float, at_mm: Float) -> int:
    """Return the number of rings, with radii (F,) at distances (F,), mm, in the shortest length of a bore."""
    apart_mm = max(float(np.ptp(at_mm)) / len(at_mm), 1e-9)
    return max(round(_LENGTH_RADII * float(np.median(radius_mm)) / apart_mm), _FEWEST_RINGS_OF_LENGTH)


def _steps(radius_mm: Float, n: int) -> Int:
    """Return the first rings (k,) after steps between lengths of at least ``n`` rings."""
    median = np.median(np.lib.stride_tricks.sliding_window_view(radius_mm, n), axis=1)
    size = np.abs(median[n + 1 :] - median[: -n - 1])  # of a step at ring n + k
    highest = size == maximum_filter1d(size, 2 * n + 1)
    place = n + np.flatnonzero(highest & (size > _STEP_MM))
    near = place[np.diff(place, prepend=-n) >= n]
    return np.array([_stepped_at(radius_mm, int(k), n) for k in near], np.int64)


def _stepped_at(radius_mm: Float, near: int, n: int) -> int:
    """Return the first ring after a step: medians of ``n`` rings locate it only to n / 2 rings."""
    part = radius_mm[near - n : near + n + 1]
    before, behind = np.abs(part - np.median(part[:n])), np.abs(part - np.median(part[n + 1 :]))
    return near - n + int(np.argmin([before[:k].sum() + behind[k:].sum() for k in range(len(part))]))


def _ribbed(off_mm: Float, at_mm: Float) -> bool:
    """Whether most of the pipe is off the bore of its length, so that no part is a cylinder.

    ``off_mm`` (F,) is how far rings at distances ``at_mm`` (F,) are off; where the probe stood, many rings
    show one place. A slow course over the run, of a pipe that widens or a lens that warms up, does not count.
    Ribs of .5 mm, 11 mm apart: landmarks held to a cylinder turned the camera by 5°, and no defect was found.
    """
    even_mm = np.linspace(at_mm[0], at_mm[-1], len(at_mm))
    evenly_mm, place = np.interp(even_mm, at_mm, off_mm), np.arange(len(at_mm))
    slow_mm = Polynomial.fit(place, evenly_mm, _SLOW)(place)
    return float(np.median(np.abs(evenly_mm - slow_mm))) > _STEP_MM / 2


def _in_reducers(off_mm: Float, place: Int) -> np.ndarray:
    """Return which rings (F,), ``off_mm`` the length they lie in, belong to a reducer around a step."""
    apart, inside = np.abs(off_mm) > _STEP_MM / 2, np.zeros(len(off_mm), bool)
    for first in place:
        start, end = int(first), int(first)
        while start > 0 and apart[start - 1]:
            start -= 1
        while end < len(apart) and apart[end]:
            end += 1
        inside[start:end] |= end - start > _MOST_RINGS_IN_STEP
    return inside
