"""Inputs and results of a comparison of two runs of one pipe.

Distances are in mm, azimuths in rad in P; "earlier" and "now" (later) name the run. Depths and their growth
are positive into the wall.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from pipeline.arrays import Byte, Float
from pipeline.artefacts.findings import DefectKind
from pipeline.artefacts.measured import WallTexture
from pipeline.artefacts.wall_map import WallMap

# Corners (distance mm, azimuth rad) of a closed polygon; the azimuth runs on beyond ±π rather than jumping.
Outline = tuple[tuple[float, float], ...]
# Probability that at least one change is declared where nothing changed. Chosen.
FAMILY_ERROR = 0.01


@dataclass(frozen=True)
class SurveyedWall:
    """One run's measurement of the wall.

    Attributes
    ----------
    smoothing_mm : float
        1 σ with which the map was smoothed.
    ring_spacing_mm : float
        Median distance of neighbouring rings along the pipe (`CloudAlong.ring_spacing_mm`).
    """

    wall: WallMap
    texture: WallTexture
    smoothing_mm: float
    ring_spacing_mm: float


@dataclass(frozen=True)
class WallPair:
    """The walls of two runs that are to be registered.

    Attributes
    ----------
    earlier, now : SurveyedWall
    welds_mm : (W,)
        Distances of the welds in the earlier run.
    is_one_calibration : bool
        Whether both were measured with the same instrument parameters, whose errors then cancel.
    """

    earlier: SurveyedWall
    now: SurveyedWall
    welds_mm: Float
    is_one_calibration: bool


@dataclass(frozen=True)
class OutlinedFinding:
    """A finding after its run's review, with the depth that the run reports."""

    id: str
    kind: DefectKind
    outline: Outline
    depth_mm: float
    depth_sigma_mm: float


@dataclass(frozen=True)
class FindingPair:
    """The findings of two runs; rejected ones are left out."""

    earlier: tuple[OutlinedFinding, ...]
    now: tuple[OutlinedFinding, ...]


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
    shift_mm, shift_sigma_mm, roll_rad, roll_sigma_rad : (K,)
    scale, scale_sigma : float
        Slope of s_now over s_earlier over the whole overlap.
    blocks, agreeing : int
        Pieces of wall that were matched, and those that agree with the result.
    correlation : float
        Median correlation of the agreeing ones.
    chance : float
        Probability that so many would agree if the walls had nothing in common.
    welds : tuple of WeldPair
    overlap_mm : (float, float)
        Range that both runs saw, in distances of the later one.
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
        """Return the places of the earlier run in the later one; ψ continues beyond ±π."""
        return distance_mm + self._shift_at(distance_mm), azimuth_rad + self._roll_at(distance_mm)

    def to_earlier(self, distance_mm: Float, azimuth_rad: Float) -> tuple[Float, Float]:
        """Return the places of the later run in the earlier one."""
        before = self.earlier_distance(distance_mm)
        return before, azimuth_rad - self._roll_at(before)

    def earlier_distance(self, distance_mm: Float) -> Float:
        """Return the earlier run's distances for the later run's; extrapolated with the common scale."""
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

    def _shift_at(self, distance_mm: Float) -> Float:
        inside = np.interp(distance_mm, self.at_mm, self.shift_mm)
        beyond = distance_mm - np.clip(distance_mm, self.at_mm[0], self.at_mm[-1])
        return np.asarray(inside + (self.scale - 1) * beyond)

    def _roll_at(self, distance_mm: Float) -> Float:
        return np.asarray(np.interp(distance_mm, self.at_mm, self.roll_rad))


@dataclass(frozen=True)
class Value:
    """A number and its 1 σ."""

    value: float
    sigma: float


@dataclass(frozen=True)
class RegisteredWalls:
    """The registration of two walls, and their difference on the later run's grid.

    Attributes
    ----------
    registration
    diameter : Value
        Growth of the mean diameter over all rings that both saw, mm.
    limit_mm : float
        The difference is stored from −limit to limit, its σ from 0 to half of that.
    difference_level, sigma_level : (S, A) uint8
        Later minus earlier radius, and its 1 σ, as palette levels: 0 is "not measured", 1 to 255 linear.
    """

    registration: Registration
    diameter: Value
    limit_mm: float
    difference_level: Byte
    sigma_level: Byte


@dataclass(frozen=True)
class Growth:
    """Growth of a defect from the earlier run to the later one.

    Attributes
    ----------
    depth_now_mm, depth_before_mm : float
        Depths on both walls by one method, within one outline; positive into the wall.
    depth_mm, length_mm, width_mm : Value
        Growth of the depth (positive into the wall) and of the extents at ``level_mm``.
    area_mm2 : Value
    level_mm : float
        Depth at which the extents are measured on both walls.
    """

    depth_now_mm: float
    depth_before_mm: float
    depth_mm: Value
    length_mm: Value
    width_mm: Value
    area_mm2: Value
    level_mm: float


class Fate(StrEnum):
    """The outcome of comparing a finding in both runs."""

    GREW = "grew"
    SHRANK = "shrank"
    UNCHANGED = "no change shown"
    NEW = "new"
    VANISHED = "vanished"
    ONLY_NOW = "found now only, no change shown"
    ONLY_EARLIER = "found earlier only, no change shown"
    UNSEEN_EARLIER = "not seen earlier"
    UNSEEN_NOW = "not seen now"
    NOT_COMPARED = "not compared: too little clean wall beside it"
    WELD = "weld"

    @property
    def is_change(self) -> bool:
        """Whether the wall itself changed."""
        return self in (Fate.GREW, Fate.SHRANK, Fate.NEW, Fate.VANISHED)


@dataclass(frozen=True)
class Place:
    """A finding of either run, or of both, in the coordinates of the later run.

    Attributes
    ----------
    now, earlier : OutlinedFinding or None
    outlines : tuple of Outline
        Outlines of the existing ones, in the later run's coordinates.
    """

    now: OutlinedFinding | None
    earlier: OutlinedFinding | None
    outlines: tuple[Outline, ...]

    @property
    def kind(self) -> DefectKind:
        """Its kind, that of the later run when it has one."""
        return next(f.kind for f in (self.now, self.earlier) if f is not None)

    @property
    def corners(self) -> Float:
        """All corners (V, 2) of its outlines."""
        return np.concatenate([np.asarray(o, float) for o in self.outlines])

    @property
    def middle(self) -> tuple[float, float]:
        """Distance and azimuth of the middle of its box."""
        s, psi = (self.corners.min(0) + self.corners.max(0)) / 2
        return float(s), float(psi)


@dataclass(frozen=True)
class Change:
    """A finding of either run and its change.

    Attributes
    ----------
    place, fate
    seen_now, seen_earlier : float
        Share of it that each run saw.
    growth : Growth or None
        None for welds, which registered the runs, and where a run did not see it.
    z, p, p_adjusted : float
        Growth of the depth over its σ, its p-value without growth, and the p-value after Holm's step-down
        over all findings (Scand. J. Statist. 6, 1979); NaN without growth. A finding of one run only was
        selected as that run's extreme: its p is corrected for the number of such places.
    """

    place: Place
    fate: Fate
    seen_now: float
    seen_earlier: float
    growth: Growth | None
    z: float = float("nan")
    p: float = float("nan")
    p_adjusted: float = float("nan")

    @property
    def is_significant(self) -> bool:
        """Whether it is declared a change, at `FAMILY_ERROR` over all findings."""
        return self.p_adjusted < FAMILY_ERROR


@dataclass(frozen=True)
class Comparison:
    """The changes of all findings of either run."""

    changes: tuple[Change, ...]
