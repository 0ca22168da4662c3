"""Patterns without a cause that have the course of an effect that was found, as alternatives to it.

A slow change of the focal length that was not in the library was once named a cone of the sheet at .996: the
alternatives were patterns of the picture that are constant or grow evenly, and none that settles as it did.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import CourseKind, FixedTo
from stages.diagnose.effects.base import Amplitude, EffectModel, Factored, ImagePoints, Product, Shape
from stages.diagnose.effects.courses import IN_TIME, factors, in_words
from stages.diagnose.effects.free_profile import FREE_PROFILES
from stages.diagnose.effects.kinds import Drifting
from stages.diagnose.effects.nameless import GENERIC, STEADY, Moves, Nameless


@dataclass(frozen=True)
class PatternInCourse(Nameless, Product):
    """A steady pattern with the course of an effect; the shape is the course's."""

    steady: Nameless
    like: EffectModel
    name: str = field(init=False)
    harmonic: int = field(init=False)
    amplitudes: tuple[Amplitude, ...] = field(init=False)

    def __post_init__(self) -> None:
        waves = ("sine ", "cosine ") if self.like.kind is CourseKind.SINUSOID else ("",)
        each = tuple(replace(a, name=wave + a.name) for wave in waves for a in self.steady.amplitudes)
        object.__setattr__(self, "name", f"{self.steady.name} as {self.like.name}")
        object.__setattr__(self, "harmonic", self.steady.harmonic)
        object.__setattr__(self, "amplitudes", each)

    def factored(self, points: ImagePoints, shape: Shape) -> Factored:
        """Return the effect's course, and the pattern."""
        return factors(self.like.kind, points, shape), self.steady, STEADY

    def goes_with(self, shape: Shape) -> tuple[FixedTo, str, int | None]:
        """Return what the pattern is fixed to, or time where it drifts, with the behaviour of its course."""
        time = IN_TIME[self.like.kind]
        fixed_to, _, harmonic = self.steady.goes_with(STEADY)
        return FixedTo.TIME if time == "drift" else fixed_to, time, harmonic

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the root sum of squares of all amplitudes."""
        return {"amplitude": float(np.linalg.norm(amplitude))}

    def formula(self, shape: Shape) -> str:
        """Return the pattern and the course as a formula."""
        return f"({self.steady.formula(STEADY)}) × ({in_words(self.like.kind, shape)})"


def patterns_in_course(like: EffectModel, harmonic: int | None) -> tuple[PatternInCourse, ...]:
    """Return the patterns of a harmonic that have an effect's course and displace what the effect does not.

    For an effect on the laser's line they displace the picture, and the other way round: a law of the
    effect's own kind with another growth is tested separately (`stages.diagnose.gauge.unknown_laws`). There
    are none for constant effects.
    """
    if like.kind is CourseKind.CONSTANT:
        return ()
    law = effect(like.static.law if isinstance(like, Drifting) else like.law)
    moves = Moves.OUTWARD if law.fixed_to is FixedTo.LASER else Moves.LINE
    powers = [t for t in GENERIC if t.moves is moves and t.harmonic == harmonic]
    free = [profile for profile, _ in FREE_PROFILES if profile.powers[0] in powers]
    return tuple(PatternInCourse(p, like) for p in (*powers, *free))
