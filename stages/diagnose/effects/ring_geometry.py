"""The line on the wall as seen in the image: how it moves when sheet, wall or image move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe

_STEP_RAD = 1e-5


@dataclass(frozen=True)
class RingGeometry:
    """The line at M points, seen in the half-planes of their azimuths in C.

    Attributes
    ----------
    per_sheet_c, per_wall_c : (M, 3)
        Displacement in C, mm, of the line's point in its half-plane per mm by which the sheet moves forward
        along the optical axis, and per mm by which the wall moves outward.
    tangent_px : (M, 2)
        Direction of the line in the image.
    outward_px : (M, 2)
        Unit direction of the image radius.
    rho_px : (M,)
        Image radius.
    by_point : (M, 2, 3)
        Derivative of the image with respect to the point, px/mm.
    """

    per_sheet_c: Float
    per_wall_c: Float
    tangent_px: Float
    outward_px: Float
    rho_px: Float
    by_point: Float

    def around(self, shift_px: Float) -> Float:
        """Return the part (M,) of shifts (M, 2) across the image radius, px."""
        return _cross(self.outward_px, shift_px)

    def read_small(self, shift_px: Float) -> Float:
        """Return how much (M,), px, farther out the line is found at one azimuth after small shifts (M, 2).

        A shift across the radius counts by the line's inclination to the circle through it, which
        distinguishes a shifted image from a tilted sheet in an off-centre ring.
        """
        return _cross(shift_px, self.tangent_px) / _cross(self.outward_px, self.tangent_px)

    def read_move(self, way_c: Float) -> Float:
        """Return `read_small` (M,) for small displacements (M, 3), mm in C, of the line's points."""
        return self.read_small(np.einsum("mij,mj->mi", self.by_point, way_c))


def ring_geometry(probe: Probe, xyz_c: Float, normal_c: Float, uv: Float) -> RingGeometry:
    """Return the geometry of the stated sheet's line at wall points and outward normals (M, 3) in C."""
    psi = np.arctan2(xyz_c[:, 1], xyz_c[:, 0])
    slope = probe.laser.slope(psi)
    unit_q = np.stack([np.cos(psi), np.sin(psi), np.zeros_like(psi)], axis=1)
    unit_z = np.array([0.0, 0.0, 1.0])
    along_sheet = unit_q + slope[:, None] * unit_z
    steepness = np.sum(normal_c * along_sheet, axis=1)
    per_wall = along_sheet / steepness[:, None]
    per_sheet = unit_z - normal_c[:, 2:] * per_wall
    by_point = probe.camera.project_jacobian(xyz_c).by_point
    tangent = np.cross(normal_c, _sheet_normal(probe.laser, xyz_c, psi, unit_q))
    away = uv - probe.camera.centre_px
    rho = np.linalg.norm(away, axis=1)
    return RingGeometry(
        per_sheet, per_wall, np.einsum("mij,mj->mi", by_point, tangent), away / rho[:, None], rho, by_point
    )


def _sheet_normal(laser: LaserSheet, xyz_c: Float, psi: Float, unit_q: Float) -> Float:
    """Return the gradient (M, 3) of z − height(ψ) − q slope(ψ)."""
    q = np.hypot(xyz_c[:, 0], xyz_c[:, 1])

    def height(azimuth: Float) -> Float:
        return np.asarray(laser.height(azimuth) + q * laser.slope(azimuth))

    turn = (height(psi + _STEP_RAD) - height(psi - _STEP_RAD)) / (2 * _STEP_RAD)
    unit_psi = np.stack([-unit_q[:, 1], unit_q[:, 0], np.zeros_like(psi)], axis=1)
    rise = laser.slope(psi)[:, None] * unit_q + (turn / q)[:, None] * unit_psi
    return np.asarray(np.array([0.0, 0.0, 1.0]) - rise)


def _cross(a: Float, b: Float) -> Float:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def turned_about_z(vector: Float, angle_rad: Float) -> Float:
    """Return vectors (M, 2) or (M, 3) turned about the optical axis by angles (M,)."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    x, y = vector[:, 0], vector[:, 1]
    return np.column_stack([c * x - s * y, s * x + c * y, vector[:, 2:]])
