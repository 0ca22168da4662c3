"""Every camera model: round trips, derivatives, validity, unchanged arguments."""

import pickle

import cv2
import numpy as np
import pytest

from pipeline.instrument.camera import Camera, invert_increasing
from pipeline.instrument.camera.fisheye import Equidistant, KannalaBrandt
from tests.unit.camera_samples import (
    BEYOND_90,
    CAMERAS,
    KANNALA_BRANDT,
    SCARAMUZZA,
    directions,
    sample_directions,
    widest_angle,
)


@pytest.fixture(params=list(CAMERAS), ids=list(CAMERAS))
def camera(request) -> Camera:
    return CAMERAS[request.param]


def test_satisfies_the_protocol(camera):
    assert isinstance(camera, Camera)
    assert len(camera.parameter_names) == len(camera.parameters)
    assert camera.with_parameters(camera.parameters) == camera
    moved = camera.with_parameters(camera.parameters + 1e-3)
    np.testing.assert_allclose(moved.parameters, camera.parameters + 1e-3, rtol=0, atol=1e-15)
    assert pickle.loads(pickle.dumps(camera)) == camera


@pytest.mark.parametrize("name", BEYOND_90)
def test_sees_beyond_90_degrees(name):
    assert widest_angle(CAMERAS[name]) > np.deg2rad(95)


def test_pinhole_never_sees_90_degrees():
    assert widest_angle(CAMERAS["pinhole without distortion"]) < np.pi / 2


def test_point_to_pixel_to_ray(camera):
    ray = sample_directions(camera)
    pixels = camera.project(37.0 * ray)
    assert pixels.valid.all()
    back = camera.unproject(pixels.uv)
    assert back.valid.all()
    np.testing.assert_allclose(back.ray, ray, rtol=0, atol=2e-12)


def test_pixel_to_ray_to_pixel(camera):
    width, height = camera.image_size
    u, v = np.meshgrid(np.linspace(0, width - 1, 33), np.linspace(0, height - 1, 29))
    uv = np.stack([u, v], -1)
    rays = camera.unproject(uv)
    assert rays.valid.mean() > 0.5
    np.testing.assert_allclose(np.linalg.norm(rays.ray[rays.valid], axis=-1), 1, atol=1e-14)
    again = camera.project(5.0 * rays.ray[rays.valid])
    inside = again.valid
    assert inside.mean() > 0.99
    np.testing.assert_allclose(again.uv[inside], uv[rays.valid][inside], rtol=0, atol=1e-8)


def test_projection_derivatives(camera):
    points = 20.0 * sample_directions(camera, 0.9)
    points = points[np.hypot(points[:, 0], points[:, 1]) > 1e-3]
    jacobian = camera.project_jacobian(points)
    by_point = _central(lambda p: camera.project(p).uv, points, np.full(3, 2e-5))
    _assert_close(jacobian.by_point, by_point)
    _assert_close(jacobian.by_parameters, _by_parameters(camera, lambda c: c.project(points).uv))


def test_ray_derivatives(camera):
    uv = camera.project(sample_directions(camera, 0.9)).uv
    uv = uv[np.all((uv >= 0) & (uv < camera.image_size), -1)]
    jacobian = camera.unproject_jacobian(uv)
    by_pixel = _central(lambda q: camera.unproject(q).ray, uv, np.full(2, 1e-4))
    _assert_close(jacobian.by_pixel, by_pixel)
    _assert_close(jacobian.by_parameters, _by_parameters(camera, lambda c: c.unproject(uv).ray))


def test_derivatives_on_the_axis(camera):
    axis = np.array([0.0, 0.0, 25.0])
    jacobian = camera.project_jacobian(axis)
    by_point = _central(lambda p: camera.project(p).uv, axis, np.full(3, 1e-4))
    np.testing.assert_allclose(jacobian.by_point, by_point, rtol=1e-5, atol=1e-6)
    rays = camera.unproject_jacobian(camera.project(axis).uv)
    assert np.isfinite(rays.by_pixel).all()
    assert np.isfinite(rays.by_parameters).all()


def test_does_not_change_its_arguments(camera):
    points, uv = 10 * sample_directions(camera), np.array([[3.0, 4.0], [-1e5, 1e5], [np.nan, 1.0]])
    for array, methods in (
        (points, (camera.project, camera.project_jacobian)),
        (uv, (camera.unproject, camera.unproject_jacobian)),
    ):
        before = array.copy()
        array.flags.writeable = False
        for method in methods:
            method(array)
        np.testing.assert_array_equal(array, before)


def test_invalid_results_are_nan_and_masked(camera):
    points = np.array([[0.0, 0.0, 0.0], [np.nan, 1.0, 1.0], [np.inf, 0.0, 1.0]])
    projected = camera.project(points)
    assert not projected.valid.any()
    assert np.isnan(projected.uv).all()
    jacobian = camera.project_jacobian(points)
    assert np.isnan(jacobian.by_point).any((1, 2)).all()
    assert np.isnan(jacobian.by_parameters).any((1, 2)).all()
    rays = camera.unproject(np.array([[np.nan, 0.0]]))
    assert not rays.valid.any()
    assert np.isnan(rays.ray).all()


def test_masks_mark_exactly_the_nan_results(camera):
    uv = np.random.default_rng(4).uniform(-4000, 6000, (500, 2))
    rays = camera.unproject(uv)
    np.testing.assert_array_equal(np.isfinite(rays.ray).all(-1), rays.valid)
    points = np.random.default_rng(5).normal(size=(500, 3))
    pixels = camera.project(points)
    np.testing.assert_array_equal(np.isfinite(pixels.uv).all(-1), pixels.valid)


def test_takes_any_leading_shape(camera):
    ray = sample_directions(camera)[50]
    single = camera.project(ray)
    assert single.uv.shape == (2,)
    assert single.valid.shape == ()
    grid = camera.project(np.broadcast_to(ray, (2, 3, 3)))
    np.testing.assert_array_equal(grid.uv[1, 2], single.uv)
    count = len(camera.parameters)
    assert camera.project_jacobian(np.broadcast_to(ray, (2, 4, 3))).by_parameters.shape == (2, 4, 2, count)
    assert camera.unproject_jacobian(grid.uv).by_parameters.shape == (2, 3, 3, count)


def test_kannala_brandt_agrees_with_opencv():
    camera = KANNALA_BRANDT
    points = 3.0 * sample_directions(camera, 0.6)
    points = points[points[:, 2] > 0.05]  # OpenCV's function maps only the half space ahead
    expected, _ = cv2.fisheye.projectPoints(
        points[:, None],
        np.zeros(3),
        np.zeros(3),
        np.diag([*camera.focal_px, 1.0])
        + np.array([[0, 0, camera.centre[0]], [0, 0, camera.centre[1]], [0, 0, 0]]),
        np.array(camera.distortion),
    )
    np.testing.assert_allclose(camera.project(points).uv, expected[:, 0], rtol=0, atol=1e-9)


def test_pinhole_agrees_with_opencv():
    camera = CAMERAS["pinhole"]
    points = 3.0 * sample_directions(camera, 0.9)
    matrix = np.array(
        [[camera.focal_px[0], 0, camera.centre[0]], [0, camera.focal_px[1], camera.centre[1]], [0, 0, 1]]
    )
    expected, _ = cv2.projectPoints(
        points[:, None], np.zeros(3), np.zeros(3), matrix, np.array(camera.distortion)
    )
    np.testing.assert_allclose(camera.project(points).uv, expected[:, 0], rtol=0, atol=1e-9)


def test_unified_agrees_with_opencv():
    camera = CAMERAS["unified, xi above 1"]
    points = 3.0 * sample_directions(camera, 0.8)
    matrix = np.array(
        [[camera.focal_px[0], 0, camera.centre[0]], [0, camera.focal_px[1], camera.centre[1]], [0, 0, 1]]
    )
    expected, _ = cv2.omnidir.projectPoints(
        points[:, None], np.zeros((3, 1)), np.zeros((3, 1)), matrix, camera.xi, np.array([camera.distortion])
    )
    np.testing.assert_allclose(camera.project(points).uv, expected[:, 0], rtol=0, atol=1e-9)


def test_equidistant_is_kannala_brandt_without_distortion():
    thin = Equidistant((1600, 1200), (360.0, 361.0), (799.5, 599.5))
    full = KannalaBrandt(thin.image_size, thin.focal_px, thin.centre)
    points = sample_directions(thin)
    np.testing.assert_allclose(thin.project(points).uv, full.project(points).uv, rtol=0, atol=1e-10)


def test_scaramuzza_follows_ocamcalib_cam2world():
    """The formula of the C code: row first, x down, z backward."""
    row, column = 200.0, 1300.0
    c, d, e = SCARAMUZZA.affine
    a, b = row - SCARAMUZZA.centre[1], column - SCARAMUZZA.centre[0]
    x, y = (a - d * b) / (c - d * e), (-e * a + c * b) / (c - d * e)
    z = sum(coefficient * np.hypot(x, y) ** i for i, coefficient in enumerate(SCARAMUZZA.polynomial))
    expected = np.array([y, x, -z]) / np.sqrt(x * x + y * y + z * z)
    np.testing.assert_allclose(SCARAMUZZA.unproject(np.array([column, row])).ray, expected, atol=1e-14)


def test_direction_behind_a_model_that_turns_back_is_refused():
    """ρ(θ) of this camera falls again before 180°, so that two directions would share a pixel."""
    camera = CAMERAS["kannala_brandt that turns back"]
    assert camera.theta_max < np.pi
    beyond = directions(np.array([camera.theta_max + 0.02]), np.array([0.3]))
    assert not camera.project(beyond).valid.any()


def test_inversion_stays_inside_its_bracket():
    """Newton's method alone diverges on x³ near 0; the bracket prevents it."""
    value = np.array([-1.0, 0.0, 1e-12, 0.3, 1.0, 2.0, np.nan])
    x = invert_increasing(lambda x: x**3, lambda x: 3 * x**2, value, np.linspace(0, 1, 5))
    np.testing.assert_allclose(x[:-1], [0, 0, 1e-4, 0.3 ** (1 / 3), 1, 1], atol=1e-6)
    assert np.isnan(x[-1])


def _central(function, x, steps):
    columns = []
    for i, step in enumerate(steps):
        shift = np.zeros(x.shape[-1])
        shift[i] = step
        columns.append((function(x + shift) - function(x - shift)) / (2 * step))
    return np.stack(columns, -1)


def _by_parameters(camera, function):
    columns = []
    for i, value in enumerate(camera.parameters):
        step = 1e-6 * (abs(value) if abs(value) > 1e-12 else 1.0)
        up, down = camera.parameters, camera.parameters
        up[i] += step
        down[i] -= step
        difference = function(camera.with_parameters(up)) - function(camera.with_parameters(down))
        columns.append(difference / (up[i] - down[i]))
    return np.stack(columns, -1)


def _assert_close(analytic, numeric):
    """Compare column by column, since the scales of parameters differ by many powers of ten."""
    known = np.isfinite(numeric)
    assert known.mean() > 0.9
    scale = np.abs(np.where(known, numeric, 0)).max(tuple(range(numeric.ndim - 1)))
    error = np.abs(np.where(known, analytic - numeric, 0)).max(tuple(range(numeric.ndim - 1)))
    assert np.all(error <= 2e-6 * scale + 1e-12), (error / scale).tolist()


@pytest.mark.parametrize("k4", [np.nan, np.inf, 1e-310, -1e-310])
def test_absurd_coefficients_map_nothing_or_change_nothing(k4):
    """A solver that overshoots must get an invalid projection, not an exception."""
    camera = KannalaBrandt((640, 480), (200.0, 200.0), (320.0, 240.0), (0.0, 0.0, 0.0, k4))
    projected = camera.project(np.array([[1.0, 2.0, 5.0]]))
    assert projected.valid.all() == np.isfinite(k4)
