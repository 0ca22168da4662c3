"""The truth of a scene: everything a recording is rendered from."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from pipeline.arrays import Float
from pipeline.errors import InputError
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Encoder, FrameTable, PipeFacts
from pipeline.simulator.instrument import TrueInstrument
from pipeline.simulator.motion import Motion, Odometer
from pipeline.simulator.scene import Rendering
from pipeline.simulator.wall.grid import Wall


class Change(Protocol):
    """A change of the instrument with time: a drift, a rocking."""

    def __call__(self, instrument: TrueInstrument, time_s: float) -> TrueInstrument:
        """Return the instrument at ``time_s``, given the one without this change."""


@dataclass(frozen=True)
class SceneTruth:
    """A scene with all values drawn; an effect is a pure function from one to another.

    Attributes
    ----------
    name, kind, seed
        As in the scene.
    stated : Probe
        What probe.yaml will say.
    instrument : TrueInstrument
        The true one, apart from what changes with time.
    changes : tuple of Change
        Applied in order: see `instrument_at`.
    wall : Wall
    facts : PipeFacts
        What recording.yaml will say of the pipe.
    motion : Motion
    odometer : Odometer or None
    frames : FrameTable
        Numbers, times at the middle of the stated exposure (of the middle row), illumination.
    frame_rate : float
    rendering : Rendering
    """

    name: str
    kind: str
    seed: int
    stated: Probe
    instrument: TrueInstrument
    wall: Wall
    facts: PipeFacts
    motion: Motion
    odometer: Odometer | None
    frames: FrameTable
    frame_rate: float
    rendering: Rendering
    changes: tuple[Change, ...] = ()

    def instrument_at(self, time_s: float) -> TrueInstrument:
        """Return the true instrument at a time."""
        instrument = self.instrument
        for change in self.changes:
            instrument = change(instrument, time_s)
        return instrument

    def late_s(self, instrument: TrueInstrument) -> float:
        """Return the delay of frames, s: a longer exposure with the same start has a later middle."""
        return 0.5 * (instrument.shutter.exposure_s - self.stated.shutter.exposure_s)

    def poses(self) -> Float:
        """Return true ``T_pc`` (N, 4, 4) at the frames' times."""
        return self.motion.pose(self.frames.time_s, self.wall.axis)

    def encoder(self) -> Encoder | None:
        """Return the readings of the odometer until the last frame, or None without one."""
        if self.odometer is None:
            return None
        return self.odometer.readings(self.motion, float(self.frames.time_s[-1]) + 2.0 / self.frame_rate)


def row_late_s(instrument: TrueInstrument, row: Float) -> Float:
    """Return the delay, s, of rows (...) relative to the frame's middle row; 0 for a global shutter."""
    rows = instrument.camera.model.image_size[1]
    readout_s = instrument.shutter.readout_s if instrument.shutter.kind == "rolling" else 0.0
    return np.asarray(((row + 0.5) / rows - 0.5) * readout_s)


def cartesian(size: float, direction_deg: float) -> tuple[float, float]:
    """Return size · (cos, sin) of a direction."""
    direction = math.radians(direction_deg)
    return size * math.cos(direction), size * math.sin(direction)


def with_laser(truth: SceneTruth, **fields: Any) -> SceneTruth:
    """Return the truth with fields of its laser replaced."""
    instrument = truth.instrument
    return replace(truth, instrument=replace(instrument, laser=replace(instrument.laser, **fields)))


def with_camera(truth: SceneTruth, **fields: Any) -> SceneTruth:
    """Return the truth with fields of its camera replaced."""
    instrument = truth.instrument
    return replace(truth, instrument=replace(instrument, camera=replace(instrument.camera, **fields)))


def with_sensor(truth: SceneTruth, **fields: Any) -> SceneTruth:
    """Return the truth with fields of its sensor replaced."""
    instrument = truth.instrument
    return replace(truth, instrument=replace(instrument, sensor=replace(instrument.sensor, **fields)))


def with_odometer(truth: SceneTruth, effect: str, **fields: Any) -> SceneTruth:
    """Return the truth with fields of its odometer replaced.

    Raises
    ------
    InputError
        When the scene has no odometer.
    """
    odometer = require_odometer(truth, effect)
    return replace(truth, odometer=replace(odometer, **fields))


def require_odometer(truth: SceneTruth, effect: str) -> Odometer:
    """Return the scene's odometer, or refuse the effect."""
    if truth.odometer is None:
        raise InputError("scene", f"{effect} acts on an encoder, and there is none", place="odometer")
    return truth.odometer
