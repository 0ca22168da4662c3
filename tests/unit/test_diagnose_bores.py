"""A gauge with a bore that is not as drawn: the bore is reported, and no effect of the instrument."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipeline.machine.stage import unheard
from stages.calibrate.gauge import MeasuredRun
from stages.diagnose import channels
from stages.diagnose.effects.courses import with_courses
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.gauge import examine as examination
from stages.diagnose.gauge.bores import free_numbers, misdrawn_bore
from stages.diagnose.gauge.fit import fit, fit_beside
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.search import Search, prepare
from tests.gauge_runs import GaugeRun, made_run, measured_run

_FEW = {"baseline": LIBRARY["baseline"]}


def exact(misdrawn_mm: float) -> GaugeRun:
    """Return a run whose probe is as stated."""
    made = made_run(1, 40, misdrawn_mm)
    return replace(made, stated=made.true)


def searched(measured: MeasuredRun, with_baseline: bool) -> Search:
    run, start = prepare(measured)
    nothing = fit(run, start, ())
    found = fit_beside(nothing, LIBRARY["baseline"], ()) if with_baseline else nothing
    return Search(run, nothing, found, (), (), 1e-9, 1.0)


def test_a_bore_of_another_diameter_is_reported_instead_of_an_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was raised as an error, and what the motion and the encoder of that run show was lost with it."""
    # Steps, which find it in practice, take long to search: whatever is found counts instead.
    monkeypatch.setattr(examination, "DETECTED", 1.0)
    monkeypatch.setattr(channels, "library_without", lambda _: _FEW)
    monkeypatch.setattr(channels, "examine", partial(examination.examine, courses=()))
    monkeypatch.setattr(channels, "gauge_travel", lambda *_: SimpleNamespace(shortcomings=("too slow",)))
    given, warned = exact(-0.2), list[str]()
    seen = channels.examine_gauge(
        given.recording,
        cast(Any, SimpleNamespace(applied_to=lambda recording: recording)),
        channels.LineProfile(None),
        channels.GaugeMeasured(measured_run(given)),
        given.stated,
        parameters=channels.DiagnosisParameters(),
        context=cast(Any, SimpleNamespace(progress=unheard, warn=warned.append)),
    )
    assert seen.geometry is None
    assert seen.misdrawn
    assert seen.travel is not None
    assert re.search(r"A bore of 83\.6. mm where recording\.yaml says 84 mm", warned[0])
    assert seen.shortcomings == (warned[0], "too slow")


def test_the_error_of_a_bore_is_that_drawn() -> None:
    bore = misdrawn_bore(searched(measured_run(exact(-0.06)), with_baseline=True))
    assert bore is not None
    assert bore.section == 1
    assert bore.error_mm == pytest.approx(-0.06, abs=0.012)


@pytest.mark.parametrize("as_stated", [True, False])
def test_no_bore_is_blamed_in_a_gauge_as_drawn(as_stated: bool) -> None:
    made = made_run(1, 40)
    off = np.where(np.array(made.true.parameter_names) == "baseline_mm", 0.1, 0.0)
    other = made.true.with_parameters(made.true.parameters + off, made.true.covariance)
    given = replace(made, stated=made.true if as_stated else other)
    assert misdrawn_bore(searched(measured_run(given), with_baseline=not as_stated)) is None


@pytest.mark.parametrize(
    ("course", "numbers"), [("ramp", 1), ("distance", 1), ("step", 2), ("exponential", 2)]
)
def test_only_what_is_estimated_of_a_course_counts_against_an_effect(course: str, numbers: int) -> None:
    """The time that a ramp refers to counted as a free number, in favour of a bore that is not as drawn."""
    model = with_courses(LIBRARY)[f"pixel_aspect, {course}"]
    assert free_numbers(Term(model, (4.0,), np.array([0.1])), 8.0, 30.0) == numbers
