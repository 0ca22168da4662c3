"""The photo of the wall, blurred as each viewing angle sees it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numba
import numpy as np

from pipeline.arrays import Float, Float32
from pipeline.artefacts.measured import WallTexture
from pipeline.instrument.probe import Probe
from stages.texture.grid import footprint_mm

LUMA_BGR = np.array([0.114, 0.587, 0.299])
"""Weights of blue, green and red in the grey of a video (ITU-R BT.601)."""
_LEVELS = 8
_KNOWN = 0.98
"""A blurred pixel is known if at least this share of its neighbourhood was photographed: less would mix in
black."""


@dataclass(frozen=True)
class Reflectance:
    """The photo's grey at several viewing angles, and its colours at the ring.

    Attributes
    ----------
    levels : (L, H, W) float32
        Reflectance × 255, blurred as pixels at the polar angles ``theta_rad`` see it; NaN where unknown.
    theta_rad : (L,)
        Ascending, uniform.
    colours : (3, H, W) float32
        Reflectance × 255 in blue, green and red.
    distance_from_mm, mm_per_px, azimuth_from_rad, rad_per_px : float
        As in `WallTexture`.
    """

    levels: Float32
    theta_rad: Float
    colours: Float32
    distance_from_mm: float
    mm_per_px: float
    azimuth_from_rad: float
    rad_per_px: float

    def level_of(self, theta_rad: Float32) -> Float32:
        """Return the fractional index of the level at which polar angles (H, W) are seen."""
        first, step = float(self.theta_rad[0]), float(self.theta_rad[1] - self.theta_rad[0])
        level = np.clip((theta_rad - first) / step, 0, len(self.theta_rad) - 1)
        return np.asarray(level, np.float32)

    def seen(self, nodes: Float32, step_px: int, phi_rad: Float32, level: Float32) -> Float32:
        """Return what pixels see, interpolated between nodes.

        Parameters
        ----------
        nodes : (3, h, w)
            At every ``step_px``-th pixel: distance on the wall, mm, azimuth relative to the pixel's own, rad,
            and irradiance; NaN where no wall is seen.
        phi_rad, level : (H, W)
            The pixels' own image azimuth, and the photo's level.

        Returns
        -------
        (4, H, W)
            Grey of the photo, irradiance, distance, mm, and azimuth, rad.
        """
        out = np.empty((4, *level.shape), np.float32)
        _see(self.levels, nodes, step_px, phi_rad, level, self._place, out)
        return out

    def coloured(self, distance_mm: Float32, azimuth_rad: Float32) -> Float32:
        """Return blue, green and red (3, N) at wall places (N,), mm and rad."""
        out = np.empty((len(self.colours), len(distance_mm)), np.float32)
        _sample(self.colours, distance_mm, azimuth_rad, self._place, out)
        return out

    @property
    def _place(self) -> Float32:
        """Offsets and factors that convert distance and azimuth to rows and columns."""
        along, around = (
            (self.distance_from_mm, 1 / self.mm_per_px),
            (self.azimuth_from_rad, 1 / self.rad_per_px),
        )
        return np.array([*along, *around], np.float32)


def reflectance_of(texture: WallTexture, probe: Probe, radius_mm: float, blur_px: float) -> Reflectance:
    """Return the photo prepared for rendering.

    The photo is as sharp as a frame at the laser ring. Farther ahead a pixel covers more wall: there the
    photo is blurred by the wider footprint and the lens (``blur_px``) as far as they exceed its own blur.

    Parameters
    ----------
    texture
    probe
        Its camera gives the footprint of a pixel.
    radius_mm
        Mean radius of the wall.
    blur_px
        1 σ of lens and pixel together, px.
    """
    ring = float(np.arctan2(radius_mm, probe.laser.baseline_mm))
    theta = np.linspace(0.3 * ring, ring, _LEVELS)
    px_mm = footprint_mm(probe, radius_mm)
    known = (texture.bgra[..., 3] > 0).astype(np.float32)
    grey = (texture.bgra[..., :3] @ LUMA_BGR).astype(np.float32)
    levels = np.stack([
        _blurred(grey, known, *_extra_blur(probe, radius_mm, float(t), px_mm, blur_px, texture))
        for t in theta
    ])  # fmt: skip
    colours = np.where(known > 0, np.moveaxis(texture.bgra[..., :3], -1, 0), np.float32(np.nan))
    return Reflectance(
        levels, theta, colours, texture.distance_from_mm, texture.mm_per_px, texture.azimuth_from_rad,
        texture.rad_per_px,
    )  # fmt: skip


def _extra_blur(
    probe: Probe, radius_mm: float, theta: float, px_mm: float, blur_px: float, texture: WallTexture
) -> tuple[float, float]:
    """Return the additional blur, 1 σ in px of the photo along and around, of a view at ``theta``, rad."""
    point = radius_mm * np.array([1.0, 0.0, 1 / np.tan(theta)])
    by_point = probe.camera.project_jacobian(point).by_point
    along = 1 / max(float(np.linalg.norm(by_point[:, 2])), 1e-9)
    around = 1 / max(float(np.linalg.norm(by_point[:, 1])), 1e-9)
    own = blur_px * px_mm
    extra = [np.sqrt(max((blur_px * mm) ** 2 - own**2, 0.0)) / texture.mm_per_px for mm in (along, around)]
    return float(extra[0]), float(extra[1])


def _blurred(grey: Float32, known: Float32, along_px: float, around_px: float) -> Float32:
    """Return the blurred photo, periodic around the pipe; NaN where too little was photographed."""
    # A blur below 0.2 px changes no pixel by more than one grey level.
    if max(along_px, around_px) < 0.2:
        return np.where(known > 0, grey, np.float32(np.nan))
    margin = int(4 * around_px) + 1
    wide = [np.pad(a, ((0, 0), (margin, margin)), mode="wrap") for a in (grey * known, known)]
    around, along, border = max(around_px, 0.01), max(along_px, 0.01), cv2.BORDER_CONSTANT
    total, weight = (
        cv2.GaussianBlur(a, (0, 0), around, sigmaY=along, borderType=border)[:, margin:-margin] for a in wide
    )
    return np.where(weight > _KNOWN, total / np.maximum(weight, 1e-6), np.float32(np.nan)).astype(np.float32)


_FAST = {"contract", "reassoc"}


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST, inline="always")
def _cell(place, distance, azimuth, rows, columns):  # type: ignore[no-untyped-def]
    """Return row, column, next column and the fractions beyond them at a place; row −1 outside the photo."""
    row = (distance - place[0]) * place[1]
    if not (0.0 <= row <= rows - 1):
        return -1, 0, 0, np.float32(0), np.float32(0)
    i = min(int(row), rows - 2)
    column, all_round = (azimuth - place[2]) * place[3], np.float32(columns)
    column -= np.floor(column / all_round) * all_round
    j = min(int(column), columns - 1)
    return i, j, j + 1 if j + 1 < columns else 0, np.float32(row - i), np.float32(column - j)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST, inline="always")
def _between(a, i, j, k, u, v):  # type: ignore[no-untyped-def]
    """Return a map's value between rows i, i + 1 and columns j, k."""
    one = np.float32(1)
    return (one - u) * ((one - v) * a[i, j] + v * a[i, k]) + u * ((one - v) * a[i + 1, j] + v * a[i + 1, k])


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)
def _sample(maps, distance, azimuth, place, out):  # type: ignore[no-untyped-def]
    """Write the values of maps (C, H, W) at places (N,) to ``out`` (C, N)."""
    count, rows, columns = maps.shape
    for n in range(len(distance)):
        i, j, k, u, v = _cell(place, distance[n], azimuth[n], rows, columns)
        for c in range(count):
            out[c, n] = _between(maps[c], i, j, k, u, v) if i >= 0 else np.nan


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)
def _see(levels, nodes, step, phi, level, place, out):  # type: ignore[no-untyped-def]
    """Write photo, irradiance, distance and azimuth (4, H, W) of pixels; see `Reflectance.seen`."""
    count, rows, columns = levels.shape
    far, turn, light = nodes[0], nodes[1], nodes[2]
    grey, lit, distances, azimuths = out[0], out[1], out[2], out[3]
    down, below = _nodes_beside(grey.shape[0], far.shape[0], step)
    right, beyond = _nodes_beside(grey.shape[1], far.shape[1], step)
    for y in range(grey.shape[0]):
        i, u = down[y], below[y]
        for x in range(grey.shape[1]):
            j, v = right[x], beyond[x]
            distance = _between(far, i, j, j + 1, u, v)
            grey[y, x], lit[y, x], distances[y, x], azimuths[y, x] = np.nan, np.nan, distance, np.nan
            if np.isnan(distance):
                continue
            azimuth = phi[y, x] + _between(turn, i, j, j + 1, u, v)
            lit[y, x], azimuths[y, x] = _between(light, i, j, j + 1, u, v), azimuth
            r, c, d, p, q = _cell(place, distance, azimuth, rows, columns)
            if r < 0:
                continue
            low = min(int(level[y, x]), max(count - 2, 0))
            w = np.float32(level[y, x] - low)
            value = _between(levels[low], r, c, d, p, q)
            if w > 0:
                value += w * (_between(levels[low + 1], r, c, d, p, q) - value)
            grey[y, x] = value


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _nodes_beside(pixels, nodes, step):  # type: ignore[no-untyped-def]
    """Return the node before each pixel along a side, and the pixel's fraction of the way to the next one."""
    first, share = np.empty(pixels, np.int64), np.empty(pixels, np.float32)
    for x in range(pixels):
        at = min(max((x + 0.5) / step - 0.5, 0.0), nodes - 1.0)
        first[x] = min(int(at), nodes - 2)
        share[x] = at - first[x]
    return first, share
