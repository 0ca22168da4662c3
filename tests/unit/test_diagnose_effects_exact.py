"""Predictions against exact instruments: each line found by bisection with the true camera, glass and sheet.

The bore is off-centre and yawed as in a gauge run. The allowed errors are those that `ring_shift_px`
neglects: third order, and second order of shifts across the radius that change along the ring. True
instruments consist of a true sheet, or of true sight lines: start and final direction of the ray of a pixel.
"""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.simulator.instrument import TrueCamera
from pipeline.simulator.rays import focal_px, viewing_rays
from stages.diagnose.effects.library import LIBRARY, ring_shift_px, texture_shift_px
from stages.diagnose.effects.window import refracted
from tests.unit.refraction import through_cylinder, through_sphere
from tests.unit.wall_points import (
    BASELINE_MM,
    CENTRE,
    FOCAL_PX,
    Bore,
    plain_probe,
    ring_points,
    ring_radius_px,
    texture_points,
)

BORES = {
    "centred": Bore(50.8),
    "off-centre": Bore(42.0, (4.0, -7.0, 0.0)),
    "off-centre and yawed": Bore(35.0, (-5.0, 3.0, 0.0), (np.sin(0.03), np.sin(-0.02), 1.0)),
}
AXIS = np.array([0.0, 0.0, 1.0])
GLASS = 1.5


def sheet(**changes):
    return replace(plain_probe(), laser=replace(LaserSheet(BASELINE_MM), **changes)).triangulate


def on_plane(sight, height_mm=BASELINE_MM):
    def meet(uv):
        place, ray = sight(uv)
        return place + ((height_mm - place[:, 2]) / ray[:, 2])[:, None] * ray

    return meet


def from_viewpoint(ray):
    return np.zeros_like(ray), ray


def plain(uv):
    return from_viewpoint(plain_probe().camera.unproject(uv).ray)


def camera(focal=(FOCAL_PX, FOCAL_PX), centre=CENTRE, k1=0.0):
    other = KannalaBrandt((1600, 1200), focal, centre, (k1, 0.0, 0.0, 0.0))
    return lambda uv: from_viewpoint(other.unproject(uv).ray)


def decentred(px, py):
    """Apply Brown's decentring, inverted by fixed-point iteration."""

    def sight(uv):
        found = (uv - np.array(CENTRE)) / FOCAL_PX
        m = found
        for _ in range(50):
            r2 = np.sum(m * m, axis=1)
            pull_x = px * (r2 + 2 * m[:, 0] ** 2) + 2 * py * m[:, 0] * m[:, 1]
            pull_y = py * (r2 + 2 * m[:, 1] ** 2) + 2 * px * m[:, 0] * m[:, 1]
            m = found - np.column_stack([pull_x, pull_y])
        return plain(np.array(CENTRE) + FOCAL_PX * m)

    return sight


def moving_pupil(shift_mm):
    def sight(uv):
        place, ray = plain(uv)
        theta = np.arccos(ray[:, 2])
        return place + np.outer(shift_mm * (theta / np.sin(theta) - 1), AXIS), ray

    return sight


def tubes(*walls):
    """Refract rays in turn at cylinders (axis, radius, index before over after, offset of the axis)."""

    def sight(uv):
        place, ray = plain(uv)
        for wall in walls:
            place, ray = through_cylinder(place, ray, *wall)
        return place, ray

    return sight


def dome(*centre):
    """Return sight lines through a dome whose radii multiply to 14² and whose glass is 2 mm thick."""

    def sight(uv):
        place, ray = through_sphere(*plain(uv), np.array(centre), 13.036, 1 / GLASS)
        return through_sphere(place, ray, np.array(centre), 15.036, GLASS)

    return sight


def leaning(tilt_deg, toward_deg):
    """Return the axis of a tube whose outward normal leans forward toward an azimuth.

    The axis leans away from it.
    """
    return np.array([*xy(-np.tan(np.radians(tilt_deg)), toward_deg), 1.0])


def xy(size, toward_deg):
    return size * np.cos(np.radians(toward_deg)), size * np.sin(np.radians(toward_deg))


TILT_X, TILT_Y = xy(np.tan(np.radians(0.6)), 40)
HEIGHT_X, HEIGHT_Y = xy(0.2, 70)
ASPECT = np.sqrt(1.004)
# Effect: shape, amplitude, the true sheet, allowed error in px. All sizes are large.
SHEETS = {
    "laser_tilt": ((), xy(0.6, 40), sheet(tilt_x=TILT_X, tilt_y=TILT_Y), 1e-4),
    "laser_cone": ((), [0.4], sheet(cone_rad=np.radians(0.4)), 1e-4),
    "baseline": ((), [0.5], sheet(baseline_mm=BASELINE_MM + 0.5), 1e-4),
    "beam_decentre": ((), xy(0.2, 70), sheet(decentre_x_mm=HEIGHT_X, decentre_y_mm=HEIGHT_Y), 1e-4),
    "sheet_waviness": ((3.0,), [2.0, 1.0], sheet(waviness=(0, 0, 2e-3, 1e-3, 0, 0)), 1e-4),
}
# Effect: amplitude, true sight lines, allowed error of the line in px. The dome is predicted as thin.
SIGHTS = {
    "principal_point": ([2.0, -1.5], camera(centre=(CENTRE[0] + 2.0, CENTRE[1] - 1.5)), 1e-3),
    "focal_scale": ([0.005], camera(focal=(FOCAL_PX * 1.005,) * 2), 1e-6),
    "radial_distortion": ([0.004], camera(k1=0.004), 1e-6),
    "sensor_tilt": (xy(2e-3, 20), decentred(*xy(2e-3, 20)), 6e-3),
    "pixel_aspect": ([0.004], camera(focal=(FOCAL_PX * ASPECT, FOCAL_PX / ASPECT)), 3e-3),
    "pupil_shift": ([1.0], moving_pupil(1.0), 1e-6),
    "housing_glass": ([2.0], tubes((AXIS, 13.0, 1 / GLASS), (AXIS, 15.0, GLASS)), 1e-6),
    "outside_index": ([0.333], tubes((AXIS, 15.0, 1 / 1.333)), 1e-6),
    "dome_axial": ([1.0], dome(0.0, 0.0, -1.0), 8e-3),
    "dome_lateral": (xy(1.0, 40), dome(*xy(1.0, 40), 0.0), 8e-3),
}


def outward_shift(triangulate, bore, points):
    azimuth = np.linspace(-np.pi, np.pi, len(points.uv), endpoint=False)
    return ring_radius_px(triangulate, bore, azimuth) - np.linalg.norm(points.uv - np.array(CENTRE), axis=1)


@pytest.mark.parametrize("bore", BORES.values(), ids=list(BORES))
@pytest.mark.parametrize("name", SHEETS)
def test_the_ring_of_another_sheet_is_where_it_is_predicted(name, bore):
    shape, amplitude, triangulate, allowed = SHEETS[name]
    points = ring_points(plain_probe(), bore)
    exact = outward_shift(triangulate, bore, points)
    assert np.abs(exact).max() > 0.5
    assert ring_shift_px(LIBRARY[name], points, shape, np.array(amplitude)) == pytest.approx(
        exact, abs=allowed
    )


@pytest.mark.parametrize("bore", BORES.values(), ids=list(BORES))
@pytest.mark.parametrize("name", SIGHTS)
def test_the_ring_through_another_camera_or_window_is_where_it_is_predicted(name, bore):
    amplitude, sight, allowed = SIGHTS[name]
    points = ring_points(plain_probe(), bore)
    exact = outward_shift(on_plane(sight), bore, points)
    assert np.abs(exact).max() > 50 * allowed
    assert ring_shift_px(LIBRARY[name], points, (), np.array(amplitude)) == pytest.approx(exact, abs=allowed)


@pytest.mark.parametrize("distance_mm", [15.0, 40.0, 90.0])
@pytest.mark.parametrize("name", SIGHTS)
def test_texture_through_another_camera_or_window_is_where_it_is_predicted(name, distance_mm):
    amplitude, sight, _ = SIGHTS[name]
    points = texture_points(plain_probe(), Bore(50.8), distance_mm)
    shift = texture_shift_px(LIBRARY[name], points, (), np.array(amplitude))
    missed = on_plane(sight, distance_mm)(points.uv + shift) - points.xyz_c
    per_px = np.hypot(50.8, distance_mm) / FOCAL_PX
    # The thin dome neglects half a per cent of its own shift.
    allowed = 8e-3 if name.startswith("dome") else 1e-6
    assert np.abs(shift).max() > 50 * allowed
    assert np.linalg.norm(missed, axis=1).max() < 3 * allowed * per_px


# Effect: shape, amplitude, the true tube. Straight tubes have radii of 13 and 15 mm.
TUBES = {
    "tube_tilt": (
        (0.0,),
        xy(1.0, 40),
        tubes((leaning(1.0, 40), 13.0, 1 / GLASS), (leaning(1.0, 40), 15.0, GLASS)),
    ),
    "tube_wedge": ((), xy(0.1, 40), tubes((AXIS, 13.0, 1 / GLASS), (AXIS, 15.0, GLASS, (*xy(0.1, 40), 0.0)))),
}
STRAIGHT = tubes((AXIS, 13.0, 1 / GLASS), (AXIS, 15.0, GLASS))


@pytest.mark.parametrize("bore", BORES.values(), ids=list(BORES))
@pytest.mark.parametrize("name", TUBES)
def test_a_faulty_tube_shifts_the_ring_against_the_straight_one_as_predicted(name, bore):
    shape, amplitude, sight = TUBES[name]
    points = ring_points(plain_probe(), bore)
    faulty, straight = (outward_shift(on_plane(tube), bore, points) for tube in (sight, STRAIGHT))
    predicted = ring_shift_px(LIBRARY[name], points, shape, np.array(amplitude))
    # The prediction starts from rays without glass, which 2 mm of glass refract by a few per cent.
    assert predicted == pytest.approx(faulty - straight, abs=0.06 * np.abs(faulty - straight).max())


@pytest.mark.parametrize("name", TUBES)
def test_a_faulty_tube_shifts_texture_along_and_around_as_predicted(name):
    shape, amplitude, sight = TUBES[name]
    points = texture_points(plain_probe(), Bore(50.8), 40.0)
    shift = texture_shift_px(LIBRARY[name], points, shape, np.array(amplitude))
    moved, still = on_plane(sight, 40.0)(points.uv), on_plane(STRAIGHT, 40.0)(points.uv)
    # The wall point that a pixel sees moves by the opposite of the image of a fixed point.
    by_point = plain_probe().camera.project_jacobian(still).by_point
    expected = -np.einsum("mij,mj->mi", by_point, moved - still)
    assert shift == pytest.approx(expected, abs=0.04 * np.abs(expected).max())


def test_a_tilted_tube_displaces_the_laser_as_predicted():
    points = ring_points(plain_probe(), Bore(50.8))
    flat = np.column_stack([np.cos(points.azimuth_rad), np.sin(points.azimuth_rad), np.zeros(len(points.uv))])
    # The tube leans about the camera's viewpoint, so that its axis passes beside the laser.
    source = np.array([0.0, 0.0, plain_probe().laser.baseline_mm])
    place, ray = np.broadcast_to(source, flat.shape), flat
    for radius_mm, ratio in ((13.0, 1 / GLASS), (15.0, GLASS)):
        place, ray = through_cylinder(place, ray, leaning(1.0, 40.0), radius_mm, ratio)
    beyond = 50.8 - np.hypot(place[:, 0], place[:, 1])
    met_mm = place[:, 2] + beyond * ray[:, 2] / np.hypot(ray[:, 0], ray[:, 1]) - source[2]
    predicted = LIBRARY["tube_tilt"].sheet_shift_mm(points, (1.0,), np.array(xy(1.0, 40.0)))
    assert predicted == pytest.approx(met_mm, abs=2e-5)
    assert predicted[np.argmin(np.abs(points.azimuth_rad - np.radians(40)))] > 0.01


def test_rays_are_refracted_by_leaning_and_decentred_faces_as_the_plain_reference_says():
    angle = np.linspace(0.3, 1.5, 40)
    ray = np.column_stack(
        [np.sin(angle) * np.cos(9 * angle), np.sin(angle) * np.sin(9 * angle), np.cos(angle)]
    )
    centre, lean = (0.3, -0.2), np.radians(xy(3.0, 70))
    faces = np.array([[13.0, GLASS, 0.0, 0.0, *lean], [15.0, 1.0, *centre, 0.0, 0.0]])
    axis = np.array([-lean[0], -lean[1], 1.0]) / np.sqrt(1 + lean @ lean)
    source = np.array([0.0, 0.0, 22.0])
    place, beyond = through_cylinder(np.broadcast_to(source, ray.shape), ray, axis, 13.0, 1 / GLASS)
    place, beyond = through_cylinder(place, beyond, AXIS, 15.0, GLASS, (*centre, 0.0))
    found = np.array([refracted(22.0, *one, faces) for one in ray])
    assert found == pytest.approx(np.hstack([place, beyond]), abs=1e-12)


def test_a_tilted_sensor_acts_on_the_angle_whatever_the_projection_of_the_lens():
    """In the simulator it acted on the image radius, so that it was 4 to 8 % too small."""
    model = KannalaBrandt((1600, 1200), (365.0, 365.0), (800.5, 598.0), (-0.0115, 0.0015, -0.00085, 0.0))
    camera, p = TrueCamera(model, decentring=(1e-3, 5e-4)), np.array([1e-3, 5e-4])
    theta, psi = np.linspace(0.2, 1.4, 60), np.linspace(0.0, 9.0, 60)
    heading = np.stack([np.cos(psi), np.sin(psi)], -1)
    ray = np.column_stack([np.sin(theta)[:, None] * heading, np.cos(theta)])
    shift = theta[:, None] ** 2 * (p + 2 * (heading @ p)[:, None] * heading)
    seen = model.project(ray).uv + focal_px(camera) * shift
    assert viewing_rays(camera, seen)[1] == pytest.approx(ray, abs=1e-9)
