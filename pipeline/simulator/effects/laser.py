"""Effects of the laser sheet: where its rays run, always or with time."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.instrument.laser import LaserSheet
from pipeline.simulator.instrument import SheetWave, TrueInstrument
from pipeline.simulator.truth import SceneTruth, cartesian, with_laser

# 1/e² radius of the beam on the cone mirror that spreads it: sets how decentring makes the ring uneven.
BEAM_RADIUS_MM = 1.0


@dataclass(frozen=True)
class Rocking:
    """The sheet's tilt swings: a sin(2πf(t − start)) towards a direction."""

    amplitude_rad: float
    frequency_hz: float
    direction_deg: float
    start_s: float

    def __call__(self, instrument: TrueInstrument, time_s: float) -> TrueInstrument:
        """See `pipeline.simulator.truth.Change`."""
        phase = 2 * math.pi * self.frequency_hz * (time_s - self.start_s)
        sheet = tilted(instrument.laser.sheet, self.amplitude_rad * math.sin(phase), self.direction_deg)
        return replace(instrument, laser=replace(instrument.laser, sheet=sheet))


def laser_tilt(truth: SceneTruth, tilt_deg: float, direction_deg: float) -> SceneTruth:
    """Lean the sheet forward by an angle on the side of ``direction_deg``."""
    sheet = tilted(truth.instrument.laser.sheet, math.radians(tilt_deg), direction_deg)
    return with_laser(truth, sheet=sheet)


def laser_cone(truth: SceneTruth, cone_deg: float) -> SceneTruth:
    """Lean the sheet forward all round."""
    sheet = truth.instrument.laser.sheet
    return with_laser(truth, sheet=replace(sheet, cone_rad=sheet.cone_rad + math.radians(cone_deg)))


def baseline(truth: SceneTruth, baseline_mm: float) -> SceneTruth:
    """Put the sheet farther away."""
    sheet = truth.instrument.laser.sheet
    return with_laser(truth, sheet=replace(sheet, baseline_mm=sheet.baseline_mm + baseline_mm))


def beam_decentre(truth: SceneTruth, height_mm: float, direction_deg: float) -> SceneTruth:
    """Let the beam hit the cone mirror beside its tip: height and brightness vary around the ring.

    A 45° cone turns a decentre h into a height h cos(ψ − ψ₀). Of a Gaussian beam of 1/e² radius w it sends
    a share 1 + √(2π) (h/w) cos(ψ − ψ₀) towards ψ, to first order.
    """
    laser = truth.instrument.laser
    x, y = cartesian(height_mm, direction_deg)
    sheet = replace(
        laser.sheet, decentre_x_mm=laser.sheet.decentre_x_mm + x, decentre_y_mm=laser.sheet.decentre_y_mm + y
    )
    share = math.sqrt(2 * math.pi) / BEAM_RADIUS_MM
    brightness = (laser.brightness[0] + share * x, laser.brightness[1] + share * y)
    return with_laser(truth, sheet=sheet, brightness=brightness)


def sheet_waviness(
    truth: SceneTruth, amplitude_mrad: float, order: float, direction_deg: float
) -> SceneTruth:
    """Give the sheet's elevation ``order`` waves around the ring, a crest towards ``direction_deg``."""
    waves = round(order)
    cos_rad, sin_rad = cartesian(1e-3 * amplitude_mrad, waves * direction_deg)
    return with_laser(truth, waves=(*truth.instrument.laser.waves, SheetWave(waves, cos_rad, sin_rad)))


def laser_rocking(
    truth: SceneTruth, amplitude_mrad: float, frequency_hz: float, direction_deg: float
) -> SceneTruth:
    """Let the sheet's tilt swing about its mean."""
    start = float(truth.frames.time_s[0])
    swing = Rocking(1e-3 * amplitude_mrad, frequency_hz, direction_deg, start)
    return replace(truth, changes=(*truth.changes, swing))


def tilted(sheet: LaserSheet, tilt_rad: float, direction_deg: float) -> LaserSheet:
    """Return the sheet with a slope tan φ added towards a direction."""
    x, y = cartesian(float(np.tan(tilt_rad)), direction_deg)
    return replace(sheet, tilt_x=sheet.tilt_x + x, tilt_y=sheet.tilt_y + y)
