"""A drift of the image scale is removed only if the run, measured again without it, has none left."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from stages.motion import MotionParameters
from stages.motion.bundle_adjustment.image_scale import drift_of_scale
from stages.motion.bundle_adjustment.solver import estimate_state
from stages.motion.windows import steady_scale
from stages.motion.windows.steady_scale import with_steady_scale
from tests.motion_scene import scene
from tests.quiet import quiet_context
from tests.unit.growing_run import FEW, GROWS, WHOLE, WholeRun


@pytest.mark.parametrize(("again", "corrected"), [(1.0, True), (0.1, False)])
def test_a_drift_that_is_not_found_again_is_not_removed(
    again: float, corrected: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Behind a noise filter a drift of .55 % was removed, and .07 % were found by the next estimate."""
    made, parameters = scene(FEW, 100, noise=0.1, picture_grows=GROWS), MotionParameters()
    estimate = estimate_state(made.truth, made.measured, parameters)
    drift, found = drift_of_scale(estimate, made.measured), iter([1.0, 1.0, 1.0, again])
    monkeypatch.setattr(
        steady_scale, "drift_of_scale", lambda *_: replace(drift, at_frames=next(found) * drift.at_frames)
    )
    monkeypatch.setattr(steady_scale, "estimate_state", lambda *_: estimate)
    run = WholeRun(made)
    steady = with_steady_scale(cast(Any, run), WHOLE, estimate, made.measured, parameters, cast(Any, None))
    assert steady.corrected == steady.drift.certain == (steady.scale is not None) == corrected
    assert steady.drift.contradicted != corrected
    assert steady.scale_sigma is not None
    assert (steady.scale_sigma >= np.abs(drift.at_frames)).all()
    assert steady.distance_sigma > 0


def test_a_drift_with_contradicting_evidence_is_reported_as_such() -> None:
    """It was called undecided for lack of texture, or not reported: p of a constant scale decided."""
    made = scene(FEW, 100, noise=0.1, picture_grows=GROWS)
    drift = drift_of_scale(estimate_state(made.truth, made.measured, MotionParameters()), made.measured)
    for p_neither in (0.0, 1.0):
        told: list[str] = []
        refused = replace(drift, p_neither=p_neither, contradicted=True)
        refused.warn(replace(quiet_context(), warn=told.append), corrected=False)
        assert not refused.certain
        assert not refused.ambiguous
        assert len(told) == 1
        assert "texture and rings do not agree" in told[0]
        assert "too little texture" not in told[0]


def test_behind_a_film_of_water_no_drift_is_removed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Flowing water "made the picture grow"; with that removed, radii were .17 mm too small."""
    made, parameters = scene(FEW, 100, noise=0.1, picture_grows=GROWS), MotionParameters(match_bias_px=0.01)
    estimate = estimate_state(made.truth, made.measured, parameters)
    monkeypatch.setattr(steady_scale, "wall_twice", lambda *_: SimpleNamespace(is_certain=True))
    steady = with_steady_scale(
        cast(Any, WholeRun(made)), WHOLE, estimate, made.measured, parameters, lambda *_: None
    )
    assert not steady.corrected
    assert steady.drift.contradicted
    assert steady.scale_sigma is not None


@pytest.mark.parametrize("landmarks", [100, 101, 140])
def test_a_real_drift_is_found_again_and_removed(landmarks: int) -> None:
    """From the last estimate, whose poses follow the drift, .0035 of .005 were removed."""
    made = scene(FEW, landmarks, noise=0.1, picture_grows=GROWS)
    parameters = MotionParameters(match_bias_px=0.01)
    estimate = estimate_state(made.truth, made.measured, parameters)
    steady = with_steady_scale(
        cast(Any, WholeRun(made)), WHOLE, estimate, made.measured, parameters, lambda *_: None
    )
    assert steady.corrected
    assert not steady.drift.contradicted
    assert steady.scale is not None
    assert np.ptp(steady.scale) == pytest.approx(GROWS, rel=0.1)
    assert steady.scale_sigma is not None
    off = steady.scale - GROWS * np.linspace(-0.5, 0.5, FEW)
    assert (np.abs(off - off.mean()) < 2 * steady.scale_sigma).all()
