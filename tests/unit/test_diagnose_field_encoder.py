"""An inspection beside an encoder whose error is known from a sure name."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipeline.adjustment.rows import Rows
from stages.diagnose import residual
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.field import answer
from stages.diagnose.field.answer import (
    _knowing_encoder,
    _scale_named,
    field_answer,
    with_field,
)
from stages.diagnose.field.evidence import FieldEvidence
from stages.diagnose.field.system import ENCODER_SCALE, FieldSystem
from stages.diagnose.inference import INSTRUMENT, Column, Evidence, Stated
from stages.diagnose.result import Diagnosis, EffectFound, Value, Verdict
from tests.gauge_runs import stated_probe
from tests.unit.field_evidence import SIGMA, WAVE


def field_with_way(tilt, read_short):
    """Evidence of a difference between pictures and encoder, which a baseline also causes, and of a tilt."""
    way, no_ring, no_way = np.linspace(0.0, 200.0, 100), np.zeros((400, 1)), np.zeros((100, 2))
    of_encoder, of_baseline = np.r_[no_ring, way[:, None]], np.r_[no_ring, -0.02 * way[:, None]]
    patterns = np.concatenate([of_encoder, of_baseline, np.r_[2.0 * WAVE, no_way]], axis=1)
    columns = [Column(INSTRUMENT, "encoder_scale")]
    columns += [Column(n, a.name) for n in ("baseline", "laser_tilt") for a in LIBRARY[n].amplitudes]
    noise = SIGMA * np.random.default_rng(2).standard_normal(500)
    signal = patterns @ np.r_[read_short, 0.0, tilt, 0.0] + noise
    information, right = patterns.T @ patterns / SIGMA**2, patterns.T @ signal / SIGMA**2
    misfit, degrees = float(signal @ signal) / SIGMA**2, np.full(4, np.inf)
    return FieldEvidence(None, Evidence(tuple(columns), information, right, information, misfit, degrees))


def seen_with_way(tilt, read_short):
    """An inspection whose scale against the encoder is so far off, with the sheet where it is stated."""
    own = SimpleNamespace(value=read_short, size_sigma=0.001)
    travel = SimpleNamespace(estimate=lambda name: own if name == "encoder_scale" else None)
    return SimpleNamespace(field=field_with_way(tilt, read_short), travel=travel)


def shown_by(seen, known):
    stated = Stated(("encoder_scale",), np.array([[0.002**-2]]))
    field, believed = _knowing_encoder(seen, known, stated)
    return field_answer(field, LIBRARY, believed).shown


def test_an_encoder_known_to_count_short_is_not_taken_for_a_baseline():
    short = Value(-0.012, 0.0007)
    assert [s.model.name for s in shown_by(seen_with_way(0.0, -0.012), None)] == ["baseline"]
    assert shown_by(seen_with_way(0.0, -0.012), short) == ()
    (tilted,) = shown_by(seen_with_way(0.5, -0.012), short)
    assert tilted.model.name == "laser_tilt"
    assert np.linalg.norm(tilted.score.amplitude) == pytest.approx(0.5, rel=0.05)


def test_an_encoder_that_counted_short_in_the_gauge_run_says_nothing_of_the_inspection():
    assert shown_by(seen_with_way(0.0, 0.0), Value(-0.012, 0.0007)) == ()


def test_only_a_sure_name_makes_an_encoder_error_known():
    effect = EffectFound("encoder_scale", 0.99, {"relative": Value(-0.012, 0.0007)}, "It counts short.", "")
    sure = Diagnosis("field", "gauge", Verdict.NAMED, 1e-9, effects=(effect,))
    assert _scale_named(sure) == effect.parameters["relative"]
    assert _scale_named(replace(sure, verdict=Verdict.CLASS)) is None


def with_this_encoder(known, monkeypatch):
    """Return the encoder error with which the effects of a tilted inspection were tested for doubt."""
    shares, seen = [], seen_with_way(0.5, -0.012)
    monkeypatch.setattr(answer, "why_unexplained", lambda field, cause: shares.append(field.encoder_scale))
    monkeypatch.setattr(answer, "location_in_field", lambda field, shown: None)
    # Which recording it is makes no difference, since it is not looked at.
    seen.field = replace(seen.field, run=SimpleNamespace())
    effect = EffectFound("encoder_scale", 0.99, {"relative": known}, "It counts short.", "")
    found = Diagnosis("field", "gauge", Verdict.NAMED, 1e-9, effects=(effect,))
    with_field(found, seen, None, (), stated_probe(), LIBRARY)
    return shares


def test_effects_in_an_inspection_are_tested_with_the_known_encoder_error(monkeypatch):
    (share,) = with_this_encoder(Value(-0.012, 0.0007), monkeypatch)
    assert share == pytest.approx(-0.012 / (1 - 0.012))
    assert with_this_encoder(Value(0.03, 0.0007), monkeypatch) == [0.0]


def test_rings_are_compared_with_texture_with_the_known_encoder_error(monkeypatch):
    """The step back to the stated instrument leads to the encoder's known error, not to a right encoder."""
    asked, row = [], Rows(np.zeros((1, 1), np.int64), np.zeros((1, 1, 7)), np.zeros((1, 3)), *np.ones((2, 1)))
    names = (Column(INSTRUMENT, "cx"), ENCODER_SCALE, Column("laser_cone", "cone_deg"))
    system = FieldSystem((row,), cast(Any, None), names, np.array([0.3, 0.0, 0.0]), np.ones(3))

    def stopped(rows, found, named):
        asked.append(named)
        raise np.linalg.LinAlgError

    monkeypatch.setattr(residual, "field_system", lambda *args: system)
    monkeypatch.setattr(residual, "reduced", lambda *args: None)
    monkeypatch.setattr(residual, "rings_after", stopped)
    run = SimpleNamespace(state=SimpleNamespace(T_pc=np.zeros((1, 4, 4))))
    with pytest.raises(np.linalg.LinAlgError):
        residual.rings_against_texture(run, ((LIBRARY["laser_cone"], (), np.array([0.5])),), -0.012)
    assert asked[0] == pytest.approx([-0.3, -0.012, 0.5])
