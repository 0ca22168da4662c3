"""Glints and wet wall, on synthetic pictures: found where they are, and nowhere else."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from pipeline.artefacts.twin import Mismatch, NamedFigure
from pipeline.recording.base import Illumination
from stages.twin import on_wall
from stages.twin.glints import SpotsOfFrames
from stages.twin.on_wall import ring_step_mm, slope_error, touching, unnamed
from stages.twin.reference import BlocksOfFrames
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Ring
from stages.twin.sums import Sums
from tests.synthetic_wall import plain_bore

SHAPE, FRAMES, STEP_PX = (240, 320), 10, 8
V, U = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]].astype(np.float32)
RING = Ring((160.0, 120.0), 90.0, 50.0, 25.0)


def _twin(number, region=Region.WALL):
    """A wall unrolled in the picture's columns, which moves down by blocks from frame to frame."""
    level = np.full(SHAPE, 80.0, np.float32)
    along = ((V + STEP_PX * number) * np.float32(50 / 90)).astype(np.float32)
    around = (U / np.float32(90.0)).astype(np.float32)
    kind, even = np.full(SHAPE, region, np.uint8), np.ones(SHAPE, np.float32)
    return TwinFrame(level, np.full(SHAPE, 4.0, np.float32), kind, along, around, even)


def _spot(u, v, grey=120.0):
    made = np.zeros(SHAPE, np.float32)
    cv2.circle(made, (round(u), round(v)), 6, grey, -1)
    return made


def _spots(spot_of, light=Illumination.LED):
    random, spots = np.random.default_rng(4), SpotsOfFrames(light, RING)
    for number in range(FRAMES):
        twin = _twin(number, Region.DARK if light == Illumination.LASER else Region.WALL)
        noise = 2 * random.standard_normal(SHAPE).astype(np.float32)
        spots.add(number, twin.level + noise + spot_of(number, random), twin)
    return spots.found()


def test_a_lamp_reflected_at_one_place_of_the_image_is_a_glint():
    (found,) = _spots(lambda n, r: _spot(100 + r.normal(0, 3), 60 + r.normal(0, 3)))
    assert (found.name, found.fixed_to) == ("glint", "image")
    u, v, _ = (p.value for p in found.place)
    assert np.hypot(u - 100, v - 60) < 4
    assert found.chi2_after < found.chi2_before / 2


@pytest.mark.parametrize("shaded_px", [0, 40])
def test_wall_too_dark_in_its_photo_is_no_glint(shaded_px):
    """A housing that shades the border made a glint where wall was photographed through the shade."""
    random, spots = np.random.default_rng(4), SpotsOfFrames(Illumination.LED, RING)
    place, shade = _spot(120, 90, 1.0) > 0, np.abs(U - 120 - 8 - shaded_px) < 0.5 * shaded_px
    for number in range(FRAMES):
        twin = _twin(number)
        twin.level[place] = 30.0
        twin.level[shade & ~place] = 20.0
        seen = np.where(shade & ~place, np.float32(20), np.float32(80))
        spots.add(number, seen + 2 * random.standard_normal(SHAPE).astype(np.float32), twin)
    assert spots.found() == ()


@pytest.mark.parametrize(("away_px", "glints"), [(0, 0), (14, 1)])
def test_light_connected_to_the_line_is_not_a_glint(away_px, glints):
    """A line displaced at a defect, or wide where it clips, was reported as a glint or a droplet."""
    spots = SpotsOfFrames(Illumination.LASER, RING)
    for number in range(FRAMES):
        twin = _twin(number, Region.DARK)
        twin.region[100:106] = Region.LINE_FLANK
        spots.add(number, twin.level + _spot(150, 111 + away_px), twin)
    assert len(spots.found()) == glints


@pytest.mark.parametrize("in_view", [True, False])
def test_burnt_in_text_beside_the_view_is_no_glint(in_view):
    """Letters in a black margin were thirteen glints or drops."""
    spots = SpotsOfFrames(Illumination.LASER, RING, outside=None if in_view else U < 150)
    for number in range(FRAMES):
        twin = _twin(number, Region.DARK)
        spots.add(number, twin.level + _spot(100, 60), twin)
    assert len(spots.found()) == in_view


@pytest.mark.parametrize(("name", "glints"), [("ambient_light or interreflection", 0), ("bloom", 1)])
def test_pale_wall_in_other_light_is_not_a_glint(name, glints):
    spots = [SpotsOfFrames(kind, RING) for kind in (Illumination.LED, Illumination.LASER)]
    for number in range(FRAMES):
        twin = _twin(number, Region.DARK)
        spots[1].add(number, twin.level + _spot(100, 60, grey=60.0), twin)
    size = (NamedFigure("level", 35.0, 1.0, "grey levels"),)
    light = Mismatch(name, "intensity", "wall", (), size, 0.0, 2.0, 1.0, "The wall is lit.")
    assert len(Sums.glints(SimpleNamespace(spots=spots), (light,))) == glints


@pytest.mark.parametrize(
    ("name", "channel", "told"),
    [
        ("droplet", "intensity", 0),
        ("droplet or window_dirt or window_scatter", "intensity", 0),
        ("window_dirt", "intensity", 1),
        ("window_dirt or window_scatter or droplet", "intensity", 1),
    ],
)
def test_wall_that_a_drop_shows_is_not_a_glint(name, channel, told):
    """A drop that was named had spots far brighter than predicted told beside it: wall from elsewhere."""
    spots = [SpotsOfFrames(kind, RING) for kind in (Illumination.LED, Illumination.LASER)]
    random = np.random.default_rng(5)
    for number in range(FRAMES):
        twin = _twin(number, Region.WALL)
        spots[0].add(number, twin.level + _spot(100 + random.normal(0, 3), 60 + random.normal(0, 3)), twin)
    at = zip(("u_px", "v_px", "radius_px"), (100.0, 60.0, 40.0), strict=True)
    place = tuple(NamedFigure(n, x, 8.0, "px") for n, x in at)
    drop = Mismatch(name, channel, "image", place, (), 0.0, 2.0, 1.0, "It bends light.")
    assert (len(Sums.glints(SimpleNamespace(spots=spots), (), (drop,))) > 0) == told


def test_a_spot_of_the_laser_that_stays_in_the_image_may_be_a_drop():
    (found,) = _spots(lambda n, r: _spot(100 + r.normal(0, 3), 60 + r.normal(0, 3)), Illumination.LASER)
    assert (found.name, found.fixed_to) == ("glint or droplet", "image")


def test_a_glint_that_moves_with_the_wall_is_fixed_to_the_wall():
    (found,) = _spots(lambda n, r: _spot(200, 200 - STEP_PX * n))
    assert (found.name, found.fixed_to) == ("glint", "wall")
    assert found.place[0].value == pytest.approx(200 * 50 / 90, abs=2)


def test_spots_that_do_not_reappear_are_counted_without_a_name():
    (found,) = _spots(lambda n, r: _spot(r.uniform(20, 300), r.uniform(20, 220)), Illumination.LASER)
    assert (found.name, found.fixed_to, found.channel) == ("", "time", "line")
    assert found.parameters[0].value == pytest.approx(1.0)


def test_noise_and_a_single_spot_are_not_glints():
    assert not _spots(lambda n, r: 0)
    assert not _spots(lambda n, r: _spot(100, 100) * (n == 4))
    assert not _spots(lambda n, r: np.float32(90.0))  # all of it too bright: not a spot


def _wall(change, surface=None, seed=3, rings_mm=0.5):
    random, blocks = np.random.default_rng(seed), BlocksOfFrames(RING)
    for number in range(12):
        twin = _twin(number)
        patch = np.hypot(twin.distance_mm - 100, 50 * (twin.azimuth_rad - 0.8)) < 14
        aside = np.hypot(U - 160, V - 120) / 90
        noise = 2 * random.standard_normal(SHAPE).astype(np.float32)
        blocks.add(number, twin.level * (1 + change(patch, aside)).astype(np.float32) + noise, twin, 255.0)
    return unnamed(blocks.samples(), surface or plain_bore(), rings_mm, 1.1)


def test_wall_that_shines_or_is_dark_is_reported_without_a_name():
    (wet,) = _wall(lambda patch, aside: 0.7 * patch * (aside - 0.8))
    assert (wet.name, wet.fixed_to, wet.parameters[0].name) == ("", "wall", "shine")
    assert "wet or polished" in wet.statement
    assert abs(wet.place[0].value - 100) < 5
    assert abs(wet.place[1].value - np.degrees(0.8)) < 5
    (dark,) = _wall(lambda patch, aside: -0.2 * patch)
    assert (dark.name, dark.parameters[0].name) == ("", "change")
    assert not _wall(lambda patch, aside: 0 * aside)
    duller = _wall(lambda patch, aside: -0.7 * patch * (aside - 0.8))
    assert not [m for m in duller if m.parameters[0].name == "shine"]


@pytest.mark.parametrize("far_px", [30, 300])
def test_effects_fixed_to_the_image_do_not_make_wall_shine(far_px):
    """Beside a drop, or where the photo contains a scatterer, all passing wall gets brighter outwards."""
    at_place = (abs(U - 72) < 25) & (abs(V - 60) < far_px)
    found = _wall(lambda patch, aside: 0.7 * at_place * (aside - 0.8))
    assert not [m for m in found if m.fixed_to == "wall" and m.parameters[0].name == "shine"]


def test_the_predicted_brightness_of_steep_wall_is_as_sure_as_its_slope():
    plain = plain_bore()
    s, psi = np.meshgrid(plain.distance_mm - 100, np.radians(np.arange(360) - 180) - 0.8, indexing="ij")
    pit = 1.4 * np.exp(-(s**2 + (50 * psi) ** 2) / 2 / 1.3**2)
    steep = replace(plain, along=(-s / 1.3**2 * pit).astype(np.float32))
    assert _wall(lambda patch, aside: -0.15 * patch, plain)
    assert not _wall(lambda patch, aside: -0.15 * patch, steep)
    assert _wall(lambda patch, aside: -0.9 * patch, steep)


@pytest.mark.parametrize(("shine", "told"), [(0.5, 0), (0.8, 0), (1.2, 1)])
def test_an_error_of_slope_makes_wall_seem_to_shine_by_more_than_that_error(shine, told):
    """Far ahead, and on wall that leans away from the lamps, its effect is large: sound welds shone."""
    plain = plain_bore()
    s = np.broadcast_to(plain.distance_mm[:, None] - 100, plain.radius_mm.shape)
    weld = replace(plain, along=(0.85 * s * np.exp(-0.5 * s**2)).astype(np.float32))
    assert len(_wall(lambda patch, aside: shine * patch * (aside - 0.8), weld)) == told
    assert len(_wall(lambda patch, aside: shine * patch * (aside - 0.8), plain)) == 1


def test_what_smoothing_took_from_a_weld_is_not_noise_of_the_map():
    """Noise was the median about a small region of a weld: two sound places were wet or polished."""
    plain = plain_bore()
    s = np.broadcast_to(plain.distance_mm[:, None] - 100, plain.radius_mm.shape)
    weld = replace(plain, along=(0.4 * np.sin(2 * np.pi * s / 7) * (abs(s) < 3.5)).astype(np.float32))
    blocks = SimpleNamespace(first_mm=float(plain.distance_mm[0]), cell_mm=2.5)
    cells = np.array([[int((101.75 - blocks.first_mm) / 2.5), 20]])
    assert slope_error(weld, blocks, cells, 1.2)[0] > 0.05
    assert slope_error(plain, blocks, cells, 1.2) == (0, 0)


def test_a_region_of_a_long_wall_does_not_smooth_all_of_the_map(monkeypatch):
    """In a wall of 20 m each region took 21 s."""
    plain, smoothed = plain_bore(), []
    rows = 20_000
    noise = np.random.default_rng(2).normal(0, 0.01, (rows, 60)).astype(np.float32)
    long = replace(
        plain, distance_mm=np.arange(rows) * 0.5, radius_mm=np.full_like(noise, 50), along=noise, around=noise
    )
    monkeypatch.setattr(
        on_wall, "gaussian_filter", lambda a, *b, **c: smoothed.append(len(a)) or gaussian_filter(a, *b, **c)
    )
    lost, _ = on_wall.slope_error(
        long, SimpleNamespace(first_mm=0.0, cell_mm=2.5), np.array([[100, 20]]), 1.2
    )
    assert sum(smoothed) < rows / 2
    assert lost < 0.03


def test_the_brightness_of_wall_between_distant_rings_is_that_of_linear_interpolation():
    plain = plain_bore()
    s = np.broadcast_to(plain.distance_mm[:, None] - 100, plain.radius_mm.shape)
    weld = replace(plain, along=(0.3 * s / 4 * np.exp(-0.5 * (s / 4) ** 2)).astype(np.float32))
    found = [len(_wall(lambda patch, aside: -0.09 * patch, weld, rings_mm=h)) for h in (0.5, 4.0)]
    assert found == [1, 0]


def test_the_distance_between_rings_is_that_of_the_cameras_motion():
    T_pc = np.tile(np.eye(4), (7, 1, 1))
    T_pc[:, 2, 3] = [0, 1, 3, 4, 6, 7, 9]
    trajectory = SimpleNamespace(frame=np.arange(7), T_pc=T_pc)
    assert ring_step_mm(SimpleNamespace(frame=np.array([0, 2, 4, 6, 9])), trajectory) == 3
    assert ring_step_mm(SimpleNamespace(frame=np.array([2])), trajectory) == 0


def test_neighbouring_cells_of_noise_are_not_a_region():
    beyond = np.zeros((12, 12), bool)
    beyond[2, 2] = beyond[2, 4] = beyond[4, 3] = True  # within the reach of the dilation, but none touching
    assert touching(beyond).max() == 1
    beyond[3, 3] = True
    assert touching(beyond).max() == 4
