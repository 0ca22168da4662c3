"""What is told of a run that is too short, could not be examined, or has a jump of its rings."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from stages.diagnose import channels
from stages.diagnose.field.run import warn_of_knock
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.result import FitQuality


@pytest.mark.parametrize(
    ("told", "ambiguous", "words"),
    [(True, False, "each other."), (False, True, "or the pipe"), (False,) * 2 + ("",)],
)
def test_a_jump_of_rings_in_an_inspection_is_reported_as_a_knock_where_it_may_be_one(told, ambiguous, words):
    warned: list[str] = []
    jump = SimpleNamespace(frame=140, jump_mm=np.array([0.2, -0.2, 0.01]))
    knock = SimpleNamespace(certain=told, ambiguous=ambiguous, jump=jump, time_s=4.67)
    warn_of_knock(cast(Any, knock), cast(Any, SimpleNamespace(warn=warned.append)))
    assert len(warned) == (told or ambiguous)
    assert all("at 4.67 s (frame 140)" in w and "0.28 mm" in w and words in w for w in warned)


def test_a_gauge_run_too_short_to_check_for_repetition_says_so(monkeypatch):
    short = FitQuality("px", 0.3, 0.3, np.nan, np.nan, 0.1)
    found = SimpleNamespace(state=None)
    searched = cast(Any, SimpleNamespace(by_chance=0.5, found=found))
    monkeypatch.setattr(channels, "examine", lambda *_, **__: Examined(searched, None, (), (), quality=short))
    monkeypatch.setattr(channels, "gauge_travel", lambda *_: SimpleNamespace(shortcomings=()))
    recording = SimpleNamespace(name="gauge")
    seen = channels.examine_gauge(
        cast(Any, recording),
        cast(Any, SimpleNamespace(applied_to=lambda recording: recording)),
        cast(Any, SimpleNamespace(limits=(), known_light=lambda without: None)),
        cast(Any, SimpleNamespace(run=SimpleNamespace(), problem="")),
        cast(Any, None),
        parameters=cast(Any, SimpleNamespace(without=())),
        context=cast(Any, SimpleNamespace(progress=None)),
    )
    (told,) = seen.shortcomings
    assert "too short" in told


def test_the_reason_why_a_run_could_not_be_examined_is_printed_too():
    """The terminal showed only the verdict "not_identifiable" of a gauge run that was never examined."""
    warned: list[str] = []
    given = {"parameters": SimpleNamespace(without=()), "context": SimpleNamespace(warn=warned.append)}
    frames = SimpleNamespace(applied_to=lambda recording: recording)
    light = SimpleNamespace(limits=(), known_light=lambda without: None)
    unmeasured = SimpleNamespace(run=None, problem="the fiducials measure 4.00 mm")
    recording = SimpleNamespace(name="a", frames=SimpleNamespace(of=lambda *_: []))
    seen = channels.examine_gauge(
        *cast(Any, (recording, frames, light, unmeasured, None)), **cast(Any, given)
    )
    still = SimpleNamespace(run=lambda *_: None, problem="the probe stands still")
    channels.examine_field(*cast(Any, (recording, frames, None, light, still, None)), **cast(Any, given))
    assert len(warned) == 2
    assert "gauge run were not examined: the fiducials measure 4.00 mm" in warned[0]
    assert warned[0] in seen.shortcomings
    assert "inspection say nothing about the instrument: the probe stands still" in warned[1]
