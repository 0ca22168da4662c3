"""Light of the laser line: power around and over time, profile across it and speckle, each with its σ.

Near the line a pixel is  black + power(frame) · p(φ) · ρ · s/w · profile(x/w),  with x the distance across
the line, s the sheet's own thickness and w the line's width after the lens, all in px, and ρ the wall's
reflectance: a weighted sum of blue, green and red of its photo, with the weights by which the line's
brightness follows them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import map_coordinates

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float, Float32, Int
from stages.twin.lamp_light import DARK, Course, Figure
from stages.twin.line_colour import Colour
from stages.twin.scene import LineSight, Scene

# The line's bell lies within this many widths (99.7 % of a Gaussian); light beyond it is the halo.
_BELL_WIDTHS = 3.0
_SECTORS, _FINE = 36, 20
PROFILE_WIDTHS = 6.0
"""The line's profile is described over this many widths to each side; light farther out is not modelled."""
_CORE_WIDTHS, _MIDDLE_WIDTHS = 1.0, 0.4

PixelNoise = Callable[[Float32], Float32]


@dataclass(frozen=True)
class LineLight:
    """Light of the laser line as the lens shows it.

    Attributes
    ----------
    level : float
        Grey levels of the middle of a line on white wall if the line were as wide as its sheet.
    colour, colour_sd : (3,)
        Weights of blue, green and red in the grey of the line, and their 1 σ.
    log_power : (36,)
        Logarithm of the power over image azimuth, uniform sectors from −π, mean 0.
    course : Course
        Power over time.
    sheet_mm, blur_px : Figure
        1 σ of the sheet's thickness along the pipe, and of the blur by lens and pixel.
    profile_x, profile : (X,)
        Mean profile over x/w, 1 in the middle.
    halo, skewness : Figure
        Share of light beyond three widths; third moment of the profile over width³.
    speckle : Figure
        Relative 1 σ of a pixel's brightness in the line's middle that neither reflectance nor power explains:
        the laser's speckle, and reflectance finer than the photo shows.
    spread : (X,)
        Variance of single pixels over the square of the peak, over x/w: speckle, relief finer than the radius
        map, and the codec's ringing about the line.
    """

    level: float
    colour: Float
    colour_sd: Float
    log_power: Float
    course: Course
    sheet_mm: Figure
    blur_px: Figure
    profile_x: Float
    profile: Float
    halo: Figure
    skewness: Figure
    speckle: Figure
    spread: Float

    def peak(self, sight: LineSight) -> tuple[Float32, Float32]:
        """Return the grey level (N,) of the line's middle next to each pixel, and the line's width, px."""
        sheet_px = self.sheet_mm.value / sight.mm_per_px
        width = np.sqrt(sheet_px**2 + self.blur_px.value**2)
        column = (sight.phi_rad + np.pi) / (2 * np.pi) * len(self.log_power) - 0.5
        power = map_coordinates(self.log_power, [column], order=1, mode="grid-wrap")
        reflectance = self.colour.astype(np.float32) @ sight.reflectance
        peak = self.level * np.exp(power) * reflectance * sheet_px / width
        return peak.astype(np.float32), width.astype(np.float32)

    @property
    def sector_power(self) -> Float:
        """(36,) logarithm of the mean power over each sector: between their middles it is interpolated."""
        each = (np.arange(_SECTORS * _FINE) + 0.5) / _FINE - 0.5
        power = np.exp(map_coordinates(self.log_power, [each], order=1, mode="grid-wrap"))
        return np.asarray(np.log(power.reshape(_SECTORS, _FINE).mean(1)))

    def line_and_slope(self, sight: LineSight, log_power: float) -> tuple[Float32, Float32]:
        """Return the grey levels (N,) that the line adds to pixels, and their slope per px across it."""
        peak, width = self.peak(sight)
        x, scale = sight.offset_px / width, np.exp(log_power) * peak
        shape = np.interp(x, self.profile_x, self.profile, left=0.0, right=0.0)
        slope = np.interp(x, self.profile_x, np.gradient(self.profile, self.profile_x), left=0.0, right=0.0)
        return (scale * shape).astype(np.float32), (scale * slope / width).astype(np.float32)

    def variance(self, sight: LineSight, log_power: float) -> Float32:
        """Return the variance (N,) of pixels near the line beyond the camera's noise."""
        peak, width = self.peak(sight)
        spread = np.interp(sight.offset_px / width, self.profile_x, self.spread, left=0.0, right=0.0)
        return np.asarray(spread * (np.exp(log_power) * peak) ** 2, np.float32)


class LineSamples:
    """Collects the brightness of the line in sectors of frames, and its profile."""

    def __init__(
        self, scene: Scene, black: float, white: float, sheet_mm: float, width_px: float, colour: Colour
    ) -> None:
        self._scene, self._black, self._white = scene, black, white
        self._sheet_mm, self._width_px, self._colour = sheet_mm, width_px, colour
        self._kept: list[tuple[int, LineSight, Float32]] = []

    def add(self, frame: int, image: Float32, sight: LineSight) -> None:
        """Add the pixels near the line of a frame (H, W)."""
        self._kept.append((frame, sight, image[sight.row, sight.column] - np.float32(self._black)))

    def solve(self) -> LineLight | None:
        """Return the light that fits the samples; None without samples."""
        if not self._kept:
            return None
        sheet_px = np.median(np.concatenate([self._sheet_mm / s.mm_per_px for _, s, _ in self._kept]))
        blur = float(np.sqrt(max(self._width_px**2 - sheet_px**2, 0.3**2)))
        colour, colour_sd = self._colour
        light = replace(_plain_line(self._sheet_mm, blur), colour=colour, colour_sd=colour_sd)
        return self._with_profile(self._with_power(light))

    def _with_power(self, light: LineLight) -> LineLight:
        """Return the light with its power around the image and over time."""
        even = replace(light, level=1.0, log_power=np.zeros(_SECTORS))
        ratio = np.stack([self._sector_ratios(even, s, grey) for _, s, grey in self._kept])
        level, power, course, course_sd = _two_way(np.log(np.where(ratio > 0, ratio, np.nan)))
        frames = np.array([f for f, _, _ in self._kept])
        known = Course(frames, course, course_sd)
        return replace(light, level=float(np.exp(level)), log_power=power, course=known)

    def with_speckle(self, light: LineLight, noise: PixelNoise) -> LineLight:
        """Return the light with the variation of single pixels across the line beyond the camera's noise.

        Brightness and place of the line are first fitted in every sector of every frame, so that a line that
        is displaced or dim over more than a sector does not count as speckle.
        """
        each = np.stack([self._spread_in(light, noise, *kept) for kept in self._kept])
        spread, middle = np.median(each, 0), np.abs(light.profile_x) < _MIDDLE_WIDTHS
        contrast, of_frame = np.sqrt(spread[middle].mean()), np.sqrt(each[:, middle].mean(1))
        speckle = Figure(float(contrast), 1.25 * float(np.std(of_frame)) / np.sqrt(len(each)))
        return replace(light, spread=spread, speckle=speckle)

    def _spread_in(
        self, light: LineLight, noise: PixelNoise, frame: int, sight: LineSight, grey: Float32
    ) -> Float:
        """Return the variance (X,) over the square of the peak, across the line in one frame."""
        line, slope = light.line_and_slope(sight, light.course.at(frame))
        peak, width = light.peak(sight)
        use = np.isfinite(line) & (peak > DARK) & (grey + self._black < self._white)
        sector, rest = _sector_of(sight.phi_rad)[use], (grey - line)[use].astype(float)
        for basis in (line[use].astype(float), slope[use].astype(float)):
            above, below = (np.bincount(sector, basis * v, _SECTORS) for v in (rest, basis))
            rest = rest - (above / np.maximum(below, 1e-9))[sector] * basis
        step = light.profile_x[1] - light.profile_x[0]
        cell = np.round(((sight.offset_px / width)[use] - light.profile_x[0]) / step).astype(int)
        inside = (cell >= 0) & (cell < len(light.profile_x))
        excess = rest**2 - noise(line[use])
        above = np.bincount(cell[inside], excess[inside], len(light.profile_x))
        below = np.bincount(cell[inside], peak[use][inside].astype(float) ** 2, len(light.profile_x))
        return np.asarray(np.maximum(above / np.maximum(below, 1e-9), 0.0))

    def _sector_ratios(self, light: LineLight, sight: LineSight, grey: Float32) -> Float:
        """Return recorded over predicted brightness (36,) of the line's core; NaN where clipped or unseen."""
        predicted, _ = light.line_and_slope(sight, 0.0)
        sector = _sector_of(sight.phi_rad)
        _, width = light.peak(sight)
        core = (np.abs(sight.offset_px) < _CORE_WIDTHS * width) & np.isfinite(predicted)
        clipped = core & (grey + self._black >= self._white)
        # A sector's brightness is fitted to its core: one clipped pixel in twenty would spoil it (chosen).
        spoiled = np.bincount(sector[clipped], minlength=_SECTORS) > 0.05 * np.bincount(
            sector[core], minlength=_SECTORS
        )
        total = np.bincount(sector[core], (grey * predicted)[core], _SECTORS)
        square = np.bincount(sector[core], (predicted**2)[core], _SECTORS)
        return np.where((square > 0) & ~spoiled, total / np.maximum(square, 1e-9), np.nan)

    def _with_profile(self, light: LineLight) -> LineLight:
        """Return the light with the mean profile of all frames, its halo and its skewness."""
        edges = np.linspace(-PROFILE_WIDTHS, PROFILE_WIDTHS, 97)
        middle = (edges[1:] + edges[:-1]) / 2
        rows = []
        for frame, sight, grey in self._kept:
            peak, width = light.peak(sight)
            scale = peak * np.exp(light.course.at(frame))
            use = np.isfinite(scale) & (scale > DARK) & (grey + self._black < self._white)
            cell = np.digitize((sight.offset_px / width)[use], edges) - 1
            inside = (cell >= 0) & (cell < len(middle))
            above = np.bincount(cell[inside], grey[use][inside], len(middle))
            below = np.bincount(cell[inside], scale[use][inside], len(middle))
            rows.append(above / np.maximum(below, 1e-9))
        profile = np.median(rows, 0)
        sd = 1.25 * np.std(rows, 0) / np.sqrt(max(len(rows), 1))
        bell = np.abs(middle) < _BELL_WIDTHS
        halo = Figure(
            float(profile[~bell].sum() / profile.sum()), float(np.linalg.norm(sd[~bell]) / profile.sum())
        )
        weight = np.where(bell, profile, 0.0) / profile[bell].sum()
        first = float(weight @ middle)
        second = float(weight @ (middle - first) ** 2)
        skewness = float(weight @ (middle - first) ** 3) / second**1.5
        noise = float(np.linalg.norm(sd * np.abs(middle) ** 3 * bell) / profile.sum())
        skew = Figure(skewness, noise / second**1.5)
        spread = np.zeros_like(middle)
        return replace(light, profile_x=middle, profile=profile, halo=halo, skewness=skew, spread=spread)


def _sector_of(phi_rad: Float32) -> Int:
    return np.asarray(((phi_rad + np.pi) / (2 * np.pi) * _SECTORS).astype(int) % _SECTORS)


def _plain_line(sheet_mm: float, blur_px: float) -> LineLight:
    """Return a line with a Gaussian profile and even power."""
    x = np.linspace(-PROFILE_WIDTHS, PROFILE_WIDTHS, 193)
    nothing, unknown = np.zeros(0), Figure(0.0, 0.0)
    return LineLight(
        1.0, np.full(3, 1 / 3), np.full(3, np.inf), np.zeros(_SECTORS),
        Course(nothing.astype(np.int64), nothing, nothing),
        Figure(sheet_mm, 0.1 * sheet_mm), Figure(blur_px, 0.1 * blur_px), x, np.exp(-0.5 * x**2), unknown,
        unknown, unknown, np.zeros_like(x),
    )  # fmt: skip


def _two_way(table: Float) -> tuple[float, Float, Float, Float]:
    """Split a table (F, S) with gaps into level, columns (S,), rows (F,) and the rows' 1 σ (F,).

    By medians: J. W. Tukey's median polish.
    """
    rest = table.copy()
    rows, columns = np.zeros(table.shape[0]), np.zeros(table.shape[1])
    for _ in range(6):
        by_row = np.nan_to_num(_median(rest, 1))
        rest, rows = rest - by_row[:, None], rows + by_row
        by_column = np.nan_to_num(_median(rest, 0))
        rest, columns = rest - by_column, columns + by_column
    level = float(rows.mean() + columns.mean())
    spread = robust_spread(rest[np.isfinite(rest)]) if np.isfinite(rest).any() else 0.0
    row_sd = 1.25 * spread / np.sqrt(np.maximum(np.isfinite(table).sum(1), 1))
    return level, columns - columns.mean(), rows - rows.mean(), row_sd


def _median(table: Float, axis: int) -> Float:
    """Return medians that ignore gaps; 0 where all values are missing."""
    known = np.isfinite(table).any(axis)
    filled = np.where(np.expand_dims(known, axis), table, 0.0)
    return np.asarray(np.nanmedian(filled, axis))
