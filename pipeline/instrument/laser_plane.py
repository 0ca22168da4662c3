"""A laser plane measured in the camera's frame, with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.errors import UnusableError
from pipeline.instrument.laser import LaserSheet

NAME = "calibrate-laser"
_STEEPEST = 1.0


@dataclass(frozen=True)
class LaserPlane:
    """The plane n · x = d in the camera's frame C.

    Attributes
    ----------
    normal_c : (3,)
        Unit normal n, its largest component positive.
    distance_mm : float
        Signed distance d of the plane from the camera's viewpoint along n.
    covariance : (4, 4)
        Of (n, d), of rank 3 because n keeps its length; the camera is taken as exact.
    rms_mm : float
        Root mean square distance of the points used from the plane.
    points : int
        Number of points used.
    """

    normal_c: Float
    distance_mm: float
    covariance: Float
    rms_mm: float
    points: int

    @property
    def tilt_sigma_rad(self) -> float:
        """1 σ of the normal's direction where it is known least."""
        return float(np.sqrt(max(np.linalg.eigvalsh(self.covariance[:3, :3])[-1], 0.0)))

    def distances(self, xyz_c: Float) -> Float:
        """Return signed distances (...), mm, of points (..., 3) from the plane, positive along the normal."""
        return np.asarray(xyz_c @ self.normal_c - self.distance_mm)

    def sheet(self, line_sigma_mm: float, wavelength_nm: float) -> LaserSheet:
        """Return the plane as a laser sheet z = l + x tilt_x + y tilt_y.

        Raises
        ------
        UnusableError
            When the plane leans by 45° or more or crosses the optical axis behind the camera: then it is
            no sheet that surrounds the axis of a ring probe.
        """
        baseline_mm, tilt_x, tilt_y = self._sheet_parameters()
        slope = float(np.hypot(tilt_x, tilt_y))
        if not slope < _STEEPEST or not baseline_mm > 0:
            raise UnusableError(
                NAME,
                f"the laser plane leans by {np.rad2deg(np.arctan(slope)):.1f}° and crosses the optical axis "
                f"at z = {baseline_mm:.1f} mm",
                limit="less than 45°, in front of the camera",
                hint="only the plane of a ring probe can go into a probe file",
            )
        return LaserSheet(
            baseline_mm, tilt_x, tilt_y, line_sigma_mm=line_sigma_mm, wavelength_nm=wavelength_nm
        )

    def sheet_covariance(self) -> Float:
        """Return the covariance (3, 3) of ``baseline_mm``, ``tilt_x`` and ``tilt_y`` of `sheet`."""
        nx, ny, nz = self.normal_c
        jacobian = np.array(
            [
                [0, 0, -self.distance_mm / nz**2, 1 / nz],
                [-1 / nz, 0, nx / nz**2, 0],
                [0, -1 / nz, ny / nz**2, 0],
            ]
        )
        return np.asarray(jacobian @ self.covariance @ jacobian.T)

    def _sheet_parameters(self) -> tuple[float, float, float]:
        nx, ny, nz = (float(n) for n in self.normal_c)
        if nz == 0:
            return float("inf"), float("inf"), float("inf")
        return self.distance_mm / nz, -nx / nz, -ny / nz
