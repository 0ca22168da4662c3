"""Nothing is done twice, every outcome is recorded, and a folder never mixes two configurations."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from pipeline.api.job import result_of, run_job
from pipeline.errors import Cancelled, InputError, UnusableError
from pipeline.machine.configuration import resolve
from pipeline.machine.display import SilentDisplay
from pipeline.machine.outcome import RunOutcome, State
from pipeline.machine.plan import PipelineError, Selection
from pipeline.machine.runner import FailedError
from pipeline.machine.stage import Context, Parameters, Stage
from tests.disk_limit import file_size_limit
from tests.shared_data import PROJECT_ROOT
from tests.toy_stages import DRAW, SMOOTH, TOYS, WEIGH, Drawn, DrawParameters, Total, Weighed
from tests.toys import run_toys, toy_job


def states(outcome: RunOutcome) -> list[str]:
    return [s.state.value for s in outcome.stages]


def record(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "run.json").read_text("utf-8"))
    return content


def snapshot(folder: Path) -> dict[str, tuple[int, int]]:
    """Return identity and time of every file: those of rewritten files differ."""
    names = (p for p in folder.rglob("*") if p.is_file() and p.name not in ("run.json", "run.log", "lock"))
    return {str(p.relative_to(folder)): (p.stat().st_ino, p.stat().st_mtime_ns) for p in names}


def test_a_second_call_does_nothing_again(tmp_path: Path) -> None:
    assert states(run_toys(tmp_path / "run")) == ["completed"] * 3
    before = snapshot(tmp_path / "run")
    assert states(run_toys(tmp_path / "run")) == ["reused"] * 3
    assert snapshot(tmp_path / "run") == before


def test_run_json_states_what_was_run(tmp_path: Path) -> None:
    outcome = run_toys(tmp_path / "run", "smooth.width=5")
    told = record(tmp_path / "run")
    assert told["format"] == 1
    assert told["state"] == "completed"
    assert told["configuration"]["smooth"]["width"] == 5
    assert told["configuration"]["draw"]["count"] == DrawParameters().count
    assert told["input_sha256"]["recording"] == "0" * 64
    assert len(told["input_sha256"]["probe"]) == 64
    assert [s["key"] for s in told["stages"]] == [s.key for s in outcome.stages]
    assert told["stages"][0]["numbers"] == [{"name": "rejected: dull", "value": 7, "unit": "numbers"}]
    assert told["reader_warnings"] == ["mended"]


def warn_of_it(drawn: Drawn, *, parameters: Any, context: Context) -> SMOOTH.output():  # type: ignore[valid-type]
    context.report("warning", "the probe was moved by 36 σ")
    return SMOOTH.function(drawn, parameters=parameters, context=context)


def test_a_warning_of_a_stage_is_in_run_json_even_if_its_result_is_reused(tmp_path: Path) -> None:
    job = toy_job(tmp_path / "run")
    job = replace(job, stages=(DRAW, replace(SMOOTH, function=warn_of_it), job.stages[2]))
    for _ in range(2):
        run_job(job, Selection(), SilentDisplay())
        assert record(tmp_path / "run")["warnings"] == ["smooth: the probe was moved by 36 σ"]


def test_numbers_of_reused_stages_are_reported_again(tmp_path: Path) -> None:
    first = run_toys(tmp_path / "run")
    again = run_toys(tmp_path / "run")
    assert [s.numbers for s in again.stages] == [s.numbers for s in first.stages]


def test_a_run_in_another_folder_gives_the_same_numbers(tmp_path: Path) -> None:
    for name in ("a", "b"):
        run_toys(tmp_path / name)
    a, b = (np.load(tmp_path / n / "numbers.dir" / "values.npy") for n in ("a", "b"))
    assert np.array_equal(a, b)


def test_a_parameter_recomputes_from_its_stage_on(tmp_path: Path) -> None:
    run_toys(tmp_path / "run")
    page = (tmp_path / "run" / "report.html").read_text()
    assert states(run_toys(tmp_path / "run", "smooth.width=5")) == ["reused", "completed", "completed"]
    assert (tmp_path / "run" / "report.html").read_text() != page
    assert states(run_toys(tmp_path / "run")) == ["reused"] * 3
    assert (tmp_path / "run" / "report.html").read_text() == page


@pytest.mark.parametrize(
    ("selection", "expected"),
    [
        (Selection(recompute_from="smooth"), ["reused", "completed", "completed"]),
        (Selection(resume=False), ["completed"] * 3),
        (Selection(only="smooth"), ["reused"] * 3),
        (Selection(only="smooth", resume=False), ["reused", "completed", "reused"]),
    ],
)
def test_the_selected_stages_are_run(tmp_path: Path, selection: Selection, expected: list[str]) -> None:
    run_toys(tmp_path / "run")
    assert states(run_toys(tmp_path / "run", selection=selection)) == expected


def test_the_option_only_computes_one_stage_and_needs_its_inputs(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no result of stage draw, which smooth needs"):
        run_toys(tmp_path / "run", selection=Selection(only="smooth"))
    outcome = run_toys(tmp_path / "run", selection=Selection(only="draw"))
    assert states(outcome) == ["completed", "waiting", "waiting"]
    assert not (tmp_path / "run" / "report.html").exists()


def test_an_unknown_stage_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(PipelineError, match="no stage smoth; there are draw, smooth, total"):
        run_toys(tmp_path / "run", selection=Selection(only="smoth"))
    assert not (tmp_path / "run").exists()


def test_after_unusable_input_completed_results_are_kept(tmp_path: Path) -> None:
    with pytest.raises(UnusableError):
        run_toys(tmp_path / "run", "smooth.unusable_above=0.001")
    told = record(tmp_path / "run")
    assert told["state"] == "unusable"
    assert [s["state"] for s in told["stages"]] == ["completed", "unusable", "waiting"]
    assert "too large" in told["problem"]
    assert states(run_toys(tmp_path / "run")) == ["reused", "completed", "completed"]


def test_a_program_error_leaves_its_traceback_in_the_log(tmp_path: Path) -> None:
    with pytest.raises(
        FailedError, match=r"stage smooth failed: ZeroDivisionError: the toy broke(?s:.*)run\.log"
    ):
        run_toys(tmp_path / "run", "smooth.fails=true")
    log = (tmp_path / "run" / ".boresight" / "run.log").read_text()
    assert "Traceback" in log
    assert "ZeroDivisionError: the toy broke" in log
    assert record(tmp_path / "run")["state"] == "failed"
    assert states(run_toys(tmp_path / "run")) == ["reused", "completed", "completed"]


def test_files_of_another_configuration_are_removed(tmp_path: Path) -> None:
    run_toys(tmp_path / "run")
    with pytest.raises(FailedError):
        run_toys(tmp_path / "run", "smooth.fails=true")
    assert not (tmp_path / "run" / "report.html").exists()
    assert not (tmp_path / "run" / "numbers.dir").exists()


@pytest.mark.parametrize("name", ["report.html", "numbers.dir/values.npy"])
@pytest.mark.parametrize("damage", [Path.unlink, lambda p: p.write_bytes(b"edited")])
def test_a_lost_or_changed_file_is_written_again(tmp_path: Path, name: str, damage: Any) -> None:
    run_toys(tmp_path / "run")
    whole = (tmp_path / "run" / name).read_bytes()
    damage(tmp_path / "run" / name)
    assert states(run_toys(tmp_path / "run")) == ["reused"] * 3
    assert (tmp_path / "run" / name).read_bytes() == whole


def stop_in_the_middle(*, parameters: DrawParameters, context: Context) -> Drawn:
    context.progress(1, 4)
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(1000):  # the thread that receives signals is another
        time.sleep(0.01)
        context.progress(2, 4)
    raise AssertionError("it went on")


def test_ctrl_c_stops_at_the_next_progress(tmp_path: Path) -> None:
    job = toy_job(tmp_path / "run")
    job = replace(job, stages=(replace(DRAW, function=stop_in_the_middle), *job.stages[1:]))
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(Cancelled, match="the same command continues"):
        run_job(job, Selection(), SilentDisplay())
    assert record(tmp_path / "run")["state"] == State.CANCELLED
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize(("stages", "weighed"), [((DRAW,), "nothing else"), (TOYS, "the total")])
def test_a_stage_gets_none_for_what_no_stage_makes(
    tmp_path: Path, stages: tuple[Stage, ...], weighed: str
) -> None:
    job = replace(toy_job(tmp_path), stages=(*stages, WEIGH), exporters=())
    job = replace(job, configuration=resolve(job.stages))
    run_job(job, Selection(), SilentDisplay())
    wanted = result_of(job, Total).total if weighed == "the total" else result_of(job, Drawn).values.sum()
    assert result_of(job, Weighed).value == wanted


def count_threads(drawn: Drawn, *, parameters: Parameters, context: Context) -> Weighed:
    threads = [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]
    return Weighed(float(max(threads)))


def test_linear_algebra_runs_on_one_thread_whatever_the_number_of_cores(tmp_path: Path) -> None:
    stages = (DRAW, Stage("threads", "1", Parameters, count_threads))
    job = replace(toy_job(tmp_path), stages=stages, exporters=(), configuration=resolve(stages))
    with threadpool_limits(2, "blas"):
        run_job(job, Selection(), SilentDisplay())
        assert count_threads(None, parameters=Parameters(), context=None).value == 2, "restored afterwards"  # type: ignore[arg-type]
    assert result_of(job, Weighed).value == 1


def answer_something_else(drawn: Drawn, *, parameters: Any, context: Context) -> SMOOTH.output():  # type: ignore[valid-type]
    return drawn


def test_a_stage_that_returns_another_type_than_declared_fails(tmp_path: Path) -> None:
    job = toy_job(tmp_path / "run")
    job = replace(job, stages=(DRAW, replace(SMOOTH, function=answer_something_else), job.stages[2]))
    with pytest.raises(FailedError, match="stage smooth"):
        run_job(job, Selection(), SilentDisplay())


def test_a_foreign_folder_is_refused_and_not_changed(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="do not belong to a boresight run"):
        run_toys(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.txt"]
    with pytest.raises(InputError, match="is a file"):
        run_toys(tmp_path / "thesis.txt")


def test_a_folder_that_cannot_be_written_is_reported() -> None:
    with pytest.raises(InputError, match="cannot be written"):
        run_toys(Path("/proc/boresight-run"))


@pytest.mark.parametrize("limit", [0, 500, 3000, 6000])
def test_a_full_disk_is_reported_and_the_run_continues_later(tmp_path: Path, limit: int) -> None:
    run_toys(tmp_path / "whole")
    with file_size_limit(limit), pytest.raises(InputError, match=r"cannot be written(?s:.*)the same command"):
        run_toys(tmp_path / "run")
    assert run_toys(tmp_path / "run").state == State.COMPLETED
    assert (tmp_path / "run" / "report.html").read_text() == (tmp_path / "whole" / "report.html").read_text()


def test_two_processes_do_not_share_a_folder(tmp_path: Path) -> None:
    arguments = [sys.executable, "-m", "tests.toys", str(tmp_path / "run"), "draw.pause_s=1"]
    other = subprocess.Popen(arguments, cwd=PROJECT_ROOT)
    try:
        lock = tmp_path / "run" / ".boresight" / "lock"
        while not lock.is_file() or not lock.read_text():
            assert other.poll() is None
        with pytest.raises(InputError, match=f"process {other.pid} is using"):
            run_toys(tmp_path / "run")
    finally:
        other.kill()
        other.wait()
    assert lock.read_text() == str(other.pid)
    assert states(run_toys(tmp_path / "run"))[1:] == ["completed"] * 2


def test_a_moved_run_can_be_continued(tmp_path: Path) -> None:
    run_toys(tmp_path / "run")
    shutil.move(tmp_path / "run", tmp_path / "moved")
    assert states(run_toys(tmp_path / "moved")) == ["reused"] * 3


def test_results_of_another_run_are_not_computed_again(tmp_path: Path) -> None:
    run_toys(tmp_path / "first")
    job = replace(toy_job(tmp_path / "second"), lent=(tmp_path / "first",))
    assert [s.state.value for s in run_job(job, Selection(), SilentDisplay()).stages] == ["reused"] * 3
    assert result_of(job, Total).total == result_of(toy_job(tmp_path / "first"), Total).total


def test_a_damaged_result_of_another_run_is_computed_here_and_stays_there(tmp_path: Path) -> None:
    run_toys(tmp_path / "first")
    array = next((tmp_path / "first" / ".boresight").glob("draw-*/*.npy"))
    array.write_bytes(array.read_bytes()[:-2])
    job = replace(toy_job(tmp_path / "second"), lent=(tmp_path / "first",))
    states = [s.state.value for s in run_job(job, Selection(), SilentDisplay()).stages]
    assert states == ["completed", "reused", "reused"]
    assert array.exists()
