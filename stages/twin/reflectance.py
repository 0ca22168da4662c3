"""The wall's photo as the reflectance that a frame is rendered from, blurred as each viewing angle needs."""

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
"""Shares of blue, green and red in the grey of a video (ITU-R BT.601)."""
_LEVELS = 8
_KNOWN = 0.98
"""A place counts as photographed where so much of what is blurred into it was: less would mix in black."""


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
        As `WallTexture` has them.
    """

    levels: Float32
    theta_rad: Float
    colours: Float32
    distance_from_mm: float
    mm_per_px: float
    azimuth_from_rad: float
    rad_per_px: float

    def grey(self, distance_mm: Float32, azimuth_rad: Float32, theta_rad: Float32) -> Float32:
        """Return the grey (H, W) of wall places seen at polar angles, all (H, W)."""
        first, step = float(self.theta_rad[0]), float(self.theta_rad[1] - self.theta_rad[0])
        level = np.clip((theta_rad - first) / step, 0, len(self.theta_rad) - 1).astype(np.float32)
        return self._sampled(self.levels, distance_mm, azimuth_rad, level)

    def coloured(self, distance_mm: Float32, azimuth_rad: Float32) -> Float32:
        """Return blue, green and red (3, ...) of wall places (...)."""
        of = [
            self._sampled(c[None], distance_mm, azimuth_rad, np.zeros_like(distance_mm)) for c in self.colours
        ]
        return np.stack(of)

    def _sampled(
        self, levels: Float32, distance_mm: Float32, azimuth_rad: Float32, level: Float32
    ) -> Float32:
        out = np.full(distance_mm.shape, np.nan, np.float32)
        _sample(
            levels, distance_mm.ravel(), azimuth_rad.ravel(), level.ravel(),
            np.float32(self.distance_from_mm), np.float32(1 / self.mm_per_px),
            np.float32(self.azimuth_from_rad), np.float32(1 / self.rad_per_px), out.ravel(),
        )  # fmt: skip
        return out


def reflectance_of(texture: WallTexture, probe: Probe, radius_mm: float, blur_px: float) -> Reflectance:
    """Return the photo prepared for rendering.

    The photo is as sharp as a frame at the laser ring. Farther ahead a pixel covers more wall: there the
    photo is blurred by what the pixel's wider footprint and the lens (``blur_px``, 1 σ) ask beyond that.

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
    """Return the blur, 1 σ in px of the photo along and around, that a view at ``theta`` needs beyond it."""
    point = radius_mm * np.array([1.0, 0.0, 1 / np.tan(theta)])
    by_point = probe.camera.project_jacobian(point).by_point
    along = 1 / max(float(np.linalg.norm(by_point[:, 2])), 1e-9)
    around = 1 / max(float(np.linalg.norm(by_point[:, 1])), 1e-9)
    own = blur_px * px_mm
    extra = [np.sqrt(max((blur_px * mm) ** 2 - own**2, 0.0)) / texture.mm_per_px for mm in (along, around)]
    return float(extra[0]), float(extra[1])


def _blurred(grey: Float32, known: Float32, along_px: float, around_px: float) -> Float32:
    """Return the photo blurred about the pipe, NaN where too little was photographed."""
    if max(along_px, around_px) < 0.2:
        return np.where(known > 0, grey, np.float32(np.nan))
    margin = int(4 * around_px) + 1
    wide = [np.pad(a, ((0, 0), (margin, margin)), mode="wrap") for a in (grey * known, known)]
    around, along, border = max(around_px, 0.01), max(along_px, 0.01), cv2.BORDER_CONSTANT
    total, weight = (
        cv2.GaussianBlur(a, (0, 0), around, sigmaY=along, borderType=border)[:, margin:-margin] for a in wide
    )
    return np.where(weight > _KNOWN, total / np.maximum(weight, 1e-6), np.float32(np.nan)).astype(np.float32)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"})
def _sample(  # type: ignore[no-untyped-def]
    levels, distance, azimuth, level, s_from, s_scale, psi_from, psi_scale, out
):
    """Write what the levels show at places (N,); bilinear on the wall, linear between levels."""
    count, rows, columns = levels.shape
    for n in range(len(distance)):
        row = (distance[n] - s_from) * s_scale
        if not (0.0 <= row <= rows - 1):
            continue
        i = min(int(row), rows - 2)
        column = (azimuth[n] - psi_from) * psi_scale
        column -= np.floor(column / columns) * columns
        j = min(int(column), columns - 1)
        k = j + 1 if j + 1 < columns else 0
        u, v = row - i, column - j
        low = min(int(level[n]), max(count - 2, 0))
        w = level[n] - low
        a = levels[low]
        value = (1 - u) * ((1 - v) * a[i, j] + v * a[i, k]) + u * ((1 - v) * a[i + 1, j] + v * a[i + 1, k])
        if w > 0:
            b = levels[low + 1]
            far = (1 - u) * ((1 - v) * b[i, j] + v * b[i, k]) + u * ((1 - v) * b[i + 1, j] + v * b[i + 1, k])
            value += w * (far - value)
        out[n] = value
