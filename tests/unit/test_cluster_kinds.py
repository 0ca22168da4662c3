"""The section ``cluster`` of a configuration: what it may contain, and who reads it."""

from pathlib import Path

import pytest

from pipeline.batch.cluster import LocalWorkers, QueuedJobs, RunningScheduler, read_cluster, workers
from pipeline.errors import InputError
from pipeline.machine.configuration import resolve
from stages.catalogue import PIPELINE


def written(folder: Path, text: str) -> Path:
    file = folder / "c.yaml"
    file.write_text(text)
    return file


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("rings: {azimuths: 360}", LocalWorkers()),
        ("cluster: {kind: local, count: 3}", LocalWorkers(count=3)),
        (
            "cluster: {kind: scheduler, address: 'tcp://a:1'}",
            RunningScheduler(address="tcp://a:1"),
        ),
        (
            "cluster: {kind: slurm, jobs: 4, memory_gib: 6, walltime: 1-02:00:00}",
            QueuedJobs(kind="slurm", jobs=4, memory_gib=6, walltime="1-02:00:00"),
        ),
    ],
)
def test_a_configuration_names_the_kind(tmp_path, text, expected):
    assert read_cluster(written(tmp_path, text)) == expected


def test_without_a_file_the_cluster_is_this_machine():
    assert read_cluster(None) == LocalWorkers()


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ("{kind: slum}", "cluster: .*expected.*slurm or pbs"),
        ("{count: 3}", "cluster: .*kind"),
        ("[local]", "cluster: "),
        ("{kind: slurm}", r"cluster\.jobs: .*required"),
        ("{kind: slurm, jobs: 0}", r"cluster\.jobs: .*greater"),
        ("{kind: local, jobs: 2}", r"cluster\.jobs: .*[Ee]xtra"),
        ("{kind: pbs, jobs: 1, walltime: forever}", r"cluster\.walltime: .*match"),
    ],
)
def test_a_wrong_section_is_refused_with_its_key(tmp_path, section, message):
    with pytest.raises(InputError, match=f"(?s)c.yaml.*{message}"):
        read_cluster(written(tmp_path, f"cluster: {section}"))


def test_a_run_accepts_the_same_file_and_is_not_changed_by_it(tmp_path):
    file = written(tmp_path, "cluster: {kind: slurm, jobs: 2}\nrings: {azimuths: 360}")
    assert resolve(PIPELINE, file) == resolve(PIPELINE, None, ["rings.azimuths=360"])


def test_a_machine_without_the_queue_is_refused_with_that_reason(monkeypatch):
    monkeypatch.setenv("PATH", "")
    jobs = QueuedJobs(kind="pbs", jobs=1)
    with pytest.raises(InputError, match="qsub: is not on the path"), workers(jobs):
        pass
