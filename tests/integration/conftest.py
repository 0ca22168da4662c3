"""What several integration tests share."""

import fcntl
import os
from pathlib import Path

import pytest

from tests.sample_run import run_sample


@pytest.fixture(scope="session")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The finished run of the sample recording, made once for all test processes; not to be changed."""
    base = tmp_path_factory.getbasetemp()
    folder = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    with (folder / "sample.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        run = folder / "sample" / "run"
        if not (folder / "sample.done").exists():
            run.parent.mkdir(exist_ok=True)
            run_sample(run)
            (folder / "sample.done").touch()
    return run
