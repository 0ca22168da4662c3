"""Effects tied to times of one recording are treated equally under each of their names in the library."""

from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.physics.effect import CourseKind
from stages.diagnose import compared as module
from stages.diagnose.effects.courses import Coursed, of_own_clock
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.gauge import heldout
from stages.diagnose.gauge.equations import Part
from stages.diagnose.gauge.hypotheses import Regime
from stages.diagnose.gauge.run import Term

SAME_DRIFT = LIBRARY["baseline_drift"], Coursed(LIBRARY["baseline"], (), CourseKind.EXPONENTIAL)
SAME_SWING = LIBRARY["laser_rocking"], Coursed(LIBRARY["laser_tilt"], (), CourseKind.SINUSOID)


@pytest.mark.parametrize(
    "model", [*SAME_DRIFT, *SAME_SWING, Coursed(LIBRARY["focal_scale"], (), CourseKind.STEP)]
)
def test_a_drift_and_a_swing_belong_to_their_own_recording_under_every_name(model):
    assert of_own_clock(model)


@pytest.mark.parametrize("kind", [CourseKind.SPEED, CourseKind.REVERSAL, CourseKind.DISTANCE])
def test_effects_tied_to_the_motion_do_not_belong_to_one_recording(kind):
    assert not of_own_clock(Coursed(LIBRARY["baseline"], (), kind))
    assert not of_own_clock(LIBRARY["baseline"])


@pytest.mark.parametrize("model", SAME_DRIFT)
def test_the_fit_of_a_drift_is_judged_by_its_own_gauge_run(model, monkeypatch):
    """The inspection need not drift again: with the gauge's drift removed, its rings would fit worse."""
    own = ("gauge before", "gauge after")
    monkeypatch.setattr(module, "rings_against_fiducials", lambda *args: own)
    monkeypatch.setattr(module, "_in_field", lambda *args: pytest.fail("asked of the inspection"))
    terms = (Term(model, (3.0,), np.array([0.2])),)
    examined = SimpleNamespace(
        best=SimpleNamespace(fit=SimpleNamespace(terms=terms)), quality="of parts held out in turn",
        searched=SimpleNamespace(run=None, nothing=SimpleNamespace(state=None)),
    )  # fmt: skip
    gauge = SimpleNamespace(frames=SimpleNamespace(frame=np.zeros(0)))
    found = module.compared(SimpleNamespace(), None, examined, gauge, None)
    assert (found.before, found.fit) == ("gauge before", "of parts held out in turn")


@pytest.mark.parametrize(
    ("model", "blocks"), [*((m, True) for m in SAME_DRIFT), (LIBRARY["baseline"], False)]
)
def test_a_drift_is_held_out_in_alternating_blocks_under_both_its_names(model, blocks, monkeypatch):
    """How far a drift has come at the end does not follow from what came before."""
    held_out = []
    monkeypatch.setattr(heldout, "repeatability_px", lambda *args: 0.1)
    monkeypatch.setattr(heldout, "evidence", lambda *args, **more: ["all", "first", "second"])
    monkeypatch.setattr(heldout, "total", lambda parts: parts)
    monkeypatch.setattr(heldout, "_rms_px", lambda run, judged, parts, rules: held_out.append(parts) or 0.1)
    early = np.arange(40) < 20
    regimes = [Regime(Part(frames), 0) for frames in (early, ~early)]
    found = SimpleNamespace(terms=(Term(model, (1.0,), np.zeros(1)),))
    judged = SimpleNamespace(fit=found, by_regime=("first", "second"))
    heldout.fit_quality(SimpleNamespace(time_s=np.arange(40)), judged, judged, regimes, None)
    assert (held_out[-1][0].frames[:20].all() and not held_out[-1][0].frames[20:].any()) is not blocks
