"""The benchmark of the twin on own simulations keeps apart what it must not mix."""

from argparse import Namespace

import pytest

from tests.benchmarks import bench_twin_own


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
