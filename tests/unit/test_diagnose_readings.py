"""For an effect of the encoder the answer compares readings with pictures, and not rings."""

from __future__ import annotations

import numpy as np
import pytest

from stages.diagnose.channels import Seen
from stages.diagnose.compared import with_readings
from stages.diagnose.result import Diagnosis, EffectFound, FitQuality, Picture, Verdict
from stages.diagnose.travel.events import with_events
from stages.diagnose.travel.evidence import TravelEvidence
from tests.travel_cases import read, seen

RINGS = FitQuality("px", 1.5, 1.5, 1.5, 1.5, 0.1)
EMPTY = np.zeros((1, 1))


def recording(**faults: float) -> Seen:
    fit = with_events(seen(np.random.default_rng(1)), read(**faults))  # type: ignore[arg-type]
    travel = TravelEvidence("gauge", (), (), (), (), fit, ())
    return Seen("some", None, travel, None, ())


def found(*names: str) -> Diagnosis:
    effects = tuple(EffectFound(name, 1.0, {}, "", "") for name in names)
    picture = Picture(np.arange(1), np.zeros(1), EMPTY, EMPTY)
    return Diagnosis("", "", Verdict.NAMED, 0.0, effects=effects, fit=RINGS, ring_picture=picture)


def test_a_wrong_scale_is_drawn_for_the_recording_that_shows_it():
    sound, wrong = recording(), recording(scale=0.02)
    for order in ((sound, wrong), (wrong, None), (None, wrong)):
        told = with_readings(found("encoder_scale"), order)
        assert told.ring_picture is None
        assert told.fit is not None
        assert told.fit.unit == "mm of the reading"
        assert told.fit.heldout_before == told.fit.rms_before > 0.1
        assert told.fit.heldout_after < 0.1 * told.fit.heldout_before
        assert 0.4 < told.fit.heldout_after / told.fit.noise_floor < 1.2
        assert told.reading_picture is not None
        assert np.std(told.reading_picture.before_mm) > 10 * np.std(told.reading_picture.after_mm)


@pytest.mark.parametrize("names", [(), ("laser_tilt",), ("laser_tilt", "encoder_scale")])
def test_an_effect_on_rings_is_drawn_with_rings(names):
    told = with_readings(found(*names), (recording(),))
    assert told.fit is RINGS
    assert told.reading_picture is None
