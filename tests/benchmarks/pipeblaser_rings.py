"""A real probe's rings as samples of its published model, and a cylinder fitted to them frame by frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.optimize import least_squares

from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingValidity
from pipeline.geometry.rigid import rotation_from_vector
from pipeline.instrument.camera import Camera
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from stages.diagnose.effects.base import ImagePoints
from stages.rings.mixture import excess_weights
from stages.rings.picture import Mixture
from stages.rings.sectors import cut_sectors
from stages.rings.trace import trace_ring

RED_NM = 650.0
PLANE = (-0.228405, 0.61683, -100.0, 17.1103)
PIXELS = 1.35
POSE, BINS = 4, 90


@dataclass(frozen=True)
class Rings:
    """Ring samples of all frames as pixels of the published model: frame (M,), uv (M, 2), bin (M,)."""

    frame: Int
    uv: Float
    bin: Int

    def of(self, frames: Sequence[int]) -> Rings:
        keep = np.isin(self.frame, frames)
        return Rings(self.frame[keep], self.uv[keep], self.bin[keep])


@dataclass(frozen=True)
class Fitted:
    """Residuals (M,) in mm at the best poses and radius, weights, and derivatives by those (M, N)."""

    points: ImagePoints
    residual: Float
    mm_per_px: Float
    weight: Float
    own: Float
    state: Float

    @property
    def radius_mm(self) -> float:
        return float(self.state[-1])

    @property
    def residual_px(self) -> Float:
        return self.residual / self.mm_per_px


def rings_of(folder: Path) -> Rings:
    frame, uv, place = [], [], []
    for k, file in enumerate(sorted(folder.glob("*.png"))):
        image = cv2.imread(str(file))
        assert image is not None
        image[:, -2:] = 0
        size = (image.shape[1], image.shape[0])
        sectors = cut_sectors(size, (0.445 * size[0], 0.524 * size[1]), 1440)
        trace = trace_ring(Mixture(image, excess_weights(RED_NM)), sectors, 255.0)
        assert trace is not None, file.name
        radius = np.where(trace.validity == RingValidity.VALID, trace.fit.radius_px, np.nan)
        condensed = np.nanmedian(radius.reshape(BINS, -1), axis=1)
        seen = np.isfinite(radius.reshape(BINS, -1)).sum(1) >= 4
        psi = sectors.azimuth_rad.reshape(BINS, -1).mean(1)
        here = sectors.centre_px + condensed[:, None] * np.stack([np.cos(psi), np.sin(psi)], -1)
        frame.append(np.full(int(seen.sum()), k))
        uv.append((here[seen] + 0.5) * PIXELS - 0.5)
        place.append(np.flatnonzero(seen))
    return Rings(np.concatenate(frame), np.concatenate(uv), np.concatenate(place))


def probe_of(camera: Camera) -> Probe:
    a, b, c, d = PLANE
    laser = LaserSheet(-1000 * d / c, tilt_x=-a / c, tilt_y=-b / c, line_sigma_mm=1.0, wavelength_nm=RED_NM)
    size = len(camera.parameter_names) + len(LaserSheet.PARAMETER_NAMES)
    return Probe(camera, laser, np.zeros((size, size)))


def fitted(rings: Rings, probe: Probe, shift_px: Float | None = None, start: Float | None = None) -> Fitted:
    """Fit a cylinder to the rings of all frames, with position and lean for each, by Gauss-Newton."""
    away = rings.uv - probe.camera.centre_px
    outward = away / np.linalg.norm(away, axis=1)[:, None]
    uv = rings.uv if shift_px is None else rings.uv - np.nan_to_num(shift_px)[:, None] * outward
    xyz = probe.triangulate(uv)
    seen = np.isfinite(xyz).all(1)
    xyz = np.where(seen[:, None], xyz, [1e3, 0.0, 1e3])
    frames, row = np.unique(rings.frame, return_inverse=True)
    state = _start(xyz, row, len(frames)) if start is None else start
    solved = least_squares(
        lambda x: np.where(seen, _cylinder(xyz, row, x, len(frames))[0], 0.0), state, loss="cauchy",
        jac=lambda x: np.where(seen[:, None], _cylinder(xyz, row, x, len(frames))[1], 0.0),
        f_scale=2.5, x_scale=np.r_[np.tile([10.0, 10.0, 0.05, 0.05], len(frames)), 10.0], max_nfev=60,
    )  # fmt: skip
    state = solved.x
    residual, own, normal, axis = _cylinder(xyz, row, state, len(frames))
    weight = seen / (1 + (residual / 2.5) ** 2)
    by_pixel = probe.triangulate_jacobian(uv)[0]
    mm_per_px = np.einsum("mi,mij,mj->m", normal, by_pixel, outward)
    none = np.zeros(len(uv))
    points = ImagePoints(
        probe, rings.frame, none, uv, xyz, normal, axis, np.zeros((len(uv), 2)), none, True,
        np.full(len(uv), 2.0),
    )  # fmt: skip
    return Fitted(points, residual, mm_per_px, weight, own, state)


def _start(xyz: Float, row: Int, frames: int) -> Float:
    """Return each frame's circle in the plane of the sheet as the start, no lean, and the median radius."""
    state, radius = np.zeros((frames, POSE)), np.zeros(frames)
    for k in range(frames):
        xy = xyz[(row == k) & np.isfinite(xyz).all(1), :2]
        *centre, rest = np.linalg.lstsq(np.c_[2 * xy, np.ones(len(xy))], (xy**2).sum(1), rcond=None)[0]
        state[k, :2], radius[k] = centre, np.sqrt(rest + np.sum(np.square(centre)))
    return np.append(state.ravel(), np.median(radius))


def _cylinder(xyz: Float, row: Int, state: Float, frames: int) -> tuple[Float, Float, Float, Float]:
    pose = state[:-1].reshape(frames, POSE)[row]
    residual, normal, axis = _gap(xyz, pose, state[-1])
    own = np.zeros((len(xyz), len(state)))
    own[:, -1] = -1.0
    for k in range(POSE):
        step = np.zeros(POSE)
        step[k] = 0.01 if k < 2 else 1e-5
        slope = (_gap(xyz, pose + step, state[-1])[0] - _gap(xyz, pose - step, state[-1])[0]) / (2 * step[k])
        own[np.arange(len(xyz)), POSE * row + k] = slope
    return residual, own, normal, axis


def _gap(xyz: Float, pose: Float, radius: float) -> tuple[Float, Float, Float]:
    """Return distance of points from cylinders less the radius, outward normals, axes, all in C."""
    lean = rotation_from_vector(np.stack([pose[:, 2], pose[:, 3], 0 * pose[:, 2]], -1))
    axis = lean[:, :, 2]
    across = xyz - np.stack([pose[:, 0], pose[:, 1], 0 * pose[:, 0]], -1)
    across = across - np.sum(across * axis, 1)[:, None] * axis
    distance = np.linalg.norm(across, axis=1)
    return distance - radius, across / distance[:, None], axis
