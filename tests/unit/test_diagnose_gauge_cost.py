"""Hypotheses about a gauge run are ranked by how well they fit, not by what their lens makes of the noise."""

import numpy as np
import pytest

from stages.calibrate.gauge.state import Unknowns
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.gauge.fit import fit
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.gauge.search import prepare
from tests.gauge_runs import made_run, measured_run


@pytest.fixture(scope="module")
def run() -> tuple[GaugeRun, Unknowns]:
    return prepare(measured_run(made_run(4, frames=40)))


@pytest.mark.parametrize("law", ["radial_distortion", "focal_scale", "dome_axial"])
def test_a_law_more_never_fits_worse(run: tuple[GaugeRun, Unknowns], law: str) -> None:
    without = fit(*run, ())
    beside = fit(*run, (Term(LIBRARY[law], (), np.zeros(1)),))
    # Rounding of the steps, which end where less than half a unit of χ² is left.
    assert beside.cost < without.cost + 0.5
