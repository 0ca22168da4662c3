"""A frame as the run and the photometric state say that the camera should have seen it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

import cv2
import numpy as np

from pipeline.arrays import Byte, Float32
from pipeline.recording.base import Illumination
from stages.twin.noise import CameraNoise
from stages.twin.scene import Scene
from stages.twin.state import PhotometricState, slope_squared

_DARK_LEVEL = 3.0
"""Grey levels above black below which lit wall counts as dark."""
_CORE_WIDTHS = 1.0


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
        Of camera noise, speckle, and the error of the photo's place.
    region : uint8
        `Region`.
    distance_mm, azimuth_rad : float32
        Place on the wall; NaN where none is known.
    """

    level: Float32
    variance: Float32
    region: Byte
    distance_mm: Float32
    azimuth_rad: Float32

    def brighter(self, factor: float | Float32, noise: CameraNoise) -> TwinFrame:
        """Return the frame with another exposure, or seen through a window that lets pass (H, W)."""
        scale = np.float32(factor) if isinstance(factor, float) else factor
        level = np.minimum(scale * self.level, np.float32(noise.white - noise.black.value))
        beyond = scale**2 * (self.variance - noise.variance(self.level))
        return replace(self, level=level, variance=noise.variance(level) + beyond)


def render_frame(
    scene: Scene, state: PhotometricState, frame: int, light: Illumination, log_exposure: float | None = None
) -> TwinFrame:
    """Return the twin of a frame.

    Parameters
    ----------
    scene, state
    frame : int
        Gives pose and, unless ``log_exposure`` is given, exposure: that of the sampled frames about it.
    light : Illumination
    log_exposure : float, optional
        Logarithm of the exposure, or of the laser's power, relative to the run's.
    """
    T_pc, shape = scene.pose(frame), state.outside.shape
    level = np.zeros(shape, np.float32)
    region = np.full(shape, Region.DARK, np.uint8)
    distance, azimuth = (np.full(shape, np.nan, np.float32) for _ in range(2))
    variance = np.zeros(shape, np.float32)
    if light != Illumination.LASER and state.lamp is not None:
        theta, phi, _ = scene.polar
        sight = scene.lit(T_pc)
        gain = state.lamp.gain.at(frame) if log_exposure is None else log_exposure
        level = (
            state.lamp.factor(theta, phi) * sight.reflectance * sight.irradiance * np.float32(np.exp(gain))
        )
        region = np.where(level > _DARK_LEVEL, Region.WALL, Region.DARK).astype(np.uint8)
        region[np.isnan(level)] = Region.UNSEEN
        level = np.nan_to_num(level)
        sharp = np.interp(theta, state.sharpness_theta, state.sharpness).astype(np.float32)
        inside = cv2.erode((region > 0).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        place = np.interp(theta, state.sharpness_theta, state.place_px).astype(np.float32)
        variance += np.where(inside, place**2 * slope_squared(level), 0)
        level += np.where(inside, sharp * cv2.Laplacian(level, cv2.CV_32F), 0)
        distance, azimuth = sight.distance_mm, sight.azimuth_rad
    if light != Illumination.LED and state.line is not None:
        near = scene.line(T_pc)
        power = state.line.course.at(frame) if log_exposure is None else log_exposure
        (line, _), (_, width) = state.line.line_and_slope(near, power), state.line.peak(near)
        known = np.isfinite(line)
        away = np.abs(near.offset_px) / width
        at = near.row, near.column
        flank = known & (away < state.line.profile_x[-1])
        kind = np.where(away < _CORE_WIDTHS, Region.LINE_CORE, Region.LINE_FLANK)
        region[at] = np.where(flank, kind, np.where(known, region[at], Region.UNSEEN))
        level[at] += np.nan_to_num(line)
        variance[at] += np.nan_to_num(state.line.variance(near, power))
        distance[at], azimuth[at] = near.distance_mm, near.azimuth_rad
    region[state.outside] = Region.DARK
    level[state.outside] = 0.0
    region[state.edge & (region != Region.UNSEEN)] = Region.EDGE
    noise = state.noise.variance(level)
    level = np.minimum(level, np.float32(state.noise.white - state.noise.black.value))
    return TwinFrame(level, noise + variance, region, distance, azimuth)
