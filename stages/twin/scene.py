"""The scene of a run: what each pixel of a frame sees, before any light is added."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.measured import Trajectory, Wall, WallTexture
from pipeline.artefacts.twin import Look
from pipeline.geometry.rigid import inverse, transform
from pipeline.instrument.probe import Probe
from stages.texture.surface import WallSurface, wall_surface
from stages.texture.views import sheet_distance_mm
from stages.twin.leds import even_light
from stages.twin.rays import wall_seen
from stages.twin.reflectance import Reflectance, reflectance_of

_STEP_PX = 4
"""Spacing, px, of the nodes whose rays are intersected with the wall; between them places are
interpolated."""
_FEW = 17
"""Every 17th node suffices to measure how the image is turned on average; there are thousands of nodes."""
_BAND_PX = 14.0
"""Half width, px, of the band about the line that is rendered pixel by pixel: four line widths plus the
variation of the ring's radius between nodes."""
_ASIDE = 0.15
"""A ray is followed if it meets the sheet at most this share of the radius away from any wall: the band and
the bends of the axis within a baseline fit in."""
SMOOTHING_MM, SHADING_MM = 0.2, 0.4
"""1 σ of the smoothing of radii and of slopes: the defaults of the stage texture, whose photo is used."""


@dataclass(frozen=True)
class LitSight:
    """What the pixels of a lit frame see, all (H, W) float32; NaN where the wall is unknown.

    Attributes
    ----------
    reflectance
        Grey of the wall's photo, × 255.
    irradiance
        By lamps that emit uniformly, relative to that at the ring of a centred probe.
    distance_mm, azimuth_rad
        Place on the wall.
    """

    reflectance: Float32
    irradiance: Float32
    distance_mm: Float32
    azimuth_rad: Float32


@dataclass(frozen=True)
class LineSight:
    """The pixels near the laser line of a frame, (N,) each.

    Attributes
    ----------
    row, column : int
    offset_px
        Distance from the sheet's middle across the line, px, positive away from the camera.
    mm_per_px
        Millimetres of the sheet's coordinate per pixel across the line.
    reflectance : (3, N)
        Blue, green and red of the wall where the sheet meets it next to the pixel, × 255, times mean radius
        over distance from the laser's axis.
    theta_rad, phi_rad
        Polar angle and image azimuth of the pixel.
    distance_mm, azimuth_rad
        Place on the wall.
    """

    row: Int
    column: Int
    offset_px: Float32
    mm_per_px: Float32
    reflectance: Float32
    theta_rad: Float32
    phi_rad: Float32
    distance_mm: Float32
    azimuth_rad: Float32


@dataclass(frozen=True)
class Ring:
    """Image of the laser line: middle and radius, px; and the line's wall radius and distance ahead, mm."""

    centre_px: tuple[float, float]
    radius_px: float
    radius_mm: float
    ahead_mm: float

    def at(self, frame: float, azimuth_rad: float) -> Look:
        """Return a view of the ring at an image azimuth in a frame."""
        u, v = self.centre_px
        away = self.radius_px
        return Look(int(frame), u + away * np.cos(azimuth_rad), v + away * np.sin(azimuth_rad), away / 4)

    def whole(self, frame: float) -> Look:
        """Return a view of the whole picture about the ring in a frame."""
        return Look(int(frame), *self.centre_px, 1.5 * self.radius_px)


@dataclass(frozen=True)
class Scene:
    """Wall, probe and poses of a run.

    Attributes
    ----------
    probe : Probe
        As corrected by the run's motion.
    surface : WallSurface
    reflectance : Reflectance
    trajectory : Trajectory
    outside : (H, W) bool, optional
        Pixels that no frame shows; their rays are not followed.
    """

    probe: Probe
    surface: WallSurface
    reflectance: Reflectance
    trajectory: Trajectory
    outside: Bool | None = None

    def pose(self, frame: int) -> Float:
        """Return T_pc (4, 4) of a frame."""
        return np.asarray(self.trajectory.T_pc[int(np.searchsorted(self.trajectory.frame, frame))])

    @cached_property
    def polar(self) -> tuple[Float32, Float32, Bool]:
        """Polar angle, image azimuth and validity of every pixel, each (H, W)."""
        nodes = self._all_rays
        theta = np.arctan2(np.hypot(nodes[..., 0], nodes[..., 1]), nodes[..., 2])
        width, height = self.probe.camera.image_size
        centre = self.probe.camera.centre_px
        v, u = np.mgrid[0:height, 0:width].astype(np.float32)
        phi = np.arctan2(v - np.float32(centre[1]), u - np.float32(centre[0]))
        full = self._enlarged(theta)
        return full, phi, np.isfinite(full)

    @cached_property
    def ring(self) -> Ring:
        """The laser line as a centred probe would see it."""
        camera, radius, ahead = self.probe.camera, self.surface.mean_radius_mm, self.probe.laser.baseline_mm
        u, v = camera.centre_px
        at = camera.project(np.array([radius, 0.0, ahead])).uv
        return Ring((float(u), float(v)), float(np.hypot(at[0] - u, at[1] - v)), radius, ahead)

    @cached_property
    def _all_rays(self) -> Float:
        width, height = self.probe.camera.image_size
        u, v = (np.arange(-(-n // _STEP_PX)) * _STEP_PX + (_STEP_PX - 1) / 2 for n in (width, height))
        rays = self.probe.camera.unproject(np.stack(np.meshgrid(u, v), -1))
        return np.where(rays.valid[..., None], rays.ray, np.nan)

    @cached_property
    def _rays(self) -> Float:
        """Rays (h, w, 3) of nodes that see wall, and of those just outside the view for interpolation."""
        if self.outside is None:
            return self._all_rays
        far = cv2.erode(self.outside.astype(np.uint8), np.ones((4 * _STEP_PX + 1,) * 2, np.uint8)) > 0
        # The last node of a side may lie outside the image.
        row, column = (
            np.minimum(np.arange(n) * _STEP_PX + _STEP_PX // 2, side - 1)
            for n, side in zip(self._all_rays.shape[:2], far.shape, strict=True)
        )
        hidden = far[np.ix_(row, column)]
        return np.where(hidden[..., None], np.nan, self._all_rays)

    @cached_property
    def _phi_nodes(self) -> Float:
        return np.arctan2(self._rays[..., 1], self._rays[..., 0])

    def lit(self, T_pc: Float) -> LitSight:
        """Return what a frame with LEDs on sees from a pose T_pc (4, 4)."""
        seen = wall_seen(self.surface, T_pc, self._rays.reshape(-1, 3))
        light = even_light(self.probe.lighting, seen.xyz_c, seen.normal_c) / self._reference
        turn = seen.azimuth_rad - self._phi_nodes.ravel()
        middle = _circular_middle(turn[::_FEW])
        turn = np.mod(turn - middle + np.pi, 2 * np.pi) - np.pi + middle
        nodes = np.stack([seen.distance_mm, turn, light]).astype(np.float32)
        nodes = nodes.reshape(3, *self._rays.shape[:2])
        return LitSight(*self.reflectance.seen(nodes, _STEP_PX, self.polar[1], self._level))

    @cached_property
    def _level(self) -> Float32:
        return self.reflectance.level_of(self.polar[0])

    def seen_again(self, T_pc: Float, next_T_pc: Float) -> tuple[Float32, Float32]:
        """Return column and row (H, W), px, at which the next frame shows the wall that each pixel sees."""
        seen = wall_seen(self.surface, T_pc, self._rays.reshape(-1, 3))
        at = self.probe.camera.project(transform(inverse(next_T_pc) @ T_pc, seen.xyz_c))
        uv = np.where((at.valid & seen.seen)[:, None], at.uv, -1e6).reshape(*self._rays.shape[:2], 2)
        return self._enlarged(uv[..., 0]), self._enlarged(uv[..., 1])

    def line(self, T_pc: Float) -> LineSight:
        """Return the pixels near the laser line of a frame from a pose T_pc (4, 4)."""
        row, column = self._near_line(T_pc)
        uv = np.stack([column, row], -1).astype(float)
        rays = self.probe.camera.unproject(uv).ray
        seen = wall_seen(self.surface, T_pc, rays)
        offset = sheet_distance_mm(self.probe.laser, seen.xyz_c)
        width, height = self.probe.camera.image_size
        dense = np.full((height + 2, width + 2), np.nan, np.float32)
        dense[row + 1, column + 1] = offset
        down, right = dense[row + 2, column + 1] - dense[row, column + 1], dense[row + 1, column + 2]
        slope = np.hypot(down, right - dense[row + 1, column]) / 2
        keep = np.isfinite(slope) & (slope > 0)
        row, column, offset, slope = row[keep], column[keep], offset[keep], slope[keep]
        distance, azimuth = seen.distance_mm[keep], seen.azimuth_rad[keep]
        theta = np.arctan2(np.hypot(rays[keep, 0], rays[keep, 1]), rays[keep, 2])
        phi = np.arctan2(rays[keep, 1], rays[keep, 0])
        reflectance = self.reflectance.coloured((distance - offset).astype(np.float32), azimuth)
        # The sheet's light spreads over a circle whose circumference grows with the distance from the laser's
        # axis.
        reflectance *= (self.surface.mean_radius_mm / np.hypot(*seen.xyz_c[keep, :2].T)).astype(np.float32)
        return LineSight(
            row, column, (offset / slope).astype(np.float32), slope.astype(np.float32), reflectance,
            theta.astype(np.float32), phi.astype(np.float32), distance, azimuth,
        )  # fmt: skip

    def _near_line(self, T_pc: Float) -> tuple[Int, Int]:
        """Return rows and columns of pixels within a band about the line, which is found on the nodes."""
        seen = wall_seen(self.surface, T_pc, self._rays_to_sheet(T_pc))
        offset = sheet_distance_mm(self.probe.laser, seen.xyz_c).reshape(self._rays.shape[:2])
        slope = np.hypot(*np.gradient(offset)) / _STEP_PX
        near = np.abs(offset) < _BAND_PX * np.maximum(slope, 1e-6)
        width, height = self.probe.camera.image_size
        row, column = np.nonzero(near)
        inner = np.arange(_STEP_PX)
        rows = _STEP_PX * row[:, None, None] + inner[:, None] + 0 * inner
        columns = _STEP_PX * column[:, None, None] + inner + 0 * inner[:, None]
        inside = (rows < height) & (columns < width)
        return rows[inside], columns[inside]

    def _rays_to_sheet(self, T_pc: Float) -> Float:
        """Return the rays (N, 3) of the nodes; NaN where they meet the sheet far from any wall."""
        axis, on_sheet = self.surface.axis, transform(T_pc, self._on_sheet)
        at = int(np.argmin(np.abs(axis.distance_mm - float(np.nanmedian(on_sheet[:, 2])))))
        away = np.hypot(*((on_sheet - axis.origin_p[at]) @ axis.R_pa[at][:, :2]).T)
        least, most = float(self.surface.radius_mm.min()), float(self.surface.radius_mm.max())
        near = (away > (1 - _ASIDE) * least) & (away < (1 + _ASIDE) * most)
        return np.where(near[:, None], self._rays.reshape(-1, 3), np.nan)

    @cached_property
    def _on_sheet(self) -> Float:
        """Points (N, 3) in C, mm, where the rays of the nodes meet the laser sheet; NaN where they do not."""
        rays = self._rays.reshape(-1, 3)
        met = np.full(rays.shape, np.nan)
        known = np.isfinite(rays[:, 0])
        met[known] = self.probe.laser.intersect(rays[known])
        return met

    @cached_property
    def _reference(self) -> float:
        """Irradiance, 1/mm², at the ring of a centred probe."""
        point = np.array([self.surface.mean_radius_mm, 0.0, self.probe.laser.baseline_mm])
        return float(even_light(self.probe.lighting, point, np.array([-1.0, 0.0, 0.0])))

    def _enlarged(self, nodes: Float | Float32) -> Float32:
        """Return node values (h, w) at all pixels (H, W), interpolated linearly."""
        width, height = self.probe.camera.image_size
        big = cv2.resize(nodes.astype(np.float32), None, fx=_STEP_PX, fy=_STEP_PX)
        return np.asarray(big[:height, :width], np.float32)


def scene_of(probe: Probe, trajectory: Trajectory, wall: Wall, texture: WallTexture, blur_px: float) -> Scene:
    """Return the scene of a run; ``blur_px`` is the 1 σ of lens and pixel.

    Raises
    ------
    UnusableError
        When the radius map contains hardly any radii.
    """
    found = probe.as_found_in(trajectory)
    surface = wall_surface(wall, SMOOTHING_MM, SHADING_MM)
    reflectance = reflectance_of(texture, found, surface.mean_radius_mm, blur_px)
    return Scene(found, surface, reflectance, trajectory)


def _circular_middle(angle: Float) -> float:
    """Return the mean direction of angles, ignoring NaN."""
    known = angle[np.isfinite(angle)]
    return float(np.arctan2(np.sin(known).mean(), np.cos(known).mean())) if len(known) else 0.0
