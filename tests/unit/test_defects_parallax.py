"""Lit pictures from several positions distinguish a groove in the wall from a drop that moved the line."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from pipeline.geometry.axis import straight_axis
from pipeline.recording.base import FrameTable
from stages.defects.depth import Depth
from stages.defects.parallax import LitPictures
from stages.defects.parameters import DefectParameters
from stages.defects.relief import smooth_shape_removed
from stages.defects.segment import Region
from tests.synthetic_wall import smooth_noise, wall_of

RADIUS, BASELINE, FOCAL, HALF = 40.0, 30.0, 300.0, 400.0
DISTANCE, AZIMUTH = np.arange(0, 90, 0.5), -np.pi + np.arange(720) * np.pi / 360
CAMERA_S = np.arange(-10.0, 60.0, 1.0)
GROOVE = Region(90, 355, np.ones((32, 11), bool), 1.0)
PAINT = smooth_noise(np.random.default_rng(2), (600, 1440), 30.0, 1.5)


def groove(s, psi, depth_mm):
    """Return the change of radius by the groove: 16 mm along the pipe, 4 mm wide."""
    return depth_mm * np.exp(-((((s - 53) / 8) ** 2) ** 2) - (RADIUS * psi / 2) ** 2)


def picture(camera_s, depth_mm):
    """Return the picture of the painted wall with its groove for a fisheye camera on the axis."""
    u, v = np.meshgrid(np.arange(2 * HALF), np.arange(2 * HALF))
    psi, theta = np.arctan2(v - HALF, u - HALF), np.maximum(np.hypot(u - HALF, v - HALF), 1) / FOCAL
    s = camera_s + RADIUS / np.tan(np.minimum(theta, 1.5))
    for _ in range(6):
        s = camera_s + (RADIUS + groove(s, psi, depth_mm)) / np.tan(np.minimum(theta, 1.5))
    row, column = ((s + 20) / 0.2).astype(np.float32), ((psi + np.pi) / 2 / np.pi * 1440).astype(np.float32)
    return 120 + cv2.remap(PAINT.astype(np.float32), column, row, cv2.INTER_LINEAR)


def project(xyz_c):
    theta = np.arctan2(np.hypot(xyz_c[..., 0], xyz_c[..., 1]), xyz_c[..., 2])
    psi = np.arctan2(xyz_c[..., 1], xyz_c[..., 0])
    uv = HALF + FOCAL * theta[..., None] * np.stack([np.cos(psi), np.sin(psi)], -1)
    return uv, theta < 1.5


def pictures(depth_mm):
    """Return the lit pictures of a wall with a groove of this depth."""
    count = len(CAMERA_S)
    T_pc = np.tile(np.eye(4), (count, 1, 1))
    T_pc[:, 2, 3] = CAMERA_S
    table = FrameTable(np.arange(count), np.arange(count) / 30, np.array(["led"] * count))

    def read(frames, planes):
        return ((int(k), picture(CAMERA_S[k], depth_mm)) for k in frames)

    probe = SimpleNamespace(
        camera=SimpleNamespace(project=project),
        laser=SimpleNamespace(baseline_mm=BASELINE),
        lighting=SimpleNamespace(radius_mm=11.0),
    )
    motion = SimpleNamespace(frame=np.arange(count), T_pc=T_pc, axis=straight_axis(-100.0, 200.0))
    return LitPictures(SimpleNamespace(frames=table, read=read), probe, motion)


@pytest.mark.parametrize("depth_mm", [0.5, -0.5, 1.2])
def test_pictures_contradict_the_groove_made_by_a_drop_but_not_one_in_the_wall(depth_mm):
    random = np.random.default_rng(1)
    s, psi = np.meshgrid(DISTANCE, AZIMUTH, indexing="ij")
    radius = RADIUS + groove(s, psi, depth_mm) + smooth_noise(random, s.shape, 0.02, 1.0)
    known = np.abs(groove(s, psi, depth_mm)) > 0.02
    relief = smooth_shape_removed(wall_of(DISTANCE, AZIMUTH, radius).radius_map, DefectParameters(), known)
    rows = relief.rows(slice(0, len(DISTANCE)))
    assert not pictures(depth_mm).contradict(GROOVE, rows)
    assert pictures(0.0).contradict(GROOVE, rows)


def test_pictures_are_not_used_for_a_short_finding():
    rows = SimpleNamespace(cell_mm=(0.5, 0.35))
    short = Region(90, 355, np.ones((10, 11), bool), 1.0)
    assert not pictures(0.0).contradict(short, rows)


@pytest.mark.parametrize(
    ("depth_mm", "row", "struck"),
    [(-35.0, 60, True), (-20.0, 60, False), (35.0, 60, False), (-35.0, 150, False)],
)
def test_a_deposit_that_the_probe_would_have_hit_is_not_real(depth_mm, row, struck):
    """A reflection was a deposit of 21 mm in a pipe of 25 mm radius.

    Only ahead of the probe one may exist.
    """
    radius = RADIUS + smooth_noise(np.random.default_rng(1), (len(DISTANCE), len(AZIMUTH)), 0.02, 1.0)
    relief = smooth_shape_removed(wall_of(DISTANCE, AZIMUTH, radius).radius_map, DefectParameters())
    rows, region = relief.rows(slice(0, len(DISTANCE))), Region(row, 700, np.ones((8, 40), bool), -1.0)
    assert pictures(0.0).drove_through(region, Depth(depth_mm, 0.1, 0.0, (4, 30)), rows) is struck
