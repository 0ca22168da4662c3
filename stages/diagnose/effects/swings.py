"""Oscillations without a known cause: patterns of the line at one frequency, as of a rocking laser."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.effect import FixedTo
from stages.diagnose.effects.base import Amplitude, ImagePoints, Shape
from stages.diagnose.effects.kinds import cosine
from stages.diagnose.effects.nameless import Nameless, growth


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
