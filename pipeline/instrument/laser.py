"""The laser sheet as a surface of rays from the laser's axis, and a plane measured in its place.

A sheet point at distance q from the axis and azimuth ψ has, in C,
z = l + h cos(ψ − ψ_h) + q · slope(ψ), slope(ψ) = tan φ cos(ψ − ψ_φ) + tan ε₀ + Σ_m ε_m cos m(ψ − ψ_m),
with baseline l, tilt φ, cone elevation ε₀ = (180° − opening angle) / 2, decentre height h, waviness ε_m
(shared PHYSICS notes, "The instrument"). The tilt alone is exactly a plane.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float
from pipeline.errors import UnusableError

# Orders of waviness that a probe file may state.
_WAVES = (2, 3, 4)


@dataclass(frozen=True)
class LaserSheet:
    """A laser sheet that may be tilted, conical, decentred and wavy.

    Attributes
    ----------
    baseline_mm : float
        Distance l from the camera's viewpoint to the laser's source along the optical axis.
    tilt_x, tilt_y : float
        tan φ cos ψ_φ and tan φ sin ψ_φ: slope of the sheet along x and y of C.
    cone_rad : float
        ε₀, positive when the sheet leans forward all round.
    decentre_x_mm, decentre_y_mm : float
        h cos ψ_h and h sin ψ_h.
    waviness : tuple of float
        (ε_m cos mψ_m, ε_m sin mψ_m) for m = 2, 3, 4, rad, flattened; six numbers.
    line_sigma_mm : float
        1 σ of the sheet's thickness at the wall.
    wavelength_nm : float
    """

    baseline_mm: float
    tilt_x: float = 0.0
    tilt_y: float = 0.0
    cone_rad: float = 0.0
    decentre_x_mm: float = 0.0
    decentre_y_mm: float = 0.0
    waviness: tuple[float, ...] = (0.0,) * (2 * len(_WAVES))
    line_sigma_mm: float = 0.15
    wavelength_nm: float = 520.0

    PARAMETER_NAMES = (
        "baseline_mm", "tilt_x", "tilt_y", "cone_rad", "decentre_x_mm", "decentre_y_mm",
        *(f"wave{m}_{part}" for m in _WAVES for part in ("cos", "sin")),
    )  # fmt: skip

    @property
    def parameters(self) -> Float:
        """(12,) geometric parameters in the order of ``PARAMETER_NAMES``."""
        lead = [getattr(self, n) for n in self.PARAMETER_NAMES[:6]]
        return np.array([*lead, *self.waviness], float)

    def with_parameters(self, parameters: Float) -> LaserSheet:
        """Return the sheet with other geometric parameters (12,), in the order of ``PARAMETER_NAMES``."""
        lead = dict(zip(self.PARAMETER_NAMES[:6], map(float, parameters[:6]), strict=True))
        return replace(self, **lead, waviness=tuple(float(p) for p in parameters[6:]))

    def untilted(self) -> LaserSheet:
        """Return this sheet as the seed paper assumes it: the plane z = baseline, parallel to the image."""
        return LaserSheet(
            self.baseline_mm, line_sigma_mm=self.line_sigma_mm, wavelength_nm=self.wavelength_nm
        )

    def slope(self, azimuth_rad: Float) -> Float:
        """Return dz/dq (...) of the sheet's rays at azimuth ψ (...) in C."""
        psi = np.asarray(azimuth_rad, float)
        slope = self.tilt_x * np.cos(psi) + self.tilt_y * np.sin(psi) + np.tan(self.cone_rad)
        for m, along, across in zip(_WAVES, self.waviness[::2], self.waviness[1::2], strict=True):
            if along or across:  # most sheets are stated without waves, and sines are slow
                slope = slope + along * np.cos(m * psi) + across * np.sin(m * psi)
        return np.asarray(slope)

    def height(self, azimuth_rad: Float) -> Float:
        """Return z (...) in mm at which the ray of azimuth ψ leaves the axis."""
        psi = np.asarray(azimuth_rad)
        return np.asarray(
            self.baseline_mm + self.decentre_x_mm * np.cos(psi) + self.decentre_y_mm * np.sin(psi)
        )

    def intersect(self, ray_c: Float) -> Float:
        """Return the points (..., 3), mm in C, where camera rays (..., 3) meet the sheet.

        NaN where a ray never meets it in front of the camera.
        """
        scale = self._ray_scale(np.asarray(ray_c, float))[0]
        return np.asarray(ray_c * scale[..., None])

    def intersect_jacobian(self, ray_c: Float) -> tuple[Float, Float]:
        """Return derivatives of `intersect`: by ray (..., 3, 3) and by parameters (..., 3, 12)."""
        d = np.asarray(ray_c, float)
        scale, slope, rho, psi = self._ray_scale(d)
        sink = self.height(psi) / scale
        c, s = np.cos(psi), np.sin(psi)
        dslope, dheight = self._azimuth_derivatives(psi)
        by_psi = (dheight + scale * rho * dslope) / sink
        d_rho = np.stack([c, s, np.zeros_like(c)], -1)
        d_psi = np.stack([-s / rho, c / rho, np.zeros_like(c)], -1)
        d_z = np.array([0.0, 0.0, 1.0])
        gradient = (scale / sink)[..., None] * (slope[..., None] * d_rho - d_z) + by_psi[..., None] * d_psi
        by_ray = scale[..., None, None] * np.eye(3) + d[..., :, None] * gradient[..., None, :]
        height_basis = np.stack([np.ones_like(c), c, s], -1) / sink[..., None]
        slope_basis = self._slope_basis(psi) * (scale * rho / sink)[..., None]
        by_scale = np.concatenate(
            [height_basis[..., :1], slope_basis[..., :3], height_basis[..., 1:], slope_basis[..., 3:]], -1
        )
        by_scale[..., 3] *= 1 + np.tan(self.cone_rad) ** 2
        return by_ray, d[..., :, None] * by_scale[..., None, :]

    def _ray_scale(self, d: Float) -> tuple[Float, Float, Float, Float]:
        rho = np.hypot(d[..., 0], d[..., 1])
        psi = np.arctan2(d[..., 1], d[..., 0])
        slope = self.slope(psi)
        sink = d[..., 2] - rho * slope
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(sink > 1e-9, self.height(psi) / sink, np.nan)
        return scale, slope, rho, psi

    def _slope_coefficients(self) -> Float:
        return np.array([self.tilt_x, self.tilt_y, np.tan(self.cone_rad), *self.waviness])

    @staticmethod
    def _slope_basis(psi: Float) -> Float:
        psi = np.asarray(psi, float)
        waves = [f(m * psi) for m in _WAVES for f in (np.cos, np.sin)]
        return np.stack([np.cos(psi), np.sin(psi), np.ones_like(psi), *waves], -1)

    def _azimuth_derivatives(self, psi: Float) -> tuple[Float, Float]:
        waves = [f for m in _WAVES for f in (-m * np.sin(m * psi), m * np.cos(m * psi))]
        basis = np.stack([-np.sin(psi), np.cos(psi), np.zeros_like(psi), *waves], -1)
        dheight = -self.decentre_x_mm * np.sin(psi) + self.decentre_y_mm * np.cos(psi)
        return basis @ self._slope_coefficients(), dheight


NAME = "calibrate-laser"
# Tangent of 45°, beyond which a plane does not surround the axis as a ring probe's sheet does.
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
            When the plane leans by 45° or more or crosses the optical axis behind the camera: then it does
            not surround the axis as the sheet of a ring probe does.
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
