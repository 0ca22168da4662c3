"""Viewing rays of the true camera, from a table that is computed once for each instrument."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.arrays import Float
from pipeline.simulator.instrument import TrueCamera
from pipeline.simulator.kernel import kernel
from pipeline.simulator.window import refracted

# Spacing of the table's nodes: see `ray_table` for the error of interpolating between them.
_STEP_PX = 8
# Nodes beyond the picture that the cubic interpolation needs on each side.
_MARGIN = 2
# Fixed-point steps: each reduces the error by about 6 p |m| ≤ 0.2, so that 20 reach rounding.
_DECENTRING_STEPS = 20


class RayTable(NamedTuple):
    """Rays at nodes ``step`` pixels apart, the first at (−margin · step, −margin · step).

    Attributes
    ----------
    node : (rows, columns, 6)
        Origin, mm, and unit direction in C; NaN where no ray maps.
    central : bool
        All rays come from the origin of C.
    step : float
    first : float
        Pixel coordinate of the first node, the same for u and v.
    centre_u, centre_v, locking : float
        Centre and amplitude of a pixel locking, px: see `TrueCamera.locking_px`.
    """

    node: Float
    central: bool
    step: float
    first: float
    centre_u: float
    centre_v: float
    locking: float


def ray_table(camera: TrueCamera) -> RayTable:
    """Return the table of a camera; cubic interpolation errs by less than 10⁻⁷ rad at 300 px/rad."""
    width, height = camera.model.image_size
    first = -_MARGIN * _STEP_PX
    u, v = (
        first + _STEP_PX * np.arange(-(-side // _STEP_PX) + 2 * _MARGIN + 1.0) for side in (width, height)
    )
    origin, ray = viewing_rays(camera, np.stack(np.meshgrid(u, v), -1))
    centre = camera.model.centre_px
    node = np.ascontiguousarray(np.concatenate([origin, ray], -1))
    central = camera.pupil_shift_mm == 0 and not camera.windows
    at = float(centre[0]), float(centre[1])
    return RayTable(node, central, float(_STEP_PX), float(first), *at, camera.locking_px)


def viewing_rays(camera: TrueCamera, uv: Float) -> tuple[Float, Float]:
    """Return origins, mm, and unit directions (..., 3) in C of pixels (..., 2), outside all windows.

    Pixel locking is left out: it belongs to the pixels, not to the rays.
    """
    ray = camera.model.unproject(_without_distortion(camera, np.asarray(uv, float))).ray
    theta = np.arctan2(np.hypot(ray[..., 0], ray[..., 1]), ray[..., 2])
    origin = np.zeros_like(ray)
    origin[..., 2] = camera.pupil_shift_mm * (theta / np.maximum(np.sin(theta), 1e-12) - 1)
    origin[..., 2] = np.where(theta < 1e-6, 0.0, origin[..., 2])
    return refracted(camera.windows, origin, ray)


def _without_distortion(camera: TrueCamera, uv: Float) -> Float:
    """Return the pixel at which the central model alone would show what is seen at ``uv``."""
    centre = camera.model.centre_px
    seen = centre + (uv - centre) / np.array([1 + camera.aspect / 2, 1 - camera.aspect / 2])
    if not any(camera.decentring):
        return np.asarray(seen)
    p, place = focal_px(camera) * np.array(camera.decentring), seen
    for _ in range(_DECENTRING_STEPS):
        ray = camera.model.unproject(place).ray
        across = np.hypot(ray[..., 0], ray[..., 1])
        # The angle and its azimuth are used, not the image radius, which depends on the model's distortion.
        m = ray[..., :2] * (np.arctan2(across, ray[..., 2]) / np.maximum(across, 1e-12))[..., None]
        place = seen - (np.sum(m * m, -1, keepdims=True) * p + 2 * m * np.sum(m * p, -1, keepdims=True))
    return np.asarray(place)


def focal_px(camera: TrueCamera) -> float:
    """Return pixels per radian on the axis."""
    ray = np.array([[1e-6, 0.0, 1.0], [-1e-6, 0.0, 1.0]])
    uv = camera.model.project(ray).uv
    return float(np.linalg.norm(uv[0] - uv[1]) / 2e-6)


@kernel
def ray_at(table: RayTable, u: float, v: float, out: Float) -> None:
    """Write origin and unit direction of pixel (u, v) to ``out`` (6,), by Lagrange's cubic both ways."""
    if table.locking != 0.0:
        du, dv = u - table.centre_u, v - table.centre_v
        rho = np.sqrt(du * du + dv * dv) + 1e-9
        back = table.locking * np.sin(2.0 * np.pi * rho) / rho
        u, v = u - back * du, v - back * dv
    x, y = (u - table.first) / table.step, (v - table.first) / table.step
    i = min(max(int(np.floor(y)), 1), table.node.shape[0] - 3)
    j = min(max(int(np.floor(x)), 1), table.node.shape[1] - 3)
    w, h = x - j, y - i
    w0, w1 = -w * (w - 1.0) * (w - 2.0) / 6.0, (w + 1.0) * (w - 1.0) * (w - 2.0) / 2.0
    w2, w3 = -(w + 1.0) * w * (w - 2.0) / 2.0, (w + 1.0) * w * (w - 1.0) / 6.0
    h0, h1 = -h * (h - 1.0) * (h - 2.0) / 6.0, (h + 1.0) * (h - 1.0) * (h - 2.0) / 2.0
    h2, h3 = -(h + 1.0) * h * (h - 2.0) / 2.0, (h + 1.0) * h * (h - 1.0) / 6.0
    n = table.node
    for c in range(3 if table.central else 0, 6):
        r0 = w0 * n[i - 1, j - 1, c] + w1 * n[i - 1, j, c] + w2 * n[i - 1, j + 1, c] + w3 * n[i - 1, j + 2, c]
        r1 = w0 * n[i, j - 1, c] + w1 * n[i, j, c] + w2 * n[i, j + 1, c] + w3 * n[i, j + 2, c]
        r2 = w0 * n[i + 1, j - 1, c] + w1 * n[i + 1, j, c] + w2 * n[i + 1, j + 1, c] + w3 * n[i + 1, j + 2, c]
        r3 = w0 * n[i + 2, j - 1, c] + w1 * n[i + 2, j, c] + w2 * n[i + 2, j + 1, c] + w3 * n[i + 2, j + 2, c]
        out[c] = h0 * r0 + h1 * r1 + h2 * r2 + h3 * r3
    if table.central:
        out[0], out[1], out[2] = 0.0, 0.0, 0.0
    size = 1.0 / np.sqrt(out[3] * out[3] + out[4] * out[4] + out[5] * out[5])
    out[3] *= size
    out[4] *= size
    out[5] *= size


@kernel
def part_ray_at(table: RayTable, u: int, v: int, n: int, samples: int, out: Float) -> None:
    """Write the ray through the middle of part ``n`` of a pixel cut into samples × samples: see `ray_at`."""
    x = u + (n % samples + 0.5) / samples - 0.5
    y = v + (n // samples + 0.5) / samples - 0.5
    ray_at(table, x, y, out)
