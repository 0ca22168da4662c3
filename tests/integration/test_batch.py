"""Many recordings.

One that fails stops no other, lost workers lose no results, and results equal single runs.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from typer.testing import CliRunner

from pipeline.batch import BatchOutcome, Work, find_recordings, outcome_of, write_summary
from pipeline.batch.cluster import LocalWorkers, RunningScheduler, outcomes, workers
from pipeline.cli import app
from pipeline.errors import InputError
from tests.bad_recordings import cut_sample
from tests.batch_queue import kill_job, local_queue, queued
from tests.dask_cluster import DaskCluster, end
from tests.patience import patience
from tests.run_content import run_content
from tests.shared_data import PROJECT_ROOT

FEW = ("--set", "rings.azimuths=360")


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Two good recordings, one of them in a subfolder, and a broken one."""
    folder = tmp_path_factory.mktemp("recordings")
    cut_sample(folder / "one", frames=16)
    cut_sample(folder / "deep" / "two", frames=16)
    (folder / "broken").mkdir()
    (folder / "broken" / "recording.yaml").write_text("name: broken\n")
    return folder


@pytest.fixture(scope="module")
def single(recordings, tmp_path_factory):
    """A run of the first recording outside a batch."""
    run = tmp_path_factory.mktemp("single") / "one"
    assert CliRunner().invoke(app, ["run", str(recordings / "one"), "-o", str(run), *FEW]).exit_code == 0
    return run


def test_when_a_worker_is_lost_no_result_is_lost(recordings, single, tmp_path):
    found = find_recordings(recordings)
    works = [Work(n, p, tmp_path / n, FEW) for n, p in found.items()]
    with workers(LocalWorkers(count=2)) as client:
        pids = list(client.run(os.getpid).values())
        kill = threading.Thread(target=lambda: (time.sleep(4), os.kill(pids[0], signal.SIGKILL)))
        kill.start()
        ended = {e.name: e for e in outcomes(client, works)}
        kill.join()
    assert {n: e.state for n, e in ended.items()} == {
        "one": "completed",
        "deep-two": "completed",
        "broken": "refused",
    }
    assert "recording.yaml, key frames: is missing" in ended["broken"].problem
    for name in ("radius_map.npz", "trajectory.csv", "defects.json", "model.glb"):
        assert (tmp_path / "one" / name).read_bytes() == (single / name).read_bytes()


def working(folder):
    """Wait until a run below a batch's folder is in its first stage."""
    until = time.monotonic() + patience(120)
    while not any("stage rings starts" in f.read_text() for f in folder.glob("*/.boresight/run.log")):
        assert time.monotonic() < until, "no run reached its first stage"
        time.sleep(0.05)


def batch_of(recordings, folder, *words):
    command = [sys.executable, "-m", "pipeline.cli", "batch", str(recordings), "-o", str(folder), *FEW]
    return subprocess.Popen([*command, *words], cwd=PROJECT_ROOT, stderr=subprocess.PIPE, text=True)


def test_when_working_cluster_workers_are_killed_no_result_is_lost(recordings, single, tmp_path):
    with DaskCluster(tmp_path, 2) as cluster:
        batch = batch_of(recordings, tmp_path / "out", "--scheduler", cluster.address)
        working(tmp_path / "out")
        for lost in cluster.workers[:]:
            end(lost)
        cluster.add_worker()
        _, told = batch.communicate(timeout=patience(300))
    assert batch.returncode == 3, told
    runs = json.loads((tmp_path / "out" / "batch.json").read_text())["runs"]
    assert {r["name"]: r["state"] for r in runs} == {
        "one": "completed",
        "deep-two": "completed",
        "broken": "refused",
    }
    assert run_content(tmp_path / "out" / "one") == run_content(single)


def test_killed_jobs_of_a_queue_are_queued_again(recordings, single, tmp_path, monkeypatch):
    queue = local_queue(tmp_path)
    monkeypatch.setenv("PATH", f"{queue}:{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", str(PROJECT_ROOT))
    (tmp_path / "c.yaml").write_text("cluster: {kind: slurm, jobs: 2, memory_gib: 4, host: 127.0.0.1}\n")
    batch = batch_of(recordings / "one", tmp_path / "out", "--config", str(tmp_path / "c.yaml"))
    working(tmp_path / "out")
    lost = queued(queue)
    for job in lost:
        kill_job(job)
    _, told = batch.communicate(timeout=patience(300))
    assert batch.returncode == 0, told
    assert len(queued(queue)) > len(lost)
    assert run_content(tmp_path / "out" / "one") == run_content(single)


def test_a_lost_scheduler_is_reported_and_the_batch_can_be_continued(recordings, single, tmp_path):
    with DaskCluster(tmp_path, 1) as cluster:
        batch = batch_of(recordings / "one", tmp_path / "out", "--scheduler", cluster.address)
        working(tmp_path / "out")
        end(cluster.scheduler)
        _, told = batch.communicate(timeout=patience(120))
    assert batch.returncode == 2, told
    assert "the scheduler was lost" in told
    assert "the same command" in told
    again = batch_of(recordings / "one", tmp_path / "out", "--workers", "1")
    _, told = again.communicate(timeout=patience(300))
    assert again.returncode == 0, told
    assert run_content(tmp_path / "out" / "one") == run_content(single)


@pytest.mark.parametrize(
    ("code", "told", "record", "expected"),
    [
        (
            2,
            "boresight: a.csv: is cut off",
            {"state": "completed"},
            ("refused", "boresight: a.csv: is cut off"),
        ),
        (2, "no room", {"state": "running", "problem": ""}, ("refused", "no room")),
        (-9, "", {"state": "running", "problem": ""}, ("failed", "it ended with status -9")),
        (
            2,
            "a.csv: is cut off",
            {"state": "unusable", "problem": "no ring"},
            ("refused", "a.csv: is cut off"),
        ),
        (3, "boresight: no ring", {"state": "unusable", "problem": "no ring"}, ("unusable", "no ring")),
        (0, "", {"state": "completed", "problem": ""}, ("completed", "")),
    ],
)
def test_the_outcome_of_a_recording_is_that_of_this_call_not_of_an_earlier_one(
    tmp_path, code, told, record, expected
):
    (tmp_path / "run.json").write_text(json.dumps(record))
    outcome = outcome_of(Work("a", tmp_path, tmp_path, ()), code, told)
    assert (outcome.state, outcome.problem) == expected


def test_a_summary_that_cannot_be_written_is_reported(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_summary([BatchOutcome("a", "completed", "")], tmp_path / "file")


def test_the_summary_lists_every_outcome_in_the_order_of_names(tmp_path):
    made = [
        BatchOutcome("b", "completed", "", (("defects", 3, ""),)),
        BatchOutcome("<i>a</i>", "refused", "no <b>video</b>"),
    ]
    write_summary(made, tmp_path)
    told = json.loads((tmp_path / "batch.json").read_text())
    assert [r["name"] for r in told["runs"]] == ["<i>a</i>", "b"]
    page = (tmp_path / "batch.html").read_text()
    assert "no &lt;b&gt;video" in page
    assert 'href="b/report.html"' in page
    assert 'href="&lt;i' not in page


def test_warnings_of_a_completed_run_are_on_the_page(tmp_path):
    record = {"state": "completed", "problem": "", "warnings": ["motion: moved <6 σ>"],
              "reader_warnings": ["2 images are missing"]}  # fmt: skip
    (tmp_path / "run.json").write_text(json.dumps(record))
    outcome = outcome_of(Work("a", tmp_path, tmp_path, ()), 0, "")
    assert outcome.warnings == ("2 images are missing", "motion: moved <6 σ>")
    write_summary([outcome, BatchOutcome("b", "completed", "")], tmp_path)
    runs = json.loads((tmp_path / "batch.json").read_text())["runs"]
    assert [r["warnings"] for r in runs] == [list(outcome.warnings), []]
    page = (tmp_path / "batch.html").read_text()
    assert "1 with warnings" in page
    assert "<li>2 images are missing</li><li>motion: moved &lt;6 σ&gt;</li>" in page
    write_summary([BatchOutcome("b", "completed", "")], tmp_path)
    assert "with warnings" not in (tmp_path / "batch.html").read_text()


def test_the_options_workers_and_scheduler_exclude_each_other(recordings, tmp_path):
    batch = batch_of(recordings, tmp_path, "--workers", "2", "--scheduler", "tcp://127.0.0.1:9")
    _, told = batch.communicate(timeout=patience(60))
    assert batch.returncode == 2
    assert "--workers: and --scheduler exclude each other" in told


def test_a_scheduler_that_does_not_answer_is_named_in_the_error():
    nobody = RunningScheduler(address="tcp://127.0.0.1:9")
    with pytest.raises(InputError, match="no scheduler answers"), workers(nobody):
        pass


def test_a_folder_without_recordings_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no recordings"):
        find_recordings(tmp_path)
