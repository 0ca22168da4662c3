"""Decoys: patterns without physics but as flexible, which a true effect must beat before it is named.

They are drawn with a fixed seed, so that they are the same in every diagnosis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from stages.diagnose.effects.base import Amplitude, EffectModel, ImagePoints, Shape
from stages.diagnose.effects.kinds import cosine
from stages.diagnose.effects.nameless import Nameless, growth, two_parts

_SEED = 20261121
_WRONG_EXPONENTS = {1: (-1.0, 3.5), 2: (-1.5, 4.0), 3: (-0.5, 3.0), 4: (0.5, 4.5)}
_WAVES = 3
_RATES_HZ = (0.02, 0.4)
_ROW_PERIODS_PX = (97.0, 260.0, 700.0)
_PIPE_PERIODS_MM = (15.0, 90.0)


@dataclass(frozen=True)
class WanderingDecoy(Nameless):
    """A harmonic of the line that grows with a wrong power of the radius and wanders slowly in time."""

    name: str
    harmonic: int
    exponent: float
    rates_hz: tuple[float, ...]
    phases_rad: tuple[float, ...]
    amplitudes: tuple[Amplitude, ...] = two_parts("mm", 0.05)

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the pattern on the line, nothing on texture."""
        if not points.on_line:
            return np.zeros(len(points.uv))
        course = _waves(points.time_s, self.rates_hz, self.phases_rad)
        pattern = cosine(points.azimuth_rad, amplitude, self.harmonic)
        return np.asarray(growth(points, self.exponent) * course * pattern)

    def formula(self, shape: Shape) -> str:
        """Return the pattern as a formula."""
        return f"δr = a (r/50)^{self.exponent:g} cos {self.harmonic}(ψ − ψ₀) w(t), w a drawn course"


@dataclass(frozen=True)
class RowDecoy(Nameless):
    """A wave along the sensor's rows that moves every image across them."""

    name: str
    period_px: float
    harmonic: int = 0
    amplitudes: tuple[Amplitude, ...] = two_parts("px", 0.1)

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the wave along v."""
        phase = 2 * np.pi * points.uv[:, 1] / self.period_px
        along_v = amplitude[0] * np.cos(phase) + amplitude[1] * np.sin(phase)
        return np.stack([np.zeros_like(along_v), along_v], axis=1)

    def formula(self, shape: Shape) -> str:
        """Return the pattern as a formula."""
        return f"δv = a cos(2πv/{self.period_px:g} − ψ₀)"


@dataclass(frozen=True)
class WallDecoy(Nameless):
    """A harmonic of the wall itself, in P, that wanders along the distance."""

    name: str
    harmonic: int
    rates_per_mm: tuple[float, ...]
    phases_rad: tuple[float, ...]
    amplitudes: tuple[Amplitude, ...] = two_parts("mm", 0.05)

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the pattern; nothing where the distance is not known."""
        if points.distance_mm is None:
            return np.zeros(len(points.uv))
        course = _waves(points.distance_mm, self.rates_per_mm, self.phases_rad)
        return np.asarray(course * cosine(points.azimuth_p_rad, amplitude, self.harmonic))

    def formula(self, shape: Shape) -> str:
        """Return the pattern as a formula."""
        return f"wall: a cos {self.harmonic}(ψ_P − ψ₀) w(s), w a drawn course"


def _waves(at: Float, rates: tuple[float, ...], phases_rad: tuple[float, ...]) -> Float:
    waves = [np.cos(2 * np.pi * rate * at + phase) for rate, phase in zip(rates, phases_rad, strict=True)]
    return np.asarray(np.sum(waves, axis=0) * np.sqrt(2 / len(waves)))


def _drawn() -> tuple[EffectModel, ...]:
    random = np.random.default_rng(_SEED)

    def draw(low: float, high: float) -> tuple[float, ...]:
        return tuple(float(x) for x in random.uniform(low, high, _WAVES))

    wandering = [
        WanderingDecoy(f"decoy_wandering_{m}_{p:g}", m, p, draw(*_RATES_HZ), draw(0, 2 * np.pi))
        for m, exponents in _WRONG_EXPONENTS.items()
        for p in exponents
    ]
    rows = [RowDecoy(f"decoy_rows_{period:g}", period) for period in _ROW_PERIODS_PX]
    longest, shortest = (1 / period for period in reversed(_PIPE_PERIODS_MM))
    wall = [
        WallDecoy(f"decoy_wall_{m}", m, draw(longest, shortest), draw(0, 2 * np.pi)) for m in (1, 2, 3, 4)
    ]
    return (*wandering, *rows, *wall)


DECOYS: tuple[EffectModel, ...] = _drawn()
