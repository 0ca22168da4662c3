"""Independent stages run at the same time; one that fails stops the others."""

from __future__ import annotations

import json
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from pipeline.api.job import Job, run_job
from pipeline.errors import UnusableError
from pipeline.machine.configuration import resolve
from pipeline.machine.display import SilentDisplay
from pipeline.machine.outcome import RunOutcome
from pipeline.machine.plan import Selection
from pipeline.machine.stage import Context, Parameters, Stage
from tests.patience import patience
from tests.toy_stages import DRAW, Drawn
from tests.toys import toy_job


def states(outcome: RunOutcome) -> list[str]:
    return [s.state.value for s in outcome.stages]


def record(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "run.json").read_text("utf-8"))
    return content


@dataclass(frozen=True)
class Left:
    value: float


@dataclass(frozen=True)
class Right:
    value: float


_MEETING = threading.Barrier(2, timeout=patience(60))


def go_left(drawn: Drawn, *, parameters: Parameters, context: Context) -> Left:
    _MEETING.wait()
    return Left(1.0)


def go_right(drawn: Drawn, *, parameters: Parameters, context: Context) -> Right:
    _MEETING.wait()
    return Right(2.0)


def fail_left(drawn: Drawn, *, parameters: Parameters, context: Context) -> Left:
    _MEETING.wait()
    raise UnusableError("left", "there is no way")


def linger_right(drawn: Drawn, *, parameters: Parameters, context: Context) -> Right:
    _MEETING.wait()
    for _ in range(3000):
        time.sleep(0.01)
        context.progress(1, 2)
    raise AssertionError("it went on")


def forked_job(folder: Path, left: Any, right: Any) -> Job:
    stages = (DRAW, Stage("left", "1", Parameters, left), Stage("right", "1", Parameters, right))
    return replace(toy_job(folder), stages=stages, exporters=(), configuration=resolve(stages, None, ()))


def test_independent_stages_run_at_the_same_time(tmp_path: Path) -> None:
    """Each waits for the other: one after the other, they would wait for ever."""
    outcome = run_job(forked_job(tmp_path / "run", go_left, go_right), Selection(), SilentDisplay())
    assert states(outcome) == ["completed"] * 3
    assert [s.name for s in outcome.stages] == ["draw", "left", "right"]


def test_a_stage_that_fails_stops_the_one_that_runs_with_it(tmp_path: Path) -> None:
    with pytest.raises(UnusableError, match="there is no way"):
        run_job(forked_job(tmp_path / "run", fail_left, linger_right), Selection(), SilentDisplay())
    told = record(tmp_path / "run")
    assert told["state"] == "unusable"
    assert [s["state"] for s in told["stages"]] == ["completed", "unusable", "cancelled"]
    assert told["stages"][2]["problem"] == "stopped with stage left"
