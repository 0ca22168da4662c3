"""Refusing views that cannot determine a camera, judging models, and the maps over the image."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import UnusableError
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from pipeline.instrument.camera.calibration import BoardView
from pipeline.instrument.camera.fisheye import KannalaBrandt
from stages.calibrate.boards import calibrate_boards
from stages.calibrate.boards.compare import displacement_map, uncertainty_map
from stages.calibrate.boards.fit import MODEL_NAMES, BoardCalibrationParameters, adjust, held_out_residuals
from stages.calibrate.boards.start import pose, start
from tests.board_scene import facing_pose, varied_poses, views_of
from tests.quiet import quiet_context
from tests.unit.camera_samples import CAMERAS

CAMERA = KannalaBrandt((640, 480), (146.0, 145.6), (318.9, 236.8), (-0.0118, 0.0008, -0.0008, 0.0001))
PARAMETERS = BoardCalibrationParameters(board_shape="bent")


def _views(poses, seed=1, camera=CAMERA, **options):
    return views_of(camera, poses, np.random.default_rng(seed), **options)


def _good_views(count=14, widest_rad=1.3, seed=5):
    return _views(varied_poses(np.random.default_rng(seed), count, widest_rad))


def _calibrate(views, models=("kannala_brandt",), reference=None):
    return calibrate_boards(views, CAMERA.image_size, models, reference, PARAMETERS, quiet_context())


def _parallel(tilt, count=10):
    """Return boards in parallel planes, at different places and distances."""
    random = np.random.default_rng(2)
    turn = rotation_from_vector(np.array(tilt))
    places = random.uniform([-70, -50, 80], [70, 50, 150], (count, 3))
    return [from_parts(turn, place) for place in places]


@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), (0.5, 0.3, 0.0)])
def test_boards_in_parallel_planes_are_refused(tilt):
    with pytest.raises(UnusableError, match="parallel planes") as raised:
        _calibrate(_views(_parallel(tilt)))
    assert "tilt the board" in str(raised.value)


def test_one_pose_seen_many_times_is_refused():
    with pytest.raises(UnusableError, match="parallel planes"):
        _calibrate(_views([facing_pose([0.2, 0.1, 1.0], 100.0, [0.3, -0.2, 0.1])] * 10))


def test_a_board_turned_in_its_own_plane_is_refused():
    turns = [
        from_parts(rotation_from_vector(np.array([0, 0, a])), np.array([5.0, 3.0, 100])) for a in range(6)
    ]
    with pytest.raises(UnusableError, match="parallel planes"):
        _calibrate(_views(turns))


def test_tilted_boards_are_not_refused():
    """Control: the same scene with tilts."""
    report = _calibrate(_good_views(10))
    np.testing.assert_allclose(
        report.calibration.camera.parameters[:4], CAMERA.parameters[:4], rtol=0, atol=1.0
    )


def test_too_few_views_are_refused():
    with pytest.raises(UnusableError, match="found in 3 usable images"):
        _calibrate(_good_views()[:3])
    with pytest.raises(UnusableError, match="found in 0 usable images"):
        _calibrate([])


def test_small_central_boards_leave_the_wide_angle_undetermined():
    """A board far away near the axis shows little of the focal length.

    It is refused, with the weakest direction.
    """
    random = np.random.default_rng(7)
    far = varied_poses(random, 6, 0.05, (2500.0, 2600.0), 0.08)
    with pytest.raises(UnusableError, match=r"uncertain by|parallel planes"):
        _calibrate(_views(far, sigma_px=0.3))


def test_a_pinhole_is_refused_for_boards_beyond_its_field_of_view():
    views = _good_views(16, 1.6)
    report = _calibrate(views, MODEL_NAMES)
    refused = {s.model: s.refusal for s in report.scores}
    assert refused["pinhole"]
    assert not refused["kannala_brandt"]


def test_models_are_ranked_by_views_they_were_not_fitted_to():
    report = _calibrate(_good_views(16), MODEL_NAMES)
    held_out = {s.model: s.held_out_rms_px for s in report.scores}
    assert report.calibration.camera.model != "equidistant"
    assert held_out["equidistant"] > 1.5 * held_out["kannala_brandt"]
    assert held_out["kannala_brandt"] == pytest.approx(0.1 * np.sqrt(2), rel=0.15)
    assert held_out[report.calibration.camera.model] == np.nanmin(list(held_out.values()))


def test_held_out_residuals_use_a_fixed_camera():
    views = _good_views(14)
    found = adjust(views[:10], start(views[:10], CAMERA.image_size), "kannala_brandt", PARAMETERS)
    residuals = held_out_residuals(found, views[10:], 1.0)
    assert [len(r) for r in residuals] == [len(v.uv) for v in views[10:]]
    wrong = replace(found, camera=found.camera.with_parameters(found.camera.parameters * 1.05))
    spoiled = held_out_residuals(wrong, views[10:], 1.0)
    assert np.hypot(*np.concatenate(spoiled).T).mean() > 1.5 * np.hypot(*np.concatenate(residuals).T).mean()


def test_a_view_that_fits_no_camera_is_left_out_and_named():
    views = _good_views(12)
    shuffled = np.random.default_rng(0).permutation(len(views[4].uv))
    views[4] = replace(views[4], uv=views[4].uv[shuffled])
    report = _calibrate(views)
    assert [name for name, _ in report.rejected] == [views[4].name]
    assert views[4].name not in report.calibration.names


def test_wrong_corners_are_left_out_and_the_rest_of_their_picture_is_used():
    """Of a 190° lens, a third of the pictures were refused for corners found beyond the image circle."""
    views = _good_views(12)
    for view, wrong in ((2, [0]), (4, [0, 1, 2]), (7, [5, 30])):
        views[view].uv[wrong] += [25.0, -18.0]
    report = _calibrate(views)
    assert not report.rejected
    assert len(report.calibration.uv) == sum(len(v.uv) for v in views) - 6
    assert np.hypot(*report.calibration.residual_px.T).max() < 1.0


def test_the_same_picture_twice_counts_once():
    """Copies of all pictures made σ smaller, and held-out pictures were no longer held out."""
    views = _good_views(12)
    again = [replace(v, name=f"copy of {v.name}", uv=v.uv + 0.01) for v in views]
    report = _calibrate([*views, *again])
    assert report.calibration.names == tuple(v.name for v in views)
    assert [name for name, _ in report.rejected] == [v.name for v in again]


@pytest.mark.parametrize("name", ["kannala_brandt", "scaramuzza", "unified, xi above 1"])
@pytest.mark.parametrize("theta", [0.0, 0.8, 1.5])
def test_pose_of_a_board_beyond_a_pinhole_view(name, theta):
    camera = CAMERAS[name]
    true = facing_pose([np.sin(theta), 0.3 * np.sin(theta), np.cos(theta)], 300.0, [0.3, -0.4, 0.2])
    xyz_b = np.array([[x, y, 0.0] for x in range(-40, 41, 20) for y in range(-40, 41, 20)])
    uv = camera.project(xyz_b @ true[:3, :3].T + true[:3, 3]).uv
    np.testing.assert_allclose(pose(BoardView("", xyz_b, uv), camera), true, rtol=0, atol=1e-3)


def test_displacement_between_equal_cameras_is_zero():
    map_ = displacement_map(CAMERA, CAMERA)
    assert np.nanmax(np.abs(map_.displacement_px)) < 1e-9
    np.testing.assert_allclose(map_.rotation_rad, 0, atol=1e-12)


def test_displacement_is_what_no_rotation_can_remove():
    """A shifted centre acts mostly like a turned camera.

    The map is smaller than the shift, and the smallest possible.
    """
    moved = replace(CAMERA, centre=(CAMERA.centre[0] + 0.5, CAMERA.centre[1]))
    map_ = displacement_map(CAMERA, moved)
    ray = CAMERA.unproject(map_.uv).ray

    def median_px(rotation):
        turned = ray @ rotation_from_vector(rotation).T
        return np.nanmedian(np.hypot(*np.moveaxis(moved.project(turned).uv - map_.uv, -1, 0)))

    assert np.nanmedian(np.hypot(*np.moveaxis(map_.displacement_px, -1, 0))) < 0.9 * 0.5
    assert median_px(np.zeros(3)) == pytest.approx(0.5)
    for axis in np.eye(3):
        assert median_px(map_.rotation_rad + 4e-3 * axis) > median_px(map_.rotation_rad)


def test_displacement_of_another_focal_length_is_radial():
    longer = replace(CAMERA, focal_px=(CAMERA.focal_px[0] * 1.01, CAMERA.focal_px[1] * 1.01))
    map_ = displacement_map(CAMERA, longer)
    seen = np.isfinite(map_.displacement_px).all(-1)
    outward = 0.01 * (map_.uv[seen] - CAMERA.centre)
    np.testing.assert_allclose(map_.displacement_px[seen], outward, rtol=0, atol=0.15)


def test_uncertainty_map_is_the_spread_of_repeated_calibrations():
    poses = varied_poses(np.random.default_rng(5), 14, 1.3)
    uv = np.array([[320.0, 240.0], [200, 240], [320, 100], [480, 360]])
    ray = CAMERA.unproject(uv).ray
    found = []
    for seed in range(12):
        views = _views(poses, seed)
        found.append(adjust(views, start(views, CAMERA.image_size), "kannala_brandt", PARAMETERS))
    spread = np.std([c.camera.project(ray).uv for c in found], axis=0)
    spread = np.sqrt(np.mean(spread**2, -1))
    map_ = uncertainty_map(found[0])
    index = np.round(uv / (map_.uv[1, 1] - map_.uv[0, 0])).astype(int)
    stated = map_.raw_sigma_px[index[:, 1], index[:, 0]]
    assert np.all((stated / spread > 0.6) & (stated / spread < 1.8)), (stated, spread)
    assert np.all(map_.sigma_px[np.isfinite(map_.sigma_px)] >= 0)
    assert np.nanmedian(map_.sigma_px) < np.nanmedian(map_.raw_sigma_px)


def test_result_is_the_same_every_time():
    views = _good_views(8)
    one, other = _calibrate(views), _calibrate(views)
    assert one.calibration.camera == other.calibration.camera
    np.testing.assert_array_equal(one.calibration.covariance, other.calibration.covariance)
