"""One known physical effect as the catalogue describes it, and the course that its size follows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType

import numpy as np

from pipeline.arrays import Float
from pipeline.errors import InputError


class FixedTo(StrEnum):
    """The part or frame that an effect's pattern is fixed to."""

    LASER = "laser"
    CAMERA = "camera"
    PIPE = "pipe"
    GRAVITY = "gravity"
    TIME = "time"


class Channel(StrEnum):
    """Which kind of measurement an effect shows in first."""

    RING = "ring"
    PROFILE = "profile"
    TEXTURE = "texture"
    MOTION = "motion"
    PICTURE = "picture"


@dataclass(frozen=True)
class Quantity:
    """One number that gives an effect's size: the true instrument minus the stated one.

    Attributes
    ----------
    name : str
        With its unit as suffix where it has one, as in ``tilt_deg``.
    unit : str
    typical : float
        A size met in practice.
    low, high : float
        Range within which a scene or a diagnosis may put it.
    meaning : str
    """

    name: str
    unit: str
    typical: float
    low: float
    high: float
    meaning: str


@dataclass(frozen=True)
class Effect:
    """A known effect.

    Attributes
    ----------
    name : str
        Canonical name.
    family : str
        ``laser``, ``camera``, ``window``, ``pose``, ``photometric`` or ``picture``.
    quantities : tuple of Quantity
        In the order in which a switch takes them.
    harmonic : int or None
        Harmonic in azimuth of the radius error; None where it has no single one.
    radial_exponent : float or None
        d ln |radius error| / d ln radius over 25 to 51 mm with baseline 22 mm.
    fixed_to : FixedTo
    channel : Channel
    time : str
        ``static``, ``drift``, ``periodic``, ``event``, ``speed`` or ``reversal``.
    law : str
        Radius error, apparent minus true.
    typical_mm : float or None
        Radius error at the typical size in a 4 inch pipe (r 50.8, l 22).
    alike : tuple of str
        Effects that one kind of recording may not tell apart from it.
    told_apart_by : str
    """

    name: str
    family: str
    quantities: tuple[Quantity, ...]
    harmonic: int | None
    radial_exponent: float | None
    fixed_to: FixedTo
    channel: Channel
    time: str
    law: str
    typical_mm: float | None
    alike: tuple[str, ...]
    told_apart_by: str

    def quantity(self, name: str) -> Quantity:
        """Return the quantity of that name.

        Raises
        ------
        KeyError
            When the effect has no such quantity.
        """
        found = {q.name: q for q in self.quantities}
        return found[name]


class CourseKind(StrEnum):
    """What an effect's size follows."""

    CONSTANT = "constant"
    STEP = "step"
    RAMP = "ramp"
    EXPONENTIAL = "exponential"
    SINUSOID = "sinusoid"
    SPEED = "speed"
    REVERSAL = "reversal"
    DISTANCE = "distance"


def _time(meaning: str) -> Quantity:
    return Quantity("time_s", "s", 4.0, 1e-3, 1e5, meaning)


# The numbers that each kind takes, in the order of `Course.values`.
COURSES: Mapping[CourseKind, tuple[Quantity, ...]] = MappingProxyType({
    CourseKind.CONSTANT: (),
    CourseKind.STEP: (_time("from when on the effect is there"),),
    CourseKind.RAMP: (_time("when it has its size, growing evenly from the first frame on and beyond"),),
    CourseKind.EXPONENTIAL: (_time("time constant t₀ of 1 − exp(−t/t₀)"),),
    CourseKind.SINUSOID: (
        Quantity("frequency_hz", "Hz", 1.0, 0.01, 200.0, "frequency of the swing"),
        Quantity("phase_deg", "deg", 0.0, -360.0, 360.0, "phase of its sine at the first frame"),
    ),
    CourseKind.SPEED: (Quantity("speed_mm_s", "mm/s", 20.0, 0.1, 1e4, "speed at which it has its size"),),
    CourseKind.REVERSAL: (),
    CourseKind.DISTANCE: (
        Quantity("distance_mm", "mm", 100.0, 0.1, 1e6, "distance in P at which it has its size"),
    ),
})  # fmt: skip


@dataclass(frozen=True)
class Course:
    """A kind of course with its numbers.

    Attributes
    ----------
    kind : CourseKind
    values : tuple of float
        In the order and units of `COURSES`.

    Raises
    ------
    InputError
        When there are more or fewer numbers than the kind takes, or one is out of its range.
    """

    kind: CourseKind = CourseKind.CONSTANT
    values: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        wanted = COURSES[self.kind]
        if len(wanted) != len(self.values) or any(
            not q.low <= v <= q.high for q, v in zip(wanted, self.values, strict=True)
        ):
            sizes = ", ".join(f"{q.name} {q.low:g} to {q.high:g} {q.unit}" for q in wanted) or "no number"
            raise InputError("course", f"{self.values} does not fit a {self.kind}", expected=sizes)

    @property
    def quantities(self) -> dict[str, float]:
        """Its numbers by name."""
        return {q.name: v for q, v in zip(COURSES[self.kind], self.values, strict=True)}

    def factor(self, time_s: float | Float, distance_mm: float | Float, speed_mm_s: float | Float) -> Float:
        """Return the part of its size (...,) that an effect has.

        Parameters
        ----------
        time_s : (...,)
            Since the first frame.
        distance_mm, speed_mm_s : (...,)
            Of the camera along the pipe, distance in P; backward speed negative.
        """
        t, at = np.asarray(time_s, np.float64), (*self.values, 1.0)[0]
        match self.kind:
            case CourseKind.CONSTANT:
                part = np.ones(t.shape)
            case CourseKind.STEP:
                part = (t >= at).astype(np.float64)
            case CourseKind.RAMP:
                part = t / at
            case CourseKind.EXPONENTIAL:
                part = -np.expm1(-t / at)
            case CourseKind.SINUSOID:
                part = np.sin(2 * np.pi * at * t + np.radians(self.values[1]))
            case CourseKind.SPEED:
                part = np.asarray(speed_mm_s) / at
            case CourseKind.REVERSAL:
                part = np.sign(np.asarray(speed_mm_s, np.float64))
            case CourseKind.DISTANCE:
                part = np.asarray(distance_mm) / at
        return np.asarray(part, np.float64)


CONSTANTLY = Course()
