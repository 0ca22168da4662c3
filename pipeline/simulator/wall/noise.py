"""Random fields on a wall, periodic around it, and the random generators they are drawn from."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft2, next_fast_len, rfft2

from pipeline.arrays import Float, Float32
from pipeline.simulator.wall.grid import Grid


@dataclass(frozen=True)
class Seeds:
    """Random generators by purpose; ``seed`` is the scene's."""

    seed: int

    def of(self, purpose: str, index: int = 0) -> np.random.Generator:
        """Return a new generator of a purpose, in the same state at every call."""
        return np.random.default_rng([self.seed, zlib.crc32(purpose.encode()), index])


# Waves of a random function: enough that their sum is nearly Gaussian.
_PLANE_WAVES = 48


def field(
    grid: Grid,
    random: np.random.Generator,
    *,
    longest_mm: float,
    shortest_mm: float = 0.0,
    slope: float = 1.0,
    stretch: float = 1.0,
) -> Float32:
    """Return a Gaussian random field (S, A) of zero mean and unit variance.

    Its spectral amplitude falls as wavelength^slope between the longest and the shortest wavelength
    (spectral synthesis; 1 is as rough at every scale, larger is smoother). Made by filtering white noise,
    so it is periodic around the wall.

    Parameters
    ----------
    grid, random
    longest_mm, shortest_mm : float
        Band of wavelengths along the wall; below the longest the amplitude levels off.
    slope : float
        Exponent of the amplitude over the wavelength.
    stretch : float
        Wavelength along the distance over that around; more than 1 gives streaks along the pipe.
    """
    rows = next_fast_len(grid.shape[0] + round(longest_mm * stretch / grid.step_mm))
    white = random.standard_normal((rows, grid.shape[1]), dtype=np.float32)
    spectrum = rfft2(white, workers=2)
    spectrum *= _filter(grid, rows, longest_mm, shortest_mm, slope, stretch)
    values = irfft2(spectrum, s=(rows, grid.shape[1]), workers=2)[: grid.shape[0]]
    values -= values.mean()
    return np.asarray(values / max(float(values.std()), 1e-12), np.float32)


def _filter(
    grid: Grid, rows: int, longest_mm: float, shortest_mm: float, slope: float, stretch: float
) -> Float32:
    along = np.abs(np.fft.fftfreq(rows, grid.step_mm)[:, None]) * stretch
    around = np.fft.rfftfreq(grid.shape[1], grid.arc_step_mm)[None]
    frequency = np.hypot(along, around)
    # in two dimensions amplitude² per ring of frequencies goes as f × |filter|²
    gain = np.maximum(frequency * longest_mm, 1.0) ** -(slope + 0.5)
    if shortest_mm > 0:
        gain *= np.exp(-((frequency * shortest_mm) ** 4))
    gain[0, 0] = 0
    return np.asarray(gain, np.float32)


@dataclass(frozen=True)
class PlaneWaves:
    """A random function of two lengths that can be evaluated anywhere: a sum of plane waves.

    Attributes
    ----------
    along, around, phase, amplitude : (W,)
        Angular frequencies, rad/mm, phases, and amplitudes that give unit variance together.
    """

    along: Float
    around: Float
    phase: Float
    amplitude: Float

    def __call__(self, along_mm: Float, around_mm: Float) -> Float:
        """Return values (n, m) at offsets (n, 1) and (1, m) or any that broadcast."""
        total = np.zeros(np.broadcast_shapes(np.shape(along_mm), np.shape(around_mm)))
        for a, b, p, h in zip(self.along, self.around, self.phase, self.amplitude, strict=True):
            total += h * np.cos(a * along_mm + b * around_mm + p)
        return total


def plane_waves(random: np.random.Generator, longest_mm: float, shortest_mm: float) -> PlaneWaves:
    """Return a random function whose wavelengths lie, evenly in their logarithm, within a band."""
    wavelength = np.exp(random.uniform(np.log(shortest_mm), np.log(longest_mm), _PLANE_WAVES))
    heading, phase = random.uniform(0, 2 * np.pi, (2, _PLANE_WAVES))
    amplitude = np.sqrt(wavelength)
    amplitude *= np.sqrt(2 / np.sum(amplitude**2))
    angular = 2 * np.pi / wavelength
    return PlaneWaves(angular * np.cos(heading), angular * np.sin(heading), phase, amplitude)


def above_share(values: Float32, share: float, softness: float) -> Float32:
    """Return (S, A) from 0 to 1: where a field is among its largest ``share``, with soft edges.

    ``softness`` is the width of the edge in standard deviations of the field.
    """
    if share <= 0:
        return np.zeros(values.shape, np.float32)
    if share >= 1:
        return np.ones(values.shape, np.float32)
    level = float(np.quantile(values[:: max(len(values) // 400, 1)], 1 - share))
    return np.asarray(np.clip((values - level) / max(softness, 1e-6) + 0.5, 0, 1), np.float32)
