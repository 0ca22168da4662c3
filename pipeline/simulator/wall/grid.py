"""The wall of a simulated pipe, the grid on which it is sampled, windows of the grid, and random fields."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.fft import irfft2, next_fast_len, rfft2

from pipeline.arrays import Float, Float32, Int
from pipeline.geometry.axis import PipeAxis

# Number of waves of a random function: enough that their sum is nearly Gaussian.
_PLANE_WAVES = 48


@dataclass(frozen=True)
class WallGrid:
    """Where samples lie: rows at distance_from + i · step, columns at azimuth −π + (j + ½) 2π / columns."""

    distance_from_mm: float
    step_mm: float
    rows: int
    columns: int

    @property
    def distance_mm(self) -> Float:
        """(rows,) distances of the rows."""
        return np.asarray(self.distance_from_mm + self.step_mm * np.arange(self.rows))

    @property
    def azimuth_rad(self) -> Float:
        """(columns,) azimuths of the columns."""
        return -np.pi + (np.arange(self.columns) + 0.5) * 2 * np.pi / self.columns


@dataclass(frozen=True)
class Wall:
    """The true wall.

    Between samples radius and reflectance are linear in distance and azimuth; beyond the first and last row
    they continue as they are there.

    Attributes
    ----------
    axis : PipeAxis
        Axis in P. A straight pipe has two points; a bent one a polyline fine enough for linear interpolation
        (sagitta step²·curvature/8 below 0.1 µm).
    shape : WallGrid
        Grid of ``radius_mm``; 0.1 to 0.25 mm a step is fine enough for chamfers and beads.
    radius_mm : (rows, columns) float32
    texture : WallGrid
        Grid of ``albedo_bgr`` and ``gloss``.
    albedo_bgr : (rows, columns, 3) float32
        Diffuse reflectance, 0 to 1, of each colour channel.
    gloss : float
        Share of the reflectance that is a glossy lobe.
    gloss_lobe : float
        Exponent of that lobe (Blinn-Phong, normalised), an even number up to 254: it is rounded to one.
    interreflection : float
        Share that is rendered of the light bounced once inside the bore; 1 is that of a dull wall.
    """

    axis: PipeAxis
    shape: WallGrid
    radius_mm: Float32
    texture: WallGrid
    albedo_bgr: Float32
    gloss: float = 0.0
    gloss_lobe: float = 40.0
    interreflection: float = 0.0


@dataclass(frozen=True)
class Grid:
    """Cells of a wall with the radius by which azimuths become arc lengths.

    Attributes
    ----------
    cells : WallGrid
    radius_mm : float
        Nominal radius.
    """

    cells: WallGrid
    radius_mm: float

    @cached_property
    def distance_mm(self) -> Float:
        """(S,) distances of the rows."""
        return self.cells.distance_mm

    @cached_property
    def azimuth_rad(self) -> Float:
        """(A,) azimuths of the columns, from −π to π."""
        return self.cells.azimuth_rad

    @property
    def shape(self) -> tuple[int, int]:
        """(S, A)."""
        return self.cells.rows, self.cells.columns

    @property
    def step_mm(self) -> float:
        """Spacing of the rows."""
        return self.cells.step_mm

    @property
    def arc_step_mm(self) -> float:
        """Spacing of the columns along the nominal wall."""
        return 2 * np.pi * self.radius_mm / self.cells.columns


@dataclass(frozen=True)
class Window:
    """A part of a grid around a place.

    Attributes
    ----------
    rows, columns : (n,), (m,)
        Indices into the grid.
    along_mm, around_mm : (n, 1), (1, m)
        Offsets from the place: along the distance and along the nominal wall.
    """

    rows: Int
    columns: Int
    along_mm: Float
    around_mm: Float

    @property
    def place(self) -> tuple[Int, ...]:
        """Indices that select the window of a map (S, A)."""
        return np.ix_(self.rows, self.columns)


def grid_over(distance_mm: tuple[float, float], radius_mm: float, cell_mm: float) -> Grid:
    """Return the grid between two distances with cells of about ``cell_mm``.

    The number of columns has only small prime factors, so that its Fourier transform is fast.
    """
    rows = max(round((distance_mm[1] - distance_mm[0]) / cell_mm) + 1, 2)
    columns = next_fast_len(max(round(2 * np.pi * radius_mm / cell_mm), 16))
    return Grid(WallGrid(distance_mm[0], cell_mm, rows, columns), radius_mm)


def window(
    grid: Grid, distance_mm: float, azimuth_rad: float, half_length_mm: float, half_width_mm: float
) -> Window:
    """Return the part of a grid within half a length and half a width of a place; empty outside the grid."""
    along = grid.distance_mm - distance_mm
    around = wrapped(grid.azimuth_rad - azimuth_rad) * grid.radius_mm
    rows = np.flatnonzero(np.abs(along) <= half_length_mm)
    columns = np.flatnonzero(np.abs(around) <= half_width_mm)
    return Window(rows, columns, along[rows, None], around[None, columns])


def wrapped(angle_rad: Float) -> Float:
    """Return angles (...) wrapped into −π … π."""
    return np.asarray((np.asarray(angle_rad) + np.pi) % (2 * np.pi) - np.pi)


@dataclass(frozen=True)
class Seeds:
    """Random generators by purpose; ``seed`` is the scene's."""

    seed: int

    def of(self, purpose: str, index: int = 0) -> np.random.Generator:
        """Return a new generator for a purpose, in the same state at every call."""
        return np.random.default_rng([self.seed, zlib.crc32(purpose.encode()), index])


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
