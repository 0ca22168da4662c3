"""The benchmark of the twin on own simulations keeps different kinds of case apart."""

import math
from argparse import Namespace

import numpy as np
import pytest

from pipeline.simulator.build import build_truth
from tests.benchmarks import bench_twin_own
from tests.simulated import SCENES


def test_answers_for_scenes_as_shipped_and_for_dulled_ones_are_stored_apart(
    tmp_path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(bench_twin_own, "scene_of", lambda name, case, frames, seed, dull: dull)
    monkeypatch.setattr(bench_twin_own, "answer", lambda dull, folder: {"dull": dull})
    told = []
    for shipped in (False, True):
        given = Namespace(
            out=tmp_path, only="nothing", nulls=2, as_shipped=shipped, frames=9, seed=1, draws=1
        )
        told.append([answer["dull"] for _, _, answer in bench_twin_own.answers(given)])
    assert told == [[True, True], [False, False]]


def test_a_requested_ghost_line_lies_beside_the_line():
    """With a flat sheet the wall reflects the line onto itself, and no picture shows it."""
    (case,) = (c for c in bench_twin_own.CASES if c.effect == "ghost_ring")
    scene = bench_twin_own.scene_of("straight-4-inch", case, 4, 1)
    laser = build_truth(scene, SCENES / "scene.yaml").instrument.laser
    forward_mm = scene.pipe.diameter_mm * math.tan(laser.sheet.cone_rad)
    assert laser.ghost_relative == case.numbers[0]
    assert forward_mm > 8


def test_a_case_is_never_scored_again_by_an_answer_to_its_own_effect():
    """With one case, or three, the third one after it was the case itself.

    The counts stayed the same, as if right.
    """
    dust, dim = (c for c in bench_twin_own.CASES if c.effect in ("dust", "laser_sector"))
    for cases in ([dust], [dust, dust, dust], [dust, dim, dust], [dust, dim]):
        answered = [(case, {"found": case.effect}, (0.0, 0.0)) for case in cases]
        exchanged = bench_twin_own.exchanged(answered)
        assert len(exchanged) == (0 if dim not in cases else len(cases))
        assert all(told["found"] != case.effect for case, told, _ in exchanged)


@pytest.mark.parametrize("case", bench_twin_own.CASES, ids=lambda c: c.effect)
def test_drawn_sizes_differ_by_a_third_at_most_and_are_in_range(case):
    drawn = [case.drawn(seed) for seed in range(20)]
    assert drawn[0] == case.drawn(0)
    assert len({c.numbers for c in drawn}) == 20
    assert all(0.74 < c.numbers[0] / case.numbers[0] < 1.34 for c in drawn)
    if case.size is not None:
        assert all(c.true_size == case.size * c.numbers[0] <= 1 for c in drawn)
    bench_twin_own.scene_of("straight-4-inch", drawn[1], 4, drawn[1].seed)


def test_a_spot_told_as_a_dim_sector_has_the_mean_loss_over_the_sector():
    """A scatter of 63 % on its middle was scored as wrong by a loss of 36 %, mean over the 25° stated."""
    of = {c.effect: c for c in bench_twin_own.CASES}
    sector = {"place": [{"name": "azimuth_deg", "value": 60.0}, {"name": "width_deg", "value": 25.0}]}
    away = np.linspace(-12.5, 12.5, 1001)
    mean = 0.5 * np.exp(-0.5 * (away / 6.0) ** 2).mean()
    assert of["window_scatter"].size_as(sector) == pytest.approx(mean, abs=0.001)
    assert of["window_scatter"].size_as({"place": []}) == 0.5
    assert of["laser_sector"].size_as(sector) == 0.8
