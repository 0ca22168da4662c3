"""The result of a diagnosis, as written to diagnosis.json and shown in the report; classes of effects."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

from pipeline.arrays import Float, Int
from pipeline.physics.catalogue import CLASSES, EFFECTS, effect
from stages.diagnose.causes import NONE, Causes
from stages.diagnose.record_next import record_next


def class_of(name: str) -> tuple[str, ...]:
    """Return the effects that one kind of recording may not distinguish from this one, including itself.

    Raises
    ------
    InputError
        When the catalogue has no such effect.
    """
    found = [members for members in CLASSES if effect(name).name in members]
    return found[0] if found else (name,)


def classes_of(names: Sequence[str], certain: Collection[str] = ()) -> tuple[str, ...]:
    """Return the members of the classes of all these effects, in the catalogue's order.

    What is ``certain`` beside them is a member only by its own name: it may be there a second time.
    """
    alike = {member for name in names for member in class_of(name)}
    members = alike - set(certain) | set(names)
    return tuple(name for name in EFFECTS if name in members)


class Verdict(StrEnum):
    """The overall result of a diagnosis."""

    CONSISTENT = "consistent"
    NAMED = "named"
    PARTLY = "partly"
    CLASS = "class"
    UNEXPLAINED = "unexplained"
    NOT_IDENTIFIABLE = "not_identifiable"


@dataclass(frozen=True)
class Value:
    """A number and its 1 σ."""

    value: float
    sd: float


@dataclass(frozen=True)
class Confirmation:
    """A second prediction of the same effect, its measurement, and whether they agree."""

    prediction: str
    measured: str
    agrees: bool


@dataclass(frozen=True)
class CourseFound:
    """How an effect's size changes: a kind of `pipeline.physics.effect`, and its parameters."""

    kind: str
    parameters: dict[str, Value]
    probability: float = 1.0


@dataclass(frozen=True)
class EffectFound:
    """An effect with its size, the probability that its name is right, and what confirms it.

    ``recording`` is ``gauge`` for an event of the gauge run alone; else it is empty. ``location`` is None
    where only that of all effects together was measured.
    """

    name: str
    probability: float
    parameters: dict[str, Value]
    statement: str
    equation: str
    confirmed_by: tuple[Confirmation, ...] = ()
    course: CourseFound | None = None
    recording: str = ""
    location: Location | None = None


@dataclass(frozen=True)
class Location:
    """Location of the mismatch: channel, what its pattern is fixed to, and where and when it shows.

    None is what was not measured.
    """

    channel: str
    fixed_to: str | None
    time: str | None
    harmonic: int | None = None
    radial_exponent: tuple[float, float] | None = None
    frames: tuple[int, int] | None = None
    distance_mm: tuple[float, float] | None = None
    azimuth_deg: tuple[float, float] | None = None


@dataclass(frozen=True)
class FitQuality:
    """Residuals before and after, on all and on held-out measurements, with the noise floor."""

    unit: str
    rms_before: float
    rms_after: float
    heldout_before: float
    heldout_after: float
    noise_floor: float


@dataclass(frozen=True)
class Feasible:
    """What this recording could show of one effect, from motion and bores alone.

    Attributes
    ----------
    detectable : float
        Least size that would stand out (5 σ), including the stated instrument's uncertainty.
    rival : str
        The most similar effect here; empty when none is similar.
    left : float
        Share of its information that remains when the rival is free.
    """

    name: str
    quantity: str
    unit: str
    detectable: float
    typical: float
    rival: str
    left: float


@dataclass(frozen=True)
class Candidate:
    """One explanation that was tested.

    Attributes
    ----------
    gain, heldout_gain : float
        Drop of χ² against the stated instrument, corrected for correlated errors: on all measurements, and on
        regimes held out in turn.
    """

    names: tuple[str, ...]
    probability: float
    gain: float
    heldout_gain: float
    statement: str


@dataclass(frozen=True)
class Picture:
    """Residuals over azimuth and frame, mm of radius: (F, A) before and after; NaN where nothing was seen."""

    frame: Int
    azimuth_rad: Float
    before_mm: Float
    after_mm: Float


@dataclass(frozen=True)
class WallPicture:
    """Residuals on the unrolled wall, mm of radius: (S, A) before and after."""

    distance_mm: Float
    azimuth_rad: Float
    before_mm: Float
    after_mm: Float


@dataclass(frozen=True)
class ReadingPicture:
    """The encoder's reading minus the distance in the pictures, mm: (N,) at their times, before and after."""

    time_s: Float
    before_mm: Float
    after_mm: Float


@dataclass(frozen=True)
class Remainder:
    """What is left beside the certain effects.

    Attributes
    ----------
    verdict : Verdict
        ``class`` or ``unexplained``.
    members : tuple of str
        The class.
    formula : str
        The empirical law of what nothing explains.
    """

    verdict: Verdict
    location: Location | None = None
    members: tuple[str, ...] = ()
    formula: str = ""


@dataclass(frozen=True)
class Diagnosis:
    """What was found, how certain it is, and its evidence; fields as in the notes on formats.

    Attributes
    ----------
    members : tuple of str
        The class, when the verdict is one.
    identifiable : str
        The combination that is determined, or the empirical formula.
    feasibility, candidates, shortcomings, pictures
        For the report.
    unexamined : tuple of str
        Parts of the recordings of which nothing is known, since they could not be examined, in words.
    causes : Causes
        How likely each cause of the class is, by rings and fiducials of the gauge run; for the report.
    """

    recording: str
    gauge: str
    verdict: Verdict
    global_p: float
    location: Location | None = None
    effects: tuple[EffectFound, ...] = ()
    members: tuple[str, ...] = ()
    identifiable: str = ""
    fit: FitQuality | None = None
    record_next: str = ""
    feasibility: tuple[Feasible, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    shortcomings: tuple[str, ...] = ()
    ring_picture: Picture | None = None
    wall_picture: WallPicture | None = None
    notes: tuple[str, ...] = field(default=())
    remainder: Remainder | None = None
    reading_picture: ReadingPicture | None = None
    causes: Causes = NONE
    unexamined: tuple[str, ...] = ()

    def not_knowing(self, names: Collection[str]) -> Diagnosis:
        """Return the diagnosis with some effects treated as unknown: without them in any class."""
        if not names:
            return self
        members = tuple(n for n in self.members if n not in names)
        left = self.remainder
        if left is not None:
            left = replace(left, members=tuple(n for n in left.members if n not in names))
        nameless = self.verdict is Verdict.CLASS and not members
        return replace(
            self, verdict=Verdict.UNEXPLAINED if nameless else self.verdict,
            members=members, remainder=left,
            record_next=record_next(members, self.causes) if self.members else self.record_next,
        )  # fmt: skip
