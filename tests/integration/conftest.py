"""What several integration tests share."""

from pathlib import Path

import pytest

from tests.sample_run import run_sample


@pytest.fixture(scope="session")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The finished run of the sample recording; not to be changed."""
    folder = tmp_path_factory.mktemp("sample") / "run"
    run_sample(folder)
    return folder
