"""Answers composed from made-up evidence of single channels."""

from __future__ import annotations

from dataclasses import replace

from pipeline.instrument.probe import Probe
from stages.diagnose.agreement import Agreement
from stages.diagnose.channels import Seen
from stages.diagnose.combine.compose import composed
from stages.diagnose.result import Confirmation, Diagnosis
from stages.diagnose.travel.evidence import TravelEstimate, TravelEvidence
from stages.diagnose.travel.lines import Line
from stages.diagnose.travel.steps import StepFound

AGREES = Agreement(Confirmation("first half: 0.02", "second half: 0.02", True), 30.0)
DIFFERS = Agreement(Confirmation("first half: 0.02", "second half: -0.01", False), 1e-12)
SCALE = TravelEstimate("encoder_scale", "relative", 0.02, 0.0004, 0.002, 1e-12, 0.01, ())
PLAY = TravelEstimate("encoder_backlash", "backlash_mm", 1.0, 0.02, 0.02, 1e-30, 0.1, ())
SLIP = StepFound(40, 1.3, 0.02, 2.0, 0.05, 1e-20, (), 0.0)
SWING = Line(5.0, 0.3, 0.002, 20.0, 1e-12, float("nan"), 0.3, float("nan"), 0.01, (AGREES,))


def seen(source: str, **shown: object) -> Seen:
    travel = TravelEvidence(source, (), (), (), (), None, ())
    return Seen("toy", None, replace(travel, **shown), None, ())  # type: ignore[arg-type]


def answer(probe: Probe, field: Seen | None, gauge: Seen | None, *without: str) -> Diagnosis:
    return composed(field, gauge, probe, without)


def of_gauge(probe: Probe, **shown: object) -> Diagnosis:
    return answer(probe, None, seen("gauge", **shown))
