"""Effects of windows and media between the probe and the wall.

Rays are traced in the half-plane of their azimuth: a ray meets a coaxial tube at the angle i from its normal,
with tan i = z/q for a straight ray. In every layer of thickness b and relative index n it advances along the
axis by b tan i′, sin i′ = sin i / n, instead of by b tan i.
"""

from __future__ import annotations

import numba
import numpy as np

from pipeline.arrays import Float
from pipeline.physics.instrument import DOME_POWER, GLASS_INDEX, TUBE_OUTER_RADIUS_MM, TUBE_THICKNESS_MM
from stages.diagnose.effects.base import EffectModel, ImagePoints, Shape
from stages.diagnose.effects.camera import image_shift
from stages.diagnose.effects.kinds import Directed, Scalar

# Glasses and clear plastics of windows have an index of 1.45 to 1.55 (fused silica 1.458, PMMA 1.491, BK7
# 1.517), taken as uniform. The shift grows as 1 − 1/n, so that a size computed with n = 1.5 has a relative
# error of dn / (n (n − 1)).
_BY_INDEX = 0.1 / np.sqrt(12) / (GLASS_INDEX * (GLASS_INDEX - 1))
_STEPS = 6
# Rounds of a fixed point: each leaves a hundredth, the tube's displacement over the distance of the wall.
_ROUNDS = 3
_NONE = np.zeros(2)


class HousingGlass(Scalar, name="housing_glass", plausible=1.0):
    """A coaxial glass tube around the probe; the laser crosses it at normal incidence."""

    law_sigma = float(_BY_INDEX)
    words = "A coaxial glass tube {thickness_mm:.3f} mm [thicker|thinner] than stated stands before the wall."

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the tube minus that without it, px."""
        glass_mm = np.full(len(points.uv), float(amplitude[0]))
        return _seen_through_layer(points, glass_mm, GLASS_INDEX)


class TubeWedge(Directed, name="tube_wedge", plausible=0.1):
    """The tube's outer face is decentred: the glass is thicker on one side, and a prism on the flanks."""

    law_sigma = float(_BY_INDEX)
    words = (
        "The glass tube is {wedge_mm:.3f} mm thicker toward azimuth {direction_deg:.1f}°, thinner opposite."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the tube with its outer face decentred minus that through it, px."""
        return _seen_through(points, _tube(wedge_mm=amplitude))


class TubeTilt(Directed, name="tube_tilt", plausible=1.0):
    """A glass tube of 2 mm thickness is tilted; the crest is where its outward normal leans forward.

    The shape is 1 where the laser also passes through the tube, 0 where only the camera looks through it.
    """

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


class DomeAxial(Scalar, name="dome_axial", plausible=0.3):
    """The viewpoint is ahead of the centre of a concentric glass dome, or behind it."""

    words = (
        "The glass dome's centre is {offset_mm:.3f} mm [behind|before] the lens's viewpoint along the axis."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the dome with its centre at −d on the axis minus that without it, px."""
        return _through_dome(points, np.array([0.0, 0.0, -amplitude[0]]))


class DomeLateral(Directed, name="dome_lateral", plausible=0.2):
    """The centre of a concentric glass dome is beside the viewpoint."""

    words = (
        "The glass dome's centre is {offset_mm:.3f} mm beside the axis, toward azimuth {direction_deg:.1f}°."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the dome with its centre beside the axis minus that without it, px."""
        return _through_dome(points, np.array([amplitude[0], amplitude[1], 0.0]))


class OutsideIndex(Scalar, name="outside_index", plausible=2e-3):
    """The medium outside a sealed tube of 15 mm radius refracts rays where they leave the tube."""

    words = (
        "The medium outside the sealed probe has an index of refraction {index_excess:.2e} "
        "[above|below] the stated."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image through the medium minus that without it, px."""
        return _seen_through_layer(points, points.radius_mm - TUBE_OUTER_RADIUS_MM, 1 + float(amplitude[0]))


def _seen_through_layer(points: ImagePoints, layer_mm: Float, index: float) -> Float:
    """Return the image shift (M, 2), px, by layers (M,), mm, of a relative index on the way to the wall.

    tan i at the lens solves z = plain · tan i + layer · tan i′, by Newton's method.
    """
    z, q, psi = points.xyz_c[:, 2], points.radius_mm, points.azimuth_rad
    plain_mm, steep = q - layer_mm, z / q
    for _ in range(_STEPS):
        inside = index**2 * (1 + steep**2) - steep**2
        excess = plain_mm * steep + layer_mm * steep / np.sqrt(inside) - z
        steep = steep - excess / (plain_mm + layer_mm * index**2 / inside**1.5)
    return image_shift(points, np.column_stack([q * np.cos(psi), q * np.sin(psi), q * steep]))


def _tube(wedge_mm: Float = _NONE, lean: Float = _NONE) -> Float:
    """Return both faces of a tube of 2 mm thickness whose outer face is decentred, or that leans.

    A face is a row: its radius, mm, the index beyond it, the point of its axis beside the viewpoint along x
    and y, mm, and by how much the axis leans toward −x and −y, rad.
    """
    inner = [TUBE_OUTER_RADIUS_MM - TUBE_THICKNESS_MM, GLASS_INDEX, 0.0, 0.0, *lean]
    return np.array([inner, [TUBE_OUTER_RADIUS_MM, 1.0, *wedge_mm, *lean]])


def _seen_through(points: ImagePoints, faulty: Float) -> Float:
    """Return the image shift (M, 2), px, of points through a faulty tube in place of the straight one."""
    seen = np.empty_like(points.xyz_c)
    see_through(points.xyz_c, faulty, _tube(), _ROUNDS, seen)
    return image_shift(points, seen)


def _height_mm(points: ImagePoints, faces: Float) -> Float:
    """Return the height (M,), mm, at which the laser's sheet meets the wall after passing faces."""
    laser, psi = points.probe.laser, points.azimuth_rad
    sent = np.column_stack([np.cos(psi), np.sin(psi), laser.slope(psi)])
    height = np.empty(len(psi))
    meet_wall(laser.baseline_mm, sent, points.radius_mm, faces, height)
    return height


@numba.njit(cache=True, nogil=True)
def see_through(point, faulty, straight, rounds, seen):  # type: ignore[no-untyped-def]
    """Write where (M, 3) points (M, 3) appear through a faulty tube in place of the straight one.

    The lens was calibrated together with the straight tube, which displaces rays parallel to themselves.
    """
    for m in range(len(point)):
        x, y, z = point[m]
        for _ in range(rounds):
            size = np.sqrt(x * x + y * y + z * z)
            a, b, c = x / size, y / size, z / size
            e, f, g, _a, _b, _c = refracted(0.0, a, b, c, straight)
            ahead = e * a + f * b + g * c
            u, v, w, p, q, r = refracted(0.0, a, b, c, faulty)
            u = point[m, 0] + e - ahead * a - u
            v = point[m, 1] + f - ahead * b - v
            w = point[m, 2] + g - ahead * c - w
            ahead = u * p + v * q + w * r
            x, y, z = x + u - ahead * p, y + v - ahead * q, z + w - ahead * r
        seen[m] = x, y, z


@numba.njit(cache=True, nogil=True)
def meet_wall(start, way, radius, faces, height):  # type: ignore[no-untyped-def]
    """Write the heights (M,) at which rays from a place on the axis along (M, 3) reach radii (M,)."""
    for m in range(len(way)):
        size = np.sqrt(way[m] @ way[m])
        u, v, w, p, q, r = refracted(start, way[m, 0] / size, way[m, 1] / size, way[m, 2] / size, faces)
        height[m] = w + (radius[m] - np.hypot(u, v)) * r / np.hypot(p, q)


@numba.njit(cache=True, nogil=True)
def refracted(start, p, q, r, faces):  # type: ignore[no-untyped-def]
    """Return place and direction of a ray beyond cylindrical faces (F, 6), from a place on the axis."""
    x, y, z, before = 0.0, 0.0, start, 1.0
    for n in range(len(faces)):
        radius, beyond, x0, y0, lean_x, lean_y = faces[n]
        size = np.sqrt(1 + lean_x * lean_x + lean_y * lean_y)
        a, b, c = -lean_x / size, -lean_y / size, 1 / size
        along, ahead = (x - x0) * a + (y - y0) * b + z * c, p * a + q * b + r * c
        u, v, w = x - x0 - along * a, y - y0 - along * b, z - along * c
        e, f, g = p - ahead * a, q - ahead * b, r - ahead * c
        square, half = e * e + f * f + g * g, e * u + f * v + g * w
        step = (np.sqrt(half * half - square * (u * u + v * v + w * w - radius * radius)) - half) / square
        x, y, z = x + step * p, y + step * q, z + step * r
        e, f, g = (u + step * e) / radius, (v + step * f) / radius, (w + step * g) / radius
        ratio, inside = before / beyond, p * e + q * f + r * g
        turn = np.sqrt(1 - ratio * ratio * (1 - inside * inside)) - ratio * inside
        p, q, r, before = ratio * p + turn * e, ratio * q + turn * f, ratio * r + turn * g, beyond
    return x, y, z, p, q, r


def _through_dome(points: ImagePoints, centre_c: Float) -> Float:
    """Return the image shift (M, 2), px, through a thin concentric dome about ``centre_c`` (3,).

    A ray that passes the centre at distance b leaves turned about it by b (n−1) t / (n ρ²), away from the
    centre; the wall point, turned back about the centre, is seen as if there were no dome.
    """
    from_centre = points.xyz_c - centre_c
    seen = points.xyz_c
    for _ in range(3):
        ray = seen / np.linalg.norm(seen, axis=1)[:, None]
        aside = -centre_c + (ray @ centre_c)[:, None] * ray
        turned = _along(ray, from_centre) * aside - _along(aside, from_centre) * ray
        seen = points.xyz_c - DOME_POWER * turned
    return image_shift(points, seen)


def _along(direction: Float, vector: Float) -> Float:
    return np.asarray(np.sum(direction * vector, axis=1)[:, None])


WINDOW_MODELS: tuple[EffectModel, ...] = (
    HousingGlass(), TubeWedge(), TubeTilt(), DomeAxial(), DomeLateral(), OutsideIndex(),
)  # fmt: skip
