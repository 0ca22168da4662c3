"""Trajectory and wall of an open recording from its truth: the result of a pipeline without errors."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from pipeline.artefacts.measured import PointCloud, RadiusMap, Trajectory, Wall
from pipeline.geometry.axis import PipeAxis
from pipeline.geometry.rigid import rotation_from_vector
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe
from pipeline.recording.base import Recording
from pipeline.recording.folder import open_folder
from tests.shared_data import shared


@dataclass(frozen=True)
class TruthRun:
    """A recording with its stated probe, its true motion and its true wall."""

    recording: Recording
    probe: Probe
    trajectory: Trajectory
    wall: Wall


def truth_run(name: str, *, margin_mm: float = 1.0) -> TruthRun:
    """Return the open recording ``name`` with its truth; the wall is the part that the laser ring passed."""
    folder = shared("recordings", name)
    recording = open_folder(folder)
    probe = read_probe(folder / "probe.yaml")
    truth = json.loads((folder / "truth.json").read_text())
    axis = true_axis(*truth["pipe"]["bend"])
    T_pc = np.array([np.vstack([p, [0, 0, 0, 1]]) for p in truth["camera_pose_in_pipe"]])
    z = T_pc[:, 2, 3] + probe.laser.baseline_mm
    radius_map = true_radius_map(name, z.min() + margin_mm, z.max() - margin_mm)
    frames = recording.frames
    trajectory = Trajectory(
        frames.frame, frames.time_s, T_pc, np.zeros((len(z), 6, 6)), axis, truth["pipe"]["radius"],
        1.0, 0.0, 0.0, (),
    )  # fmt: skip
    return TruthRun(recording, probe, trajectory, Wall(no_points(), radius_map, axis))


def true_axis(curvature: float, direction_rad: float) -> PipeAxis:
    """Return the axis: an arc of ``curvature``, 1/mm, tangent to z at distance 0."""
    distance = np.arange(-60.0, 400.0, 2.0)
    angle = curvature * distance
    toward = np.array([np.cos(direction_rad), np.sin(direction_rad), 0.0])
    along = distance * np.sinc(angle / np.pi)
    aside = distance * np.sinc(angle / 2 / np.pi) * np.sin(angle / 2)
    origin = aside[:, None] * toward + along[:, None] * np.array([0.0, 0.0, 1.0])
    turn = np.array([-toward[1], toward[0], 0.0])
    return PipeAxis(distance, origin, rotation_from_vector(angle[:, None] * turn))


def true_radius_map(name: str, distance_from_mm: float, distance_to_mm: float) -> RadiusMap:
    """Return the true radii between two distances, columns moved to start at −π."""
    with np.load(shared("recordings", name, "truth_wall.npz")) as file:
        distance, azimuth, radius = (
            file[k].astype(float) for k in ("distance_mm", "azimuth_rad", "radius_mm")
        )
    rows = (distance >= distance_from_mm) & (distance <= distance_to_mm)
    columns = -np.pi + np.arange(len(azimuth)) * 2 * np.pi / len(azimuth)
    radius = np.array([np.interp(columns, azimuth, r, period=2 * np.pi) for r in radius[rows]])
    small = np.full(radius.shape, 1e-3, np.float32)
    ones = np.ones(radius.shape, np.int64)
    return RadiusMap(distance[rows], columns, radius.astype(np.float32), small, small, ones, 0 * small)


def no_points() -> PointCloud:
    """Return an empty cloud."""
    none, none3 = np.zeros(0, np.float32), np.zeros((0, 3), np.float32)
    return PointCloud(none3, none3, none, none, none, none, np.zeros(0, np.int64))
