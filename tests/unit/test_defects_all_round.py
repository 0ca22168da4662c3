"""Beads with glints on them, and steps of the bore, measured by the median round the pipe."""

from dataclasses import fields, replace

import numpy as np
import pytest

from pipeline.artefacts.cloud_along import cloud_along
from stages.defects import DefectParameters, find_defects
from stages.defects.all_round import Bore, bore_beside, measure_all_round
from stages.defects.clean import clean_wall
from stages.defects.grow import millimetre_mean
from stages.defects.relief import smooth_shape_removed
from stages.defects.segment import Region
from stages.defects.surface import MeasuredWall
from tests.quiet import quiet_context
from tests.synthetic_wall import DrawnDefect, bare_recording, grey_texture, relief, smooth_noise, wall_of

DISTANCE, RADIUS, NOISE_MM = np.arange(0, 160, 0.5), 38.0, 0.03
MIDDLE, CENTRE = 60.0, 120
AZIMUTH = -np.pi + np.arange(360) * np.pi / 180
SHAPE = (len(DISTANCE), len(AZIMUTH))
CELL = (0.5, RADIUS * np.pi / 180)


def uneven(rng, share):
    """Return a height round the pipe (A,): a ripple of so many per cent, and half as much at random."""
    ripple = np.sin(rng.integers(3, 25) * AZIMUTH + rng.uniform(0, 6))
    return 1 + share * ripple + smooth_noise(rng, (1, SHAPE[1]), share / 2, 4.0)[0]


def glints(rng, count):
    """Return the shifts (S, A) of the line by so many glints on every ring, up to 3 mm to either side."""
    out = np.zeros(SHAPE)
    for row in range(SHAPE[0]):
        for column in rng.integers(0, SHAPE[1], count):
            out[row, (column + np.arange(4)) % SHAPE[1]] = rng.choice([-1, 1]) * rng.uniform(0.5, 3)
    return out


def searched(radius_mm, distance_mm=DISTANCE):
    wall = wall_of(distance_mm, AZIMUTH, radius_mm, NOISE_MM)
    recording = bare_recording(2 * RADIUS)
    return find_defects(recording, wall, grey_texture(wall), DefectParameters(draws=20), quiet_context())


def drawn_bead(rng, share):
    """Return the change of radius (S, A) by a drawn bead or groove."""
    depth = rng.choice([-1, 1]) * rng.uniform(0.4, 1.5)
    drawn = DrawnDefect("weld", MIDDLE, 0.0, rng.uniform(4, 8), 0.0, depth)
    return relief(drawn, DISTANCE, AZIMUTH, RADIUS, rng) * uneven(rng, share)


def measured(radius_mm):
    """Return the depth of what goes all round a wall; other findings are not searched."""
    wall = wall_of(DISTANCE, AZIMUTH, radius_mm, NOISE_MM)
    shape = smooth_shape_removed(wall.radius_map, DefectParameters())
    all_mm = shape.rows(shape.welds[0]).all_mm
    region = Region(shape.welds[0].start, 0, np.isfinite(all_mm), float(np.sign(np.nanmedian(all_mm))), True)
    seen = np.isfinite(wall.cloud.radius_mm)
    cloud = replace(wall.cloud, **{f.name: getattr(wall.cloud, f.name)[seen] for f in fields(wall.cloud)})
    whole = MeasuredWall(shape, cloud_along(cloud), 0.5)
    surface, here = whole.surface_about(region, every_point=False)
    return measure_all_round(
        here, surface, clean_wall(whole, (region,)), bore_beside(region, wall.radius_map, whole.rings_mm)
    )


@pytest.mark.parametrize(("glints_per_ring", "share"), [(0, 0.02), (0, 0.15), (3, 0.1)])
def test_a_bead_with_glints_on_it_has_the_right_depth(glints_per_ring, share):
    """Formerly its depth was that of a glint: 4.2 ± 0.2 mm for 0.9."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        bead = drawn_bead(rng, share)
        mean = millimetre_mean(bead, CELL)
        true = float(mean.flat[np.argmax(np.abs(mean))])
        told = measured(
            RADIUS + bead + smooth_noise(rng, SHAPE, NOISE_MM, 1.5) + glints(rng, glints_per_ring)
        )
        assert abs(told.depth_mm - true) < 2.5 * told.sigma_mm
        assert told.sigma_mm < max(0.12 * abs(true), 0.06)


def test_a_bead_with_a_glint_on_it_is_found_as_a_bead_and_the_glint_separately():
    """A bead of 0.9 mm with a glint of 2 mm was reported as a step, of 0, between bores of one width."""
    rng = np.random.default_rng(5)
    drawn = DrawnDefect("weld", MIDDLE, 0.0, 6.0, 0.0, -0.9)
    radius = RADIUS + relief(drawn, DISTANCE, AZIMUTH, RADIUS, rng) + smooth_noise(rng, SHAPE, NOISE_MM, 1.5)
    radius[CENTRE, 100:106] -= 3.0
    found = searched(radius)
    (weld,) = (d for d in found.items if d.kind == "weld")
    assert weld.probability > 0.9
    assert abs(weld.depth_mm + 0.9) < 0.1
    assert not any("it is a step" in d.statement for d in found.unconfirmed)


@pytest.mark.parametrize("step_mm", [-8.0, 0.6])
def test_a_step_with_a_glint_on_it_is_not_a_bead(step_mm):
    rng = np.random.default_rng(3)
    step = step_mm / (1 + np.exp(-(DISTANCE - MIDDLE) / 1.0))[:, None]
    radius = RADIUS + step + smooth_noise(rng, SHAPE, NOISE_MM, 1.5)
    radius[CENTRE - 3, 100:106] -= 3.0
    found = searched(radius)
    assert not any(d.clock_to - d.clock_from == 12.0 for d in found.items)
    assert [d for d in found.unconfirmed if "it is a step" in d.statement and d.probability < 0.01]


def test_a_bead_between_bores_of_two_widths_is_a_bead():
    rng = np.random.default_rng(4)
    drawn = DrawnDefect("weld", MIDDLE, 0.0, 6.0, 0.0, -1.0)
    step = 0.3 / (1 + np.exp(-(DISTANCE - MIDDLE) / 1.0))[:, None]
    bead = relief(drawn, DISTANCE, AZIMUTH, RADIUS, rng)
    found = searched(RADIUS + step + bead + smooth_noise(rng, SHAPE, NOISE_MM, 1.5))
    assert [d for d in found.items if d.kind == "weld" and d.probability > 0.9]


@pytest.mark.parametrize("step_mm", [1.5, -1.5])
def test_a_weld_in_a_short_run_over_a_step_of_the_bore_is_found(step_mm):
    """The slow shape was .5 mm off on either side of the step, which hid a weld of .9 mm 21 mm away."""
    distance = np.arange(0, 42, 0.5)
    bore = RADIUS + step_mm / 2 * (1 + np.tanh(distance - 30.0)) - 0.9 * np.exp(-(((distance - 9) / 2) ** 2))
    noise = smooth_noise(np.random.default_rng(4), (len(distance), len(AZIMUTH)), NOISE_MM, 1.5)
    found = searched(bore[:, None] + noise, distance)
    welds = [d for d in found.items if d.clock_to - d.clock_from > 11.9]
    assert [d.kind for d in welds] == ["weld"]
    assert welds[0].depth_mm == pytest.approx(-0.9, abs=1.96 * welds[0].depth_sigma_mm)
    assert abs(welds[0].peak_distance_mm - 9) < 1


def test_the_probability_of_a_bead_depends_on_how_well_the_bore_beside_it_is_known():
    """A bead has equal height above both sides, a step above one.

    With half the height both are equally likely.
    """
    assert Bore(np.array([1.0, 1.0]), 0.05).chance_of_bead(0.2) == 1.0
    assert Bore(np.array([1.0, 0.0]), 0.05).chance_of_bead(0.2) < 0.001
    assert Bore(np.array([0.9, 0.3]), 0.05).chance_of_bead(0.2) == 0.5
    assert 0.5 < Bore(np.array([1.0, 0.55]), 0.1).chance_of_bead(0.2) < 0.9
    assert Bore(np.array([1.0, np.nan]), 0.05).chance_of_bead(0.2) == 0.5
    assert Bore(np.array([0.05, np.nan]), 0.01).chance_of_bead(0.2) < 0.01


def test_the_scatter_of_the_bore_is_estimated_outside_the_foot_of_a_step():
    rng = np.random.default_rng(5)
    errors = rng.normal(0, 0.05, SHAPE[0])[:, None]
    step = -3.0 / (1 + np.exp(-(DISTANCE - 62) / 1.0))[:, None]
    wall = wall_of(DISTANCE, AZIMUTH, RADIUS + errors + step + np.zeros(SHAPE))
    bore = bore_beside(Region(110, 0, np.ones((14, SHAPE[1]), bool), -1.0, True), wall.radius_map, 0.0)
    assert bore.sigma_mm == pytest.approx(0.05, rel=0.6)


def profiles(rng):
    """Yield heights round the pipe (A,) as beads have them: a sine, two heights in arcs, a gap, at random."""
    turn = rng.uniform(0, 6)
    yield 1 + rng.uniform(0.1, 0.25) * np.sin(rng.integers(2, 20) * AZIMUTH + turn)
    yield np.where(np.cos(2 * AZIMUTH + turn) > rng.uniform(-0.4, 0.4), 1.2, 0.6)
    yield (np.abs(np.angle(np.exp(1j * (AZIMUTH - turn)))) < np.pi * rng.uniform(0.8, 0.95)) * 1.0
    yield uneven(rng, rng.uniform(0.02, 0.15))


def test_the_depth_of_a_bead_is_within_its_sigma_for_any_profile_round_the_pipe():
    """A crest of 1.2 mm of two arcs was 1.75 ± .24 mm, that of a sine twice its height."""
    off = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        for profile in profiles(rng):
            drawn = DrawnDefect("weld", MIDDLE, 0.0, 6.0, 0.0, -rng.uniform(0.5, 1.4))
            bead = relief(drawn, DISTANCE, AZIMUTH, RADIUS, rng) * profile
            told = measured(RADIUS + bead + smooth_noise(rng, SHAPE, NOISE_MM, 1.5))
            true = np.abs(millimetre_mean(bead, CELL)).max()
            off.append((abs(told.depth_mm) - true) / told.sigma_mm)
    assert abs(np.mean(off)) < 1.0
    assert np.mean(np.abs(off) < 1.96) > 0.9


def test_a_step_at_the_start_of_the_measured_wall_is_not_a_bead():
    """One 3 mm behind the start was a weld of -1.01 ± .04 mm at .98: unmeasured wall counted as bore."""
    rng = np.random.default_rng(3)
    step = -1.0 / (1 + np.exp(-(DISTANCE - 3) / 0.7))[:, None]
    found = searched(RADIUS + step + smooth_noise(rng, SHAPE, NOISE_MM, 1.5))
    assert not any(d.clock_to - d.clock_from == 12.0 for d in found.items)
    assert [d for d in found.unconfirmed if "it is a step" in d.statement or "be a step" in d.statement]


@pytest.mark.parametrize("rings_mm", [1.0, 3.0, 5.0])
def test_the_scatter_of_rings_is_estimated_rightly_however_far_apart_they_are(rings_mm):
    """Rows of the map between rings 5 mm apart scattered by .006 mm, while the rings err by .05."""
    rng = np.random.default_rng(6)
    apart = np.arange(0, 600, rings_mm)
    rings = wall_of(apart, AZIMUTH, RADIUS + rng.normal(0, 0.05, (len(apart), 1)) + np.zeros((1, SHAPE[1])))
    rows = np.arange(0, 600 - rings_mm, 0.5)
    between = np.stack([np.interp(rows, apart, c) for c in rings.radius_map.radius_mm.T], -1)
    shape = smooth_shape_removed(wall_of(rows, AZIMUTH, between).radius_map, DefectParameters())
    wall = MeasuredWall(shape, cloud_along(rings.cloud), rings_mm)
    bore = bore_beside(Region(600, 0, np.ones((14, SHAPE[1]), bool), -1.0), shape.radius_map, wall.rings_mm)
    assert wall.rings_mm == pytest.approx(0.05, rel=0.35)
    assert bore.sigma_mm >= wall.rings_mm


def test_a_helical_groove_between_bores_of_one_width_is_not_a_step():
    """With one turn, no circle of it is deep on one half, and it was "a step, with a probability of .98"."""
    rng = np.random.default_rng(5)
    off = DISTANCE[:, None] - MIDDLE - 20 * AZIMUTH / np.pi
    found = searched(RADIUS + 0.8 * np.exp(-((off / 2) ** 2)) + smooth_noise(rng, SHAPE, NOISE_MM, 1.5))
    assert found.items
    assert not any("step" in d.statement for d in found.unconfirmed)


def test_a_hardly_measured_circle_of_a_bead_does_not_set_its_depth():
    """The circle with the largest median counted, even one of which only a glint was measured."""
    rng = np.random.default_rng(7)
    drawn = DrawnDefect("weld", MIDDLE, 0.0, 6.0, 0.0, -0.9)
    radius = RADIUS + relief(drawn, DISTANCE, AZIMUTH, RADIUS, rng) + smooth_noise(rng, SHAPE, NOISE_MM, 1.5)
    radius[CENTRE : CENTRE + 2, 100:120] -= 1.5
    radius[CENTRE : CENTRE + 2, :100] = radius[CENTRE : CENTRE + 2, 120:] = np.nan
    told = measured(radius)
    assert abs(told.depth_mm + 0.9) < 1.96 * told.sigma_mm
