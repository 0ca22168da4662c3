"""Effects of the laser sheet, and of windows and media in front of camera and laser.

Windows are refracting surfaces, traced by Snell's law. Behind a tube there is air again, so that tubes may be
added in any order; the medium outside comes last. A ray is intersected with each surface on its whole line,
also behind its last point, so that a tube whose outer surface lies inside its inner one is the exact inverse
of glass. A wedge is therefore modelled as the difference from the straight tube that the probe was calibrated
in, and a tilt as a tilted tube in place of the straight one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.instrument.laser import LaserSheet
from pipeline.physics.instrument import (
    DOME_RADIUS_MM,
    DOME_THICKNESS_MM,
    GLASS_INDEX,
    TUBE_OUTER_RADIUS_MM,
    TUBE_THICKNESS_MM,
)
from pipeline.simulator.instrument import SheetWave, TrueInstrument
from pipeline.simulator.truth import SceneTruth, cartesian, with_camera, with_laser
from pipeline.simulator.window import CylinderWindow, SphereWindow, Window

# 1/e² radius of the beam on the cone mirror that spreads it: it sets how uneven decentring makes the ring.
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
    """Tilt the sheet so that it leans forward on the side of ``direction_deg``."""
    sheet = tilted(truth.instrument.laser.sheet, math.radians(tilt_deg), direction_deg)
    return with_laser(truth, sheet=sheet)


def laser_cone(truth: SceneTruth, cone_deg: float) -> SceneTruth:
    """Make the sheet a cone that leans forward all round."""
    sheet = truth.instrument.laser.sheet
    return with_laser(truth, sheet=replace(sheet, cone_rad=sheet.cone_rad + math.radians(cone_deg)))


def baseline(truth: SceneTruth, baseline_mm: float) -> SceneTruth:
    """Move the sheet farther away from the camera."""
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
    """Give the sheet's elevation ``order`` waves around the ring, with a crest towards ``direction_deg``."""
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


# Refractive index of air, taken as that of vacuum: the difference, 2.7e-4, is the effect `outside_index`.
_AIR = 1.0


def housing_glass(truth: SceneTruth, thickness_mm: float) -> SceneTruth:
    """Put camera and laser into a coaxial glass tube that the stated probe does not have."""
    inner = CylinderWindow(TUBE_OUTER_RADIUS_MM - thickness_mm, GLASS_INDEX)
    return _with_windows(truth, (inner, CylinderWindow(TUBE_OUTER_RADIUS_MM, _AIR)))


def tube_wedge(truth: SceneTruth, wedge_mm: float, direction_deg: float) -> SceneTruth:
    """Decentre a tube's outer surface: the glass is thicker by up to ``wedge_mm`` towards a direction."""
    x, y = cartesian(wedge_mm, direction_deg)
    inner = CylinderWindow(TUBE_OUTER_RADIUS_MM, GLASS_INDEX)
    return _with_windows(truth, (inner, CylinderWindow(TUBE_OUTER_RADIUS_MM, _AIR, point_c=(x, y, 0.0))))


def tube_tilt(truth: SceneTruth, tilt_deg: float, direction_deg: float) -> SceneTruth:
    """Tilt the tube of the calibration: its outer normal leans forward at ``direction_deg``."""
    x, y = cartesian(math.sin(math.radians(tilt_deg)), direction_deg)
    axis = (-x, -y, math.cos(math.radians(tilt_deg)))
    inside = TUBE_OUTER_RADIUS_MM - TUBE_THICKNESS_MM
    leaning = (
        CylinderWindow(inside, GLASS_INDEX, axis_c=axis),
        CylinderWindow(TUBE_OUTER_RADIUS_MM, _AIR, axis_c=axis),
    )
    undone = (CylinderWindow(TUBE_OUTER_RADIUS_MM, GLASS_INDEX), CylinderWindow(inside, _AIR))
    return _with_windows(truth, (*leaning, *undone))


def dome_axial(truth: SceneTruth, offset_mm: float) -> SceneTruth:
    """Set the dome back by ``offset_mm``: the viewpoint is so far ahead of the dome's centre."""
    return _with_dome_moved(truth, 0.0, 0.0, -offset_mm)


def dome_lateral(truth: SceneTruth, offset_mm: float, direction_deg: float) -> SceneTruth:
    """Displace the dome towards ``direction_deg``."""
    return _with_dome_moved(truth, *cartesian(offset_mm, direction_deg), 0.0)


def outside_index(truth: SceneTruth, index_excess: float) -> SceneTruth:
    """Fill the pipe with a medium; the sealed probe itself remains full of air."""
    return _with_windows(truth, (CylinderWindow(TUBE_OUTER_RADIUS_MM, 1 + index_excess),))


def _with_windows(truth: SceneTruth, windows: tuple[Window, ...]) -> SceneTruth:
    """Return the truth with further windows outside the others, in front of both camera and laser."""
    instrument = truth.instrument
    laser = replace(instrument.laser, windows=(*instrument.laser.windows, *windows))
    camera = replace(instrument.camera, windows=(*instrument.camera.windows, *windows))
    return replace(truth, instrument=replace(instrument, laser=laser, camera=camera))


def _with_dome_moved(truth: SceneTruth, x: float, y: float, z: float) -> SceneTruth:
    """Move the camera's dome. Centred on the viewpoint, as it is without this effect, it refracts no ray."""
    windows = truth.instrument.camera.windows
    domes = [w for w in windows if isinstance(w, SphereWindow)] or list(_centred_dome())
    moved = [replace(w, centre_c=(w.centre_c[0] + x, w.centre_c[1] + y, w.centre_c[2] + z)) for w in domes]
    others = [w for w in windows if not isinstance(w, SphereWindow)]
    return with_camera(truth, windows=(*moved, *others))


def _centred_dome() -> tuple[SphereWindow, SphereWindow]:
    half = DOME_THICKNESS_MM / 2
    return SphereWindow(DOME_RADIUS_MM - half, GLASS_INDEX), SphereWindow(DOME_RADIUS_MM + half, _AIR)
