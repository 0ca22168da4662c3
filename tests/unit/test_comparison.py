"""Two walls registered to each other.

Shift and roll are found, and growth is distinguished from no change.
"""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.adjustment.robust import independent_count
from pipeline.artefacts.comparison import FAMILY_ERROR, Fate
from pipeline.errors import UnusableError
from stages.compare import changes, holm, put_together
from stages.compare.paired import PairedWalls
from stages.compare.patch import Cutter, Patch, outline_mask
from stages.compare.registration.by_marks import register
from tests.two_walls import (
    COLUMNS,
    FINE,
    NO_WELDS,
    PIPE,
    PLACES,
    RADIUS,
    ROLL_RAD,
    SAME,
    SCALE,
    SHIFT_MM,
    Pipe,
    compared,
    family,
    finding,
    later,
    moved,
    unseen,
)


def test_shift_scale_and_roll_are_found_within_their_sigma():
    found = register(PIPE.surface((), 1), later((), 2), NO_WELDS, SAME)
    at = np.array([40.0, 70.0, 95.0])
    now, azimuth = found.to_now(at, np.zeros(3))
    sigma = np.array([found.sigma_at(s) for s in at])
    assert np.all(np.abs(now - (SCALE * at + SHIFT_MM)) < np.maximum(3 * sigma[:, 0], 0.05))
    assert np.all(sigma[:, 0] < 0.3)
    assert np.all(np.abs(np.mod(azimuth - ROLL_RAD + 1, 2 * np.pi) - 1) < np.maximum(3 * sigma[:, 1], 1e-3))
    back, turned = found.to_earlier(now, azimuth)
    assert back == pytest.approx(at, abs=1e-6)
    assert turned == pytest.approx(0, abs=1e-6)
    assert abs(found.scale - SCALE) < 3 * found.scale_sigma + 5e-4


def test_relief_alone_is_enough():
    before, after = (replace(s, texture=None) for s in (PIPE.surface((), 1), later((), 2)))
    assert register(before, after, NO_WELDS, SAME).chance < 1e-6


@pytest.mark.parametrize("seed", range(2, 8))
def test_another_pipe_is_refused(seed):
    with pytest.raises(UnusableError, match="do not show the same wall"):
        register(PIPE.surface((), 1), later((), 2, Pipe(seed)), NO_WELDS, SAME)


def test_another_bore_is_refused():
    wide = later((), 2)
    wide = replace(wide, wall=replace(wide.wall, radius_mm=wide.wall.radius_mm + 10))
    with pytest.raises(UnusableError, match=r"bores are 100\.. mm and 120\.. mm"):
        register(PIPE.surface((), 1), wide, NO_WELDS, SAME)


def test_grown_new_and_vanished_defects_are_found_and_others_are_unchanged():
    grown, stays, new, gone = (45.0, 0.3), (65.0, -2.0), (85.0, 1.5), (75.0, -0.5)
    before = [(*grown, 0.4, 2.0), (*stays, 0.6, 2.0), (*gone, 0.5, 2.0)]
    after = [(*grown, 0.6, 2.0), (*stays, 0.6, 2.0), (*new, 0.5, 2.0)]
    found = compared(
        before, after, [finding(1, *grown), finding(2, *stays), finding(3, *gone)],
        [finding(1, *grown), finding(2, *stays), finding(3, *new)],
    )  # fmt: skip
    fates = {(c.place.earlier and c.place.earlier.id, c.place.now and c.place.now.id): c for c in found}
    assert {k: c.fate for k, c in fates.items()} == {
        ("1", "1"): Fate.GREW, ("2", "2"): Fate.UNCHANGED, (None, "3"): Fate.NEW, ("3", None): Fate.VANISHED,
    }  # fmt: skip
    growth = fates["1", "1"].growth.depth_mm
    assert abs(growth.value - 0.2) < 1.96 * growth.sigma
    assert growth.sigma < 0.08


def test_where_one_picture_was_displaced_by_water_a_change_of_that_size_is_no_growth():
    wet, dry = (45.0, 0.3), (85.0, 0.3)
    names = [finding(1, *wet), finding(2, *dry)]
    before, after = ([(*pit, depth, 2.0) for pit in (wet, dry)] for depth in (0.4, 0.6))
    found = sorted(compared(before, after, names, names, wet_mm=0.2), key=lambda c: c.place.middle)
    assert found[0].growth.depth_mm.sigma == pytest.approx(0.2, rel=0.1)
    assert [c.fate for c in found] == [Fate.UNCHANGED, Fate.GREW]


def test_cells_of_a_displaced_picture_are_as_unsure_as_it_is_displaced():
    before, after = PIPE.surface([], 1), later([], 2)
    registration = register(before, after, NO_WELDS, SAME)
    wet = replace(after.wall, displaced_mm=0.2 * (np.arange(len(after.wall.distance_mm)) < 60))
    displaced, dry = (PairedWalls(before.wall, w, registration).stretch(40, 80) for w in (wet, after.wall))
    np.testing.assert_allclose(displaced.sigma_mm[:20], np.hypot(dry.sigma_mm[:20], 0.2))
    np.testing.assert_array_equal(displaced.sigma_mm[20:], dry.sigma_mm[20:])


def test_growth_lies_in_its_95_percent_interval_in_95_percent_of_cases():
    inside = []
    for seed in range(3):
        truth = np.random.default_rng(seed).uniform(-0.1, 0.3, len(PLACES))
        found = family(truth, 50 + 2 * seed)
        growth = [found[k].growth.depth_mm for k in range(len(PLACES))]
        inside += [abs(g.value - t) < 1.96 * g.sigma for g, t in zip(growth, truth, strict=True)]
    # 36 of them; with true intervals fewer than 31 would occur by chance in one of 150 cases
    assert sum(inside) >= 31


def test_no_change_is_declared_where_nothing_changed():
    families = [family(np.zeros(len(PLACES)), 300 + 2 * seed, found_now=9) for seed in range(3)]
    assert FAMILY_ERROR == 0.01
    assert not any(c.is_significant for found in families for c in found.values())


def test_wall_that_one_run_did_not_measure_is_not_called_unchanged():
    before, after = PIPE.surface([(60.0, 0.3, 0.5, 2.0)], 1), later((), 2)
    hidden = np.array(before.wall.radius_mm)
    hidden[108:132, 380:412] = np.nan
    before = replace(before, wall=replace(before.wall, radius_mm=hidden))
    registration = register(before, after, NO_WELDS, SAME)
    places = put_together([], [moved(finding(1, 60.0, 0.3))], registration, RADIUS)
    (found,) = changes(places, PairedWalls(before.wall, after.wall, registration), FINE, unseen)
    assert found.fate is Fate.UNSEEN_EARLIER
    assert found.seen_earlier < 0.5 < found.seen_now


def test_a_deposit_is_not_mistaken_for_the_pit_beside_it():
    registration = register(PIPE.surface((), 1), later((), 2), NO_WELDS, SAME)
    places = put_together(
        [finding(1, 60.0, 0.3)], [moved(finding(1, 60.0, 0.3, kind="deposit"))], registration, RADIUS
    )
    assert [(p.now is None, p.earlier is None) for p in places].count((False, False)) == 0
    assert len(places) == 2


def test_the_holm_correction_steps_down_and_ignores_what_was_not_tested():
    assert holm([0.01, float("nan"), 0.04, 0.03]) == pytest.approx(
        [0.03, float("nan"), 0.06, 0.06], nan_ok=True
    )


@pytest.mark.parametrize("alike", [0.0, 0.6, 0.9])
def test_the_spread_of_a_median_of_correlated_diameters_is_stated_rightly(alike):
    """Medians of 300 drawn series against their own σ; if taken as independent, σ is 4 times too small."""
    random = np.random.default_rng(3)
    drawn, white = random.normal(size=(300, 400)), []
    for row in drawn:
        for k in range(1, len(row)):
            row[k] = alike * row[k - 1] + np.sqrt(1 - alike**2) * row[k]
        white.append(np.median(row) / np.sqrt(np.pi / 2 / len(row)))
    z = [np.median(r) / (r.std() * np.sqrt(np.pi / 2 / independent_count(r))) for r in drawn]
    assert 0.8 < np.sqrt(np.mean(np.square(z))) < 1.25
    assert alike < 0.9 or np.sqrt(np.mean(np.square(white))) > 3


@pytest.mark.parametrize("radius_mm", [RADIUS, 25.0])
def test_the_foot_of_a_finding_reaches_as_far_across_the_seam_as_elsewhere(radius_mm):
    """The foot beyond the first or last column counted as clean wall; in narrow pipes it was too narrow."""
    wall = PIPE.surface((), 3).wall
    wall = replace(wall, radius_mm=np.full_like(wall.radius_mm, radius_mm))
    registration = register(PIPE.surface((), 3), later((), 4), NO_WELDS, SAME)
    pair = PairedWalls(wall, wall, registration)
    half = 5.0 / radius_mm
    counts = []
    for middle in (0.0, -np.pi + half):  # the second begins at the seam
        corners = [(s, middle + psi) for s, psi in ((50, -half), (60, -half), (60, half), (50, half))]
        counts.append(outline_mask([np.array(corners)], pair).sum(1))
    assert counts[1] == pytest.approx(counts[0], abs=2)
    wide_mm = counts[0].max() * 2 * np.pi * radius_mm / COLUMNS
    assert wide_mm == pytest.approx(10 + 2 * 2.0, abs=1.5)  # the finding, and 2 mm of foot on either side


def test_where_the_later_run_did_not_measure_a_finding_its_coverage_is_zero():
    """The radius there, NaN, was converted to a number of cells, which ended the comparison."""
    wall = PIPE.surface((), 3).wall
    unknown = wall.radius_mm.copy()
    unknown[wall.rows(40.0, 70.0)] = np.nan
    now = replace(wall, radius_mm=unknown)
    pair = PairedWalls(wall, now, register(PIPE.surface((), 3), later((), 4), NO_WELDS, SAME))
    outline = np.array([(s, psi) for s, psi in ((50, -0.1), (60, -0.1), (60, 0.1), (50, 0.1))])
    cutter = Cutter(pair, outline_mask([outline], pair))
    assert cutter.patch([outline], np.random.default_rng(0)).coverage[0] == 0
    nowhere = replace(pair, now=replace(wall, radius_mm=np.full_like(wall.radius_mm, np.nan)))
    assert (outline_mask([outline], nowhere) == cutter.defective).all()


def test_a_defect_beyond_the_common_wall_has_no_coverage_and_raises_no_warning():
    none, height = np.zeros((3, 4), bool), np.zeros((3, 4))
    patch = Patch(height, height, none, none, none, (0.5, 0.4), np.zeros((0, 3, 4)), 0)
    assert np.isnan(patch.coverage).all()
    assert not patch.is_seen_in_both
