"""The bundle solver: exact steps, true parameters within their σ, true covariance, robustness."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.camera.scaramuzza import Scaramuzza
from stages.calibrate.boards.bundle import (
    BENT,
    FLAT,
    Corners,
    Free,
    cost,
    linearise,
    solve,
)
from stages.calibrate.boards.fit import BoardCalibrationParameters, adjust
from stages.calibrate.boards.start import start
from tests.board_scene import varied_poses, views_of
from tests.unit.camera_samples import CAMERAS, KANNALA_BRANDT

PARAMETERS = BoardCalibrationParameters(board_shape="bent")
FLAT_BOARD = BoardCalibrationParameters(board_shape="flat")
SMALL_FISHEYE = KannalaBrandt((640, 480), (146.0, 145.6), (318.9, 236.8), (-0.0118, 0.0008, -0.0008, 0.0001))


ROUGH = KannalaBrandt(KANNALA_BRANDT.image_size, (340.0, 340.0), (799.5, 599.5))


def _setup(camera=KANNALA_BRANDT, seed=0, count=10, widest_rad=1.3, **options):
    random = np.random.default_rng(seed)
    return views_of(camera, varied_poses(random, count, widest_rad), random, **options)


def test_the_step_by_schur_complement_equals_the_dense_step():
    views = _setup(count=4)
    corners, free = Corners.of(views), Free(np.arange(8), BENT)
    estimate = replace(start(views, KANNALA_BRANDT.image_size), camera=KANNALA_BRANDT)
    system, damping = linearise(estimate, corners, free, 1.0), 1e-2
    f, v = free.count, len(views)
    dense = np.zeros((f + 6 * v, f + 6 * v))
    dense[:f, :f] = system.shared
    gradient = np.concatenate([system.shared_gradients.sum(0), system.block_gradient.ravel()])
    for i in range(v):
        part = slice(f + 6 * i, f + 6 * i + 6)
        dense[part, part], dense[:f, part], dense[part, :f] = (
            system.block[i], system.coupling[i], system.coupling[i].T,
        )  # fmt: skip
    dense += damping * np.diag(np.diag(dense))
    scale = 1 / np.sqrt(np.diag(dense))
    expected = -scale * np.linalg.solve(dense * scale * scale[:, None], scale * gradient)
    shared, poses = system.step(damping)
    np.testing.assert_allclose(np.concatenate([shared, poses.ravel()]), expected, rtol=1e-6, atol=1e-12)


def test_gradient_is_that_of_the_cost():
    """All blocks, Huber weights and board shape included, are compared with finite differences."""
    views = _setup(count=3)
    corners, free = Corners.of(views), Free(np.arange(8), BENT)
    estimate = replace(start(views, KANNALA_BRANDT.image_size), shape_mm=np.array([0.2, -0.1, 0.3]))
    estimate = replace(estimate, camera=KANNALA_BRANDT)
    system = linearise(estimate, corners, free, 0.7)
    analytic = np.concatenate([2 * system.shared_gradients.sum(0), 2 * system.block_gradient.ravel()])
    for i, step in enumerate([1e-4] * 4 + [1e-7] * 4 + [1e-5] * 3 + [1e-7, 1e-7, 1e-7, 1e-5, 1e-5, 1e-5] * 3):
        move = np.zeros(len(analytic))
        move[i] = step
        sides = [
            cost(estimate.moved(free, s * move[:11], s * move[11:].reshape(-1, 6)).residuals(corners), 0.7)
            for s in (1, -1)
        ]
        assert (sides[0] - sides[1]) / (2 * step) == pytest.approx(analytic[i], rel=2e-4, abs=1e-2)


@pytest.mark.parametrize(
    ("name", "widest_rad"),
    [
        ("kannala_brandt", 1.6),
        ("equidistant", 1.6),
        ("unified, xi above 1", 1.2),
        ("pinhole", 0.3),
    ],
)
def test_true_camera_is_found_within_its_uncertainty(name, widest_rad):
    camera = CAMERAS[name]
    distance = (250.0, 400.0) if name == "pinhole" else (70.0, 140.0)
    random = np.random.default_rng(3)
    views = views_of(camera, varied_poses(random, 24, widest_rad, distance), random)
    found = adjust(views, start(views, camera.image_size), camera.model, PARAMETERS)
    assert found.rms_px == pytest.approx(0.1 * np.sqrt(2), rel=0.1)
    inside = np.concatenate([view.uv for view in views])
    true = camera.unproject(inside).ray
    jacobian = found.camera.project_jacobian(true).by_parameters
    sigma = np.sqrt(np.einsum("nip,pq,niq->ni", jacobian, found.covariance, jacobian))
    error = (found.camera.project(true).uv - inside) / sigma
    assert np.sqrt(np.mean(error**2)) < 2.5


def test_scaramuzza_fits_another_model_and_its_unused_parameter_stays():
    views = _setup(widest_rad=1.4, count=20)
    found = adjust(views, start(views, KANNALA_BRANDT.image_size), "scaramuzza", PARAMETERS)
    assert isinstance(found.camera, Scaramuzza)
    assert found.rms_px == pytest.approx(0.1 * np.sqrt(2), rel=0.1)
    assert found.camera.affine[2] == 0
    assert found.covariance[4, 4] == 0


def test_intervals_hold_over_many_noisy_sets():
    """Squared errors over their covariance average the number of parameters (chi-square, 30 sets)."""
    squares = []
    for seed in range(30):
        views = _setup(SMALL_FISHEYE, seed=seed, count=12, widest_rad=1.2)
        found = adjust(views, start(views, SMALL_FISHEYE.image_size), "kannala_brandt", FLAT_BOARD)
        error = found.camera.parameters - SMALL_FISHEYE.parameters
        squares.append(error @ np.linalg.solve(found.covariance, error))
    # σ of the mean of 30 chi-squares of 8 is 0.73; the covariance is never scaled down, hence the lower side
    assert 4.5 < np.mean(squares) < 8 + 3 * 0.73


def test_covariance_grows_when_the_corners_of_a_picture_err_together():
    random = np.random.default_rng(0)
    views = _setup(SMALL_FISHEYE, count=14, widest_rad=1.2)
    together = []
    for view in views:
        centred = (view.xyz_b - view.xyz_b.mean(0)) / 90
        shift = np.stack([centred[:, 0] ** 2, centred[:, 0] * centred[:, 1]], -1) @ random.normal(
            0, 2.0, (2, 2)
        )
        together.append(replace(view, uv=view.uv + shift))
    ratio = []
    for set_ in (views, together):
        found = adjust(set_, start(set_, SMALL_FISHEYE.image_size), "kannala_brandt", FLAT_BOARD)
        ratio.append(np.sqrt(found.covariance[0, 0]) / found.sigma_px)
    assert ratio[1] > 1.5 * ratio[0]


def test_wrong_corners_are_rejected():
    views = _setup(count=16)
    random = np.random.default_rng(8)
    spoiled = []
    for view in views:
        uv = view.uv.copy()
        uv[random.integers(len(uv), size=2)] += random.normal(0, 15, (2, 2))
        spoiled.append(replace(view, uv=uv))
    found = adjust(spoiled, start(spoiled, KANNALA_BRANDT.image_size), "kannala_brandt", PARAMETERS)
    np.testing.assert_allclose(found.camera.parameters[:4], KANNALA_BRANDT.parameters[:4], rtol=0, atol=0.6)


def test_sag_of_the_board_is_found():
    sag = (0.5, -0.2, 0.3)
    views = _setup(count=20, sag_mm=sag)
    first = start(views, KANNALA_BRANDT.image_size)
    bent = adjust(views, first, "kannala_brandt", PARAMETERS)
    flat = adjust(views, first, "kannala_brandt", FLAT_BOARD)
    np.testing.assert_allclose(bent.shape_mm, sag, rtol=0, atol=0.08)
    np.testing.assert_array_equal(flat.shape_mm, 0)
    assert bent.rms_px < 0.9 * flat.rms_px


def test_solver_ends_where_the_gradient_vanishes():
    """Not too early: at the end the undamped system gives no step worth taking."""
    views = _setup(count=10)
    corners, free = Corners.of(views), Free(np.arange(8), FLAT)
    first = replace(start(views, KANNALA_BRANDT.image_size), camera=ROUGH)
    end = solve(first, corners, free, 1.0)
    shared, _ = linearise(end, corners, free, 1.0).step(0.0)
    assert np.all(np.abs(shared[:4]) < 1e-4)
    assert np.all(np.abs(shared[4:]) < 1e-6)
