"""What the effects share: changing one part of a scene's truth, and directions."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from pipeline.errors import InputError
from pipeline.simulator.motion import Odometer
from pipeline.simulator.truth import SceneTruth


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
