"""First poses of all frames: from fiducials where they are read, interpolated or carried on elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.geometry.rigid import from_parts
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Recording
from stages.calibrate.gauge.detect import Sighting
from stages.calibrate.gauge.start import FirstPose

_LEAST_SAMPLES = 90


@dataclass(frozen=True)
class PosedFrames:
    """Frames whose fiducials gave a pose: ``index`` (K,) in the recording, what was seen, and the poses."""

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
    """Return the places of frame numbers in the recording's frame table."""
    return np.asarray(np.searchsorted(recording.frames.frame, frame), np.int64)


def poses_of_all_frames(recording: Recording, posed: PosedFrames, rings: RingSamples, probe: Probe) -> Float:
    """Return first guesses (N, 4, 4) of all poses.

    Before the first and after the last posed frame the turn stays, the encoder gives the distance, and the
    middle of the ring the place across.
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
