"""Effects of windows and media: refracting surfaces put before camera and laser, traced by Snell's law.

Behind a tube there is air again, so that tubes may be added in any order; the medium outside comes last. A
ray is intersected with each surface on its whole line, also behind its last point, so that a tube whose outer
surface lies inside its inner one is the exact inverse of glass. A wedge is therefore modelled as the
difference from the straight tube that the probe was calibrated in, and a tilt as a tilted tube in place of
the straight one.
"""

from __future__ import annotations

import math
from dataclasses import replace

from pipeline.physics.instrument import DOME_RADIUS_MM, DOME_THICKNESS_MM, GLASS_INDEX
from pipeline.simulator.truth import SceneTruth, cartesian, with_camera
from pipeline.simulator.window import CylinderWindow, SphereWindow, Window

# Outer radius of the sealed probe, and the glass of the tube that tilts (catalogue, PHYSICS notes).
TUBE_OUTER_RADIUS_MM, TUBE_THICKNESS_MM = 15.0, 2.0
# Refractive index of air, taken as that of vacuum: the difference, 2.7e-4, is the effect `outside_index`.
_AIR = 1.0


def housing_glass(truth: SceneTruth, thickness_mm: float) -> SceneTruth:
    """Put camera and laser into a coaxial glass tube that the stated probe does not have."""
    inner = CylinderWindow(TUBE_OUTER_RADIUS_MM - thickness_mm, GLASS_INDEX)
    return _with_windows(truth, (inner, CylinderWindow(TUBE_OUTER_RADIUS_MM, _AIR)))


def tube_wedge(truth: SceneTruth, wedge_mm: float, direction_deg: float) -> SceneTruth:
    """Decentre a tube's outer surface: glass thicker by up to ``wedge_mm`` towards a direction."""
    x, y = cartesian(wedge_mm, direction_deg)
    inner = CylinderWindow(TUBE_OUTER_RADIUS_MM, GLASS_INDEX)
    return _with_windows(truth, (inner, CylinderWindow(TUBE_OUTER_RADIUS_MM, _AIR, point_c=(x, y, 0.0))))


def tube_tilt(truth: SceneTruth, tilt_deg: float, direction_deg: float) -> SceneTruth:
    """Tilt the tube that the probe was calibrated in: its outer normal leans forward at ``direction_deg``."""
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
    """Set the dome back by ``offset_mm``: the viewpoint lies so far ahead of its centre."""
    return _with_dome_moved(truth, 0.0, 0.0, -offset_mm)


def dome_lateral(truth: SceneTruth, offset_mm: float, direction_deg: float) -> SceneTruth:
    """Set the dome aside towards ``direction_deg``."""
    return _with_dome_moved(truth, *cartesian(offset_mm, direction_deg), 0.0)


def outside_index(truth: SceneTruth, index_excess: float) -> SceneTruth:
    """Fill the pipe with a medium; the sealed probe itself stays full of air."""
    return _with_windows(truth, (CylinderWindow(TUBE_OUTER_RADIUS_MM, 1 + index_excess),))


def _with_windows(truth: SceneTruth, windows: tuple[Window, ...]) -> SceneTruth:
    """Return the truth with windows outside the others, before camera and laser alike."""
    instrument = truth.instrument
    laser = replace(instrument.laser, windows=(*instrument.laser.windows, *windows))
    camera = replace(instrument.camera, windows=(*instrument.camera.windows, *windows))
    return replace(truth, instrument=replace(instrument, laser=laser, camera=camera))


def _with_dome_moved(truth: SceneTruth, x: float, y: float, z: float) -> SceneTruth:
    """Move the camera's dome, which sits about the viewpoint and shows nothing while it is not moved."""
    windows = truth.instrument.camera.windows
    domes = [w for w in windows if isinstance(w, SphereWindow)] or list(_centred_dome())
    moved = [replace(w, centre_c=(w.centre_c[0] + x, w.centre_c[1] + y, w.centre_c[2] + z)) for w in domes]
    others = [w for w in windows if not isinstance(w, SphereWindow)]
    return with_camera(truth, windows=(*moved, *others))


def _centred_dome() -> tuple[SphereWindow, SphereWindow]:
    half = DOME_THICKNESS_MM / 2
    return SphereWindow(DOME_RADIUS_MM - half, GLASS_INDEX), SphereWindow(DOME_RADIUS_MM + half, _AIR)
