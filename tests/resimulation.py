"""The open recordings of an independent renderer as scenes of the simulator, made from their truth."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from scipy.optimize import least_squares

from pipeline.arrays import Float
from pipeline.geometry.axis import straight_axis
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe
from pipeline.recording import open_recording
from pipeline.simulator.instrument import (
    LedRing,
    LineProfile,
    TrueCamera,
    TrueInstrument,
    TrueLaser,
    TrueSensor,
)
from pipeline.simulator.motion import motion_through
from pipeline.simulator.scene import Rendering
from pipeline.simulator.sheet import room_mm
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.wall import bent_axis
from pipeline.simulator.wall.description import Bend
from pipeline.simulator.wall.grid import Wall, WallGrid


def truth_of_recording(folder: Path) -> SceneTruth:
    """Return the scene of an open recording, its instrument as stated."""
    recording = open_recording(folder)
    told = json.loads((folder / "truth.json").read_text())
    probe = read_probe(recording.probe_file)
    wall = wall_of(folder, told)
    T_pc = np.array(told["camera_pose_in_pipe"])
    T_pc = np.concatenate([T_pc, np.broadcast_to([[[0, 0, 0, 1]]], (len(T_pc), 1, 4))], 1)
    light = LedRing(probe.lighting.leds, probe.lighting.radius_mm, probe.lighting.z_mm)
    laser = TrueLaser(probe.laser, profile=LineProfile(probe.laser.line_sigma_mm))
    return SceneTruth(
        name=recording.name, kind=recording.kind, seed=0, stated=probe,
        instrument=TrueInstrument(TrueCamera(probe.camera), laser, light, TrueSensor()),
        wall=wall, facts=recording.pipe, motion=motion_through(T_pc, recording.frames.time_s, wall.axis),
        odometer=None, frames=recording.frames, frame_rate=recording.frame_rate,
        rendering=Rendering.model_validate({}),
    )  # fmt: skip


def wall_of(folder: Path, told: dict) -> Wall:
    shape = np.load(folder / "truth_wall.npz")
    s, radius = shape["distance_mm"], shape["radius_mm"]
    albedo = cv2.imread(str(folder / "truth_albedo.jpg"), cv2.IMREAD_COLOR).astype(np.float32) / 255
    first, last = told["albedo_extent"]["distance_mm"]
    step = (last - first) / len(albedo)
    curvature, direction = told["pipe"]["bend"]
    ends = float(s[0]), float(s[-1])
    axis = straight_axis(*ends)
    if curvature:
        bend = Bend(distance_mm=ends[0], length_mm=ends[1] - ends[0] + 1, curvature_per_mm=curvature,
                    direction_deg=float(np.degrees(direction)))  # fmt: skip
        axis = bent_axis(ends, (bend,))
    return Wall(
        axis, WallGrid(ends[0], float(np.diff(s).mean()), *radius.shape), radius.astype(np.float32),
        WallGrid(first + step / 2, step, *albedo.shape[:2]), albedo,
    )  # fmt: skip


def fitted_probe(
    truth: SceneTruth, frames: list[int], azimuth_rad: Float, centre_px: Float, radius_px: Float
) -> Probe:
    """Return the instrument, within its stated uncertainty, that predicts the rings where they were measured.

    ``radius_px`` (F, A) lies along image azimuths about ``centre_px``, NaN where nothing was measured.
    """
    probe = truth.stated
    directions = probe.principal_uncertainties()
    outward = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)], -1)

    def residual(x: Float) -> Float:
        scene = with_probe(truth, probe.with_parameters(probe.parameters + directions @ x, probe.covariance))
        off = np.stack([off_line(scene, frame, centre_px, outward, radius)
                        for frame, radius in zip(frames, radius_px, strict=True)])  # fmt: skip
        return np.concatenate([np.nan_to_num(off).ravel() / 0.05, 0.1 * x])

    found = least_squares(residual, np.zeros(directions.shape[1]), loss="soft_l1", max_nfev=6)
    return probe.with_parameters(probe.parameters + directions @ found.x, probe.covariance)


def off_line(truth: SceneTruth, frame: int, centre_px: Float, outward: Float, radius_px: Float) -> Float:
    """Return by how much measured image radii (A,) lie beyond the exact line, px, to first order."""
    here, beyond = (room_mm(truth, frame, centre_px + (radius_px + d)[:, None] * outward) for d in (0, 0.5))
    return np.asarray(0.5 * here / (beyond - here))


def with_probe(truth: SceneTruth, probe: Probe) -> SceneTruth:
    camera, laser = TrueCamera(probe.camera), replace(truth.instrument.laser, sheet=probe.laser)
    return replace(truth, instrument=replace(truth.instrument, camera=camera, laser=laser))
