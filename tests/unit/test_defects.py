"""Defects drawn at random on noisy walls, and walls without any.

Noise of 0.03 mm correlated over about 1 mm, natural roughness of 0.02 mm, rings shifted by 0.02 mm, a slow
taper, an oval and an off-centre residual: the errors that the error budget predicts for an accumulated wall.
"""

import numpy as np
import pytest

from pipeline.artefacts.findings import pof_class
from pipeline.errors import UnusableError
from pipeline.pages import notation
from stages.defects import DefectParameters, find_defects
from stages.defects.grow import millimetre_mean
from tests.quiet import quiet_context
from tests.synthetic_wall import (
    DrawnDefect,
    bare_recording,
    draw_defect,
    grey_texture,
    relief,
    smooth_noise,
    wall_of,
)

DISTANCE = np.arange(0, 160, 0.5)
AZIMUTH = -np.pi + np.arange(720) * np.pi / 360
RADIUS = 38.0
CELL = (0.5, RADIUS * np.pi / 360)
SHAPE = (len(DISTANCE), len(AZIMUTH))


def noisy(rng, relief_mm=0.0, sigma=0.03):
    smooth = 0.25 * np.cos(2 * (AZIMUTH - rng.uniform(0, 3))) + 0.2 * np.sin(DISTANCE / 60)[:, None] * np.cos(
        AZIMUTH
    )
    taper = rng.uniform(-0.3, 0.3) * (DISTANCE / DISTANCE[-1])[:, None]
    shift = np.repeat(rng.normal(0, 0.02, (len(DISTANCE) // 2, 2)), 2, 0)
    rings = shift[:, :1] * np.cos(AZIMUTH) + shift[:, 1:] * np.sin(AZIMUTH)
    noise = smooth_noise(rng, SHAPE, sigma, 2.0)
    return wall_of(DISTANCE, AZIMUTH, RADIUS + smooth + taper + rings + noise + relief_mm, sigma)


def roughness(rng):
    return smooth_noise(rng, SHAPE, 0.014, 6.0) + smooth_noise(rng, SHAPE, 0.014, 4.0)


def search(wall, thickness=None, **parameters):
    recording = bare_recording(2 * RADIUS, thickness)
    return find_defects(recording, wall, grey_texture(wall), DefectParameters(**parameters), quiet_context())


def one(kind, azimuth=1.0, seed=0, **changes):
    """Search a wall with a single defect and return (drawn, found defects)."""
    rng = np.random.default_rng(seed)
    drawn = DrawnDefect(kind, 80.0, azimuth, **changes)
    return drawn, search(noisy(rng, relief(drawn, DISTANCE, AZIMUTH, RADIUS, rng))).items


@pytest.mark.parametrize("seed", range(5))
def test_nothing_is_found_on_a_clean_wall(seed):
    rng = np.random.default_rng(100 + seed)
    assert search(noisy(rng, roughness(rng))).items == ()


def test_all_drawn_defects_are_found_with_true_depth_and_sigma():
    errors, scores, found, right = [], [], 0, 0
    for seed in range(5):
        rng = np.random.default_rng(seed)
        rough = roughness(rng)
        kinds = rng.permutation(["pit", "corrosion", "gouge", "dent", "deposit", "weld"])[:3]
        drawn = [
            draw_defect(str(k), z, rng.uniform(-np.pi, np.pi), rng)
            for k, z in zip(kinds, (35, 80, 125), strict=True)
        ]
        reliefs = [relief(d, DISTANCE, AZIMUTH, RADIUS, rng) for d in drawn]
        items = search(noisy(rng, rough + sum(reliefs))).items
        assert len(items) == len(drawn)
        for d, r, item in zip(drawn, reliefs, items, strict=True):
            truth = np.where(np.abs(r) > 0.1 * abs(d.depth_mm), millimetre_mean(r + rough, CELL), 0)
            depth = truth.flat[np.argmax(np.abs(truth))]
            found += item.distance_from_mm - 5 <= d.distance_mm <= item.distance_to_mm + 5
            right += item.kind == d.kind
            errors.append(item.depth_mm - depth)
            scores.append(errors[-1] / item.depth_sigma_mm)
    assert found == 15
    assert right >= 13
    assert np.abs(errors).max() < 0.1
    # 15 draws: a true σ gives an RMS within 1 ± 0.18
    assert 0.45 < np.sqrt(np.mean(np.square(scores))) < 1.6


def test_a_weld_is_one_finding_all_round_and_a_pit_beside_it_is_another():
    rng = np.random.default_rng(4)
    weld = DrawnDefect("weld", 60.0, 0.0, 6.0, 0.0, -0.8)
    pit = DrawnDefect("pit", 75.0, 2.0, 6.0, 6.0, 0.8)
    both = sum(relief(d, DISTANCE, AZIMUTH, RADIUS, rng) for d in (weld, pit))
    first, second = search(noisy(rng, both)).items
    assert (first.kind, first.clock_from, first.clock_to) == ("weld", 0.0, 12.0)
    assert first.depth_mm == pytest.approx(-0.8, abs=0.1)
    assert (second.kind, second.pof_class) == ("pit", "pinhole")
    # Formerly one dent had ± 0.029 in its sentence and in defects.json, and ± 0.030 in the report's table.
    for told in (first, second):
        assert told.depth_sigma_mm == round(told.depth_sigma_mm, 4)
        assert notation.depth(told.depth_mm, told.depth_sigma_mm) in told.statement


@pytest.mark.parametrize("step_mm", [-8.0, 3.0])
def test_a_step_of_the_bore_is_neither_a_bead_nor_a_groove(step_mm):
    """Formerly steps of 8.8 and 7 mm in a gauge run were a weld and a gouge, both at .98."""
    step = step_mm / (1 + np.exp(-(DISTANCE - 60) / 1.0))[:, None]
    found = search(noisy(np.random.default_rng(5), step))
    assert not any(d.clock_to == 12.0 for d in found.items)
    steps = [d for d in found.unconfirmed if "it is a step" in d.statement]
    assert steps
    assert all(d.probability == d.confidence == 0 for d in steps)


def test_a_groove_all_round_is_not_a_pit():
    """The gap of a joint, 70 times as long as wide, was called a pit; no kind of pit is so long."""
    rng = np.random.default_rng(3)
    groove = relief(DrawnDefect("weld", 60.0, 0.0, 4.0, 0.0, 1.5), DISTANCE, AZIMUTH, RADIUS, rng)
    (found,) = search(noisy(rng, groove)).items
    assert found.kind in ("gouge", "crack")
    assert (found.clock_from, found.clock_to) == (0.0, 12.0)
    assert "joint" in found.statement


@pytest.mark.parametrize(
    ("azimuth_deg", "hours"), [(-90.0, 0.0), (180.0, 9.0), (-179.9, 9.0), (0.0, 3.0), (-100.0, 11.667)]
)
def test_clock_positions_are_right_across_the_seam_and_twelve(azimuth_deg, hours):
    drawn, items = one("dent", np.radians(azimuth_deg), length_mm=30.0, width_mm=25.0, depth_mm=-1.0)
    (item,) = items
    span = (item.clock_to - item.clock_from) % 12
    middle = item.clock_from + span / 2
    assert abs((middle - hours + 6) % 12 - 6) < 0.1
    # the radius is the measured one: oval, taper and rings are all below 1 %
    assert span * 30 * np.pi / 180 * RADIUS == pytest.approx(item.width_mm, rel=0.01)
    assert item.width_mm == pytest.approx(drawn.width_mm, rel=0.3)
    assert 0 <= item.clock_from < 12
    assert abs((item.peak_clock - hours + 6) % 12 - 6) < 0.15, "the depth was read at the deepest place"
    assert item.peak_distance_mm == pytest.approx(80.0, abs=2.0)
    assert np.ptp(item.outline[:, 1]) * RADIUS == pytest.approx(item.width_mm, rel=0.1)


def test_frames_are_those_whose_rings_touched_it():
    _, (item,) = one("pit", length_mm=8.0, width_mm=8.0, depth_mm=1.0)
    centres = DISTANCE[item.frames]
    assert centres[0] == pytest.approx(item.distance_from_mm + 0.25)
    assert centres[-1] == pytest.approx(item.distance_to_mm - 0.25)
    assert np.all(np.diff(item.frames) == 1)


def test_wall_loss_needs_a_thickness_and_metal_that_is_lost():
    rng = np.random.default_rng(2)
    pit = DrawnDefect("pit", 50.0, 0.5, 8.0, 8.0, 1.0)
    dent = DrawnDefect("dent", 110.0, 0.5, 30.0, 30.0, -1.0)
    wall = noisy(rng, sum(relief(d, DISTANCE, AZIMUTH, RADIUS, rng) for d in (pit, dent)))
    first, second = search(wall, thickness=5.0).items
    assert first.wall_loss_percent == pytest.approx(100 * first.depth_mm / 5)
    assert np.isnan(second.wall_loss_percent)
    assert np.isnan(search(wall).items[0].wall_loss_percent)


def test_unmeasured_parts_are_not_defects_and_do_not_hide_any():
    rng = np.random.default_rng(6)
    pit = DrawnDefect("pit", 80.0, 1.0, 8.0, 8.0, 1.0)
    wall = noisy(rng, relief(pit, DISTANCE, AZIMUTH, RADIUS, rng))
    wall.radius_map.radius_mm[100:130] = np.nan
    wall.radius_map.radius_mm[:, 20:60] = np.nan
    wall.radius_map.radius_mm[250:, :500] = np.nan
    (item,) = search(wall).items
    assert item.kind == "pit"


def test_the_same_input_gives_the_same_defects():
    a, b = (one("corrosion", length_mm=25.0, width_mm=25.0, depth_mm=0.8)[1][0] for _ in range(2))
    assert a.depth_mm == b.depth_mm
    assert a.depth_sigma_mm == b.depth_sigma_mm


def test_the_limit_of_depth_is_obeyed():
    rng = np.random.default_rng(1)
    pit = DrawnDefect("pit", 80.0, 1.0, 8.0, 8.0, 0.6)
    wall = noisy(rng, relief(pit, DISTANCE, AZIMUTH, RADIUS, rng))
    assert len(search(wall).items) == 1
    assert search(wall, min_depth_mm=0.8).items == ()


def test_too_small_a_wall_is_refused():
    wall = wall_of(DISTANCE[:2], AZIMUTH[:8], np.full((2, 8), 30.0))
    with pytest.raises(UnusableError, match="16 cells"):
        search(wall)


@pytest.mark.parametrize(
    ("length", "width", "thickness", "name"),
    [
        (5, 5, None, "pinhole"), (25, 25, None, "pitting"), (40, 40, None, "general"),
        (45, 15, None, "axial grooving"), (15, 45, None, "circumferential grooving"),
        (20, 5, None, "axial slotting"), (5, 20, None, "circumferential slotting"),
        (15, 15, 20.0, "pinhole"), (15, 15, 5.0, "pitting"),
    ],
)  # fmt: skip
def test_pof_classes(length, width, thickness, name):
    assert pof_class(length, width, thickness) == name
