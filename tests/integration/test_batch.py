"""Many recordings: one failing stops nothing, lost workers lose nothing, results are those of single runs."""

import json
import os
import signal
import threading
import time

import pytest
from typer.testing import CliRunner

from pipeline.batch.cluster import endings, workers
from pipeline.batch.find import find_recordings
from pipeline.batch.summary import write_summary
from pipeline.batch.work import Ending, Work
from pipeline.cli import app
from pipeline.errors import InputError
from tests.bad_recordings import cut_sample

FEW = ("--set", "rings.azimuths=360")


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Two good recordings, one below another folder, and a broken one."""
    folder = tmp_path_factory.mktemp("recordings")
    cut_sample(folder / "one", frames=16)
    cut_sample(folder / "deep" / "two", frames=16)
    (folder / "broken").mkdir()
    (folder / "broken" / "recording.yaml").write_text("name: broken\n")
    return folder


@pytest.fixture(scope="module")
def single(recordings, tmp_path_factory):
    """The run of the first recording by itself."""
    run = tmp_path_factory.mktemp("single") / "one"
    assert CliRunner().invoke(app, ["run", str(recordings / "one"), "-o", str(run), *FEW]).exit_code == 0
    return run


def test_a_lost_worker_loses_nothing(recordings, single, tmp_path):
    found = find_recordings(recordings)
    works = [Work(n, p, tmp_path / n, FEW) for n, p in found.items()]
    with workers(2, "") as client:
        pids = list(client.run(os.getpid).values())
        kill = threading.Thread(target=lambda: (time.sleep(4), os.kill(pids[0], signal.SIGKILL)))
        kill.start()
        ended = {e.name: e for e in endings(client, works)}
        kill.join()
    assert {n: e.state for n, e in ended.items()} == {
        "one": "completed",
        "deep-two": "completed",
        "broken": "refused",
    }
    assert "key kind: is missing" in ended["broken"].problem
    for name in ("radius_map.npz", "trajectory.csv", "defects.json", "model.glb"):
        assert (tmp_path / "one" / name).read_bytes() == (single / name).read_bytes()


def test_the_summary_tells_every_ending_in_the_order_of_names(tmp_path):
    made = [
        Ending("b", "completed", "", (("defects", 3, ""),)),
        Ending("<i>a</i>", "refused", "no <b>video</b>"),
    ]
    write_summary(made, tmp_path)
    told = json.loads((tmp_path / "batch.json").read_text())
    assert [r["name"] for r in told["runs"]] == ["<i>a</i>", "b"]
    page = (tmp_path / "batch.html").read_text()
    assert "no &lt;b&gt;video" in page
    assert 'href="b/report.html"' in page
    assert 'href="&lt;i' not in page


def test_a_scheduler_that_does_not_answer_is_named():
    with pytest.raises(InputError, match="no scheduler answers"), workers(None, "tcp://127.0.0.1:9"):
        pass


def test_a_folder_without_recordings_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no recordings"):
        find_recordings(tmp_path)
