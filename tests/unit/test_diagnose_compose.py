"""Channels come to one answer: a name needs a second prediction that agrees, and a name that is known."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe
from stages.diagnose.compose import composed
from stages.diagnose.result import Diagnosis, Verdict
from stages.diagnose.seen import Seen
from stages.diagnose.travel.events import StepFound
from stages.diagnose.travel.evidence import TravelEstimate, TravelEvidence
from tests.shared_data import PROJECT_ROOT
from tests.toys import toy_recording


@pytest.fixture
def real_probe() -> Probe:
    """The probe of the sample recording."""
    return read_probe(PROJECT_ROOT / "data" / "sample" / "probe.yaml")


SCALE = TravelEstimate("encoder_scale", "scale", "", 0.02, 0.0004, 0.002, 1e-12, 0.01, ())
SLIP = StepFound(40, 1.3, 2.0, 0.05, 1e-20, (), 0.0)


def seen(source: str, **shown: object) -> Seen:
    travel = TravelEvidence(source, (), (), (), (), None, (), ())
    return Seen(toy_recording(), None, replace(travel, **shown), None, ())  # type: ignore[arg-type]


def answer(probe: Probe, field: Seen | None, gauge: Seen | None, *without: str) -> Diagnosis:
    return composed(field, gauge, probe, without)


def test_what_one_recording_shows_once_is_a_class(real_probe: Probe) -> None:
    found = answer(real_probe, None, seen("gauge", estimates=(SCALE,)))
    assert found.verdict is Verdict.CLASS
    assert "encoder_scale" in found.members


def test_what_both_recordings_show_is_named(real_probe: Probe) -> None:
    both = (seen(source, estimates=(SCALE,)) for source in ("field", "gauge"))
    found = answer(real_probe, *both)
    assert found.verdict is Verdict.NAMED
    (effect,) = found.effects
    assert effect.name == "encoder_scale"
    assert effect.confirmed_by


def test_a_slip_is_confirmed_by_the_pictures_going_on(real_probe: Probe) -> None:
    found = answer(real_probe, None, seen("gauge", slips=(SLIP,)))
    assert found.verdict is Verdict.NAMED
    assert [e.name for e in found.effects] == ["encoder_slip"]


def test_what_the_library_lacks_is_seen_but_not_named(real_probe: Probe) -> None:
    both = (seen(source, estimates=(SCALE,)) for source in ("field", "gauge"))
    found = answer(real_probe, *both, "encoder_scale")
    assert found.verdict is Verdict.UNEXPLAINED
    assert found.effects == ()
    assert found.location is not None
    assert found.location.channel == "motion"


def test_what_is_within_the_stated_uncertainty_is_nothing(real_probe: Probe) -> None:
    quiet = replace(SCALE, p_value=0.2)
    found = answer(real_probe, None, seen("gauge", estimates=(quiet,)))
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert found.effects == ()
