"""Registers an earlier run's wall on a later one's by marks: shift along the pipe and roll, over distance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.stats import binom

from pipeline.arrays import Float, Float32
from pipeline.artefacts.comparison import Registration, WeldPair
from pipeline.errors import UnusableError
from pipeline.machine.stage import Parameters
from stages.compare.registration.marks import Surface, sampled
from stages.compare.registration.matching import AGREE, Matches, best_place, coarse_course, matched_blocks

# A shift needs two stations to have a slope.
_LEAST_STATIONS = 2
# A weld's bead is searched in a profile this long to each side, up to this distance from its place by
# texture, in radii: a bead is a few mm wide on a 4 inch pipe. Chosen; only welds of 4 inch pipes were tried.
_HALF_RADII, _ROOM_RADII = 0.2, 0.06
_SAMPLES_PER_CELL = 2
_LEAST_CORRELATION = 0.8
_LONGER = (
    "compare runs that have a longer stretch of wall in common: 2 diameters and more, with texture or relief"
)
_AZIMUTHS = 360


class RegisterParameters(Parameters):
    """Limits for two walls to count as the same."""

    largest_chance: float = Field(
        1e-4, gt=0, lt=1,
        description="largest probability that so many pieces of wall would agree if the pipes were different",
    )  # fmt: skip
    least_share: float = Field(0.4, gt=0, le=1, description="share of the pieces of wall that must agree")
    bores_alike: float = Field(
        0.1, gt=0, lt=1, description="largest difference of the two mean diameters, relative"
    )


def register(earlier: Surface, now: Surface, welds_mm: Float, parameters: RegisterParameters) -> Registration:
    """Return the earlier wall's registration on the later one; ``welds_mm`` (W,) are the earlier run's welds.

    Raises
    ------
    UnusableError
        When the two do not show the same wall, or too little of it.
    """
    _refuse_other_bore(earlier, now, parameters.bores_alike)
    matches = matched_blocks(earlier, now, coarse_course(earlier, now))
    chance = _chance(matches)
    _refuse_strangers(matches, chance, parameters)
    stations = _stations(matches)
    pairs = _weld_pairs(stations, welds_mm, earlier, now)
    return _registration(_with_welds(stations, pairs, now), matches, pairs, chance, earlier, now)


@dataclass(frozen=True)
class _Stations:
    """Shift and roll (K,) at distances of the earlier run, each with its 1 σ (K,)."""

    at_mm: Float
    shift_mm: Float
    shift_sigma_mm: Float
    roll_rad: Float
    roll_sigma_rad: Float

    def shift_at(self, distance_mm: float) -> tuple[float, float]:
        """Return shift and its 1 σ at a distance."""
        shift, sigma = (np.interp(distance_mm, self.at_mm, v) for v in (self.shift_mm, self.shift_sigma_mm))
        return float(shift), float(sigma)


def _refuse_other_bore(earlier: Surface, now: Surface, alike: float) -> None:
    if not 1 - alike < earlier.radius_mm / now.radius_mm < 1 + alike:
        raise UnusableError(
            "compare",
            f"the bores are {2 * earlier.radius_mm:.1f} mm and {2 * now.radius_mm:.1f} mm",
            limit=f"{alike:.0%} apart",
            hint="compare two runs of one pipe",
        )


def _chance(matches: Matches) -> float:
    """Return the probability of so many agreeing blocks if every block lands anywhere in its search area.

    A block agrees by chance with the share of its search area that lies within the limit. The factor 3
    allows for the median being taken from the same blocks, which makes agreement easier; it is not derived.
    """
    count, good = (int(n / matches.overlapping) for n in (len(matches.agree), matches.agree.sum()))
    return float(binom.sf(good - 1, count, min(3 * AGREE**2, 1.0))) if good else 1.0


def _refuse_strangers(matches: Matches, chance: float, limits: RegisterParameters) -> None:
    good, count = int(matches.agree.sum()), len(matches.agree)
    stations = len(np.unique(matches.at_mm[matches.agree]))
    alike = good >= limits.least_share * count
    if stations < _LEAST_STATIONS or not alike or chance > limits.largest_chance:
        raise UnusableError(
            "compare",
            f"the runs do not show the same wall, or too little of it: {good} of {count} pieces of wall "
            f"agree, which happens by chance with a probability of {min(chance, 1.0):.2g}",
            limit=f"{limits.least_share:.0%} of the pieces, chance below {limits.largest_chance:g}",
            hint=_LONGER if alike else "compare two runs of one pipe, recorded in the same direction",
        )


def _stations(matches: Matches) -> _Stations:
    """Return the mean of the agreeing blocks at each distance, with the 1 σ of a single place on the wall.

    That σ joins the scatter of the blocks around the pipe, to which a tilt between both axes contributes, and
    the scatter of stations against their neighbours.
    """
    good = matches.agree
    at, group = np.unique(matches.at_mm[good], return_inverse=True)
    number = np.bincount(group)
    columns = [_grouped(values[good], group, number) for values in (matches.shift_mm, matches.roll_rad)]
    (shift, shift_sigma), (roll, roll_sigma) = columns
    return _Stations(at, shift, np.full(len(at), shift_sigma), roll, np.full(len(at), roll_sigma))


def _grouped(values: Float, group: NDArray[np.int64], number: NDArray[np.int64]) -> tuple[Float, float]:
    """Return the mean of each group and the 1 σ of a single value about a line between the means."""
    mean = np.bincount(group, values) / number
    within = float(((values - mean[group]) ** 2).sum()) / max(len(values) - len(mean), 1)
    bent = mean[1:-1] - (mean[:-2] + mean[2:]) / 2
    wander = float(np.mean(bent**2)) / 1.5 if len(bent) else 0.0
    return mean, float(np.sqrt(within + wander))


def _weld_pairs(stations: _Stations, welds_mm: Float, earlier: Surface, now: Surface) -> tuple[WeldPair, ...]:
    """Return the welds that the later run shows within their own width of where the texture puts them."""
    found = (_weld_place(float(s), float(s) + stations.shift_at(float(s))[0], earlier, now) for s in welds_mm)
    return tuple(
        WeldPair(float(s), place) for s, place in zip(welds_mm, found, strict=True) if place is not None
    )


def _with_welds(stations: _Stations, pairs: tuple[WeldPair, ...], now: Surface) -> _Stations:
    """Return the stations and one more at every weld, with the weighted mean of weld and texture as shift."""
    if not pairs:
        return stations
    weld_sigma = now.wall.step_mm / np.sqrt(12)
    at = np.array([p.earlier_mm for p in pairs])
    shift, sigma = np.array([stations.shift_at(s) for s in at]).T
    weight = sigma**-2 / (sigma**-2 + weld_sigma**-2)
    joined = weight * shift + (1 - weight) * np.array([p.now_mm - p.earlier_mm for p in pairs])
    roll, roll_sigma = (
        np.interp(at, stations.at_mm, v) for v in (stations.roll_rad, stations.roll_sigma_rad)
    )
    new = (at, joined, sigma * np.sqrt(weight), roll, roll_sigma)
    old = (
        stations.at_mm,
        stations.shift_mm,
        stations.shift_sigma_mm,
        stations.roll_rad,
        stations.roll_sigma_rad,
    )
    order = np.argsort(np.concatenate([stations.at_mm, at]), kind="stable")
    return _Stations(*(np.concatenate(pair)[order] for pair in zip(old, new, strict=True)))


def _registration(
    stations: _Stations, matches: Matches, pairs: tuple[WeldPair, ...], chance: float, earlier: Surface,
    now: Surface,
) -> Registration:  # fmt: skip
    away = stations.at_mm - stations.at_mm.mean()
    slope = float(away @ stations.shift_mm / (away @ away))
    left = stations.shift_mm - stations.shift_mm.mean() - slope * away
    spread = max(float(np.sqrt(left @ left / max(len(left) - 2, 1))), float(stations.shift_sigma_mm.min()))
    ends = np.array([earlier.from_mm, earlier.from_mm + earlier.length_mm])
    whole_turns = 2 * np.pi * np.round(stations.roll_rad.mean() / (2 * np.pi))
    made = Registration(
        stations.at_mm, stations.shift_mm, stations.shift_sigma_mm, stations.roll_rad - whole_turns,
        stations.roll_sigma_rad, 1 + slope, float(spread / np.sqrt(away @ away)), len(matches.agree),
        int(matches.agree.sum()), float(np.median(matches.correlation[matches.agree])), chance, pairs,
        (0.0, 0.0),
    )  # fmt: skip
    low, high = made.to_now(ends, 0 * ends)[0]
    return replace(made, overlap_mm=(max(low, now.from_mm), min(high, now.from_mm + now.length_mm)))


def _weld_place(before_mm: float, expected_mm: float, earlier: Surface, now: Surface) -> float | None:
    """Return the later run's distance, mm, of the weld at ``before_mm``; None if it does not show it."""
    step = now.wall.step_mm / _SAMPLES_PER_CELL
    half, room = (round(share * now.radius_mm / step) for share in (_HALF_RADII, _ROOM_RADII))
    bead = _ring_radius(earlier, before_mm, step, half)
    around = _ring_radius(now, expected_mm, step, half + room)
    if not (np.isfinite(bead).all() and np.isfinite(around).all()):
        return None
    row, _, correlation = best_place(bead[:, None], around[:, None])
    inside = 0 < row < 2 * room
    return expected_mm + (row - room) * step if inside and correlation > _LEAST_CORRELATION else None


def _ring_radius(surface: Surface, middle_mm: float, step_mm: float, half: int) -> Float32:
    """Return the ring's mean radius (2 half + 1,) along the pipe; NaN where less than half was seen."""
    s = np.asarray(middle_mm + step_mm * np.arange(-half, half + 1), float)
    wall = surface.wall
    ring = sampled(wall.radius_mm, float(wall.distance_mm[0]), wall.step_mm, s, _AZIMUTHS)
    seen = np.isfinite(ring)
    mean = np.nan_to_num(ring).sum(1) / np.maximum(seen.sum(1), 1)
    return np.asarray(np.where(seen.mean(1) > 0.5, mean, np.nan), np.float32)
