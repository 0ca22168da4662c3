"""Fixtures that tests of several files use: a drawn recording, and a probe."""

import numpy as np
import pytest

from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe
from pipeline.recording.base import Recording
from stages.diagnose.travel.model import TravelFit, fitted
from tests.drawn_run import DrawnRun
from tests.premises_run import good_recording, steady_run
from tests.shared_data import PROJECT_ROOT
from tests.travel_cases import read
from tests.travel_cases import seen as sight


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


@pytest.fixture(scope="session")
def thirty_a_second() -> TravelFit:
    """Return a fit of pictures that follow each other by 1/30 s; its contents do not matter."""
    return fitted(sight(np.random.default_rng(8), every=6), read(), (), None)
