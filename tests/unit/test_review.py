"""The review: decisions are kept, undone and refused as they should be; strangers are refused."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from pipeline.artefacts.wall_map import WallMap
from pipeline.errors import InputError
from pipeline.export.run_record import mean_diameter
from pipeline.review import decisions as do
from pipeline.review.decisions.ledger import Ledger, StaleError
from pipeline.review.decisions.replay import (
    Finding,
    ImpossibleError,
    Measured,
    counting,
    covered,
    labels,
    replay,
)
from pipeline.review.documents import b31g, strength
from pipeline.review.measuring import OutlineGauge, contradiction, readings
from tests.shared_data import PROJECT_ROOT

SQUARE = ((48.0, 0.1), (52.0, 0.1), (52.0, 0.2), (48.0, 0.2))
SIZE = Measured(48, 52, 3, 4, 4, 5, 1.0, 0.1)


class SameSize:
    def measure(self, outline):
        return SIZE


@pytest.fixture
def ledger(tmp_path):
    made = Ledger(tmp_path / "review" / "decisions.sqlite")
    made.prepare()
    made.keep_basis("b", "[]")
    return made


def found(number):
    return Finding(str(number), "pit", SQUARE, SIZE, original=number)


def after(ledger):
    return {f.id: f for f in replay([found(1), found(2)], ledger.entries(), SameSize())}


def test_actions_are_kept_and_undone_in_order(ledger):
    for k, action in enumerate([do.Accept(finding="1"), do.Merge(findings=("1", "2")), do.Undo()]):
        ledger.append(action, "ann", "b", k)
    assert after(ledger)["1"].status == "accepted"
    assert after(ledger)["2"].status == "open"
    ledger.append(do.Redo(), "ann", "b", 3)
    assert after(ledger)["1"].status == "gone"
    assert "m2" in after(ledger)
    assert len(counting(ledger.entries())[0]) == 2


def test_an_author_who_has_not_seen_the_last_action_is_refused(ledger):
    ledger.append(do.Accept(finding="1"), "ann", "b", 0)
    with pytest.raises(StaleError, match="1 changes"):
        ledger.append(do.Reject(finding="1"), "bo", "b", 0)
    with pytest.raises(StaleError, match="older than the shown state"):
        ledger.append(do.Reject(finding="1"), "bo", "b", 7)
    assert after(ledger)["1"].decided_by == "ann"


def test_a_removed_finding_cannot_be_decided(ledger):
    ledger.append(do.Merge(findings=("1", "2")), "ann", "b", 0)
    ledger.append(do.Accept(finding="1"), "ann", "b", 1)
    with pytest.raises(ImpossibleError, match="no longer exists"):
        after(ledger)


def square(name, s, a, half_s, half_a):
    outline = (
        (s - half_s, a - half_a),
        (s + half_s, a - half_a),
        (s + half_s, a + half_a),
        (s - half_s, a + half_a),
    )
    return Finding(
        name, "pit", outline, replace(SIZE, distance_from_mm=s - half_s, distance_to_mm=s + half_s)
    )


def test_findings_covered_by_a_merged_outline_are_reported():
    wide = square("m7", 50, 3.1, 20, 0.3)
    within, around = square("1", 45, 3.1 - 2 * np.pi, 2, 0.1), square("2", 50, 3.1, 30, 0.5)
    beyond, behind = square("3", 90, 3.1, 5, 0.1), square("4", 50, 0.0, 5, 0.1)
    assert covered(wide, [wide, within, around, beyond, behind]) == ("1", "2")


def test_findings_added_by_hand_are_numbered_after_the_measured_ones():
    ids = ("1", "2", "3", "m8", "a9", "2.1", "m8.2")
    assert labels([replace(found(1), id=name) for name in ids]) == {
        "1": "1", "2": "2", "3": "3", "m8": "4 (merged)", "a9": "5 (added)", "2.1": "2.1 (split)",
        "m8.2": "4.2 (split)",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "depth", "contradicts"),
    [("deposit", 1.0, True), ("deposit", -1.0, False), ("pit", -1.0, True), ("pit", 1.0, False),
     ("dent", 1.0, True), ("deposit", 0.15, False), ("pit", float("nan"), False)],
)  # fmt: skip
def test_a_kind_that_the_measured_depth_contradicts_is_reported(kind, depth, contradicts):
    told = contradiction(replace(found(1), kind=kind, size=replace(SIZE, depth_mm=depth)))
    assert ("Check its kind" in told) == contradicts


def test_a_file_that_is_not_a_ledger_is_refused(tmp_path):
    file = tmp_path / "decisions.sqlite"
    file.write_text("not a database, " * 20)
    with pytest.raises(InputError, match="cannot be used as a ledger"):
        Ledger(file).prepare()


def test_the_depth_of_a_pit_is_measured_against_the_wall_around_it():
    s, psi = np.arange(0, 100, 0.5), -np.pi + 2 * np.pi / 720 * np.arange(720)
    radius = np.full((len(s), len(psi)), 50.0)
    radius[(s > 45)[:, None] & (s < 55)[:, None] & (np.abs(psi - 0.15) < 0.1)[None]] += 1.0
    wall = WallMap(s, psi, radius, np.full_like(radius, 0.03), np.full_like(radius, 0.02))
    inside = ((44.0, 0.03), (56.0, 0.03), (56.0, 0.27), (44.0, 0.27))
    assert OutlineGauge(wall).measure(inside).depth_mm == pytest.approx(1.0, abs=0.01)
    radius[(s == 47.0)[:, None] & (np.abs(psi - 0.1) < 0.02)[None]] += (
        4.0  # the deepest place, off the middle
    )
    deepest = OutlineGauge(wall).measure(inside)
    assert deepest.peak_distance_mm == pytest.approx(47.0, abs=0.6)
    assert deepest.peak_clock == pytest.approx(3 + 0.1 * 6 / np.pi, abs=0.05)
    diameter = readings(wall, "diameter", ((20.0, 1.0),))[0]
    assert (diameter.value, diameter.sigma) == pytest.approx((100.0, 0.06))


def test_what_displaces_the_picture_from_place_to_place_averages_out_of_a_mean_diameter():
    """A film of water of .13 mm widened σ of the mean diameter from .03 to .26 mm."""
    s, psi = np.arange(0, 100, 0.5), -np.pi + 2 * np.pi / 720 * np.arange(720)
    radius = np.full((len(s), len(psi)), 50.0)
    wall = WallMap(s, psi, radius, 0 * radius + 0.05, 0 * radius + 1e-6, displaced_mm=np.full(len(s), 0.04))
    across, mean = readings(wall, "diameter", ((20.0, 1.0),))
    assert mean.sigma == pytest.approx(2 * 0.03)
    assert across.sigma == pytest.approx(np.hypot(2 * 0.03, np.sqrt(2) * 0.04))
    assert mean_diameter(wall)[1] == pytest.approx(2 * 0.03)


def test_strength_falls_from_that_of_sound_pipe_to_the_barlow_pressure_of_the_remaining_wall():
    assert b31g(0.0, 5.0) == 1.0
    assert b31g(0.5, 1e9) == 0.5
    assert strength(-1, 10, 100, 6, 240) is None
    shallow, deep = (strength(d, 50, 100, 6, 240) for d in (1.0, 3.0))
    assert shallow.b31g_mpa > deep.b31g_mpa > 0


def test_a_review_of_one_run_starts_without_slow_imports() -> None:
    """Stages, Numba and SciPy take longer to load than everything else."""
    told = "import sys, pipeline.commands.review as _; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", told], cwd=PROJECT_ROOT, capture_output=True, text=True, check=True
    )
    assert not {"stages", "numba", "scipy", "matplotlib"} & set(loaded.stdout.split())
