"""A small straight pipe with a small camera, for tests of the renderer."""

from dataclasses import replace

import numpy as np

from pipeline.geometry.axis import straight_axis
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.recording.base import FrameTable, PipeFacts
from pipeline.simulator.instrument import (
    LedRing,
    LineProfile,
    TrueCamera,
    TrueInstrument,
    TrueLaser,
    TrueSensor,
)
from pipeline.simulator.motion import Motion, Signal, constant
from pipeline.simulator.scene import Rendering
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.wall.grid import Wall, WallGrid

RADIUS = 50.0


def small_truth(line_samples: int = 3) -> SceneTruth:
    """A laser and a LED frame, off-centre and leaning, without noise."""
    camera = KannalaBrandt((400, 300), (95.0, 95.0), (199.5, 149.5), (-0.01, 0.0, 0.0, 0.0))
    sheet = LaserSheet(22.0, tilt_x=0.004, tilt_y=-0.003)
    probe = Probe(camera, sheet, np.zeros((20, 20)))
    grid = WallGrid(-20.0, 0.5, 300, 720)
    radius = np.full((grid.rows, grid.columns), RADIUS, np.float32)
    albedo = np.full((grid.rows, grid.columns, 3), 0.4, np.float32)
    laser = TrueLaser(sheet, profile=LineProfile(0.5))
    sensor = TrueSensor(full_well_e=1e9, read_noise_e=0.0, psf_sigma_px=0.0)
    motion = Motion(Signal(np.array([0.0, 1.0]), np.array([0.0, 10.0])), constant(2.0), constant(-1.0),
                    constant(0.02))  # fmt: skip
    frames = FrameTable(np.arange(2), np.arange(2) / 30, np.array(["laser", "led"]))
    return SceneTruth(
        "small", "inspection", 5, probe, TrueInstrument(TrueCamera(camera), laser, LedRing(), sensor),
        Wall(straight_axis(-20.0, 130.0), grid, radius, grid, albedo), PipeFacts(2 * RADIUS), motion, None,
        frames, 30.0, Rendering.model_validate({"line_samples": line_samples}),
    )  # fmt: skip


def with_sensor(truth: SceneTruth, **changes: float) -> SceneTruth:
    instrument = truth.instrument
    return replace(truth, instrument=replace(instrument, sensor=replace(instrument.sensor, **changes)))
