"""Lit pictures from several positions distinguish a groove in the wall from a drop that moved the line."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from pipeline.geometry.axis import straight_axis
from pipeline.recording.base import FrameTable
from stages.defects.depth import Depth
from stages.defects.parallax import LitPictures, _agreement
from stages.defects.parameters import DefectParameters
from stages.defects.relief import smooth_shape_removed
from stages.defects.report import warn_of_drops
from stages.defects.segment import Region
from tests.quiet import quiet_context
from tests.synthetic_wall import smooth_noise, wall_of

RADIUS, BASELINE, FOCAL, HALF = 40.0, 30.0, 300.0, 400.0
DISTANCE, AZIMUTH = np.arange(0, 90, 0.5), -np.pi + np.arange(720) * np.pi / 360
CAMERA_S = np.arange(-10.0, 60.0, 1.0)
GROOVE = Region(90, 355, np.ones((32, 11), bool), 1.0)
LONG_MM, SHORT_MM = 8.0, 3.0
PIT = Region(99, 350, np.ones((14, 21), bool), 1.0)
PAINT = smooth_noise(np.random.default_rng(2), (600, 1440), 30.0, 1.5)


def groove(s, psi, depth_mm, half_mm=LONG_MM):
    """Return the change of radius by the groove: 4 mm wide, or as wide as long if it is short."""
    wide = 2.0 if half_mm == LONG_MM else half_mm
    return depth_mm * np.exp(-((((s - 53) / half_mm) ** 2) ** 2) - (RADIUS * psi / wide) ** 2)


def picture(camera_s, depth_mm, half_mm=LONG_MM):
    """Return the picture of the painted wall with its groove for a fisheye camera on the axis."""
    u, v = np.meshgrid(np.arange(2 * HALF), np.arange(2 * HALF))
    psi, theta = np.arctan2(v - HALF, u - HALF), np.maximum(np.hypot(u - HALF, v - HALF), 1) / FOCAL
    s = camera_s + RADIUS / np.tan(np.minimum(theta, 1.5))
    for _ in range(6):
        s = camera_s + (RADIUS + groove(s, psi, depth_mm, half_mm)) / np.tan(np.minimum(theta, 1.5))
    row, column = ((s + 20) / 0.2).astype(np.float32), ((psi + np.pi) / 2 / np.pi * 1440).astype(np.float32)
    return 120 + cv2.remap(PAINT.astype(np.float32), column, row, cv2.INTER_LINEAR)


def project(xyz_c):
    theta = np.arctan2(np.hypot(xyz_c[..., 0], xyz_c[..., 1]), xyz_c[..., 2])
    psi = np.arctan2(xyz_c[..., 1], xyz_c[..., 0])
    uv = HALF + FOCAL * theta[..., None] * np.stack([np.cos(psi), np.sin(psi)], -1)
    return uv, theta < 1.5


def pictures(depth_mm, half_mm=LONG_MM):
    """Return the lit pictures of a wall with a groove of this depth."""
    count = len(CAMERA_S)
    T_pc = np.tile(np.eye(4), (count, 1, 1))
    T_pc[:, 2, 3] = CAMERA_S
    table = FrameTable(np.arange(count), np.arange(count) / 30, np.array(["led"] * count))

    def read(frames, planes):
        return ((int(k), picture(CAMERA_S[k], depth_mm, half_mm)) for k in frames)

    probe = SimpleNamespace(
        camera=SimpleNamespace(project=project),
        laser=SimpleNamespace(baseline_mm=BASELINE),
        lighting=SimpleNamespace(radius_mm=11.0),
    )
    motion = SimpleNamespace(frame=np.arange(count), T_pc=T_pc, axis=straight_axis(-100.0, 200.0))
    return LitPictures(SimpleNamespace(frames=table, read=read), probe, motion)


@pytest.mark.parametrize(
    ("depth_mm", "half_mm"),
    [(0.5, LONG_MM), (-0.5, LONG_MM), (1.2, LONG_MM), (1.5, SHORT_MM), (-1.5, SHORT_MM)],
)
def test_pictures_contradict_what_a_drop_makes_but_not_what_is_in_the_wall(depth_mm, half_mm):
    """Of seven pits and deposits of 2 mm that drops made on open-1, all were confirmed: they were short."""
    random = np.random.default_rng(1)
    s, psi = np.meshgrid(DISTANCE, AZIMUTH, indexing="ij")
    height = groove(s, psi, depth_mm, half_mm)
    radius = RADIUS + height + smooth_noise(random, s.shape, 0.02, 1.0)
    known = np.abs(height) > 0.02
    relief = smooth_shape_removed(wall_of(DISTANCE, AZIMUTH, radius).radius_map, DefectParameters(), known)
    rows = relief.rows(slice(0, len(DISTANCE)))
    region = GROOVE if half_mm == LONG_MM else PIT
    assert not pictures(depth_mm, half_mm).contradict(region, rows)
    assert pictures(0.0, half_mm).contradict(region, rows)


def test_one_picture_of_a_strut_hardly_changes_how_well_the_others_agree() -> None:
    """A true pit of .87 mm was contradicted by one of eight pictures, in which its ground lay at a strut."""
    random = np.random.default_rng(4)
    wall = random.normal(0, 10, 200) + random.normal(0, 2, (8, 200))
    assert _agreement(wall) == pytest.approx(1 / 1.04, abs=0.02)
    one_of_strut = np.vstack([wall[1:], 10 * np.sign(np.arange(200) - 100.5)])
    assert _agreement(one_of_strut) == pytest.approx(_agreement(wall), abs=0.01)
    unlike = random.normal(0, 10, (8, 200))
    assert abs(_agreement(unlike)) < 0.1


def steep_pit(s, psi):
    """Return the change of radius by a pit of 4 mm × 4 mm with steep sides, 2 mm deep."""
    return 2.0 * np.exp(-(((s - 53) / 2) ** 4) - (RADIUS * psi / 2) ** 4)


def picture_of_steep_pit(camera_s, deep):
    """Return the picture of the wall around a pit with a dark ground, of which its sides hide a part."""
    v, u = np.mgrid[HALF - 60 : HALF + 60, HALF + 60 : 2 * HALF]
    psi, slope = np.arctan2(v - HALF, u - HALF), 1 / np.tan(np.hypot(u - HALF, v - HALF) / FOCAL)
    radius, free = np.full(psi.shape, RADIUS), np.ones(psi.shape, bool)
    for _ in range(50):
        free &= radius < RADIUS + deep * steep_pit(camera_s + radius * slope, psi)
        radius += 0.04 * free
    s = camera_s + radius * slope
    row, column = ((s + 20) / 0.2).astype(np.float32), ((psi + np.pi) / 2 / np.pi * 1440).astype(np.float32)
    paint = 150 + cv2.remap(PAINT.astype(np.float32), column, row, cv2.INTER_LINEAR)
    image = np.full((int(2 * HALF), int(2 * HALF)), 100.0)
    image[int(HALF) - 60 : int(HALF) + 60, int(HALF) + 60 :] = paint * (1 - 0.4 * steep_pit(s, psi))
    return cv2.GaussianBlur(image, (0, 0), 0.8)


@pytest.mark.parametrize("deep", [0, 1])
def test_pictures_do_not_contradict_a_steep_pit_whose_sides_hide_its_dark_ground(deep):
    """Its opening looked alike from several places, but worse alike than the wall beside it."""
    s, psi = np.meshgrid(DISTANCE, AZIMUTH, indexing="ij")
    radius = RADIUS + steep_pit(s, psi) + smooth_noise(np.random.default_rng(1), s.shape, 0.02, 1.0)
    known = steep_pit(s, psi) > 0.02
    relief = smooth_shape_removed(wall_of(DISTANCE, AZIMUTH, radius).radius_map, DefectParameters(), known)
    region = Region(102, 354, np.ones((9, 13), bool), 1.0)
    lit, noise = pictures(0.0), np.random.default_rng(3)

    def read(frames, planes):
        for k in frames:
            image = picture_of_steep_pit(CAMERA_S[k], deep)
            yield int(k), image + noise.normal(0, 2, image.shape)

    lit = replace(lit, recording=SimpleNamespace(frames=lit.recording.frames, read=read))
    assert lit.contradict(region, relief.rows(slice(0, len(DISTANCE)))) == (not deep)


@pytest.mark.parametrize("places", [1, 2])
def test_drops_are_named_where_pictures_contradict_several_findings(places):
    told = []
    warn_of_drops(places, replace(quiet_context(), warn=told.append))
    assert len(told) == (places == 2)
    assert all("drops or dirt moved over the window" in words for words in told)


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
