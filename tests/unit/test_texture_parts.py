"""Parts of the texture stage: blending, light, photometry, grid, surface, choice of views."""

import numpy as np
import pytest

from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.axis import straight_axis
from pipeline.instrument.probe import Lighting
from pipeline.recording.images import SplitImage
from stages.rings.kernels import median
from stages.texture import brightest_wall
from stages.texture.blend import REFLECTANCE_SCALE, TileStack, blend_samples
from stages.texture.grid import NODE_PX, FlatGrid, flat_grid, footprint_mm
from stages.texture.light import irradiance
from stages.texture.photometry import solve_light
from stages.texture.project import TileProjection, _enlarge
from stages.texture.sampling import LightSampler, LightSamples
from stages.texture.surface import smoothed, wall_surface
from stages.texture.views import LitViews, lit_views, seen_by, sheet_distance_mm, thinned
from tests.synthetic_wall import wall_of
from tests.unit.drawn_pipe import BASELINE, RADIUS, poses, recording_of, small_probe, trajectory_of


def plain_blend(luma, weights):
    """Return the robust weights of one pixel's samples (views,) and their mean, in plain NumPy."""
    seen = weights > 0
    grey, w = luma[seen].astype(float), weights[seen].astype(float)

    def median(x):
        order = np.argsort(x, kind="stable")
        return x[order][np.searchsorted(np.cumsum(w[order]), 0.5 * w.sum())]

    middle = median(grey)
    limit = 4.685 * max(1.4826 * median(np.abs(grey - middle)), 0.03 * middle + 1)
    worth = np.zeros(len(luma))
    worth[seen] = w * np.clip(1 - ((grey - middle) / limit) ** 2, 0, None) ** 2
    return worth, worth @ luma / worth.sum()


def test_blend_agrees_with_plain_numpy():
    random = np.random.default_rng(1)
    luma = random.integers(3000, 4000, (15, 6, 64)).astype(np.uint16)
    colour = random.integers(2000, 5000, (15, 3, 3, 32)).astype(np.uint16)
    luma[4] = colour[4] = 20000
    weights = random.integers(0, 255, (15, 6, 64)).astype(np.uint8)
    weights[3] = 0
    mean, mean_colour, count = blend_samples(luma, colour, weights)
    plain = [[plain_blend(luma[:, i, j], weights[:, i, j]) for j in range(64)] for i in range(6)]
    assert np.abs(mean - [[pixel[1] for pixel in row] for row in plain]).max() <= 0.51
    assert np.array_equal(count, (weights > 0).sum(0))
    worth = np.array([[pixel[0] for pixel in row] for row in plain])
    block = worth[::2, ::2] + worth[::2, 1::2] + worth[1::2, ::2] + worth[1::2, 1::2]
    expected = np.einsum("ijk,kicj->ijc", block, colour.astype(float)) / block.sum(2)[..., None]
    assert np.abs(mean_colour - expected).max() <= 0.51


def test_pixels_without_samples_stay_empty():
    luma, colour = np.ones((2, 4, 32), np.uint16), np.ones((2, 2, 3, 16), np.uint16)
    mean, mean_colour, count = blend_samples(luma, colour, np.zeros((2, 4, 32), np.uint8))
    assert mean.max() == mean_colour.max() == count.max() == 0


def test_colours_of_a_wall_are_recovered_and_its_luma_for_each_pixel():
    u, v = np.meshgrid(np.arange(20, 84, dtype=np.float32), np.arange(10, 26, dtype=np.float32))
    uv = np.stack([u, v], -1)
    bright = np.random.default_rng(2).uniform(0.5, 1.0, (48, 120, 1))
    image = np.round(bright * np.where(np.arange(120) < 52, 1, -1)[:, None] * [60, 0, -60] + 150 * bright)
    split = SplitImage.of(image.astype(np.uint8))
    ones, middles = np.ones((16, 64), np.float32), (uv[::2, ::2] + uv[1::2, 1::2]) / 2
    stack = TileStack(2, 16, 64)
    for _ in range(2):
        stack.add(split, TileProjection(uv, middles, ones, ones))
    seen, count = stack.blend()
    told, true = seen / REFLECTANCE_SCALE, image[10:26, 20:84]
    assert np.all(count == 2)
    luma = [0.114, 0.587, 0.299]
    assert np.abs(told @ luma - true @ luma).max() < 1.0
    away = np.r_[0:28, 36:64]  # away from the border between the colours
    assert np.abs(told - true)[:, away].mean() < 6.0


@pytest.mark.parametrize("values", [[3.0], [2.0, -1.0], [5.0, 1.0, 1.0], list(np.sin(np.arange(50.0)))])
def test_the_compiled_median_equals_that_of_numpy(values):
    assert median(np.array(values)) == np.median(values)


def test_one_led_on_the_axis_follows_lambert_and_inverse_square():
    lamp = Lighting(leds=1, radius_mm=0.0, z_mm=0.0)
    z = np.array([5.0, 20.0, 60.0])
    point = np.stack([np.full(3, RADIUS), 0 * z, z], -1)
    d = np.hypot(RADIUS, z)
    light = irradiance(lamp, point, np.array([-1.0, 0.0, 0.0]))
    assert np.allclose(light, (z / d) * (RADIUS / d) / d**2)
    assert irradiance(lamp, point, np.array([1.0, 0.0, 0.0])).max() == 0


def test_the_light_of_a_ring_is_the_mean_of_its_leds():
    lamp = Lighting(leds=5, radius_mm=9.0, z_mm=-2.0)
    random = np.random.default_rng(3)
    point = random.normal(0, 30, (4, 6, 3))
    normal = -point / np.linalg.norm(point, axis=-1, keepdims=True)
    expected = np.zeros((4, 6))
    for turn in 2 * np.pi * np.arange(5) / 5:
        ray = point - np.array([9 * np.cos(turn), 9 * np.sin(turn), -2.0])
        forward, at_wall = np.maximum(ray[..., 2], 0), np.maximum(-(ray * normal).sum(-1), 0)
        expected += forward * at_wall / (ray * ray).sum(-1) ** 2 / 5
    assert expected.max() > 0
    assert np.allclose(irradiance(lamp, point, normal), expected, rtol=1e-12, atol=0)


def drawn_samples(wall_slope, gain, views=40, wall_rows=80):
    """Return samples of a wall of random cells under a light that falls with θ.

    View v sees rows v to v + 30.
    """
    random = np.random.default_rng(5)
    wall = random.normal(0, 0.2, (wall_rows, 12)) + wall_slope * np.arange(wall_rows)[:, None]
    view, row, column = (
        g.ravel() for g in np.meshgrid(np.arange(views), np.arange(30), np.arange(12), indexing="ij")
    )
    theta = 1.3 - 0.02 * row
    value = wall[view + row, column] - 2.0 * (theta - 1.0) ** 2 + gain[view]
    value += random.normal(0, 0.02, value.shape)
    azimuth = -np.pi + 2 * np.pi * column / 12
    return LightSamples(value, theta, azimuth, (view + row) * 12 + column, view)


def test_photometry_separates_light_from_wall():
    gain = np.random.default_rng(2).normal(0, 0.1, 40)
    gain -= np.polyval(np.polyfit(np.arange(40), gain, 1), np.arange(40))
    light = solve_light(drawn_samples(0.0, gain), 40, small_probe(), 1.0)
    assert np.std(np.log(light.gain) - gain) < 0.005
    theta = light.field.theta_from + light.field.theta_step * np.arange(9)
    expected = -2.0 * (theta - 1.0) ** 2
    found = light.field.log_correction.mean(1)
    assert np.abs((found - found.mean()) - (expected - expected.mean())).max() < 0.02
    assert light.residual == pytest.approx(0.02, rel=0.15)


def test_a_wall_that_gets_brighter_is_not_taken_for_exposure():
    light = solve_light(drawn_samples(0.01, np.zeros(40)), 40, small_probe(), 1.0)
    assert np.ptp(np.log(light.gain)) < 0.02


def test_views_without_samples_have_no_gain():
    light = solve_light(drawn_samples(0.0, np.zeros(40)), 42, small_probe(), 1.0)
    assert np.isnan(light.gain[40:]).all()
    assert np.isfinite(light.gain[:40]).all()


def test_enlarged_nodes_coincide_with_the_pixels():
    grid = FlatGrid(10.0, 0.1, 40, 32, 16)
    down, right = np.meshgrid(grid._nodes(16), grid._nodes(32), indexing="ij")
    assert np.allclose(_enlarge(down)[:, 5], np.arange(16), atol=1e-4)
    assert np.allclose(_enlarge(right)[3], np.arange(32), atol=1e-4)


def test_tiles_cover_every_row_exactly_once():
    tiles = FlatGrid(0.0, 0.1, 41, 32, 16).tiles()
    assert [(t.first_row, t.last_row) for t in tiles] == [(0, 16), (16, 32), (32, 41)]


def test_the_footprint_agrees_with_the_equidistant_lens():
    # Around: r / (f θ); along: (r² + l²) / (r f), both per pixel.
    probe = small_probe()
    focal, theta = probe.camera.focal_px[0], np.arctan2(RADIUS, BASELINE)
    expected = np.sqrt(RADIUS / (focal * theta) * (RADIUS**2 + BASELINE**2) / (RADIUS * focal))
    assert footprint_mm(probe, RADIUS) == pytest.approx(expected, rel=1e-6)


def straight_wall(radius_at=lambda s, psi: RADIUS + 0 * s, gap=None):
    distance, azimuth = np.arange(0.0, 60.0, 0.5), np.linspace(-np.pi, np.pi, 360, endpoint=False)
    radius = radius_at(*np.meshgrid(distance, azimuth, indexing="ij")).astype(float)
    if gap is not None:
        radius[gap] = np.nan
    return wall_of(distance, azimuth, radius)


def test_grid_pixels_are_square_and_close_the_circle():
    surface = wall_surface(straight_wall(), 0.0, 0.5)
    grid = flat_grid(surface, small_probe(), 1.0, 10.0)
    assert grid.columns % NODE_PX == 0
    assert grid.columns * grid.mm_per_px == pytest.approx(2 * np.pi * RADIUS, rel=1e-6)
    assert grid.distance_from_mm + (grid.rows - 1) * grid.mm_per_px <= surface.seen_mm[1]


def test_surface_normals_of_a_cone_are_inclined_along_it():
    surface = wall_surface(straight_wall(lambda s, psi: RADIUS + 0.2 * s), 0.0, 0.5)
    patch = surface.patch(np.array([20.0, 30.0]), np.array([0.3, 2.0]))
    radial = np.array([[np.cos(a), np.sin(a), 0.0] for a in (0.3, 2.0)])
    expected = (0.2 * np.array([0, 0, 1.0]) - radial) / np.hypot(1, 0.2)
    assert np.allclose(patch.normal_p[0], expected, atol=1e-3)
    assert np.allclose(patch.xyz_p[1, :, :2], (RADIUS + 6.0) * radial[:, :2], atol=1e-3)


def test_surface_normals_of_an_ellipse_are_inclined_around_it():
    surface = wall_surface(straight_wall(lambda s, psi: RADIUS + np.cos(2 * psi)), 0.0, 0.5)
    patch = surface.patch(np.array([20.0, 30.0]), np.array([0.4, 0.4001]))
    along_wall = patch.xyz_p[0, 1] - patch.xyz_p[0, 0]
    assert abs(patch.normal_p[0, 0] @ along_wall) / np.linalg.norm(along_wall) < 1e-3


def test_gaps_are_filled_from_their_neighbours_even_across_the_seam():
    random = np.random.default_rng(0)
    radius = RADIUS + 0.01 * random.normal(size=(60, 90))
    radius[20:40, :8], radius[20:40, -8:] = np.nan, np.nan
    filled = smoothed(radius.astype(np.float32), (1.0, 1.0))
    assert np.abs(filled - RADIUS).max() < 0.05


def views_at(distance):
    count = len(distance)
    T = np.tile(np.eye(4), (count, 1, 1))
    return LitViews(np.arange(count), np.zeros(count, bool), T, np.asarray(distance, float), np.zeros(count))


def plan_of(distance, reach_mm=10.0, most=40):
    surface = wall_surface(straight_wall(), 0.0, 0.5)
    grid = FlatGrid(0.0, 0.5, 120, 640, 24)
    return grid, thinned(seen_by(grid, surface, views_at(distance), small_probe().laser, reach_mm), most)


def test_a_picture_that_shows_no_measured_wall_gives_no_samples_of_light():
    """At the end of a pipe, pictures beyond the measured wall ended the run as an error of the program."""
    surface, probe = wall_surface(straight_wall(), 0.0, 0.5), small_probe()
    sampler = LightSampler(surface, probe, views_at([500.0, -10.0]), 10.0, 1.0)
    image = np.full(probe.camera.image_size[::-1], 90, np.uint8)
    assert not len(sampler.of((0, image)).cell)
    assert len(sampler.of((1, image)).cell), "control"


def test_views_near_the_sheet_are_preferred():
    distance = np.arange(-30.0, 60.0, 2.0)
    grid, plan = plan_of(distance)
    for tile, chosen in zip(grid.tiles(), plan, strict=True):
        assert np.abs(grid.centre_mm(tile) - distance[chosen.views] - BASELINE).max() < 10 + 6
        assert len(chosen.views) >= 10


def test_with_few_views_farther_ones_are_used():
    _, plan = plan_of([-20.0, 10.0, 40.0])
    assert all(len(chosen.views) == 3 and chosen.reach_mm > 30 for chosen in plan)


def test_no_more_views_than_allowed_are_chosen_spread_evenly():
    _, plan = plan_of(np.linspace(-30, 60, 2000), most=20)
    assert max(len(chosen.views) for chosen in plan) == 20


def test_of_two_passes_only_one_is_used():
    there = np.arange(-40.0, 60.0, 2.0)
    _, plan = plan_of(np.concatenate([there, there[::-1]]))
    middle = plan[2].views
    assert np.all(np.diff(middle) == 1)
    assert middle.max() < len(there) or middle.min() >= len(there)


def test_the_distance_from_the_sheet_is_zero_on_the_tilted_sheet():
    laser = small_probe().laser.with_parameters(np.array([22.0, 0.01, 0.02, 0.003, 0.1, 0.2, *[0.001] * 6]))
    ray = np.array([[1.0, 0.3, 0.5], [-0.4, 1.0, 0.4]])
    assert np.allclose(sheet_distance_mm(laser, laser.intersect(ray)), 0, atol=1e-9)
    assert np.allclose(sheet_distance_mm(laser, laser.intersect(ray) + np.array([0, 0, 2.0])), 2.0)


def test_only_lit_frames_with_a_pose_become_views():
    T = poses(5)
    images = [np.zeros((300, 400, 3), np.uint8)] * 6
    full = trajectory_of(T)
    keep = np.array([0, 2, 3])
    some = Trajectory(
        full.frame[keep], full.time_s[keep], full.T_pc[keep], full.covariance[keep],
        straight_axis(-50, 100), RADIUS, 1.0, 0.0, 0.0, (),
    )  # fmt: skip
    views = lit_views(recording_of(images, "both"), some)
    assert views.frame.tolist() == [0, 2, 3]
    assert views.laser_on.all()
    assert np.allclose(views.T_cp[1] @ T[2], np.eye(4))


def test_a_few_glints_do_not_darken_the_photo_but_white_wall_does():
    """A photo was nearly black: noise beside a hole in it was twelve times as bright as the wall."""
    counts = np.zeros(1 << 16, np.int64)
    counts[500:700] = 50  # the wall
    counts[8000] = 60  # .6 % of the picture
    assert brightest_wall(counts, 0.9995) == pytest.approx(4 * 600, rel=0.01)
    counts[8000], counts[2000] = 0, 60  # white spots
    assert brightest_wall(counts, 0.9995) == 2000
    assert brightest_wall(0 * counts, 0.9995) == 1.0
