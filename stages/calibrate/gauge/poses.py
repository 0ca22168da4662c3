"""First poses of all frames: from fiducials where they are read, interpolated or extrapolated elsewhere.

Perspective-n-Point gives the pose of each lit frame; fiducials that contradict the majority are rejected.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.geometry.rigid import (
    from_parts,
    inverse,
    perspective_pose,
    rotation_from_vector,
    skew,
    transform,
)
from pipeline.instrument.camera import Camera
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Recording
from stages.calibrate.gauge.edges import Sighting
from stages.calibrate.gauge.geometry import Gauge

_LEAST_SAMPLES = 90
LEAST_MARKERS = 3
_DRAWS = 12
_FITS_PX = 6.0
# Normalised coordinates tan θ give too much weight to corners near 90°.
_WIDEST = np.radians(80.0)


@dataclass(frozen=True)
class FirstPose:
    """Pose ``T_pc`` (4, 4) of a frame, and which of its seen fiducials (M,) fit it."""

    T_pc: Float
    fits: Bool


def first_pose(
    sighting: Sighting, gauge: Gauge, camera: Camera, random: np.random.Generator
) -> FirstPose | None:
    """Return the pose that most fiducials agree on; None when fewer than three or half of them do."""
    count = len(sighting.marker)
    if count < LEAST_MARKERS:
        return None
    xyz_p = gauge.corners(sighting.marker)
    draws = [np.arange(count)] + [random.permutation(count)[:LEAST_MARKERS] for _ in range(_DRAWS)]
    best: FirstPose | None = None
    for draw in draws:
        found = _tried(camera, sighting.corner_px, xyz_p, draw)
        if found is not None and (best is None or found.fits.sum() > best.fits.sum()):
            best = found
        if best is not None and best.fits.all():
            break
    if best is None or best.fits.sum() < max(LEAST_MARKERS, count / 2):
        return None
    T_pc = refined_pose(camera, sighting.corner_px[best.fits], xyz_p[best.fits], best.T_pc)
    return FirstPose(T_pc, _fits(camera, sighting.corner_px, xyz_p, T_pc))


def refined_pose(camera: Camera, uv: Float, xyz_p: Float, T_pc: Float) -> Float:
    """Minimise the reprojection of corners (M, 4, 2) by Gauss-Newton with Cauchy weights."""
    uv, xyz_p = uv.reshape(-1, 2), xyz_p.reshape(-1, 3)
    for _ in range(8):
        xyz_c = transform(inverse(T_pc), xyz_p)
        residual = camera.project(xyz_c).uv - uv
        by_c = camera.project_jacobian(xyz_c).by_point
        jacobian = np.concatenate([-by_c @ T_pc[:3, :3].T, by_c @ skew(xyz_c)], -1)
        ok = np.isfinite(jacobian).all((1, 2)) & np.isfinite(residual).all(1)
        weight = 1 / (1 + np.sum(residual[ok] ** 2, 1))
        j, r = jacobian[ok], residual[ok]
        normal = np.einsum("mki,m,mkj->ij", j, weight, j)
        step = np.linalg.lstsq(normal, -np.einsum("mki,m,mk->i", j, weight, r), rcond=None)[0]
        T_pc = from_parts(T_pc[:3, :3] @ rotation_from_vector(step[3:]), T_pc[:3, 3] + step[:3])
    return T_pc


def disagreeing(poses: Sequence[tuple[Sighting, FirstPose]], markers: int) -> tuple[Int, Bool]:
    """Return how often each fiducial was seen in posed frames, and which were rejected in most of them."""
    seen, outvoted = np.zeros(markers, np.int64), np.zeros(markers, np.int64)
    for sighting, pose in poses:
        np.add.at(seen, sighting.marker, 1)
        np.add.at(outvoted, sighting.marker[~pose.fits], 1)
    return seen, outvoted * 2 > seen


def _tried(camera: Camera, uv: Float, xyz_p: Float, draw: Int) -> FirstPose | None:
    ray = camera.unproject(uv[draw].reshape(-1, 2)).ray
    ok = ray[:, 2] > np.cos(_WIDEST)
    if ok.sum() < 6:
        return None
    flat = ray[ok, :2] / ray[ok, 2:]
    T_cp = perspective_pose(xyz_p[draw].reshape(-1, 3)[ok], flat)
    if T_cp is None:
        return None
    T_pc = inverse(T_cp)
    return FirstPose(T_pc, _fits(camera, uv, xyz_p, T_pc))


def _fits(camera: Camera, uv: Float, xyz_p: Float, T_pc: Float) -> Bool:
    error = np.linalg.norm(camera.project(transform(inverse(T_pc), xyz_p)).uv - uv, axis=-1)
    return np.asarray(np.nan_to_num(error, nan=np.inf).mean(1) < _FITS_PX)


@dataclass(frozen=True)
class PosedFrames:
    """Frames whose fiducials gave a pose: ``index`` (K,) in the recording, seen fiducials, and poses."""

    index: Int
    sightings: tuple[Sighting, ...]
    poses: tuple[FirstPose, ...]

    @property
    def T_pc(self) -> Float:  # noqa: N802  a frame's name
        """(K, 4, 4)."""
        return np.stack([p.T_pc for p in self.poses])


def posed_frames(
    recording: Recording, sightings: Sequence[Sighting], poses: Sequence[FirstPose | None]
) -> PosedFrames:
    """Return the sightings that gave a pose."""
    found = [(s, p) for s, p in zip(sightings, poses, strict=True) if p is not None]
    index = frame_index(recording, np.array([s.frame for s, _ in found], np.int64))
    return PosedFrames(index, tuple(s for s, _ in found), tuple(p for _, p in found))


def frame_index(recording: Recording, frame: Int) -> Int:
    """Return the indices of frame numbers in the recording's frame table."""
    return np.asarray(np.searchsorted(recording.frames.frame, frame), np.int64)


def poses_of_all_frames(recording: Recording, posed: PosedFrames, rings: RingSamples, probe: Probe) -> Float:
    """Return first guesses (N, 4, 4) of all poses.

    Before the first and after the last posed frame the rotation is constant, the encoder gives the distance,
    and the middle of the ring the position across.
    """
    time, known = recording.frames.time_s, posed.T_pc
    at = np.clip(time, time[posed.index[0]], time[posed.index[-1]])
    turn = Slerp(time[posed.index], Rotation.from_matrix(known[:, :3, :3]))(at).as_matrix()
    place = CubicSpline(time[posed.index], known[:, :3, 3])(at)
    if recording.encoder is not None:
        reading = [np.interp(t, recording.encoder.time_s, recording.encoder.distance_mm) for t in (time, at)]
        place[:, 2] += reading[0] - reading[1]
    T_pc = from_parts(turn, place)
    beyond = (np.arange(len(time)) < posed.index[0]) | (np.arange(len(time)) > posed.index[-1])
    return _centred(T_pc, beyond, frame_index(recording, rings.frame), rings, probe)


def _centred(T_pc: Float, beyond: Bool, index: Int, rings: RingSamples, probe: Probe) -> Float:
    """Move poses ``beyond`` the fiducials across, so that the axis passes the middle of their rings."""
    out = T_pc.copy()
    rows = np.flatnonzero(beyond[index] & (rings.valid.sum(1) >= _LEAST_SAMPLES))
    places = []
    for row in rows:
        xyz_c = probe.triangulate(rings.pixels()[row][rings.valid[row]])
        xyz_c = xyz_c[np.isfinite(xyz_c).all(1)]
        centre_c = np.append(_circle_centre(xyz_c[:, :2]), xyz_c[:, 2].mean())
        places.append(-(T_pc[index[row], :3, :3] @ centre_c)[:2])
    if places:
        for part in range(2):
            across = np.interp(np.arange(len(T_pc)), index[rows], np.array(places)[:, part])
            out[beyond, part, 3] = across[beyond]
    return out


def _circle_centre(xy: Float) -> Float:
    """Return the centre of the circle through points (M, 2) (Kåsa's algebraic fit)."""
    design = np.concatenate([2 * xy, np.ones((len(xy), 1))], 1)
    return np.asarray(np.linalg.lstsq(design, np.sum(xy**2, 1), rcond=None)[0][:2])
