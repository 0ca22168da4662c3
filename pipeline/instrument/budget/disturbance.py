"""Effects between wall and pixel that the probe's parameters do not describe, exactly and to first order.

Laws: shared PHYSICS notes, tables "Camera" and "Windows and media".
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.camera.base import Camera

# Refractive index of crown glass, and outer radius of the tube that the budget supposes. Debt: data/debts.md.
TUBE_INDEX = 1.51
TUBE_RADIUS_MM = 14.0
# (n − 1) t / (n ρ²) of an acrylic dome 1.5 mm thick with a radius of 12 mm, 1/mm
_DOME_POWER = 0.49 * 1.5 / (1.49 * 12.0**2)


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
    index = ((reach - TUBE_RADIUS_MM) * tangent * (1 + tangent**2))[:, None] * along_axis
    columns = [
        -(theta / np.sin(theta) - 1)[:, None] * along_axis,
        tilt_x, tilt_y,
        m * np.array([0.5, -0.5]),
        glass, glass * c[:, None], glass * s[:, None],
        index,
        _DOME_POWER * np.sin(theta)[:, None] * outward,
        _DOME_POWER * (np.cos(theta) * c)[:, None] * outward,
        _DOME_POWER * (np.cos(theta) * s)[:, None] * outward,
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
        lift = glass * (tangent - _tan_glass(tangent)) + (reach - TUBE_RADIUS_MM) * (tangent - outside)
        before, z = z, xyz_c[:, 2] + lift - d.pupil_mm * (theta / np.sin(theta) - 1)
        if np.abs(z - before).max() < 1e-12:
            break
    theta = np.arctan2(reach, z)
    lateral = d.dome_x_mm * c + d.dome_y_mm * s
    theta = theta + _DOME_POWER * (d.dome_axial_mm * np.sin(theta) + lateral * np.cos(theta))
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
    return _refracted(tangent, TUBE_INDEX)


def _refracted(tangent: Float, index: float) -> Float:
    """Return tan i′ for tan i, sin i′ = sin i / index."""
    sine = tangent / np.sqrt(1 + tangent**2) / index
    return np.asarray(sine / np.sqrt(1 - sine**2))
