"""Effects of windows and media between the probe and the wall.

Rays are followed in the half-plane of their azimuth: a coaxial tube is met at the angle i from its normal,
with tan i = z/q for a straight ray, and every layer of thickness b and relative index n lets the ray climb by
b tan i′, sin i′ = sin i / n, instead of b tan i.
"""

from __future__ import annotations

import numpy as np

from pipeline.physics.window import DOME_RADIUS_MM, DOME_THICKNESS_MM, GLASS_INDEX
from stages.diagnose.effects.base import EffectModel, Float, ImagePoints, Shape
from stages.diagnose.effects.camera import image_shift
from stages.diagnose.effects.kinds import Directed, Scalar, along_x_and_y, cosine, one

_TUBE_THICKNESS_MM = 2.0
_TUBE_RADIUS_MM = 15.0
_DOME_POWER_PER_MM = (GLASS_INDEX - 1) * DOME_THICKNESS_MM / (GLASS_INDEX * DOME_RADIUS_MM**2)
_STEPS = 6


class HousingGlass(Scalar):
    """A coaxial glass tube around the probe; the laser crosses it at normal incidence."""

    name = "housing_glass"
    amplitudes = one(name, 1.0)
    words = "A coaxial glass tube {thickness_mm:+.3f} mm thicker than stated stands before the wall."

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the tube, less that without."""
        return _through_glass(points, np.full(len(points.uv), float(amplitude[0])))


class TubeWedge(Directed):
    """The tube is thicker on one side."""

    name = "tube_wedge"
    amplitudes = along_x_and_y(name, 0.1)
    words = (
        "The glass tube is {wedge_mm:.3f} mm thicker toward azimuth {direction_deg:.1f}°, thinner opposite."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through glass of thickness δt cos(ψ − ψ₀), less that without."""
        return _through_glass(points, cosine(points.azimuth_rad, amplitude))


class TubeTilt(Directed):
    """A glass tube of 2 mm leans; the crest is where its outward normal leans forward.

    The shape is 1 where the laser crosses the tube too, 0 where only the camera looks through it.
    """

    name = "tube_tilt"
    amplitudes = along_x_and_y(name, 1.0)
    words = (
        "The glass tube before the wall is tilted by {tilt_deg:.3f}°, its normal leaning forward at azimuth "
        "{direction_deg:.1f}°."
    )

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return a tube before the camera alone and one before both."""
        return ((0.0,), (1.0,))

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the leaning tube, less that through the straight one."""
        lean = cosine(points.azimuth_rad, np.radians(amplitude))
        climb = points.xyz_c[:, 2].copy()
        for _ in range(_STEPS):
            incidence = np.arctan2(climb, points.radius_mm)
            lost = (_displacement_mm(incidence - lean) - _displacement_mm(incidence)) / np.cos(incidence)
            climb = points.xyz_c[:, 2] + lost
        return image_shift(points, np.column_stack([points.xyz_c[:, :2], climb]))

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the laser's displacement by the leaning glass."""
        return shape[0] * _displacement_mm(cosine(points.azimuth_rad, np.radians(amplitude)))


class DomeAxial(Scalar):
    """The viewpoint stands ahead of the centre of a concentric glass dome, or behind it."""

    name = "dome_axial"
    amplitudes = one(name, 0.3)
    words = "The glass dome's centre is {offset_mm:+.3f} mm behind the lens's viewpoint along the axis."

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the dome whose centre is at −d on the axis, less that without."""
        return _through_dome(points, np.array([0.0, 0.0, -amplitude[0]]))


class DomeLateral(Directed):
    """The centre of a concentric glass dome lies beside the viewpoint."""

    name = "dome_lateral"
    amplitudes = along_x_and_y(name, 0.2)
    words = (
        "The glass dome's centre is {offset_mm:.3f} mm beside the axis, toward azimuth {direction_deg:.1f}°."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the dome whose centre is beside the axis, less that without."""
        return _through_dome(points, np.array([amplitude[0], amplitude[1], 0.0]))


class OutsideIndex(Scalar):
    """The medium outside a sealed tube of 15 mm radius bends rays where they leave the tube."""

    name = "outside_index"
    amplitudes = one(name, 2e-3)
    words = (
        "The medium outside the sealed probe has an index of refraction {index_excess:+.2e} above the stated."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the medium, less that without."""
        inside = np.full(len(points.uv), _TUBE_RADIUS_MM)
        outside = points.radius_mm - inside
        return _through_layers(points, inside, outside, 1 + float(amplitude[0]))


def _through_glass(points: ImagePoints, thickness_mm: Float) -> Float:
    return _through_layers(points, points.radius_mm - thickness_mm, thickness_mm, GLASS_INDEX)


def _through_layers(points: ImagePoints, plain_mm: Float, dense_mm: Float, index: float) -> Float:
    """Return (M, 2) the image's shift where rays cross ``dense_mm`` of an index and ``plain_mm`` without.

    Newton's method on z = plain · tan i + dense · tan i′.
    """
    z = points.xyz_c[:, 2]
    steep = z / points.radius_mm
    for _ in range(_STEPS):
        inside = index**2 * (1 + steep**2) - steep**2
        excess = plain_mm * steep + dense_mm * steep / np.sqrt(inside) - z
        steep = steep - excess / (plain_mm + dense_mm * index**2 / inside**1.5)
    return image_shift(points, np.column_stack([points.xyz_c[:, :2], points.radius_mm * steep]))


def _displacement_mm(incidence_rad: Float) -> Float:
    """Return (M,) parallel displacement of a ray by the tube's glass met at an incidence."""
    sine = np.sin(incidence_rad)
    glass = np.sqrt(GLASS_INDEX**2 - sine**2)
    return np.asarray(_TUBE_THICKNESS_MM * sine * (1 - np.cos(incidence_rad) / glass))


def _through_dome(points: ImagePoints, centre_c: Float) -> Float:
    """Return (M, 2) the image's shift through a thin concentric dome about ``centre_c`` (3,).

    A ray that passes the centre at distance b leaves turned about it by b (n−1) t / (n ρ²), away from the
    centre; the wall point turned back about the centre is seen as though there were no dome.
    """
    from_centre = points.xyz_c - centre_c
    seen = points.xyz_c
    for _ in range(3):
        ray = seen / np.linalg.norm(seen, axis=1)[:, None]
        aside = -centre_c + (ray @ centre_c)[:, None] * ray
        turned = _along(ray, from_centre) * aside - _along(aside, from_centre) * ray
        seen = points.xyz_c - _DOME_POWER_PER_MM * turned
    return image_shift(points, seen)


def _along(direction: Float, vector: Float) -> Float:
    return np.asarray(np.sum(direction * vector, axis=1)[:, None])


WINDOW_MODELS: tuple[EffectModel, ...] = (
    HousingGlass(),
    TubeWedge(),
    TubeTilt(),
    DomeAxial(),
    DomeLateral(),
    OutsideIndex(),
)
