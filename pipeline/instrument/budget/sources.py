"""The error sources: the paper's Table I, the further effects of the shared PHYSICS notes, a typical probe.

A systematic source changes parameters of the probe or of `Disturbance`, equally in every frame. A random
source moves every sample of the line independently, and averages out over frames.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from enum import StrEnum

import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.physics.instrument import DOME_POWER, TUBE_OUTER_RADIUS_MM

_DEG = math.radians(1)


class Kind(StrEnum):
    """Whether a source is the same in all frames."""

    SYSTEMATIC = "systematic"
    RANDOM = "random"


@dataclass(frozen=True)
class Source:
    """An error source.

    Attributes
    ----------
    name
        As in the shared PHYSICS notes.
    label
        In words.
    kind
    unit
        Of the σ shown.
    typical
        1 σ where the probe does not state it, in ``unit``; 0 where the effect needs a part (a window, a
        drifting temperature) that not every probe has.
    parameters
        What it moves; empty for random sources.
    factor
        Parameter units per ``unit``.
    table_one
        The row's name in the paper's Table I, else empty.
    """

    name: str
    label: str
    kind: Kind
    unit: str
    typical: float
    parameters: tuple[str, ...] = ()
    factor: float = 1.0
    table_one: str = ""


def stated_sources(probe: Probe) -> tuple[Source, ...]:
    """Return the sources whose σ the probe's covariance holds; all of them are systematic."""
    names = probe.camera.parameter_names
    focal = tuple(n for n in names if n.startswith("f"))
    centre = tuple(n for n in names if n in ("cx", "cy"))
    rest = tuple(n for n in names if n not in (*focal, *centre))
    first = rest[0] if rest else ""
    both = (
        Source("focal_scale", "Focal length", Kind.SYSTEMATIC, "px", 0.36, focal, 1.0, "focal length"),
        Source("principal_point", "Principal point, per axis", Kind.SYSTEMATIC, "px", 0.5, centre, 1.0,
               "camera calibration"),
        Source("radial_distortion", "Lens distortion", Kind.SYSTEMATIC, first, 1e-3, rest, 1.0,
               "camera calibration"),
        Source("laser_tilt", "Misalignment of the sheet, per axis", Kind.SYSTEMATIC, "°", 0.05,
               ("tilt_x", "tilt_y"), _DEG, "misalignment"),
        Source("laser_cone", "Opening angle", Kind.SYSTEMATIC, "°", 0.1, ("cone_rad",), _DEG / 2,
               "opening angle"),
        Source("baseline", "Baseline", Kind.SYSTEMATIC, "mm", 0.05, ("baseline_mm",), 1.0, "baseline"),
        Source("beam_decentre", "Laser beside the axis, per axis", Kind.SYSTEMATIC, "mm", 0.02,
               ("decentre_x_mm", "decentre_y_mm")),
        Source("sheet_waviness", "Waviness of the sheet, each of 6", Kind.SYSTEMATIC, "mrad", 0.02,
               LaserSheet.PARAMETER_NAMES[6:], 1e-3),
    )  # fmt: skip
    return tuple(source for source in both if source.parameters)


def further_sources(probe: Probe) -> tuple[Source, ...]:
    """Return the sources beyond the probe's covariance, independent of it and of each other."""
    focal = tuple(n for n in probe.camera.parameter_names if n.startswith("f"))
    f_px = float(probe.camera.parameters[0]) if focal else 1.0
    drift = Source(
        "focal_drift", "Focal length over temperature", Kind.SYSTEMATIC, "relative", 5e-5, focal, f_px
    )
    sources = (
        *((drift,) if focal else ()),
        Source("baseline_drift", "Baseline over temperature (Al, 5 K)", Kind.SYSTEMATIC, "mm",
               round(23e-6 * 5 * probe.laser.baseline_mm, 5), ("baseline_mm",)),
        Source("centre_drift", "Principal point over temperature, per axis", Kind.SYSTEMATIC, "px", 0.02,
               tuple(n for n in probe.camera.parameter_names if n in ("cx", "cy"))),
        Source("pixel_aspect", "Pixel aspect", Kind.SYSTEMATIC, "relative", 5e-5, ("aspect",)),
        Source("sensor_tilt", "Sensor tilt, per axis", Kind.SYSTEMATIC, "relative", 2e-5,
               ("sensor_tilt_x", "sensor_tilt_y")),
        Source("pupil_shift", "Entrance pupil moves with the angle", Kind.SYSTEMATIC, "mm", 0.02,
               ("pupil_mm",)),
        Source("housing_glass", "Thickness of a glass tube", Kind.SYSTEMATIC, "mm", 0.0, ("glass_mm",)),
        Source("tube_wedge", "Wedge of a glass tube, per axis", Kind.SYSTEMATIC, "mm", 0.0,
               ("wedge_x_mm", "wedge_y_mm")),
        Source("dome_axial", "Dome along the axis", Kind.SYSTEMATIC, "mm", 0.0, ("dome_axial_mm",)),
        Source("dome_lateral", "Dome beside the axis, per axis", Kind.SYSTEMATIC, "mm", 0.0,
               ("dome_x_mm", "dome_y_mm")),
        Source("outside_index", "Medium outside a sealed probe", Kind.SYSTEMATIC, "index", 0.0,
               ("outside_index",)),
    )  # fmt: skip
    return tuple(source for source in sources if source.parameters)


RANDOM_SOURCES = (
    Source("line_width", "Laser line width (its own shot noise)", Kind.RANDOM, "px", math.nan,
           table_one="line width"),
    Source("image_noise", "Image noise", Kind.RANDOM, "px", math.nan, table_one="image noise"),
    Source("speckle", "Speckle", Kind.RANDOM, "px", math.nan),
    Source("albedo_bias", "Texture under the line", Kind.RANDOM, "px", math.nan),
    Source("pixel_locking", "Pixel locking and compression", Kind.RANDOM, "px", 0.014),
    Source("saturation", "Clipped peaks", Kind.RANDOM, "px", 0.01),
)  # fmt: skip

NOT_IN_RADIUS = {
    "off-centre, yaw, bend, ovality": "states that the motion estimate finds, not errors of the instrument",
    "encoder_scale, encoder_slip, time_offset": "they move distance, not radius",
    "rolling_shutter, motion_blur": "depend on the run's vibration; negligible with a short global shutter",
    "gamma, vignetting, ambient_light, subsurface, ghost_ring": "depend on exposure and wall; judged per run",
    "tube_tilt": "only known to first order on one side; needs a window",
}
"""Effects of the PHYSICS notes without a row, and why."""


def typical_probe(baseline_mm: float = 22.0) -> Probe:
    """Return an uncalibrated probe: equidistant 360 px/rad, σ as "typical" in the shared PHYSICS notes.

    Its σ: focal length 10⁻³, principal point 0.5 px, k1 10⁻³, tilt 0.05° per axis, opening angle 0.1°,
    baseline 0.05 mm.
    """
    camera = KannalaBrandt((1600, 1200), (360.0, 360.0), (799.5, 599.5))
    laser = LaserSheet(baseline_mm)
    names = (*camera.parameter_names, *LaserSheet.PARAMETER_NAMES)
    sigma = {"cx": 0.5, "cy": 0.5, "k1": 1e-3, "tilt_x": np.radians(0.05), "tilt_y": np.radians(0.05),
             "cone_rad": np.radians(0.05), "baseline_mm": 0.05}  # fmt: skip
    covariance = np.diag([sigma.get(n, 0.0) ** 2 for n in names])
    covariance[:2, :2] = 0.36**2
    return Probe(camera, laser, covariance)


# Crown glass: with it PHYSICS.md's 0.74 mm for 2 mm of glass in a 4 inch pipe is right; 1.5 gives 0.73 mm.
_GLASS_INDEX = 1.51


@dataclass(frozen=True)
class Disturbance:
    """Sizes of the effects, all zero for the instrument as believed.

    Attributes
    ----------
    pupil_mm : float
        ε: the viewpoint moves by ε (θ / sin θ − 1) along the axis.
    sensor_tilt_x, sensor_tilt_y : float
        Decentring p of the image in units of the focal length: 3 p θ² cos ψ outward.
    aspect : float
        a: pixels wider by a/2, lower by a/2.
    glass_mm, wedge_x_mm, wedge_y_mm : float
        Unexpected thickness of a coaxial tube: mean, and its first harmonic.
    outside_index : float
        Refractive index outside the sealed tube minus that inside.
    dome_axial_mm, dome_x_mm, dome_y_mm : float
        Displacement of the viewpoint from a dome's centre.
    """

    pupil_mm: float = 0.0
    sensor_tilt_x: float = 0.0
    sensor_tilt_y: float = 0.0
    aspect: float = 0.0
    glass_mm: float = 0.0
    wedge_x_mm: float = 0.0
    wedge_y_mm: float = 0.0
    outside_index: float = 0.0
    dome_axial_mm: float = 0.0
    dome_x_mm: float = 0.0
    dome_y_mm: float = 0.0


DISTURBANCE_NAMES = tuple(f.name for f in fields(Disturbance))


def observe(camera: Camera, xyz_c: Float, disturbance: Disturbance) -> Float:
    """Return the pixels (A, 2) at which a camera behind disturbed optics sees wall points (A, 3)."""
    uv = camera.project(_apparent(xyz_c, disturbance)).uv
    m = uv - camera.centre_px
    scale = np.linalg.norm(m, axis=-1) / np.maximum(_theta(xyz_c), 1e-9)
    x, y = (m / scale[:, None]).T
    p, q = disturbance.sensor_tilt_x, disturbance.sensor_tilt_y
    rho2 = x * x + y * y
    dx = p * (rho2 + 2 * x * x) + 2 * q * x * y + disturbance.aspect / 2 * x
    dy = q * (rho2 + 2 * y * y) + 2 * p * x * y - disturbance.aspect / 2 * y
    return np.asarray(uv + scale[:, None] * np.stack([dx, dy], -1))


def observe_jacobian(camera: Camera, xyz_c: Float) -> Float:
    """Return d pixel / d disturbance (A, 2, E) at zero disturbance, in the order of the fields."""
    projected = camera.project_jacobian(xyz_c).by_point
    theta, unit = _theta(xyz_c), _unit(xyz_c)
    c, s = unit.T
    along_axis, outward = projected[..., 2], _by_theta(projected, xyz_c)
    glass = (_tan_inside(xyz_c) - _tan_glass(_tan_inside(xyz_c)))[:, None] * along_axis
    m = camera.project(xyz_c).uv - camera.centre_px
    size = np.linalg.norm(m, axis=-1, keepdims=True)
    tilt_x, tilt_y = (theta[:, None] * (2 * m * m[:, [i]] / size + size * np.eye(2)[i]) for i in (0, 1))
    reach, tangent = np.linalg.norm(xyz_c[:, :2], axis=-1), _tan_inside(xyz_c)
    index = ((reach - TUBE_OUTER_RADIUS_MM) * tangent * (1 + tangent**2))[:, None] * along_axis
    columns = [
        -(theta / np.sin(theta) - 1)[:, None] * along_axis,
        tilt_x, tilt_y,
        m * np.array([0.5, -0.5]),
        glass, glass * c[:, None], glass * s[:, None],
        index,
        DOME_POWER * np.sin(theta)[:, None] * outward,
        DOME_POWER * (np.cos(theta) * c)[:, None] * outward,
        DOME_POWER * (np.cos(theta) * s)[:, None] * outward,
    ]  # fmt: skip
    return np.stack(columns, -1)


def _apparent(xyz_c: Float, d: Disturbance) -> Float:
    """Return points (A, 3) in the directions from which the light of ``xyz_c`` arrives."""
    reach, unit = np.linalg.norm(xyz_c[:, :2], axis=-1), _unit(xyz_c)
    c, s = unit.T
    glass = d.glass_mm + d.wedge_x_mm * c + d.wedge_y_mm * s
    z = xyz_c[:, 2]
    for _ in range(30 if d != Disturbance() else 0):
        tangent = z / reach
        theta = np.arctan2(reach, z)
        outside = _refracted(tangent, 1 + d.outside_index)
        lift = glass * (tangent - _tan_glass(tangent)) + (reach - TUBE_OUTER_RADIUS_MM) * (tangent - outside)
        before, z = z, xyz_c[:, 2] + lift - d.pupil_mm * (theta / np.sin(theta) - 1)
        if np.abs(z - before).max() < 1e-12:
            break
    theta = np.arctan2(reach, z)
    lateral = d.dome_x_mm * c + d.dome_y_mm * s
    theta = theta + DOME_POWER * (d.dome_axial_mm * np.sin(theta) + lateral * np.cos(theta))
    return np.concatenate([unit * np.sin(theta)[:, None], np.cos(theta)[:, None]], -1)


def _by_theta(projected: Float, xyz_c: Float) -> Float:
    """Return d pixel / dθ (A, 2) from d pixel / d point."""
    theta, unit = _theta(xyz_c), _unit(xyz_c)
    e_theta = np.concatenate([unit * np.cos(theta)[:, None], -np.sin(theta)[:, None]], -1)
    return np.asarray(np.einsum("nij,nj->ni", projected, e_theta * np.linalg.norm(xyz_c, axis=-1)[:, None]))


def _theta(xyz_c: Float) -> Float:
    return np.asarray(np.arctan2(np.linalg.norm(xyz_c[:, :2], axis=-1), xyz_c[:, 2]))


def _unit(xyz_c: Float) -> Float:
    return np.asarray(xyz_c[:, :2] / np.linalg.norm(xyz_c[:, :2], axis=-1, keepdims=True))


def _tan_inside(xyz_c: Float) -> Float:
    """Return tan i of the angle of incidence on a coaxial tube, z / r."""
    return np.asarray(xyz_c[:, 2] / np.linalg.norm(xyz_c[:, :2], axis=-1))


def _tan_glass(tangent: Float) -> Float:
    return _refracted(tangent, _GLASS_INDEX)


def _refracted(tangent: Float, index: float) -> Float:
    """Return tan i′ for tan i, sin i′ = sin i / index."""
    sine = tangent / np.sqrt(1 + tangent**2) / index
    return np.asarray(sine / np.sqrt(1 - sine**2))
