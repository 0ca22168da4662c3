"""Re-render frames with a photometric state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property

import cv2
import numba
import numpy as np

from pipeline.arrays import Byte, Float, Float32
from pipeline.recording.base import Illumination
from stages.twin.noise import CameraNoise
from stages.twin.scene import Scene
from stages.twin.state import PhotometricState

_DARK_LEVEL = 3.0
"""Lit wall with fewer grey levels above black counts as dark."""
_CORE_WIDTHS, _MIDDLE_GREY = 1.0, 100.0
"""Widths of the line's core; grey of the photo that a power response leaves unchanged, since any other scale
is absorbed by the exposure."""


class Region(IntEnum):
    """What a pixel of a frame shows."""

    UNSEEN = 0
    LINE_CORE = 1
    LINE_FLANK = 2
    WALL = 3
    DARK = 4
    EDGE = 5


@dataclass(frozen=True)
class TwinFrame:
    """A re-rendered frame, all (H, W).

    Attributes
    ----------
    level : float32
        Grey levels above black; 0 where the region is UNSEEN.
    variance : float32
        Variance from camera noise, speckle and errors of the photo's place, grey levels².
    region : uint8
        `Region`.
    distance_mm, azimuth_rad : float32
        Place on the wall; NaN where unknown.
    irradiance : float32 or None
        As in `LitSight`; None in frames of the laser alone.
    """

    level: Float32
    variance: Float32
    region: Byte
    distance_mm: Float32
    azimuth_rad: Float32
    irradiance: Float32 | None = None

    def brighter(self, factor: float | Float32, noise: CameraNoise) -> TwinFrame:
        """Return the frame with its light multiplied by a factor, or by a window's transmission (H, W)."""
        scale = np.full((1, 1), factor, np.float32) if isinstance(factor, float) else factor
        white = np.float32(noise.full_scale)
        level, variance = _brighter(self.level, self.variance, scale, white, *noise.polynomial)
        return replace(self, level=level, variance=variance)

    def drawn_aside(self, aside: Float32 | None) -> TwinFrame:
        """Return the frame through a window that displaces lit wall by (2, H, W), px right and down."""
        if aside is None:
            return self
        v, u = np.mgrid[0 : self.level.shape[0], 0 : self.level.shape[1]].astype(np.float32)
        wall = self.region == Region.WALL
        level, variance, whole = (
            np.asarray(cv2.remap(a, u - aside[0], v - aside[1], cv2.INTER_LINEAR), np.float32)
            for a in (self.level, self.variance, wall.astype(np.float32))
        )
        # 0.999: surrounded by wall only, up to rounding.
        moved = wall & (whole > 0.999)
        return replace(
            self,
            level=np.where(moved, level, self.level),
            variance=np.where(moved, variance, self.variance),
        )


@dataclass(frozen=True)
class Renderer:
    """Renders a scene in the light of a photometric state; what all frames share is computed once."""

    scene: Scene
    state: PhotometricState

    @cached_property
    def _white_wall(self) -> Float32:
        """Grey levels (H, W) of white wall in uniform light."""
        assert self.state.lamp is not None
        return self.state.lamp.factor(*self.scene.polar[:2])

    @cached_property
    def _sharp(self) -> Float32:
        """Half of the difference (H, W) of blur variances between frames and photo, px²."""
        return self._over_view(self.state.sharpness)

    @cached_property
    def _place_variance(self) -> Float32:
        """Variance (H, W) of the photo's place, px²."""
        return self._over_view(self.state.place_px) ** 2

    def _over_view(self, of_zone: Float) -> Float32:
        return np.interp(self.scene.polar[0], self.state.sharpness_theta, of_zone).astype(np.float32)

    def frame(self, frame: int, light: Illumination) -> TwinFrame:
        """Return the twin of a frame; exposure is interpolated between sampled frames of its light."""
        state, shape = self.state, self.state.outside.shape
        made = _Canvas.dark(shape)
        if light != Illumination.LASER and state.lamp is not None:
            self._light_wall(made, frame)
        if light != Illumination.LED and state.line is not None:
            self._draw_line(made, frame)
        if light == Illumination.BOTH and state.line is None:
            near = self.scene.line(self.scene.pose(frame))
            made.region[near.row, near.column] = Region.UNSEEN
        white = np.float32(state.noise.full_scale)
        _finish(
            made.level, made.variance, made.region, state.outside, state.edge, white, *state.noise.polynomial
        )
        place = made.distance_mm, made.azimuth_rad
        return TwinFrame(made.level, made.variance, made.region, *place, made.irradiance)

    def _light_wall(self, made: _Canvas, frame: int) -> None:
        """Add lit wall to a dark frame."""
        assert self.state.lamp is not None
        sight = self.scene.lit(self.scene.pose(frame))
        exposure = np.float32(np.exp(self.state.lamp.gain.at(frame)))
        even = _lit(self._white_wall, sight.reflectance, sight.irradiance, exposure,
                    np.float32(self.state.power - 1), made.region)  # fmt: skip
        _sharpened(even, made.region, self._sharp, self._place_variance, made.level, made.variance)
        made.distance_mm, made.azimuth_rad = sight.distance_mm, sight.azimuth_rad
        made.irradiance = sight.irradiance

    def _draw_line(self, made: _Canvas, frame: int) -> None:
        """Add the laser line to a frame."""
        assert self.state.line is not None
        near, light = self.scene.line(self.scene.pose(frame)), self.state.line
        power = light.course.at(frame)
        (line, _), (_, width) = light.line_and_slope(near, power), light.peak(near)
        known = np.isfinite(line)
        away = np.abs(near.offset_px) / width
        at = near.row, near.column
        flank = known & (away < light.profile_x[-1])
        kind = np.where(away < _CORE_WIDTHS, Region.LINE_CORE, Region.LINE_FLANK)
        made.region[at] = np.where(flank, kind, np.where(known, made.region[at], Region.UNSEEN))
        made.level[at] += np.nan_to_num(line)
        made.variance[at] += np.nan_to_num(light.variance(near, power))
        made.distance_mm[at], made.azimuth_rad[at] = near.distance_mm, near.azimuth_rad


@dataclass
class _Canvas:
    """A frame while it is rendered, each (H, W); ``variance`` is in addition to the camera's noise."""

    level: Float32
    variance: Float32
    region: Byte
    distance_mm: Float32
    azimuth_rad: Float32
    irradiance: Float32 | None = None

    @staticmethod
    def dark(shape: tuple[int, ...]) -> _Canvas:
        """Return a frame in which nothing is lit."""
        nowhere = [np.full(shape, np.nan, np.float32) for _ in range(2)]
        level, variance = (np.zeros(shape, np.float32) for _ in range(2))
        return _Canvas(level, variance, np.full(shape, Region.DARK, np.uint8), *nowhere)


_UNSEEN, _WALL, _DARK, _EDGE = (int(r) for r in (Region.UNSEEN, Region.WALL, Region.DARK, Region.EDGE))


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _lit(white, reflectance, irradiance, exposure, power, region):  # type: ignore[no-untyped-def]
    """Return the grey levels (H, W) of lit wall, 0 where it is unknown; writes ``region``."""
    out = np.zeros_like(white)
    for i in range(white.shape[0]):
        for j in range(white.shape[1]):
            level = white[i, j] * reflectance[i, j] * irradiance[i, j] * exposure
            if power != 0:
                level *= (reflectance[i, j] / np.float32(_MIDDLE_GREY)) ** power
            if np.isnan(level):
                region[i, j] = _UNSEEN
                continue
            region[i, j] = _WALL if level > _DARK_LEVEL else _DARK
            out[i, j] = level
    return out


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _sharpened(even, region, sharp, place, level, variance):  # type: ignore[no-untyped-def]
    """Write levels blurred by ``sharp``, px², and the variance from a photo displaced by ``place``, px²."""
    rows, columns = even.shape
    for i in range(rows):
        for j in range(columns):
            here = even[i, j]
            level[i, j] = here
            if i == 0 or j == 0 or i == rows - 1 or j == columns - 1:
                continue
            whole = True
            for k in range(-1, 2):
                for m in range(-1, 2):
                    whole &= region[i + k, j + m] != _UNSEEN
            if not whole:
                continue
            up, down, left, right = even[i - 1, j], even[i + 1, j], even[i, j - 1], even[i, j + 1]
            variance[i, j] = place[i, j] * ((down - up) ** 2 + (right - left) ** 2) / 4
            level[i, j] = here + sharp[i, j] * (up + down + left + right - 4 * here)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _finish(level, variance, region, outside, edge, white, dark, shot, square):  # type: ignore[no-untyped-def]
    """Clear what is outside the view, add the camera's noise, and clip; all (H, W), in place."""
    for i in range(level.shape[0]):
        for j in range(level.shape[1]):
            if outside[i, j]:
                region[i, j], level[i, j] = _DARK, 0.0
            if edge[i, j] and region[i, j] != _UNSEEN:
                region[i, j] = _EDGE
            bright = max(level[i, j], 0.0)
            variance[i, j] += dark + bright * (shot + bright * square)
            level[i, j] = min(level[i, j], white)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _brighter(level, variance, factor, white, dark, shot, square):  # type: ignore[no-untyped-def]
    """Return level and variance (H, W) after multiplying the light by factors (H, W) or (1, 1)."""
    out, spread, one = np.empty_like(level), np.empty_like(level), factor.shape == (1, 1)
    scale = factor[0, 0]
    for i in range(level.shape[0]):
        for j in range(level.shape[1]):
            if not one:
                scale = factor[i, j]
            before = max(level[i, j], 0.0)
            beyond = scale * scale * (variance[i, j] - dark - before * (shot + before * square))
            made = min(scale * level[i, j], white)
            bright = max(made, 0.0)
            out[i, j] = made
            spread[i, j] = dark + bright * (shot + bright * square) + beyond
    return out, spread
