"""The bench on which laws are checked: the plain instrument of the physics notes in a smooth round pipe."""

from __future__ import annotations

import numpy as np

from pipeline.geometry.axis import straight_axis
from pipeline.instrument.camera.kannala_brandt import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe, Shutter
from pipeline.recording.base import FrameTable, PipeFacts
from pipeline.simulator.instrument import TrueCamera, TrueInstrument, TrueLaser, TrueSensor
from pipeline.simulator.motion import Motion, Odometer, constant
from pipeline.simulator.profile import LineProfile
from pipeline.simulator.scene import Rendering
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.wall.base import Wall, WallGrid

# The instrument of the notes: baseline 22 mm, equidistant lens of 360 px/rad, 2 MP.
BASELINE_MM, FOCAL_PX = 22.0, 360.0
IMAGE_SIZE = (1600, 1200)
LINE_SIGMA_MM = 0.15
# 2, 3 and 4 inch.
RADII_MM = (25.4, 38.1, 50.8)
ALBEDO = 0.4
_FROM_MM, _TO_MM, _STEP_MM, _COLUMNS = -20.0, 120.0, 0.5, 256
_FRAME_RATE = 30.0


def bench_probe(image_size: tuple[int, int] = IMAGE_SIZE) -> Probe:
    """Return the probe of the notes, without any uncertainty; its optical axis is the picture's middle."""
    middle = ((image_size[0] - 1) / 2, (image_size[1] - 1) / 2)
    camera = KannalaBrandt(image_size, (FOCAL_PX, FOCAL_PX), middle)
    laser = LaserSheet(BASELINE_MM, line_sigma_mm=LINE_SIGMA_MM)
    size = len(camera.parameter_names) + len(LaserSheet.PARAMETER_NAMES)
    return Probe(camera, laser, np.zeros((size, size)), Shutter())


def bench_truth(
    radius_mm: float, motion: Motion | None = None, frames: int = 1, image_size: tuple[int, int] = IMAGE_SIZE
) -> SceneTruth:
    """Return a scene in which the true instrument is the stated one, in a smooth pipe.

    Parameters
    ----------
    radius_mm : float
    motion : Motion, optional
        At rest on the axis at distance 0 where none is given.
    frames : int
        At 30 frames a second, from time 0.
    image_size : (int, int)
    """
    stated = bench_probe(image_size)
    instrument = TrueInstrument(
        TrueCamera(stated.camera),
        TrueLaser(stated.laser, profile=LineProfile(LINE_SIGMA_MM)),
        sensor=TrueSensor(read_noise_e=0.0),
        shutter=stated.shutter,
    )
    table = FrameTable(np.arange(frames), np.arange(frames) / _FRAME_RATE, np.full(frames, "laser"))
    facts = PipeFacts(2 * radius_mm)
    return SceneTruth(
        "bench", "inspection", 0, stated, instrument, bench_wall(radius_mm), facts,
        motion or Motion(constant(0.0)), Odometer(quantum_mm=0.0), table, _FRAME_RATE,
        Rendering.model_validate({}),
    )  # fmt: skip


def bench_wall(radius_mm: float) -> Wall:
    """Return a smooth, grey, matt pipe."""
    rows = round((_TO_MM - _FROM_MM) / _STEP_MM) + 1
    grid = WallGrid(_FROM_MM, _STEP_MM, rows, _COLUMNS)
    radius = np.full((rows, _COLUMNS), radius_mm, np.float32)
    albedo = np.full((rows, _COLUMNS, 3), ALBEDO, np.float32)
    return Wall(straight_axis(_FROM_MM, _TO_MM), grid, radius, grid, albedo)
