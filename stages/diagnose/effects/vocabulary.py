"""The patterns without a known cause that are searched, and that empirical formulas are built from."""

from __future__ import annotations

from pipeline.physics.effect import CourseKind
from stages.diagnose.effects.base import Shape
from stages.diagnose.effects.nameless import (
    STEADY,
    FractionTerm,
    GenericTerm,
    Moves,
    Nameless,
    PatternInCourse,
    RowTerm,
    two_parts,
)

_HARMONICS = (0, 1, 2, 3, 4)
_EXPONENTS = (0, 1, 2, 3)
# Reference values for the units of a pattern's size; any would do.
_REFERENCE_S, _REFERENCE_MM_S = 10.0, 20.0


def _term(moves: Moves, harmonic: int, exponent: int, hangs: bool = False) -> GenericTerm:
    in_mm = moves in (Moves.LINE, Moves.WALL)
    amplitudes = two_parts("mm", 0.05) if in_mm else two_parts("px", 0.2)
    kept = amplitudes if harmonic else amplitudes[:1]
    name = f"generic_{moves}_{harmonic}_{exponent}{'_hangs' if hangs else ''}"
    return GenericTerm(name, moves, harmonic, exponent, kept, hangs)


GENERIC: tuple[GenericTerm, ...] = tuple(
    _term(moves, harmonic, exponent)
    for moves in (Moves.LINE, Moves.OUTWARD, Moves.AROUND)
    for harmonic in _HARMONICS
    for exponent in _EXPONENTS
)


def _vocabulary() -> tuple[tuple[Nameless, Shape], ...]:
    with_time, with_speed = (CourseKind.RAMP, (_REFERENCE_S,)), (CourseKind.SPEED, (_REFERENCE_MM_S,))
    courses = {Moves.LINE: (with_time, with_speed), Moves.OUTWARD: (with_time,)}
    out: list[tuple[Nameless, Shape]] = []
    for term in GENERIC:
        out.append((term, STEADY))
        out += [(PatternInCourse(term, kind), shape) for kind, shape in courses.get(term.moves, ())]
    out += [(_term(Moves.WALL, m, power), STEADY) for m in (1, 2, 3, 4) for power in (0, 1)]
    # A sheet that shifts or tilts by its weight.
    out += [(_term(Moves.LINE, 1, power, hangs=True), STEADY) for power in (1, 2)]
    return (*out, (RowTerm(), STEADY), (FractionTerm(), STEADY))


# The patterns that empirical formulas are built from, in (r, ψ, t, s, speed, row).
VOCABULARY: tuple[tuple[Nameless, Shape], ...] = _vocabulary()
# A sheet that moves along the axis, or rocks.
SWINGS: tuple[PatternInCourse, ...] = tuple(
    PatternInCourse(_term(Moves.LINE, harmonic, exponent), CourseKind.SINUSOID)
    for harmonic, exponent in ((0, 1), (1, 2))
)
