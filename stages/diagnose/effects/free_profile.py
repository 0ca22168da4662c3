"""Patterns of one harmonic with any dependence on the radius: one law that the library does not contain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.effect import FixedTo
from stages.diagnose.effects.base import Amplitude, ImagePoints, Shape
from stages.diagnose.effects.nameless import GENERIC, STEADY, GenericTerm, Moves, Nameless


@dataclass(frozen=True)
class FreeProfile(Nameless):
    """The patterns of one harmonic with all powers of the radius or of θ, each with amplitudes of its own."""

    name: str
    harmonic: int
    powers: tuple[GenericTerm, ...]
    amplitudes: tuple[Amplitude, ...]

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the sum of the patterns' shifts."""
        each = self._each(amplitude)
        return np.asarray(sum(term.wall_shift_mm(points, STEADY, a) for term, a in each))

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the sum of the patterns' shifts."""
        each = self._each(amplitude)
        return np.asarray(sum(term.image_shift_px(points, STEADY, a) for term, a in each))

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

    def _each(self, amplitude: Float) -> zip[tuple[GenericTerm, Float]]:
        return zip(self.powers, np.split(np.asarray(amplitude), len(self.powers)), strict=True)


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
