"""The warped cases: every answer can be compared with another case, however few were requested."""

import json
import sys

import pytest

from tests.benchmarks import bench_warped
from tests.benchmarks.bench_warped import CASES, another


@pytest.mark.parametrize("name", CASES)
def test_every_case_has_another_with_a_different_right_answer(name):
    other = another(name)
    assert (other.names, other.verdict) != (CASES[name].names, CASES[name].verdict)


def test_one_case_alone_is_compared_with_another_and_is_wrong(tmp_path, monkeypatch, capsys):
    """It ended in StopIteration, since only the requested cases were searched."""
    folder = tmp_path / "open-1-focal" / "answer"
    folder.mkdir(parents=True)
    told = {"verdict": "named", "effects": [{"name": "focal_scale", "probability": 0.999, "parameters": {}}]}
    (folder / "diagnosis.json").write_text(json.dumps(told), "utf-8")
    for spoilt, counted in (([], "1 right, 0 silent, 0 WRONG"), (["--others"], "0 right, 0 silent, 1 WRONG")):
        monkeypatch.setattr(sys, "argv", ["bench_warped", str(tmp_path), "focal", *spoilt])
        bench_warped.main()
        assert counted in capsys.readouterr().out
