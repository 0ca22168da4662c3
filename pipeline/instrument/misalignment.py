"""How a misaligned laser sheet falsifies the radius of a ring scanner.

The equation of "Error Model of Misalignment Error in a Radial 3D Scanner", eq. (1), its extension to every
azimuth, and the exact chain: misaligned sheet ∩ pipe, seen by the camera, triangulated as if the sheet were
the plane z = baseline. Azimuths are in C; the sheet leans forward toward the tilt direction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float
from pipeline.errors import InputError
from pipeline.instrument.camera import Camera
from pipeline.instrument.laser import LaserSheet

# With less of the ring in view, neither a circle nor a first harmonic can be fitted well (chosen).
_LEAST_SEEN = 0.25
# Half a degree apart: one of them meets the maximum of a first harmonic to 1e-5 of its amplitude.
AZIMUTHS = 720


@dataclass(frozen=True)
class MisalignedScan:
    """A straight pipe parallel to the probe, seen with a sheet assumed to be the plane z = ``baseline_mm``.

    Attributes
    ----------
    diameter_mm, baseline_mm : float
    tilt_deg, tilt_direction_deg : float
        Tilt φ of the sheet and the azimuth ψ₀ in C toward which it leans forward.
    opening_angle_deg : float
        α; below 180 the sheet is a cone that leans forward all round.
    offset_x_mm, offset_y_mm : float
        Where the probe sits in the pipe's section, from the pipe's axis, along x and y of C.

    Raises
    ------
    InputError
        If a value is out of its range or the sheet does not reach the wall in front of the camera all round.
    """

    diameter_mm: float
    baseline_mm: float
    tilt_deg: float = 0.0
    tilt_direction_deg: float = 0.0
    opening_angle_deg: float = 180.0
    offset_x_mm: float = 0.0
    offset_y_mm: float = 0.0

    def __post_init__(self) -> None:
        _within("diameter_mm", self.diameter_mm, 0.0, math.inf, "a diameter above 0 mm")
        _within("baseline_mm", self.baseline_mm, 0.0, math.inf, "a baseline above 0 mm")
        _within("tilt_deg", self.tilt_deg, -1e-12, 90.0, "a tilt from 0 to below 90°")
        _within("tilt_direction_deg", self.tilt_direction_deg, -math.inf, math.inf, "a finite azimuth")
        _within("opening_angle_deg", self.opening_angle_deg, 90.0, 270.0, "an opening angle of 90–270°")
        for name in ("offset_x_mm", "offset_y_mm"):
            _within(name, getattr(self, name), -math.inf, math.inf, "a finite offset")
        if math.hypot(self.offset_x_mm, self.offset_y_mm) >= self.diameter_mm / 2:
            raise InputError(
                "error model", "the probe is outside the pipe",
                place="offset_x_mm, offset_y_mm", expected="an offset below the pipe's radius",
            )  # fmt: skip
        if np.min(self.wall_points(self.azimuths())[:, 2]) <= 0:
            raise InputError(
                "error model", "on one side the sheet meets the wall beside or behind the camera",
                place="tilt_deg, opening_angle_deg", expected="a sheet in front of the camera all round",
                hint="reduce the tilt, or raise the baseline",
            )  # fmt: skip

    @property
    def radius_mm(self) -> float:
        """Radius of the pipe."""
        return self.diameter_mm / 2

    @property
    def offset_mm(self) -> Float:
        """(2,) probe minus pipe axis, in the section."""
        return np.array([self.offset_x_mm, self.offset_y_mm])

    @property
    def sheet(self) -> LaserSheet:
        """The true sheet."""
        slope, direction = math.tan(math.radians(self.tilt_deg)), math.radians(self.tilt_direction_deg)
        cone = math.radians(180 - self.opening_angle_deg) / 2
        return LaserSheet(
            self.baseline_mm, slope * math.cos(direction), slope * math.sin(direction), cone_rad=cone
        )

    def azimuths(self) -> Float:
        """Return (720,) azimuths in C from the tilt direction on, so that both extremes are among them."""
        return math.radians(self.tilt_direction_deg) + 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS

    def wall_points(self, azimuth_rad: Float) -> Float:
        """Return the points (A, 3), mm in C, at which the true sheet meets the wall."""
        return sheet_on_wall(self.sheet, self.radius_mm, self.offset_mm, azimuth_rad)


@dataclass(frozen=True)
class MisreadRing:
    """A true ring, and the same ring triangulated with the assumed plane.

    Attributes
    ----------
    azimuth_rad : (A,)
    xyz_c, xyz_assumed_c : (A, 3)
        On the wall; triangulated. NaN where the camera cannot see.
    radial_mm : (A,)
        Distance of the triangulated point from the pipe's axis minus the pipe's radius.
    euclidean_mm : (A,)
        Distance between the two points, the paper's eq. (3).
    """

    azimuth_rad: Float
    xyz_c: Float
    xyz_assumed_c: Float
    radial_mm: Float
    euclidean_mm: Float


@dataclass(frozen=True)
class MisalignmentError:
    """The figures of one misaligned scan, mm; the field names are the keys of the JSON output."""

    paper_equation_mm: float
    max_radial_mm: float
    max_euclidean_mm: float
    ring_centre_shift_mm: float
    ring_radius_change_mm: float


def paper_error(
    radius_mm: Float | float, baseline_mm: float, tilt_rad: float, azimuth_rad: Float | float = 0.0
) -> Float:
    """Return the paper's eq. (1), r tanθ tanφ / (1 + tanθ tanφ) with tanθ = r/l, at an azimuth.

    Parameters
    ----------
    radius_mm, baseline_mm
    tilt_rad
        φ.
    azimuth_rad
        From the tilt direction; 0 is the paper's side. The product becomes tanθ tanφ cos ψ, so that the
        error is larger on the opposite side. Positive where the radius is measured too small.
    """
    product = np.asarray(radius_mm) / baseline_mm * math.tan(tilt_rad) * np.cos(azimuth_rad)
    return np.asarray(radius_mm * product / (1 + product))


def sheet_on_wall(sheet: LaserSheet, radius_mm: float, offset_mm: Float, azimuth_rad: Float) -> Float:
    """Return (A, 3) points in C where a sheet's rays of azimuth (A,) meet a pipe parallel to the probe.

    ``offset_mm`` (2,) is the probe's place from the pipe's axis.
    """
    unit = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)], -1)
    along = unit @ offset_mm
    reach = -along + np.sqrt(radius_mm**2 - offset_mm @ offset_mm + along**2)
    z = sheet.height(azimuth_rad) + reach * sheet.slope(azimuth_rad)
    return np.concatenate([unit * reach[:, None], z[:, None]], -1)


def misread_ring(
    scan: MisalignedScan, camera: Camera | None = None, azimuth_rad: Float | None = None
) -> MisreadRing:
    """Return the ring on the wall and as triangulated with the plane z = baseline.

    With a camera, only the part of the ring that it sees is returned. The camera is taken to
    be without error.
    """
    azimuth = scan.azimuths() if azimuth_rad is None else azimuth_rad
    xyz = scan.wall_points(azimuth)
    ray = xyz if camera is None else camera.unproject(in_image(camera, camera.project(xyz).uv)).ray
    assumed = LaserSheet(scan.baseline_mm).intersect(ray)
    radial = np.linalg.norm(assumed[:, :2] + scan.offset_mm, axis=-1) - scan.radius_mm
    return MisreadRing(azimuth, xyz, assumed, radial, np.linalg.norm(assumed - xyz, axis=-1))


def in_image(camera: Camera, uv: Float) -> Float:
    """Return pixels (..., 2) with NaN in place of those outside the camera's image."""
    inside = ((uv >= -0.5) & (uv < np.array(camera.image_size) - 0.5)).all(-1, keepdims=True)
    return np.where(inside, uv, np.nan)


def fit_circle(xy: Float) -> tuple[Float, float]:
    """Return centre (2,) and radius of the circle with least squared distances to points (N, 2)."""
    centre = xy.mean(0)
    for _ in range(20):
        arm = xy - centre
        distance = np.linalg.norm(arm, axis=-1)
        design = np.concatenate([arm / distance[:, None], np.ones((len(xy), 1))], -1)
        step = np.linalg.lstsq(design, distance, rcond=None)[0]
        centre = centre + step[:2]
        if np.abs(step[:2]).max() < 1e-12:
            break
    return centre, float(np.linalg.norm(xy - centre, axis=-1).mean())


def misalignment_error(scan: MisalignedScan, camera: Camera | None = None) -> MisalignmentError:
    """Return the figures of a scan; the circle's centre shift is from the pipe's axis.

    Raises
    ------
    InputError
        If the camera sees less than a quarter of the ring.
    """
    ring = misread_ring(scan, camera)
    seen = np.isfinite(ring.radial_mm)
    if seen.mean() < _LEAST_SEEN:
        raise InputError(
            "error model", f"the camera sees {seen.mean():.0%} of the ring",
            expected=f"at least {_LEAST_SEEN:.0%}",
            hint="take a longer baseline or a camera with a wider field of view",
        )  # fmt: skip
    centre, radius = fit_circle(ring.xyz_assumed_c[seen, :2])
    return MisalignmentError(
        float(paper_error(scan.radius_mm, scan.baseline_mm, math.radians(scan.tilt_deg))),
        float(np.abs(ring.radial_mm[seen]).max()),
        float(ring.euclidean_mm[seen].max()),
        float(np.linalg.norm(centre + scan.offset_mm)),
        radius - scan.radius_mm,
    )


def allowed_tilt_deg(scan: MisalignedScan, accuracy_mm: float) -> float:
    """Return the largest tilt at which no point's radial error exceeds ``accuracy_mm``, deg.

    The other properties of the scan (direction, opening angle, offset) stay; its own tilt is not used. NaN
    where the error is larger already without tilt.

    Raises
    ------
    InputError
        If the accuracy is not a positive number.
    """
    _within("accuracy_mm", accuracy_mm, 0.0, math.inf, "an accuracy above 0 mm")
    if _largest_error(scan, 0.0) > accuracy_mm:
        return math.nan
    low, high = 0.0, 90.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if _largest_error(scan, middle) <= accuracy_mm else (low, middle)
    return low


def implied_baselines_mm(diameter_mm: float, tilt_deg: float, accuracy_mm: float) -> tuple[float, float]:
    """Return the baselines at which the paper's radial and its Euclidean error reach ``accuracy_mm``.

    The paper states 0.05° for 0.1 mm in a 4 inch pipe but not its baseline: 22.5 mm if its error is radial
    (eq. 1), 25.1 mm if it is the distance of the points (eq. 3), both on the paper's side.
    """
    r, lift = diameter_mm / 2, diameter_mm / 2 * math.tan(math.radians(tilt_deg))
    radial = lift * (r - accuracy_mm) / accuracy_mm
    # |X̂ − X| = lift √(r² + z²) / z with z = l + lift
    z = r / math.sqrt((accuracy_mm / lift) ** 2 - 1) if accuracy_mm > lift else math.nan
    return radial, z - lift


def _largest_error(scan: MisalignedScan, tilt_deg: float) -> float:
    try:
        ring = misread_ring(replace(scan, tilt_deg=tilt_deg))
    except InputError:
        return math.inf
    return float(np.abs(ring.radial_mm).max())


def _within(name: str, value: float, low: float, high: float, expected: str) -> None:
    """Refuse a value outside the open interval (low, high) or not finite."""
    if not (math.isfinite(value) and low < value < high):
        raise InputError("error model", f"{value} is out of range", place=name, expected=expected)
