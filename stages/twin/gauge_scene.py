"""The scene of a recorded gauge run, which the simulator can render again with effects."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from pipeline.geometry.axis import straight_axis
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Recording
from pipeline.simulator.instrument import (
    LedRing,
    LineProfile,
    TrueCamera,
    TrueInstrument,
    TrueLaser,
    TrueSensor,
)
from pipeline.simulator.motion import Odometer, motion_through
from pipeline.simulator.scene import Rendering
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.wall.grid import Wall, WallGrid
from stages.calibrate.gauge.geometry import gauge_of

_BEYOND_MM, _STEP_MM, _COLUMNS = 300.0, 0.1, 16
"""How far the wall extends beyond the probe's path, mm; its step along the pipe, mm, finer than the chamfer
of a bore; columns around: a bore is round."""


def gauge_scene(recording: Recording, probe: Probe, T_pc: Float) -> SceneTruth:
    """Return the scene of a gauge run without any effect.

    Parameters
    ----------
    recording : Recording
        Of a gauge with fiducials.
    probe : Probe
        The instrument as in probe.yaml, which is rendered.
    T_pc : (N, 4, 4)
        The camera's pose in every frame.
    """
    wall = _bores(recording, T_pc)
    laser = TrueLaser(probe.laser, profile=LineProfile(probe.laser.line_sigma_mm))
    return SceneTruth(
        name=recording.name, kind=recording.kind, seed=0, stated=probe,
        instrument=TrueInstrument(TrueCamera(probe.camera), laser, LedRing(), TrueSensor(), probe.shutter),
        wall=wall, facts=recording.pipe, motion=motion_through(T_pc, recording.frames.time_s, wall.axis),
        odometer=Odometer(), frames=recording.frames, frame_rate=recording.frame_rate,
        rendering=Rendering.model_validate({}),
    )  # fmt: skip


def _bores(recording: Recording, T_pc: Float) -> Wall:
    z = T_pc[:, 2, 3]
    ends = float(z.min()) - _BEYOND_MM, float(z.max()) + _BEYOND_MM
    grid = WallGrid(ends[0], _STEP_MM, round((ends[1] - ends[0]) / _STEP_MM) + 1, _COLUMNS)
    fiducials = recording.pipe.fiducials
    assert fiducials is not None
    gauge = gauge_of(recording.pipe, fiducials)
    radius = gauge.radius_mm[gauge.section(grid.distance_mm)]
    shape = np.repeat(radius[:, None], _COLUMNS, axis=1).astype(np.float32)
    plain = WallGrid(ends[0], ends[1] - ends[0], 2, _COLUMNS)
    albedo = np.full((2, _COLUMNS, 3), 0.5, np.float32)
    return Wall(straight_axis(*ends), grid, shape, plain, albedo)
