"""Patterns without a known cause: oscillations, and decoys that are as flexible as true effects.

A true effect must beat the decoys before it is named. They are drawn with a fixed seed, so that they are the
same in every diagnosis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.effect import FixedTo
from stages.diagnose.effects.base import Amplitude, EffectModel, ImagePoints, Shape
from stages.diagnose.effects.kinds import cosine

_REFERENCE_MM = 50.0
_SEED = 20261121
_WRONG_EXPONENTS = {1: (-1.0, 3.5), 2: (-1.5, 4.0), 3: (-0.5, 3.0), 4: (0.5, 4.5)}
_WAVES = 3
_RATES_HZ = (0.02, 0.4)
_ROW_PERIODS_PX = (97.0, 260.0, 700.0)
_PIPE_PERIODS_MM = (15.0, 90.0)


class Nameless(EffectModel):
    """A pattern of m waves around the ring, with a cosine and a sine part; m = 0 has the first part only."""

    harmonic: int

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the amplitude and the direction of a crest; with m = 0 the signed size alone."""
        if len(amplitude) == 1:
            return {"amplitude": float(amplitude[0])}
        crest = np.degrees(np.arctan2(amplitude[1], amplitude[0])) / max(self.harmonic, 1)
        return {"amplitude": float(np.hypot(*amplitude)), "direction_deg": float(crest)}

    def formula(self, shape: Shape) -> str:
        """Return the pattern as a formula in a, r, ψ, t."""
        raise NotImplementedError

    def goes_with(self, shape: Shape) -> tuple[FixedTo, str, int | None]:
        """Return what the pattern turns and travels with, its behaviour in time, and its harmonic."""
        return FixedTo.TIME, "static", self.harmonic

    def equation(self, shape: Shape, amplitude: Float) -> str:
        """Return the formula with the numbers to put into it."""
        numbers = (f"{name} = {value:.5g}" for name, value in self.quantities(shape, amplitude).items())
        return f"{self.formula(shape)}, {', '.join(numbers)} {self.amplitudes[0].unit}"

    def statement(self, shape: Shape, amplitude: Float) -> str:
        """Return that it is a pattern without a known cause, with its formula."""
        return f"A pattern without a known cause: {self.equation(shape, amplitude)}."

    def possible(self, shape: Shape, amplitude: Float) -> bool:
        """Return True: a pattern without a cause has no bounds."""
        return True


def two_parts(unit: str, plausible: float) -> tuple[Amplitude, ...]:
    """Return the amplitudes of a pattern's cosine and sine."""
    return Amplitude("cosine", unit, plausible), Amplitude("sine", unit, plausible)


def growth(points: ImagePoints, exponent: float) -> Float:
    """Return (M,) the power of the distance from the optical axis, 1 at 50 mm."""
    return np.asarray((points.radius_mm / _REFERENCE_MM) ** exponent)


@dataclass(frozen=True)
class SwingTerm(Nameless):
    """One harmonic of the line with one power of the radius; amplitudes are of its sine, then its cosine."""

    name: str
    harmonic: int
    exponent: int
    amplitudes: tuple[Amplitude, ...]

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return frequencies half a resolution cell apart, up to half the frame rate."""
        step = 0.5 / duration_s
        return tuple((float(f),) for f in np.arange(2 * step, frame_rate / 2 + step / 2, step))

    def shape_step(self, shape: Shape) -> float:
        """Return the step of the frequency: the resolution of the recording's duration."""
        return 0.05

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return (r/50)^p cos m(ψ − ψ₀) at each point's time, on the line."""
        if not points.on_line:
            return np.zeros(len(points.uv))
        phase = 2 * np.pi * shape[0] * points.time_s
        sine, cosines = np.split(np.asarray(amplitude), 2)
        swing = np.sin(phase) * self._wave(points, sine) + np.cos(phase) * self._wave(points, cosines)
        return np.asarray(growth(points, self.exponent) * swing)

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the amplitude and the frequency."""
        return {"amplitude": float(np.linalg.norm(amplitude)), "frequency_hz": shape[0]}

    def goes_with(self, shape: Shape) -> tuple[FixedTo, str, int | None]:
        """Return the laser: the line moves against the fiducials, and the camera has no part in that."""
        return FixedTo.LASER, "periodic", self.harmonic

    def formula(self, shape: Shape) -> str:
        """Return the pattern as a formula."""
        wave = f" cos {self.harmonic}(ψ − ψ₀)" if self.harmonic else ""
        return f"δr = a (r/50)^{self.exponent}{wave} sin(2πft + φ)"

    def _wave(self, points: ImagePoints, parts: Float) -> Float:
        return cosine(points.azimuth_rad, np.array([*parts, 0.0])[:2], self.harmonic)


def _swing(harmonic: int, exponent: int) -> SwingTerm:
    parts = ("along x", "along y") if harmonic else ("size",)
    amplitudes = tuple(
        Amplitude(f"{wave} {part}", "mm", 0.05) for wave in ("sine", "cosine") for part in parts
    )
    return SwingTerm(f"generic_swing_{harmonic}_{exponent}", harmonic, exponent, amplitudes)


# A sheet lifts and falls, or rocks.
SWINGS: tuple[SwingTerm, ...] = (_swing(0, 1), _swing(1, 2))


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
