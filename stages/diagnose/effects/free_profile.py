"""Patterns of one harmonic with any dependence on the radius: one law that the library does not contain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import CourseKind, FixedTo
from stages.diagnose.effects.base import Amplitude, EffectModel, ImagePoints, Shape, Share, SumOfLaws
from stages.diagnose.effects.courses import Drifting
from stages.diagnose.effects.nameless import STEADY, GenericTerm, Moves, Nameless, PatternInCourse
from stages.diagnose.effects.vocabulary import GENERIC


@dataclass(frozen=True)
class FreeProfile(Nameless, SumOfLaws):
    """The patterns of one harmonic with all powers of the radius or of θ, each with amplitudes of its own."""

    name: str
    harmonic: int
    powers: tuple[GenericTerm, ...]
    amplitudes: tuple[Amplitude, ...]

    def shares(self, points: ImagePoints, shape: Shape, amplitude: Float) -> list[Share]:
        """Return the patterns, each in full."""
        each = zip(self.powers, np.split(np.asarray(amplitude), len(self.powers)), strict=True)
        return [(np.ones(len(points.uv)), term, STEADY, a) for term, a in each]

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the root of the sum of squares of all amplitudes."""
        return {"amplitude": float(np.linalg.norm(amplitude))}

    def goes_with(self, shape: Shape) -> tuple[FixedTo, str, int | None]:
        """Return what its patterns are fixed to."""
        return self.powers[0].goes_with(STEADY)

    def formula(self, shape: Shape) -> str:
        """Return the pattern as a formula."""
        wave = f" cos {self.harmonic}(ψ − ψ₀)" if self.harmonic else ""
        return f"δr = a(r){wave}" if self.powers[0].moves is Moves.LINE else f"image: a(θ){wave} outward"


def _profile(moves: Moves, harmonic: int) -> FreeProfile:
    powers = tuple(t for t in GENERIC if t.moves is moves and t.harmonic == harmonic)
    amplitudes = tuple(
        Amplitude(f"{a.name} {t.exponent}", a.unit, a.plausible) for t in powers for a in t.amplitudes
    )
    return FreeProfile(f"generic_{moves}_{harmonic}_any", harmonic, powers, amplitudes)


FREE_PROFILES: tuple[tuple[FreeProfile, Shape], ...] = tuple(
    (_profile(moves, harmonic), STEADY)
    for moves in (Moves.LINE, Moves.OUTWARD)
    for harmonic in sorted({t.harmonic for t in GENERIC})
)


def patterns_in_course(like: EffectModel, harmonic: int | None) -> tuple[PatternInCourse, ...]:
    """Return the patterns of a harmonic that have an effect's course and displace what the effect does not.

    For an effect on the laser's line they displace the picture, and the other way round: see
    `patterns_of_kind`. There are none for constant effects.
    """
    if like.kind is CourseKind.CONSTANT:
        return ()
    moves = Moves.OUTWARD if _of_laser(like) else Moves.LINE
    return tuple(PatternInCourse(p, like.kind, like) for p in _patterns(moves, harmonic))


def patterns_of_kind(like: EffectModel, harmonic: int | None) -> tuple[Nameless, ...]:
    """Return the steady patterns of a harmonic that displace what a constant effect displaces.

    They are its law with another growth, which is weighed by `stages.diagnose.gauge.unknown_laws`.
    """
    moves = Moves.LINE if _of_laser(like) else Moves.OUTWARD
    return _patterns(moves, harmonic) if like.kind is CourseKind.CONSTANT else ()


def _of_laser(model: EffectModel) -> bool:
    law = effect(model.static.law if isinstance(model, Drifting) else model.law)
    return law.fixed_to is FixedTo.LASER


def _patterns(moves: Moves, harmonic: int | None) -> tuple[Nameless, ...]:
    powers = tuple(t for t in GENERIC if t.moves is moves and t.harmonic == harmonic)
    return (*powers, *(profile for profile, _ in FREE_PROFILES if profile.powers[0] in powers))
