"""Ring bins and fiducial edges of a gauge run as image points of effects, and the patterns of their baseline.

The baseline is the error of ordinary image formation: smooth patterns of a hundredth of a pixel. Compression,
clipped peaks and line width on texture shift rings and edges by about that much (shared notes on the
recordings). They are unknowns of the recording, so that what is only baseline is not taken for an effect.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.geometry.rigid import inverse, transform, vector_from_rotation
from pipeline.instrument.probe import Probe
from stages.calibrate.gauge.edges import Edges
from stages.calibrate.gauge.geometry import BoreRings
from stages.calibrate.gauge.state import Unknowns
from stages.diagnose.effects.base import ImagePoints

# Number of frames over which rates of a gauge run are taken, because poses are noisy, more so with a rolling
# shutter. 11 frames leave as much of this noise as differences over two frames, smoothed over nine, did (up
# to a tenth more), and lose less of the motion. Below 30 frames/s a third of a second, or 7 frames, leave at
# most .10 mm/s of poses that err by .01 mm, and lose .5 % of a sway of .6 Hz at 10 frames/s. 5 frames (sharp)
# lose 1.2 % at an eighth of the frame rate: these are for inspections, whose adjustment has already smoothed
# the poses and whose sizes do not include what rates lose.
_FEWEST, _MOST, _SMOOTHED_S = 7, 11, 1 / 3
SHARP = 5
# Degree of the polynomial: where frames were lost, times are uneven, and a cubic has an error of fourth
# order.
_DEGREE = 4
BASELINE_SIGMA_PX = 0.01
_RING_HARMONICS = (0, 1, 2, 3, 4)
_EDGE_HARMONICS = (0, 1, 2)
_MIDDLE_THETA = 1.1
BASELINE_SIZE = 2 * (2 * len(_RING_HARMONICS) - 1) + 4 * (2 * len(_EDGE_HARMONICS) - 1)


def ring_baseline(points: ImagePoints) -> Float:
    """Return outward shifts (M, 18), px: harmonics of azimuth, constant and linear in the polar angle."""
    return _patterns(points, _RING_HARMONICS)


def edge_baseline(points: ImagePoints, normal: Float) -> Float:
    """Return shifts (M, 20) along the edges' normals (M, 2), px, of radial and of tangential patterns."""
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
    """The camera's motion at each frame.

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
    def of(T_pc: Float, time_s: Float, frames: int | None = None) -> Moving:
        """Return the motion from poses (N, 4, 4) at times (N,), by ``frames``; None: as `smoothed`."""
        steps = vector_from_rotation(np.swapaxes(T_pc[:-1, :3, :3], -1, -2) @ T_pc[1:, :3, :3])
        turned = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        both = rates(np.hstack([turned, T_pc[:, :3, 3]]), time_s, frames or smoothed(time_s))
        turning_c, velocity_p = np.split(both, 2, axis=1)
        return Moving(turning_c, np.einsum("nij,ni->nj", T_pc[:, :3, :3], velocity_p), velocity_p[:, 2])

    def passing_mm_s(self, frame: Int, xyz_c: Float) -> Float:
        """Return the velocity (M, 3) in C, mm/s, of wall points (M, 3) seen in frames (M,)."""
        return np.asarray(-self.velocity_c[frame] - np.cross(self.turning_c[frame], xyz_c))


def ring_points(
    state: Unknowns, rings: BoreRings, time_s: Float, moving: Moving, width_px: Float
) -> ImagePoints:
    """Return the ring bins, with wall points as predicted by the state's probe and poses."""
    T = state.T_pc[rings.frame]
    xyz_c = state.probe.triangulate(rings.uv)
    xyz_p = transform(T, xyz_c)
    normal_c, along_c = _wall_directions(xyz_p, T)
    along_ray = way_per_px(state.probe, rings.uv, rings.outward)
    points = ImagePoints(
        state.probe, rings.frame, time_s[rings.frame] - time_s[0], rings.uv, xyz_c, normal_c, along_c,
        rings.outward, moving.speed_mm_s[rings.frame], True, width_px,
        np.arctan2(xyz_p[:, 1], xyz_p[:, 0]), xyz_p[:, 2], per_px_c=along_ray, across_px=rings.across_px,
    )  # fmt: skip
    return moved(points, moving, rings.outward)


def moved(points: ImagePoints, moving: Moving, outward: Float) -> ImagePoints:
    """Return a gauge run's points of the line, shifted by ``outward`` (M, 2), with the camera's motion."""
    assert points.per_px_c is not None
    passing = moving.passing_mm_s(points.frame, points.xyz_c)
    rate = np.einsum("mi,mi->m", points.normal_c, passing)
    rate /= np.einsum("mi,mi->m", points.normal_c, points.per_px_c)
    speed = moving.speed_mm_s[points.frame]
    return replace(points, velocity_px=rate[:, None] * outward, speed_mm_s=speed)


def way_per_px(probe: Probe, uv: Float, outward: Float) -> Float:
    """Return the displacement (M, 3) of the line's points in C, mm, for each px farther ``outward``."""
    return np.asarray(np.einsum("mij,mj->mi", probe.triangulate_jacobian(uv)[0], outward))


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
    """Return the line's width (M,), px, in image directions ``outward`` (M, 2), from the nearest sample.

    Parameters
    ----------
    index : (F,) int
        Frame numbers of the sampled frames in the recording.
    frame : (M,) int
        Index of each point's frame.
    """
    width = source.width_px[np.searchsorted(index, frame), _column(source, outward)].astype(float)
    seen = np.isfinite(width)
    return np.where(seen, width, np.median(width[seen]) if seen.any() else 1.0)


def runs_across(source: RingSamples, index: Int, frame: Int, outward: Float, bins: int) -> Float:
    """Return by how much (M,), px, the image radius changes over one of ``bins`` bins; 0 where none is seen.

    The other parameters are those of `widths_at`; a bin is centred on each direction.
    """
    half, row = len(source.azimuth_rad) / (2 * bins), np.searchsorted(index, frame)
    ends = [_column(source, outward, turned) for turned in (-half, half)]
    valid = source.valid
    first, last = (np.where(valid[row, c], source.radius_px[row, c], np.nan) for c in ends)
    return np.asarray(np.nan_to_num(last - first), np.float64)


def _column(source: RingSamples, outward: Float, turned: float = 0.0) -> Int:
    """Return the column (M,) of samples nearest to directions, or to these turned by ``turned``."""
    step = 2 * np.pi / len(source.azimuth_rad)
    turn = (np.arctan2(outward[:, 1], outward[:, 0]) - source.azimuth_rad[0]) / step
    return np.asarray(np.round(turn + turned).astype(np.int64) % len(source.azimuth_rad))


def _wall_directions(xyz_p: Float, T_pc: Float) -> tuple[Float, Float]:
    radius = np.hypot(xyz_p[:, 0], xyz_p[:, 1])
    normal_p = np.stack([xyz_p[:, 0] / radius, xyz_p[:, 1] / radius, 0 * radius], -1)
    return np.einsum("mij,mi->mj", T_pc[:, :3, :3], normal_p), T_pc[:, 2, :3]


def smoothed(time_s: Float) -> int:
    """Return over how many frames the noise of a gauge run's poses at times (N,) is smoothed."""
    step_s = float(np.ptp(time_s)) / max(len(time_s) - 1, 1)
    return 2 * int(np.clip(np.round(_SMOOTHED_S / max(2 * step_s, 1e-9)), _FEWEST // 2, _MOST // 2)) + 1


def rates(value: Float, time_s: Float, frames: int) -> Float:
    """Return the rates (N, K) of noisy values (N, K) at ascending times (N,), by ``frames`` around each.

    They are slopes of the polynomial of degree 4 that fits these values best (Savitzky & Golay 1964), of
    lower degree where values are fewer. Times may be uneven; near an end the first or last frames are used.
    """
    count = min(frames, len(time_s))
    if count < 2:
        return np.zeros_like(value)
    first = np.clip(np.arange(len(time_s)) - count // 2, 0, len(time_s) - count)
    near = first[:, None] + np.arange(count)
    apart = time_s[near] - time_s[:, None]
    span = np.maximum(np.abs(apart).max(axis=1), 1e-9)
    powers = (apart / span[:, None])[..., None] ** np.arange(min(_DEGREE, count - 1) + 1)
    slope = np.linalg.pinv(powers)[:, 1] / span[:, None]
    return np.asarray(np.einsum("nw,nwk->nk", slope, value[near]))


def one_of_each_frame(points: ImagePoints) -> ImagePoints:
    """Return one point of each frame, in view where one is: a course depends on the frame alone."""
    order = np.lexsort((~np.isfinite(points.xyz_c).all(axis=1), points.frame))
    first = order[np.unique(points.frame[order], return_index=True)[1]]
    each = {f.name: getattr(points, f.name) for f in fields(points)}
    rows: dict[str, Any] = {name: v[first] for name, v in each.items() if isinstance(v, np.ndarray)}
    return replace(points, **rows)
