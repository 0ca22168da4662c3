"""Effects of windows and media between the probe and the wall.

Rays are traced in the half-plane of their azimuth: a ray meets a coaxial tube at the angle i from its normal,
with tan i = z/q for a straight ray. In every layer of thickness b and relative index n it advances along the
axis by b tan i′, sin i′ = sin i / n, instead of by b tan i.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.instrument import DOME_POWER, GLASS_INDEX, TUBE_OUTER_RADIUS_MM, TUBE_THICKNESS_MM
from stages.diagnose.effects.base import EffectModel, ImagePoints, Shape
from stages.diagnose.effects.camera import image_shift
from stages.diagnose.effects.kinds import Directed, Scalar, along_x_and_y, one

# Glasses and clear plastics of windows have an index of 1.45 to 1.55 (fused silica 1.458, PMMA 1.491, BK7
# 1.517), taken as uniform. The shift grows as 1 − 1/n, so that a size computed with n = 1.5 has a relative
# error of dn / (n (n − 1)).
_BY_INDEX = 0.1 / np.sqrt(12) / (GLASS_INDEX * (GLASS_INDEX - 1))
_STEPS = 6
_NONE = np.zeros(2)


class HousingGlass(Scalar):
    """A coaxial glass tube around the probe; the laser crosses it at normal incidence."""

    name = "housing_glass"
    amplitudes = one(name, 1.0)
    law_sigma = float(_BY_INDEX)
    words = "A coaxial glass tube {thickness_mm:.3f} mm [thicker|thinner] than stated stands before the wall."

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the tube minus that without it, px."""
        layers = _layers(points, np.full(len(points.uv), float(amplitude[0])))
        return _seen_under(points, points.azimuth_rad, _steepness(points, *layers, GLASS_INDEX))


class TubeWedge(Directed):
    """The tube's outer face is decentred: the glass is thicker on one side, and a prism on the flanks."""

    name = "tube_wedge"
    amplitudes = along_x_and_y(name, 0.1)
    law_sigma = float(_BY_INDEX)
    words = (
        "The glass tube is {wedge_mm:.3f} mm thicker toward azimuth {direction_deg:.1f}°, thinner opposite."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the tube with its outer face decentred minus that through it, px."""
        return _seen_through(points, _tube(wedge_mm=amplitude))


class TubeTilt(Directed):
    """A glass tube of 2 mm thickness is tilted; the crest is where its outward normal leans forward.

    The shape is 1 where the laser also passes through the tube, 0 where only the camera looks through it.
    """

    name = "tube_tilt"
    amplitudes = along_x_and_y(name, 1.0)
    words = (
        "The glass tube before the wall is tilted by {tilt_deg:.3f}°, its normal leaning forward at azimuth "
        "{direction_deg:.1f}°."
    )
    # A calibration treats the straight tube as part of the lens. Whether its displacement is subtracted or
    # undone by glass the other way round makes 4 to 30 % of the shift of texture 12 to 70 mm ahead in a bore
    # of 84 mm, and 1 % of the ring's.
    law_sigma = 0.3

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return a tube before the camera only, and one before both."""
        return ((0.0,), (1.0,))

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the tilted tube minus that through the straight one, px."""
        return _seen_through(points, _tube(lean=np.radians(amplitude)))

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the laser's displacement by the tilted glass, mm."""
        faulty, straight = (
            _height_mm(points, faces) for faces in (_tube(lean=np.radians(amplitude)), _tube())
        )
        return np.asarray(shape[0] * (faulty - straight))


class DomeAxial(Scalar):
    """The viewpoint is ahead of the centre of a concentric glass dome, or behind it."""

    name = "dome_axial"
    amplitudes = one(name, 0.3)
    words = (
        "The glass dome's centre is {offset_mm:.3f} mm [behind|before] the lens's viewpoint along the axis."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the dome with its centre at −d on the axis minus that without it, px."""
        return _through_dome(points, np.array([0.0, 0.0, -amplitude[0]]))


class DomeLateral(Directed):
    """The centre of a concentric glass dome is beside the viewpoint."""

    name = "dome_lateral"
    amplitudes = along_x_and_y(name, 0.2)
    words = (
        "The glass dome's centre is {offset_mm:.3f} mm beside the axis, toward azimuth {direction_deg:.1f}°."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the dome with its centre beside the axis minus that without it, px."""
        return _through_dome(points, np.array([amplitude[0], amplitude[1], 0.0]))


class OutsideIndex(Scalar):
    """The medium outside a sealed tube of 15 mm radius refracts rays where they leave the tube."""

    name = "outside_index"
    amplitudes = one(name, 2e-3)
    words = (
        "The medium outside the sealed probe has an index of refraction {index_excess:.2e} "
        "[above|below] the stated."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the medium minus that without it, px."""
        plain, dense = _layers(points, points.radius_mm - TUBE_OUTER_RADIUS_MM)
        steep = _steepness(points, plain, dense, 1 + float(amplitude[0]))
        return _seen_under(points, points.azimuth_rad, steep)


def _layers(points: ImagePoints, dense_mm: Float) -> tuple[Float, Float]:
    """Return the path (M,), mm, across layers without the index, and that in layers with it."""
    return points.radius_mm - dense_mm, dense_mm


def _steepness(points: ImagePoints, plain_mm: Float, dense_mm: Float, index: float) -> Float:
    """Return tan i (M,) at the lens, by Newton's method on z = plain · tan i + dense · tan i′."""
    z = points.xyz_c[:, 2]
    steep = z / points.radius_mm
    for _ in range(_STEPS):
        inside = index**2 * (1 + steep**2) - steep**2
        excess = plain_mm * steep + dense_mm * steep / np.sqrt(inside) - z
        steep = steep - excess / (plain_mm + dense_mm * index**2 / inside**1.5)
    return np.asarray(steep)


def _seen_under(points: ImagePoints, azimuth_rad: Float, steep: Float) -> Float:
    """Return the image shift (M, 2), px, where rays leave the lens at azimuths and with tan i (M,)."""
    q = points.radius_mm
    return image_shift(points, np.column_stack([q * np.cos(azimuth_rad), q * np.sin(azimuth_rad), q * steep]))


@dataclass(frozen=True)
class _Face:
    """A cylindrical face of a tube.

    Attributes
    ----------
    radius_mm, index : float
        Its radius, and the index of refraction beyond it.
    centre_mm, lean : (2,)
        The point of its axis beside the viewpoint, and by how much the axis leans toward −x and −y, rad.
    """

    radius_mm: float
    index: float
    centre_mm: Float
    lean: Float


def _tube(wedge_mm: Float = _NONE, lean: Float = _NONE) -> tuple[_Face, _Face]:
    """Return both faces of a tube of 2 mm thickness whose outer face is decentred, or that leans."""
    inner = _Face(TUBE_OUTER_RADIUS_MM - TUBE_THICKNESS_MM, GLASS_INDEX, _NONE, lean)
    return inner, _Face(TUBE_OUTER_RADIUS_MM, 1.0, wedge_mm, lean)


def _seen_through(points: ImagePoints, faulty: Sequence[_Face]) -> Float:
    """Return the image shift (M, 2), px, of points through a faulty tube in place of the straight one.

    The lens was calibrated together with the straight tube, which displaces rays parallel to themselves.
    """
    seen = points.xyz_c
    for _ in range(_STEPS):
        ray = _unit(seen)
        straight, _same = _refracted(np.zeros(3), ray, _tube())
        place, beyond = _refracted(np.zeros(3), ray, faulty)
        missed = points.xyz_c + straight - _along(ray, straight) * ray - place
        seen = seen + missed - _along(beyond, missed) * beyond
    return image_shift(points, seen)


def _height_mm(points: ImagePoints, faces: Sequence[_Face]) -> Float:
    """Return the height (M,), mm, at which the laser's sheet meets the wall after passing faces."""
    laser, psi = points.probe.laser, points.azimuth_rad
    sent = np.column_stack([np.cos(psi), np.sin(psi), laser.slope(psi)])
    place, ray = _refracted(np.array([0.0, 0.0, laser.baseline_mm]), _unit(sent), faces)
    beyond = points.radius_mm - np.hypot(place[:, 0], place[:, 1])
    return np.asarray(place[:, 2] + beyond * ray[:, 2] / np.hypot(ray[:, 0], ray[:, 1]))


def _refracted(source: Float, ray: Float, faces: Sequence[_Face]) -> tuple[Float, Float]:
    """Return points (M, 3) on the last face and directions (M, 3) beyond it of rays from a point (3,)."""
    place, before = np.broadcast_to(source, ray.shape), 1.0
    for face in faces:
        axis = np.array([-face.lean[0], -face.lean[1], 1.0]) / np.sqrt(1 + face.lean @ face.lean)
        from_axis = _across(place - np.append(face.centre_mm, 0.0), axis)
        away = _across(ray, axis)
        square, half = _along(away, away), _along(away, from_axis)
        inside = _along(from_axis, from_axis) - face.radius_mm**2
        step = (np.sqrt(half**2 - square * inside) - half) / square
        place, normal = place + step * ray, (from_axis + step * away) / face.radius_mm
        ratio, cosine_in = before / face.index, _along(ray, normal)
        cosine_out = np.sqrt(1 - ratio**2 * (1 - cosine_in**2))
        ray, before = ratio * ray + (cosine_out - ratio * cosine_in) * normal, face.index
    return place, ray


def _unit(vector: Float) -> Float:
    return np.asarray(vector / np.linalg.norm(vector, axis=1)[:, None])


def _across(vector: Float, axis: Float) -> Float:
    return np.asarray(vector - (vector @ axis)[:, None] * axis)


def _through_dome(points: ImagePoints, centre_c: Float) -> Float:
    """Return the image shift (M, 2), px, through a thin concentric dome about ``centre_c`` (3,).

    A ray that passes the centre at distance b leaves turned about it by b (n−1) t / (n ρ²), away from the
    centre; the wall point, turned back about the centre, is seen as if there were no dome.
    """
    from_centre = points.xyz_c - centre_c
    seen = points.xyz_c
    for _ in range(3):
        ray = _unit(seen)
        aside = -centre_c + (ray @ centre_c)[:, None] * ray
        turned = _along(ray, from_centre) * aside - _along(aside, from_centre) * ray
        seen = points.xyz_c - DOME_POWER * turned
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
