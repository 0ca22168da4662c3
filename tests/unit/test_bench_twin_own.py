"""The benchmark of the twin on own simulations keeps apart what it must not mix."""

import math
from argparse import Namespace

import pytest

from pipeline.simulator.build import build_truth
from tests.benchmarks import bench_twin_own
from tests.simulated import SCENES


def test_scenes_as_shipped_and_dulled_ones_are_not_taken_for_each_other(
    tmp_path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(bench_twin_own, "scene_of", lambda name, case, frames, seed, dull: dull)
    monkeypatch.setattr(bench_twin_own, "answer", lambda dull, folder: {"dull": dull})
    told = []
    for shipped in (False, True):
        given = Namespace(out=tmp_path, only="nothing", nulls=2, as_shipped=shipped, frames=9, seed=1)
        told.append([answer["dull"] for _, _, answer in bench_twin_own.answers(given)])
    assert told == [[True, True], [False, False]]


def test_a_ghost_that_is_asked_for_lies_beside_the_line():
    """Of a flat sheet the wall mirrors the line onto itself, and no picture shows it."""
    (case,) = (c for c in bench_twin_own.CASES if c.effect == "ghost_ring")
    scene = bench_twin_own.scene_of("straight-4-inch", case, 4, 1)
    laser = build_truth(scene, SCENES / "scene.yaml").instrument.laser
    forward_mm = scene.pipe.diameter_mm * math.tan(laser.sheet.cone_rad)
    assert laser.ghost_relative == case.numbers[0]
    assert forward_mm > 8
