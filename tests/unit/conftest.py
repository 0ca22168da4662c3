"""The drawn recording of `tests.premises_run`, which the tests of stage premises share."""

import pytest

from pipeline.recording.base import Recording
from tests.drawn_run import DrawnRun
from tests.premises_run import good_recording, steady_run


@pytest.fixture(scope="session")
def run() -> DrawnRun:
    return steady_run()


@pytest.fixture(scope="session")
def good() -> Recording:
    return good_recording()
