"""A drop that displaces the wall while the line passes is told from a defect, a shaken camera and noise."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from pipeline.geometry.axis import straight_axis
from pipeline.recording.base import FrameTable
from stages.defects.behind_drop import shows_drop
from stages.defects.parallax import LitPictures
from stages.defects.parameters import DefectParameters
from stages.defects.relief import smooth_shape_removed
from stages.defects.segment import Region
from tests.synthetic_wall import smooth_noise, wall_of

RADIUS, BASELINE, FOCAL, HALF = 40.0, 30.0, 180.0, 240
DISTANCE, AZIMUTH = np.arange(0, 90, 0.5), -np.pi + np.arange(720) * np.pi / 360
CAMERA_S = np.arange(7.0, 42.0, 1.5)
PAINT = smooth_noise(np.random.default_rng(2), (600, 1440), 30.0, 1.5).astype(np.float32)
FIRST, LAST = 50.0, 57.0
"""Distances, mm, between which the line passes the finding, which lies at azimuth 0."""
REGION = Region(100, 350, np.ones((14, 21), bool), 1.0)
V, U = np.mgrid[: 2 * HALF, : 2 * HALF].astype(np.float32)
LINE_PX = FOCAL * np.arctan2(RADIUS, BASELINE)


def pit(s, psi, depth_mm):
    """Return the change of radius by a pit of 7 mm × 7 mm."""
    return depth_mm * np.exp(-((((s - 53.5) / 3.5) ** 2) ** 2) - ((RADIUS * psi / 3.5) ** 2) ** 2)


def picture(camera_s, depth_mm):
    """Return the picture of the painted wall with a pit for a fisheye camera on the axis."""
    psi = np.arctan2(V - HALF, U - HALF)
    slope = 1 / np.tan(np.clip(np.hypot(U - HALF, V - HALF) / FOCAL, 1e-3, 1.5))
    s = camera_s + RADIUS * slope
    for _ in range(4):
        s = camera_s + (RADIUS + pit(s, psi, depth_mm)) * slope
    row, column = ((s + 20) / 0.2).astype(np.float32), ((psi + np.pi) / 2 / np.pi * 1440).astype(np.float32)
    return 120 + cv2.remap(PAINT, column, row, cv2.INTER_LINEAR)


def project(xyz_c):
    theta = np.arctan2(np.hypot(xyz_c[..., 0], xyz_c[..., 1]), xyz_c[..., 2])
    psi = np.arctan2(xyz_c[..., 1], xyz_c[..., 0])
    return HALF + FOCAL * theta[..., None] * np.stack([np.cos(psi), np.sin(psi)], -1), theta < 1.5


def under_drop(image, depth_mm=0.4):
    """Return a picture in which a drop at the line displaces line and wall at azimuth 0 outward.

    The line then shows a pit of ``depth_mm``, of which the ray's angle follows.
    """
    largest = FOCAL * np.arctan2(RADIUS + depth_mm, BASELINE) - LINE_PX
    bulge = largest * np.exp(-((U - HALF - LINE_PX) ** 2 + (V - HALF) ** 2) / 30.0**2)
    return cv2.remap(image, (U - bulge).astype(np.float32), V, cv2.INTER_LINEAR)


def moved_aside(image):
    """Return a picture in which the wall about the line is displaced around the pipe at azimuth 0."""
    bulge = 1.5 * np.exp(-((U - HALF - LINE_PX) ** 2 + (V - HALF) ** 2) / 30.0**2)
    return cv2.remap(image, U, (V - bulge).astype(np.float32), cv2.INTER_LINEAR)


def shaken(image):
    return cv2.warpAffine(image, np.float32([[1, 0, 3], [0, 1, 2]]), image.shape[::-1])


def pictures(depth_mm, spoil, noise=1.0, lights="led"):
    """Return lit pictures of a wall with a pit; those taken while the line passes it are spoiled."""
    count, random = len(CAMERA_S), np.random.default_rng(3)
    T_pc = np.tile(np.eye(4), (count, 1, 1))
    T_pc[:, 2, 3] = CAMERA_S
    table = FrameTable(np.arange(count), np.arange(count) / 30, np.array([lights] * count))

    def read(frames, planes):
        for k in frames:
            image = picture(CAMERA_S[k], depth_mm)
            image = spoil(image) if FIRST <= CAMERA_S[k] + BASELINE <= LAST else image
            yield int(k), image + random.normal(0, noise, image.shape)

    probe = SimpleNamespace(
        camera=SimpleNamespace(project=project), laser=SimpleNamespace(baseline_mm=BASELINE)
    )
    motion = SimpleNamespace(frame=np.arange(count), T_pc=T_pc, axis=straight_axis(-100.0, 200.0))
    return LitPictures(SimpleNamespace(frames=table, read=read), probe, motion)


def measured(depth_mm):
    """Return the relief of a wall whose line shows a pit of some depth."""
    s, psi = np.meshgrid(DISTANCE, AZIMUTH, indexing="ij")
    height = pit(s, psi, depth_mm)
    radius = RADIUS + height + smooth_noise(np.random.default_rng(1), s.shape, 0.02, 1.0)
    wall = wall_of(DISTANCE, AZIMUTH, radius).radius_map
    relief = smooth_shape_removed(wall, DefectParameters(), np.abs(height) > 0.02)
    return relief.rows(slice(0, len(DISTANCE)))


@pytest.mark.parametrize("lights", ["led", "both"])
@pytest.mark.parametrize("noise", [1.0, 25.0])
def test_a_wall_displaced_while_the_line_passes_is_under_a_drop(noise, lights):
    """So shallow a finding, and in such noise, no pictures from elsewhere contradict."""
    lit = pictures(0.0, under_drop, noise, lights)
    assert shows_drop(lit, REGION, measured(0.4))
    assert noise < 25 or not lit.contradict(REGION, measured(0.4))


@pytest.mark.parametrize("measured_mm", [1.5, 0.5])
@pytest.mark.parametrize("noise", [1.0, 25.0])
def test_a_pit_is_not_a_drop_even_if_its_depth_is_wrong(noise, measured_mm):
    assert not shows_drop(pictures(1.5, lambda image: image, noise), REGION, measured(measured_mm))


def test_a_wall_displaced_around_the_pipe_explains_no_depth():
    """A codec did this beside a true corrosion of .42 mm, which was unconfirmed as under a drop."""
    assert not shows_drop(pictures(0.4, moved_aside), REGION, measured(0.4))


def test_a_wall_displaced_the_other_way_than_the_line_is_not_under_a_drop():
    assert not shows_drop(pictures(0.0, lambda image: under_drop(image, -0.4)), REGION, measured(0.4))


def test_a_camera_that_shakes_while_the_line_passes_a_pit_is_not_a_drop():
    assert not shows_drop(pictures(1.5, shaken), REGION, measured(1.5))


def test_a_shaken_camera_makes_no_drop_of_the_only_texture_on_a_plain_wall(monkeypatch):
    """No other place showed that the camera had moved, and a pit in smooth enamel was under a drop."""
    row, column = np.arange(600) / 5 - 20, RADIUS * (np.arange(1440) / 720 - 1) * np.pi
    near = np.exp(-((row[:, None] - 53.5) ** 4 + column**4) / 5**4)
    monkeypatch.setattr(f"{__name__}.PAINT", (near * PAINT).astype(np.float32))
    assert not shows_drop(pictures(1.5, shaken), REGION, measured(1.5))


def glossy(lit, share, reflection, scale_mm):
    """Return pictures of a wall with a share of the texture, and a reflection that crosses the pit.

    It moves from 2 mm before to 2 mm behind the middle while the line moves there by a few ``scale_mm``.
    """
    psi = np.arctan2(V - HALF, U - HALF)
    slope = 1 / np.tan(np.clip(np.hypot(U - HALF, V - HALF) / FOCAL, 1e-3, 1.5))

    def read(frames, planes):
        for k, image in lit.recording.read(frames, planes):
            middle = 53.5 + 2 * np.tanh((CAMERA_S[k] + BASELINE - 53.5) / scale_mm)
            off = CAMERA_S[k] + RADIUS * slope - middle
            spot = np.exp(-(off**2) - (RADIUS * psi / 1.5) ** 2)
            yield k, 120 + share * (image - 120) + reflection * spot

    return replace(lit, recording=SimpleNamespace(frames=lit.recording.frames, read=read))


@pytest.mark.parametrize("scale_mm", [1, 3, 6])
def test_a_reflection_that_moves_with_the_camera_is_not_a_drop(scale_mm):
    """A true dent of .73 mm in glossy steel was unconfirmed: of other texture such a wall has little."""
    lit = glossy(pictures(0.5, lambda image: image), 0.2, 100, scale_mm)
    assert not shows_drop(lit, REGION, measured(0.5))


def test_a_drop_is_seen_on_little_texture_without_a_reflection():
    assert shows_drop(glossy(pictures(0.0, under_drop), 0.2, 0, 3), REGION, measured(0.4))


def test_what_goes_all_round_is_not_judged():
    assert not shows_drop(pictures(0.0, under_drop), replace(REGION, all_round=True), measured(0.4))
