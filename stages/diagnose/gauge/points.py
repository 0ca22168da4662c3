"""Ring bins and fiducial edges of a gauge run as image points of effects, and the patterns of their baseline.

The baseline is errors of ordinary image formation: smooth patterns of a hundredth of a pixel.
Compression, clipped peaks and line width over texture move rings and edges by about that much (shared notes
on the recordings). They are unknowns of the recording, so that no effect is seen in what is only baseline.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_smoothing_spline

from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.geometry.rigid import inverse, transform, vector_from_rotation
from pipeline.instrument.probe import Probe
from stages.calibrate.gauge.edges import Edges
from stages.calibrate.gauge.geometry import BoreRings
from stages.calibrate.gauge.state import Unknowns
from stages.diagnose.effects.base import ImagePoints

# What a probe does faster than this is taken for noise of its poses: slower motion of f Hz loses (f / 3)⁴ of
# its rate, 0.2 % of a sway of 0.6 Hz. A rolling shutter itself makes poses noisy: at 5 Hz that noise hid it.
_FASTEST_HZ = 3.0
_LEAST_FOR_SPLINE = 5
BASELINE_SIGMA_PX = 0.01
_RING_HARMONICS = (0, 1, 2, 3, 4)
_EDGE_HARMONICS = (0, 1, 2)
_MIDDLE_THETA = 1.1
# Half the step of a derivative along the image radius, px: its error is of the third order, below 1e-6.
_APART = 0.1
BASELINE_SIZE = 2 * (2 * len(_RING_HARMONICS) - 1) + 4 * (2 * len(_EDGE_HARMONICS) - 1)


def ring_baseline(points: ImagePoints) -> Float:
    """Return (M, 18) outward shifts in px: harmonics of azimuth, constant and linear in polar angle."""
    return _patterns(points, _RING_HARMONICS)


def edge_baseline(points: ImagePoints, normal: Float) -> Float:
    """Return (M, 20) shifts along the edges' normals (M, 2) in px, of outward and of across patterns."""
    patterns = _patterns(points, _EDGE_HARMONICS)
    outward = points.outward
    around = np.stack([-outward[:, 1], outward[:, 0]], -1)
    parts = [patterns * np.sum(normal * way, 1)[:, None] for way in (outward, around)]
    return np.concatenate(parts, 1)


def _patterns(points: ImagePoints, harmonics: tuple[int, ...]) -> Float:
    psi, tilt = points.azimuth_rad, points.theta - _MIDDLE_THETA
    waves = [np.ones_like(psi)]
    waves += [f(m * psi) for m in harmonics if m for f in (np.cos, np.sin)]
    return np.stack([w * g for g in (np.ones_like(psi), 2 * tilt) for w in waves], -1)


@dataclass(frozen=True)
class Moving:
    """How the camera moves at each frame, noise of its poses smoothed.

    Attributes
    ----------
    turning_c, velocity_c : (N, 3)
        In C, rad/s and mm/s.
    speed_mm_s : (N,)
        Along the pipe.
    """

    turning_c: Float
    velocity_c: Float
    speed_mm_s: Float

    @staticmethod
    def of(T_pc: Float, time_s: Float) -> Moving:
        """Return it of poses (N, 4, 4) at times (N,)."""
        steps = vector_from_rotation(np.swapaxes(T_pc[:-1, :3, :3], -1, -2) @ T_pc[1:, :3, :3])
        turned = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        # In one call, which sets up the spline once: that takes far longer than to use it.
        turning_c, velocity_p = np.split(rates(np.hstack([turned, T_pc[:, :3, 3]]), time_s), 2, axis=1)
        return Moving(turning_c, np.einsum("nij,ni->nj", T_pc[:, :3, :3], velocity_p), velocity_p[:, 2])

    def passing_mm_s(self, frame: Int, xyz_c: Float) -> Float:
        """Return how points (M, 3) of the wall, seen in frames (M,), pass in C, mm/s."""
        return np.asarray(-self.velocity_c[frame] - np.cross(self.turning_c[frame], xyz_c))


def ring_points(
    state: Unknowns, rings: BoreRings, time_s: Float, moving: Moving, width_px: Float
) -> ImagePoints:
    """Return the ring bins, their wall points as probe and poses of the state place them."""
    T = state.T_pc[rings.frame]
    xyz_c = state.probe.triangulate(rings.uv)
    xyz_p = transform(T, xyz_c)
    normal_c, along_c = _wall_directions(xyz_p, T)
    along_ray = way_per_px(state.probe, rings.uv, rings.outward)
    passing = moving.passing_mm_s(rings.frame, xyz_c)
    rate = np.einsum("mi,mi->m", normal_c, passing) / np.einsum("mi,mi->m", normal_c, along_ray)
    return ImagePoints(
        state.probe, rings.frame, time_s[rings.frame] - time_s[0], rings.uv, xyz_c, normal_c, along_c,
        rate[:, None] * rings.outward, moving.speed_mm_s[rings.frame], True, width_px,
        np.arctan2(xyz_p[:, 1], xyz_p[:, 0]), xyz_p[:, 2], per_px_c=along_ray,
    )  # fmt: skip


def way_per_px(probe: Probe, uv: Float, outward: Float) -> Float:
    """Return the way (M, 3) of the line's points in C, mm per px that they are found farther ``outward``."""
    farther, nearer = (probe.triangulate(uv + way * outward) for way in (_APART, -_APART))
    return np.asarray((farther - nearer) / (2 * _APART))


def edge_points(state: Unknowns, edges: Edges, time_s: Float, moving: Moving) -> ImagePoints:
    """Return the points of fiducial borders."""
    T = state.T_pc[edges.frame]
    xyz_c = transform(inverse(T), edges.xyz_p)
    normal_c, along_c = _wall_directions(edges.xyz_p, T)
    passing = moving.passing_mm_s(edges.frame, xyz_c)
    by_c = state.probe.camera.project_jacobian(xyz_c).by_point
    return ImagePoints(
        state.probe, edges.frame, time_s[edges.frame] - time_s[0], edges.uv, xyz_c, normal_c, along_c,
        np.einsum("mij,mj->mi", by_c, passing), moving.speed_mm_s[edges.frame], False,
        np.full(len(edges.uv), np.nan), np.arctan2(edges.xyz_p[:, 1], edges.xyz_p[:, 0]), edges.xyz_p[:, 2],
    )  # fmt: skip


def widths_at(source: RingSamples, index: Int, frame: Int, outward: Float) -> Float:
    """Return the line's width (M,) in image directions ``outward`` (M, 2), from the sample nearest to each.

    Parameters
    ----------
    index : (F,) int
        Places in the recording of the sampled frames.
    frame : (M,) int
        Place of each point's frame.
    """
    step = 2 * np.pi / len(source.azimuth_rad)
    turn = (np.arctan2(outward[:, 1], outward[:, 0]) - source.azimuth_rad[0]) / step
    column = np.round(turn).astype(np.int64) % len(source.azimuth_rad)
    width = source.width_px[np.searchsorted(index, frame), column].astype(float)
    seen = np.isfinite(width)
    return np.where(seen, width, np.median(width[seen]) if seen.any() else 1.0)


def _wall_directions(xyz_p: Float, T_pc: Float) -> tuple[Float, Float]:
    radius = np.hypot(xyz_p[:, 0], xyz_p[:, 1])
    normal_p = np.stack([xyz_p[:, 0] / radius, xyz_p[:, 1] / radius, 0 * radius], -1)
    return np.einsum("mij,mi->mj", T_pc[:, :3, :3], normal_p), T_pc[:, 2, :3]


def rates(value: Float, time_s: Float) -> Float:
    """Return the rates (N, K) of noisy values (N, K) at times (N,) that rise, by a smoothing spline.

    Differences over two frames, smoothed over nine, lost up to 5 % of a sway at 10 frames/s; a spline that
    gives up ∫f″² for closeness passes a wave of angular frequency ω with the share 1 / (1 + λ Δt ω⁴).
    """
    if len(time_s) < _LEAST_FOR_SPLINE:
        return np.asarray(np.gradient(value, time_s, axis=0)) if len(time_s) > 1 else np.zeros_like(value)
    step_s = float(np.median(np.diff(time_s)))
    smoothness = 1 / (step_s * (2 * np.pi * _FASTEST_HZ) ** 4)
    return np.asarray(make_smoothing_spline(time_s, value, lam=smoothness)(time_s, 1))
