"""How an earlier run's wall lies on a later one's: shift along the pipe and roll, by distance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import binom

from pipeline.arrays import Float, Int
from pipeline.errors import UnusableError
from pipeline.review.comparison.blocks import AGREE, Matches, matched_blocks
from pipeline.review.comparison.coarse import coarse_course
from pipeline.review.comparison.surface import Surface
from pipeline.review.comparison.welds import weld_place

# Two walls are taken for the same when chance would have made their blocks agree so often at most.
_LARGEST_CHANCE = 1e-4
_LEAST_SHARE = 0.4
_LEAST_STATIONS = 2
_BORES_ALIKE = 0.1


@dataclass(frozen=True)
class WeldPair:
    """One weld in both runs: distance in the earlier and in the later one."""

    earlier_mm: float
    now_mm: float


@dataclass(frozen=True)
class Registration:
    """s_now = s_earlier + shift(s_earlier), ψ_now = ψ_earlier + roll(s_earlier), linear between stations.

    Attributes
    ----------
    at_mm : (K,)
        Stations, distances of the earlier run, increasing.
    shift_mm, shift_sigma_mm : (K,)
    roll_rad, roll_sigma_rad : (K,)
    scale, scale_sigma : float
        Slope of s_now over s_earlier, over all.
    blocks, agreeing : int
        Pieces of wall that were matched, and those that agree with the result.
    correlation : float
        Median correlation of the agreeing ones.
    chance : float
        Probability that so many would agree if the walls had nothing in common.
    welds : tuple of WeldPair
    overlap_mm : (float, float)
        What both runs saw, in distances of the later one.
    """

    at_mm: Float
    shift_mm: Float
    shift_sigma_mm: Float
    roll_rad: Float
    roll_sigma_rad: Float
    scale: float
    scale_sigma: float
    blocks: int
    agreeing: int
    correlation: float
    chance: float
    welds: tuple[WeldPair, ...]
    overlap_mm: tuple[float, float]

    def to_now(self, distance_mm: Float, azimuth_rad: Float) -> tuple[Float, Float]:
        """Return where places of the earlier run lie in the later one; ψ runs on beyond ±π."""
        return distance_mm + self._at(distance_mm, self.shift_mm), azimuth_rad + self._at(
            distance_mm, self.roll_rad
        )

    def to_earlier(self, distance_mm: Float, azimuth_rad: Float) -> tuple[Float, Float]:
        """Return where places of the later run lie in the earlier one."""
        before = self.earlier_distance(distance_mm)
        return before, azimuth_rad - self._at(before, self.roll_rad)

    def earlier_distance(self, distance_mm: Float) -> Float:
        """Return the earlier run's distances of the later run's; beyond the stations at the common scale."""
        now = self.at_mm + self.shift_mm
        inside = np.interp(distance_mm, now, self.at_mm)
        beyond = distance_mm - np.clip(distance_mm, now[0], now[-1])
        return np.asarray(inside + beyond / self.scale)

    def sigma_at(self, earlier_mm: float) -> tuple[float, float]:
        """Return 1 σ of shift, mm, and of roll, rad, at a distance of the earlier run."""
        away = abs(earlier_mm - float(np.clip(earlier_mm, self.at_mm[0], self.at_mm[-1])))
        along = float(np.interp(earlier_mm, self.at_mm, self.shift_sigma_mm))
        turn = float(np.interp(earlier_mm, self.at_mm, self.roll_sigma_rad))
        return float(np.hypot(along, self.scale_sigma * away)), turn

    def _at(self, distance_mm: Float, values: Float) -> Float:
        inside = np.interp(distance_mm, self.at_mm, values)
        if values is not self.shift_mm:
            return np.asarray(inside)
        beyond = distance_mm - np.clip(distance_mm, self.at_mm[0], self.at_mm[-1])
        return np.asarray(inside + (self.scale - 1) * beyond)


def register(earlier: Surface, now: Surface, welds_mm: Float) -> Registration:
    """Return how the earlier wall lies on the later one; ``welds_mm`` (W,) are those of the earlier run.

    Raises
    ------
    UnusableError
        When the two do not show the same wall, or too little of it.
    """
    _refuse_other_bore(earlier, now)
    matches = matched_blocks(earlier, now, coarse_course(earlier, now))
    chance = _chance(matches)
    _refuse_strangers(matches, chance)
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


def _refuse_other_bore(earlier: Surface, now: Surface) -> None:
    if not 1 - _BORES_ALIKE < earlier.radius_mm / now.radius_mm < 1 + _BORES_ALIKE:
        raise UnusableError(
            "compare",
            f"the bores are {2 * earlier.radius_mm:.1f} mm and {2 * now.radius_mm:.1f} mm",
            limit=f"{_BORES_ALIKE:.0%} apart",
            hint="give two runs of one pipe",
        )


def _chance(matches: Matches) -> float:
    """Return how probable so many agreeing blocks are when every block lands anywhere in its room.

    That the median they agree with is their own makes agreement easier than the share of the room says.
    """
    count, good = (int(n / matches.overlapping) for n in (len(matches.agree), matches.agree.sum()))
    return float(binom.sf(good - 1, count, min(3 * AGREE**2, 1.0))) if good else 1.0


def _refuse_strangers(matches: Matches, chance: float) -> None:
    good, count = int(matches.agree.sum()), len(matches.agree)
    stations = len(np.unique(matches.at_mm[matches.agree]))
    if stations < _LEAST_STATIONS or good < _LEAST_SHARE * count or chance > _LARGEST_CHANCE:
        raise UnusableError(
            "compare",
            f"the runs do not show the same wall, or too little of it: {good} of {count} pieces of wall "
            f"lie on each other, which chance does in {min(chance, 1.0):.2g} of cases",
            limit=f"{_LEAST_SHARE:.0%} of the pieces, chance below {_LARGEST_CHANCE:g}",
            hint="give two runs of one pipe, driven in the same direction",
        )


def _stations(matches: Matches) -> _Stations:
    """Return the mean of the agreeing blocks at each distance; σ is that of a single place on the wall.

    It is the scatter of the blocks around the turn, which also holds what a tilt of one run's axis against
    the other's does, and the scatter of stations against their neighbours.
    """
    good = matches.agree
    at, group = np.unique(matches.at_mm[good], return_inverse=True)
    number = np.bincount(group)
    columns = [_grouped(values[good], group, number) for values in (matches.shift_mm, matches.roll_rad)]
    (shift, shift_sigma), (roll, roll_sigma) = columns
    return _Stations(at, shift, np.full(len(at), shift_sigma), roll, np.full(len(at), roll_sigma))


def _grouped(values: Float, group: Int, number: Int) -> tuple[Float, float]:
    """Return the mean of each group and the 1 σ of a single value about a line between the means."""
    mean = np.bincount(group, values) / number
    within = float(((values - mean[group]) ** 2).sum()) / max(len(values) - len(mean), 1)
    bent = mean[1:-1] - (mean[:-2] + mean[2:]) / 2
    wander = float(np.mean(bent**2)) / 1.5 if len(bent) else 0.0
    return mean, float(np.sqrt(within + wander))


def _weld_pairs(stations: _Stations, welds_mm: Float, earlier: Surface, now: Surface) -> tuple[WeldPair, ...]:
    """Return the welds that the later run shows where the texture says, to within their own width."""
    found = (weld_place(float(s), float(s) + stations.shift_at(float(s))[0], earlier, now) for s in welds_mm)
    return tuple(
        WeldPair(float(s), place) for s, place in zip(welds_mm, found, strict=True) if place is not None
    )


def _with_welds(stations: _Stations, pairs: tuple[WeldPair, ...], now: Surface) -> _Stations:
    """Return the stations and one more at every weld, where weld and texture both say what the shift is."""
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
