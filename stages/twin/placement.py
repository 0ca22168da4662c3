"""Where the camera was in a gauge run, from its fiducials alone, as a given instrument sees them.

The rings have no say in these poses: an error of the laser sheet cannot hide in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.adjustment.motion_priors import third_difference_sigma
from pipeline.arrays import Float, Int
from pipeline.geometry.rigid import inverse, transform
from pipeline.recording.base import Recording
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.instrument import TrueCamera
from pipeline.simulator.rays import viewing_rays
from pipeline.simulator.truth import SceneTruth
from stages.calibrate.gauge.adjust import adjust
from stages.calibrate.gauge.calibrate import MeasuredRun
from stages.calibrate.gauge.scene import gauge_scene
from stages.calibrate.gauge.state import GaugeParameters

_ROUNDS, _STEPS = 2, 3
"""Rounds of predicting how effects shift the fiducials, and Gauss-Newton steps of the poses in each."""
_NEWTON = 8
"""Steps that lead a pixel to the point that it sees; each makes the miss ten times smaller."""


def scene_with(
    recording: Recording, run: MeasuredRun, effects: Sequence[Switch], parameters: GaugeParameters
) -> SceneTruth:
    """Return a gauge run's scene with the stated instrument and effects, the camera placed by fiducials.

    Raises
    ------
    InputError
        When an effect does not fit the scene.
    """
    start = run.start
    # One unknown that changes nothing: the adjustment is to move poses and fiducials, not the instrument.
    state = replace(start, instrument=np.zeros(1), unsure=np.zeros((len(start.stated.parameters), 1)))
    no_rings = run.measured.rings.select(np.zeros(len(run.measured.rings.frame), bool))
    smooth = third_difference_sigma(start.T_pc, run.posed)
    measured = replace(run.measured, rings=no_rings, smooth_sigma=smooth)
    edges = run.measured.edges
    for _ in range(_ROUNDS):
        scene = switch_on(gauge_scene(recording, start.stated, start.stated, state.T_pc), effects)
        shifted = replace(edges, uv=edges.uv - _shift_px(scene, edges.frame, edges.xyz_p))
        for _ in range(_STEPS):
            state = adjust(state, replace(measured, edges=shifted), parameters).state
    return switch_on(gauge_scene(recording, start.stated, start.stated, state.T_pc), effects)


def _shift_px(scene: SceneTruth, frame: Int, xyz_p: Float) -> Float:
    """Return how far (M, 2) beside the stated camera's image the scene's camera sees points (M, 3) in P."""
    out = np.zeros((len(frame), 2))
    for number in np.unique(frame):
        here = frame == number
        time_s = scene.frames.time_s[number]
        xyz_c = transform(inverse(scene.motion.pose(time_s, scene.wall.axis)), xyz_p[here])
        out[here] = (
            seen_at(scene.instrument_at(float(time_s)).camera, xyz_c) - scene.stated.camera.project(xyz_c).uv
        )
    return np.nan_to_num(out)


def seen_at(camera: TrueCamera, xyz_c: Float) -> Float:
    """Return the pixels (M, 2) whose viewing rays pass through points (M, 3) in C."""
    uv = camera.model.project(xyz_c).uv
    by_point = camera.model.project_jacobian(xyz_c).by_point
    for _ in range(_NEWTON):
        origin, ray = viewing_rays(camera, uv)
        from_origin = xyz_c - origin
        miss = from_origin - np.sum(from_origin * ray, -1, keepdims=True) * ray
        uv = uv + np.einsum("mij,mj->mi", by_point, miss)
    return np.asarray(uv)
