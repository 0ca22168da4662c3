"""Laser planes through points and from rendered boards, compared with known planes and lines."""

import cv2
import numpy as np
import pytest

from pipeline.commands.calibrate_laser import with_plane
from pipeline.errors import UnusableError
from pipeline.geometry.rigid import from_parts
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserPlane, LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe, write_probe
from stages.calibrate.boards.bundle import POSES_ONLY, Corners, Estimate, pose_covariances, solve
from stages.calibrate.boards.detect import Chessboard, detect, grid
from stages.calibrate.laser import (
    LaserPicture,
    calibrate_laser_plane,
    line_on_board,
)
from stages.calibrate.laser.line import LaserPlaneParameters, fit_peaks
from stages.calibrate.laser.plane import BoardErrors, fit_plane_robustly, weighted_plane
from tests.board_scene import chessboard_picture, facing_pose, render, views_of
from tests.quiet import quiet_context

CAMERA = KannalaBrandt((640, 480), (230.0, 229.5), (318.3, 241.2), (-0.0118, 0.0008, -0.0008, 0.0001))
BOARD = Chessboard(8, 6, 20.0)
SHEET = LaserSheet(90.0, 0.21, -0.13)
PX_PER_MM, LINE_SIGMA_MM = 3.0, 0.8
# Scene poses: directions, distance and tilt of boards that the sheet crosses.
POSES = (
    ([0.05, 0.02, 1.0], 95.0, [0.7, 0.1, 0.0]),
    ([0.1, -0.1, 1.0], 110.0, [-0.6, 0.4, 0.1]),
    ([-0.2, 0.1, 1.0], 90.0, [0.1, 0.6, 0.3]),
    ([-0.3, -0.2, 1.0], 110.0, [0.3, -0.6, 0.2]),
)
GREEN = LaserPlaneParameters(wavelength_nm=520.0)


def _plane_points(random, pictures=8, per_picture=60, noise_mm=0.03, picture_mm=0.0):
    """Return lines in z = 50 + 0.2 x − 0.1 y with noise, each displaced as a whole, and their groups."""
    lines = []
    for _ in range(pictures):
        start, direction = random.uniform(-60, 60, 2), random.normal(size=2)
        xy = start + np.linspace(-30, 30, per_picture)[:, None] * direction / np.linalg.norm(direction)
        z = 50 + 0.2 * xy[:, 0] - 0.1 * xy[:, 1] + random.normal(0, picture_mm)
        lines.append(np.c_[xy, z + random.normal(0, noise_mm, per_picture)])
    return np.concatenate(lines), np.repeat(np.arange(pictures), per_picture)


def fit_plane(points, group, boards=None):
    """Return the plane of least squared distances, all points alike."""
    return weighted_plane(points, group, np.ones(len(points)), boards)


TRUE_NORMAL = np.array([-0.2, 0.1, 1.0]) / np.linalg.norm([-0.2, 0.1, 1.0])


def test_exact_points_give_the_sheet_of_their_plane():
    points, group = _plane_points(np.random.default_rng(1), noise_mm=0.0)
    sheet = fit_plane(points, group).sheet(0.15, 520.0)
    assert [sheet.baseline_mm, sheet.tilt_x, sheet.tilt_y] == pytest.approx([50, 0.2, -0.1], abs=1e-9)


def test_the_robust_fit_rejects_points_off_the_plane():
    points, group = _plane_points(np.random.default_rng(2))
    points[::5] += [0.0, 0.0, 7.0]
    assert abs(fit_plane(points, group).sheet(0.15, 520.0).baseline_mm - 50) > 0.5
    robust = fit_plane_robustly(points, group)
    assert abs(robust.sheet(0.15, 520.0).baseline_mm - 50) < 0.02
    assert robust.rms_mm < 0.05
    assert robust.points <= 0.8 * len(points)


@pytest.mark.parametrize("picture_mm", [0.0, 0.1])
def test_covariance_agrees_with_repeated_measurements(picture_mm):
    """Squared errors in units of the stated covariance average 3, also when pictures err as a whole."""
    squares = []
    for seed in range(200):
        points, group = _plane_points(np.random.default_rng(seed), 12, 40, picture_mm=picture_mm)
        plane = fit_plane(points, group)
        assert np.linalg.matrix_rank(plane.covariance, tol=1e-12) == 3
        sheet = plane.sheet(0.15, 520.0)
        error = np.array([sheet.baseline_mm - 50, sheet.tilt_x - 0.2, sheet.tilt_y + 0.1])
        squares.append(error @ np.linalg.solve(plane.sheet_covariance(), error))
    # Median of χ² with 3 degrees of freedom is 2.37; the scale comes from 24 numbers, so it is loose.
    assert 1.3 < np.median(squares) < 3.6


def test_covariance_without_groups_would_be_too_small():
    points, group = _plane_points(np.random.default_rng(3), 12, 40, picture_mm=0.1)
    apart = fit_plane(points, np.arange(len(points)))
    assert fit_plane(points, group).tilt_sigma_rad > 2 * apart.tilt_sigma_rad


def _drawn(random, poses):
    """Return points on the sheet computed from boards with noisy corners, and the errors of the boards."""
    points, arms, spread = [], [], []
    for view, T_centre in zip(views_of(CAMERA, poses, random, sigma_px=0.2), poses, strict=True):
        T_true = T_centre @ from_parts(np.eye(3), -grid(9, 6, 20.0).mean(0))
        corners = Corners.of([view])
        posed = solve(Estimate(CAMERA, T_true[None], np.zeros(3)), corners, POSES_ONLY, 1.0)
        upright = np.array([-SHEET.tilt_x, -SHEET.tilt_y, 1.0])
        across = (upright @ T_true[:3, :3])[:2]
        nearest = across * (SHEET.baseline_mm - upright @ T_true[:3, 3]) / (across @ across)
        line = np.array([-across[1], across[0]]) / np.linalg.norm(across)
        xyz_b = np.column_stack([nearest + np.linspace(-40, 40, 60)[:, None] * line, np.zeros(60)])
        arms.append(xyz_b @ posed.T_cb[0, :3, :3].T)
        points.append(arms[-1] + posed.T_cb[0, :3, 3] + random.normal(0, 0.01, (60, 3)))
        spread.append(pose_covariances(posed, corners, 1.0)[0])
    group = np.repeat(np.arange(len(points)), 60)
    return np.concatenate(points), group, BoardErrors(np.concatenate(arms), np.stack(spread))


def test_covariance_includes_the_errors_of_board_poses():
    """From 60 draws; without the errors of poses σ of the plane is half of what it should be."""
    squares = {True: [], False: []}
    poses = [facing_pose(*pose) for pose in POSES]
    for seed in range(60):
        points, group, boards = _drawn(np.random.default_rng(seed), poses)
        for knows in squares:
            plane = fit_plane(points, group, boards if knows else None)
            sheet = plane.sheet(0.15, 520.0)
            error = np.array([sheet.baseline_mm - 90, sheet.tilt_x - 0.21, sheet.tilt_y + 0.13])
            squares[knows].append(error @ np.linalg.solve(plane.sheet_covariance(), error))
    # Median of χ² with 3 degrees of freedom: 2.37; four boards leave the scatter of their lines uncertain.
    assert 1.2 < np.median(squares[True]) < 3.3
    assert np.median(squares[False]) > 4


def test_probe_takes_the_plane_with_its_covariance(tmp_path):
    points, group = _plane_points(np.random.default_rng(8))
    plane = fit_plane(points, group)
    names = (*CAMERA.parameter_names, *LaserSheet.PARAMETER_NAMES)
    stated = Probe(CAMERA, LaserSheet(45.0), np.eye(len(names)))
    write_probe(with_plane(stated, CAMERA, plane, 532.0), tmp_path / "probe.yaml")
    probe = read_probe(tmp_path / "probe.yaml")
    assert probe.laser.parameters[:3] == pytest.approx([50, 0.2, -0.1], abs=0.02)
    assert probe.laser.wavelength_nm == 532
    place = np.ix_(*[[names.index(n) for n in ("baseline_mm", "tilt_x", "tilt_y")]] * 2)
    assert np.allclose(probe.covariance[place], plane.sheet_covariance())
    assert np.count_nonzero(probe.covariance) == 9


def test_a_plane_beside_the_axis_is_not_a_sheet():
    plane = LaserPlane(np.array([-0.019, 0.8963, 0.4431]), 16.11, np.zeros((4, 4)), 0.05, 100)
    with pytest.raises(UnusableError, match=r"leans by 63\.\d°"):
        plane.sheet(0.15, 650.0)
    with pytest.raises(UnusableError, match=r"z = -16\.0 mm"):
        LaserPlane(np.array([0.0, 0.0, 1.0]), -16.0, np.zeros((4, 4)), 0.05, 100).sheet(0.15, 650.0)


def test_sheet_contains_the_planes_points():
    points, group = _plane_points(np.random.default_rng(4), noise_mm=0.0)
    sheet = fit_plane(points, group).sheet(0.15, 520.0)
    met = sheet.intersect(points / np.linalg.norm(points, axis=1, keepdims=True))
    assert np.abs(met - points).max() < 1e-6


def test_peaks_are_found_at_bells_and_nowhere_else():
    x, random = np.arange(-12.0, 13.0), np.random.default_rng(5)
    centre = random.uniform(-3, 3, 300)
    bells = 80 * np.exp(-0.5 * ((x - centre[:, None]) / 2.3) ** 2) + 20
    found = fit_peaks(bells + random.normal(0, 2, bells.shape), 6.0)
    # Cramér–Rao: σ = noise / amplitude · sqrt(2 w / sqrt(π)) = 0.040 samples.
    assert np.sqrt(np.mean((found - centre) ** 2)) < 1.25 * 2 / 80 * np.sqrt(2 * 2.3 / np.sqrt(np.pi))
    assert np.isnan(fit_peaks(random.normal(0, 2, (300, 25)), 6.0)).all()
    assert np.isnan(fit_peaks(np.where(x > 3, np.nan, bells[:2]), 6.0)).all()


def _picture(T_cb, random, line=True):
    face, _ = chessboard_picture(BOARD.columns, BOARD.rows, int(BOARD.square_mm * PX_PER_MM), 60)
    grey = render(CAMERA, T_cb, face, PX_PER_MM, random)
    image = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR).astype(float) * 0.6
    if line:
        image[..., 1] += 140 * _line_light(T_cb) * (0.25 + grey / 300)
    noisy = image + random.normal(0, 1.5, image.shape)
    return np.clip(np.round(noisy), 0, 255).astype(np.uint8)


def _line_light(T_cb):
    """Return the laser's light in every pixel.

    A Gaussian of the height above the sheet of the board's point.
    """
    uv = np.stack(np.meshgrid(np.arange(640.0), np.arange(480.0)), -1)
    ray = CAMERA.unproject(uv).ray
    point = ray * ((T_cb[:3, 2] @ T_cb[:3, 3]) / (ray @ T_cb[:3, 2]))[..., None]
    height = point[..., 2] - 90.0 - 0.21 * point[..., 0] + 0.13 * point[..., 1]
    return np.exp(-0.5 * (height / LINE_SIGMA_MM) ** 2)


@pytest.fixture(scope="module")
def pictures():
    random = np.random.default_rng(6)
    images = [_picture(facing_pose(*pose), random) for pose in POSES]
    views = [detect(image, BOARD, f"{i}.png") for i, image in enumerate(images)]
    return [LaserPicture(image, view) for image, view in zip(images, views, strict=True)]


def test_laser_plane_from_rendered_boards(pictures):
    result = calibrate_laser_plane(pictures, CAMERA, GREEN, quiet_context())
    assert len(result.lines) == len(POSES)
    assert result.plane.rms_mm < 0.1
    sheet = result.plane.sheet(0.15, 520.0)
    error = np.array([sheet.baseline_mm - 90, sheet.tilt_x - 0.21, sheet.tilt_y + 0.13])
    # A tenth of a pixel in the size of a board 200 px across moves it by 0.05 %.
    assert np.abs(error[0]) < 0.1
    assert np.abs(error[1:]).max() < 0.002


def test_pictures_without_a_line_are_named_and_too_few_pictures_refused(pictures):
    random = np.random.default_rng(7)
    dark = _picture(facing_pose(*POSES[0]), random, line=False)
    without = LaserPicture(dark, pictures[0].view)
    result = calibrate_laser_plane([without, *pictures[1:]], CAMERA, GREEN, quiet_context())
    assert [name for name, _ in result.rejected] == [pictures[0].view.name]
    with pytest.raises(UnusableError, match=r"2 pictures show the laser line"):
        calibrate_laser_plane([without, *pictures[2:]], CAMERA, GREEN, quiet_context())


def test_a_line_of_another_colour_is_ignored(pictures):
    red = LaserPlaneParameters(wavelength_nm=650.0)
    assert len(line_on_board(pictures[0], CAMERA, red).xyz_c) < red.least_points


def test_one_line_seen_many_times_does_not_determine_the_plane(pictures):
    with pytest.raises(UnusableError, match="nearly coincide"):
        calibrate_laser_plane([pictures[0]] * 3, CAMERA, GREEN, quiet_context())
