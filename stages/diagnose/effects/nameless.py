"""Patterns without a known cause: what decoys and the generic basis have in common."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.effect import FixedTo
from stages.diagnose.effects.base import Amplitude, EffectModel, ImagePoints, Shape

_REFERENCE_MM = 50.0


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
