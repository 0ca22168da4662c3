"""Fixtures that several integration tests use."""

import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.review.papers import PAPERS, paper_of
from pipeline.review.review import Review
from tests.reviewed import reviewed
from tests.sample_run import run_sample


def _files_of(run: Path) -> dict[str, tuple[int, int]]:
    """Return size and time of every file of a run, by its name."""
    told = {str(p.relative_to(run)): p.stat() for p in run.rglob("*") if p.is_file()}
    return {name: (of.st_size, of.st_mtime_ns) for name, of in told.items()}


@pytest.fixture(scope="session")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The finished run of the sample recording, made once for all test processes. No test may change it.

    Other tests copy it at the same time, so that even a short change breaks them.
    """
    base = tmp_path_factory.getbasetemp()
    folder = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    with (folder / "sample.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        run = folder / "sample" / "run"
        if not (folder / "sample.done").exists():
            run.parent.mkdir(exist_ok=True)
            run_sample(run)
            (folder / "sample.done").touch()
    before = _files_of(run)
    yield run
    assert _files_of(run) == before, "a test has changed the run that all tests share"


@pytest.fixture(scope="module")
def review(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Review:
    """A review with every kind of decision, signed."""
    return reviewed(sample, tmp_path_factory.mktemp("papers") / "run")


@pytest.fixture(scope="module")
def papers(review: Review) -> dict[str, bytes]:
    """All papers of that review."""
    return {name: paper_of(name, review, review.state()).content for name in PAPERS}
