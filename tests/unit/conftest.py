"""Fixtures that tests of several files use: a drawn recording, and a probe."""

import pytest

from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe
from pipeline.recording.base import Recording
from tests.drawn_run import DrawnRun
from tests.premises_run import good_recording, steady_run
from tests.shared_data import PROJECT_ROOT


@pytest.fixture(scope="session")
def run() -> DrawnRun:
    return steady_run()


@pytest.fixture(scope="session")
def good() -> Recording:
    return good_recording()


@pytest.fixture
def real_probe() -> Probe:
    """The probe of the sample recording."""
    return read_probe(PROJECT_ROOT / "data" / "sample" / "probe.yaml")
