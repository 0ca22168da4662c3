"""Common bases of effects: one signed size, a size with a direction, and an oscillation."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import CourseKind, Quantity
from stages.diagnose.effects.base import Amplitude, EffectModel, Shape

# Uncertainty of a frequency between two that are searched: the resolution of a recording of 20 s.
FREQUENCY_STEP_HZ = 0.05
_EITHER = re.compile(r"\[([^|]*)\|([^]]*)\]")


@dataclass(frozen=True)
class Worded(EffectModel):
    """An effect whose statement is a sentence template filled with its quantities.

    In ``[farther|nearer]`` the second word is used where the first quantity is negative, which is then
    written without its sign. A subclass states its name in the catalogue and the plausible size of its
    amplitudes, which are the ``parts`` of the catalogue's first quantity.
    """

    words: ClassVar[str]
    parts: ClassVar[tuple[str, ...]] = ("",)

    def __init_subclass__(cls, name: str = "", plausible: float = 0.0) -> None:
        if name:
            cls.name, size = name, effect(name).quantities[0]
        if name and "amplitudes" not in vars(cls):
            cls.amplitudes = tuple(Amplitude(size.name + part, size.unit, plausible) for part in cls.parts)

    def statement(self, shape: Shape, amplitude: Float) -> str:
        """Return a sentence that states the effect with its size."""
        values, signed = self.values_in_words(shape, amplitude), effect(self.name).quantities[0].name
        if "[" in self.words:
            size = self.quantities(shape, amplitude)[signed]
            word = 2 if size < 0 else 1
            values = {**values, signed: abs(size)}
            return _EITHER.sub(lambda either: either[word], self.words).format(**values)
        return self.words.format(**values)

    def values_in_words(self, shape: Shape, amplitude: Float) -> dict[str, float | str]:
        """Return the quantities in the sentence, by name."""
        return {**self.quantities(shape, amplitude)}


class Scalar(Worded):
    """An effect with one amplitude, which is the catalogue's first quantity."""

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the size by its name in the catalogue."""
        return {effect(self.name).quantities[0].name: float(amplitude[0])}


class Directed(Worded):
    """An effect with a size and an azimuth ψ₀; the amplitudes are its components along x and y."""

    order: int = 1
    parts = (" along x", " along y")

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return size and direction of the crest by their names in the catalogue."""
        return {
            effect(self.name).quantities[0].name: float(np.hypot(*amplitude)),
            "direction_deg": float(np.degrees(np.arctan2(amplitude[1], amplitude[0])) / self.order),
        }


class Periodic(Worded):
    """A directed effect at one frequency; the amplitudes are (x, y) of its sine, then of its cosine.

    The reported frequency is the lowest of all aliases |f − k · frame rate| that look the same in these
    frames.
    """

    kind = CourseKind.SINUSOID
    parts = tuple(f", {wave} along {axis}" for wave in ("sine", "cosine") for axis in "xy")

    def course(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the frequency."""
        return {"frequency_hz": shape[0]}

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return the `frequencies` within the catalogue's range."""
        return within(effect(self.name).quantity("frequency_hz"), frequencies(duration_s, frame_rate))

    def shape_step(self, shape: Shape) -> float:
        """Return the step of the frequency."""
        return FREQUENCY_STEP_HZ

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the ellipse's semi-major axis, its direction, and the frequency."""
        axes, size, _ = np.linalg.svd(np.asarray(amplitude).reshape(2, 2).T)
        return {
            effect(self.name).quantities[0].name: float(size[0]),
            "frequency_hz": shape[0],
            "direction_deg": float(np.degrees(np.arctan2(axes[1, 0], axes[0, 0]))),
        }


def frequencies(duration_s: float, frame_rate: float) -> Float:
    """Return frequencies, Hz, half a resolution cell apart, up to half the frame rate."""
    step = 0.5 / duration_s
    return np.arange(2 * step, frame_rate / 2 + step / 2, step)


def within(quantity: Quantity, grid: Float) -> tuple[Shape, ...]:
    """Return the shapes of the grid within the catalogue's range."""
    return tuple((float(x),) for x in grid if quantity.low <= x <= quantity.high)


def sine_and_cosine_at(time_s: Float, frequency_hz: float) -> tuple[Float, Float]:
    """Return sine and cosine (M,) at times (M,)."""
    phase = 2 * np.pi * frequency_hz * time_s
    return np.sin(phase), np.cos(phase)


def cosine(azimuth_rad: Float, amplitude: Float, order: int = 1) -> Float:
    """Return (M,) a cos m(ψ − ψ₀) with (a cos mψ₀, a sin mψ₀) = ``amplitude`` (2,)."""
    # Columns are asked for one amplitude at a time, and sines are slow.
    waves = ((a, f) for a, f in zip(amplitude, (np.cos, np.sin), strict=True) if a)
    return np.asarray(sum((a * f(order * azimuth_rad) for a, f in waves), np.zeros_like(azimuth_rad)))
