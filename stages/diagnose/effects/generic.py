"""A smooth basis that can mimic any slow pattern of low harmonic: the model of "none of the library"."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from stages.diagnose.effects.base import Amplitude, Float, ImagePoints, Shape
from stages.diagnose.effects.kinds import cosine
from stages.diagnose.effects.nameless import Nameless, growth, two_parts
from stages.diagnose.effects.predict import columns, texture_columns

_HARMONICS = (0, 1, 2, 3, 4)
_EXPONENTS = (0, 1, 2, 3)
_REFERENCE_S = 10.0


class Moves(StrEnum):
    """What a generic term moves: the line on the wall, or every image outward or around."""

    LINE = "line"
    OUTWARD = "outward"
    AROUND = "around"


@dataclass(frozen=True)
class GenericTerm(Nameless):
    """One harmonic with one power of the radius (line) or of θ (image); the shape is the power of time."""

    name: str
    moves: Moves
    harmonic: int
    exponent: int
    amplitudes: tuple[Amplitude, ...]

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return constant and linear in time."""
        return ((0.0,), (1.0,))

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return a (r/50)^p cos m(ψ − ψ₀) on the line."""
        if self.moves is not Moves.LINE or not points.on_line:
            return np.zeros(len(points.uv))
        return np.asarray(growth(points, self.exponent) * self._pattern(points, shape, amplitude))

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return a θ^p cos m(ψ − ψ₀) outward or around."""
        if self.moves is Moves.LINE:
            return np.zeros((len(points.uv), 2))
        heading = points.outward if self.moves is Moves.OUTWARD else points.outward[:, ::-1] * [-1.0, 1.0]
        size = points.theta**self.exponent * self._pattern(points, shape, amplitude)
        return np.asarray(size[:, None] * heading)

    def formula(self, shape: Shape) -> str:
        """Return the pattern as a formula."""
        wave = f" cos {self.harmonic}(ψ − ψ₀)" if self.harmonic else ""
        course = " t/10" if shape[0] else ""
        if self.moves is Moves.LINE:
            return f"δr = a (r/50)^{self.exponent}{wave}{course}"
        return f"image {self.moves}: a θ^{self.exponent}{wave}{course}"

    def _pattern(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        parts = np.array([*amplitude, 0.0])[:2]
        return (points.time_s / _REFERENCE_S) ** shape[0] * cosine(points.azimuth_rad, parts, self.harmonic)


def smooth_columns(points: ImagePoints) -> Float:
    """Return (M, 72) columns of the generic line terms, constant and linear in time, for line points."""
    terms = [term for term in GENERIC if term.moves is Moves.LINE]
    return np.concatenate([columns(t, points, s) for t in terms for s in t.shapes(0.0, 0.0)], axis=-1)


def smooth_texture_columns(points: ImagePoints) -> Float:
    """Return (M, 2, 144) columns of the generic image terms, constant and linear in time."""
    terms = [term for term in GENERIC if term.moves is not Moves.LINE]
    return np.concatenate([texture_columns(t, points, s) for t in terms for s in t.shapes(0.0, 0.0)], axis=-1)


def _term(moves: Moves, harmonic: int, exponent: int) -> GenericTerm:
    amplitudes = two_parts("mm", 0.05) if moves is Moves.LINE else two_parts("px", 0.2)
    kept = amplitudes if harmonic else amplitudes[:1]
    return GenericTerm(f"generic_{moves}_{harmonic}_{exponent}", moves, harmonic, exponent, kept)


GENERIC: tuple[GenericTerm, ...] = tuple(
    _term(moves, harmonic, exponent) for moves in Moves for harmonic in _HARMONICS for exponent in _EXPONENTS
)
