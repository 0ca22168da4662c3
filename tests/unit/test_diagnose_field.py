"""An inspection alone gives a class, never a name; beside a gauge run it confirms or contradicts."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.physics.effect import CourseKind
from stages.diagnose.channels import Seen
from stages.diagnose.effects.courses import Coursed
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.field import answer
from stages.diagnose.field import unexplained as left
from stages.diagnose.field.against_gauge import _met as met_of
from stages.diagnose.field.against_gauge import met_in_field, not_refuted
from stages.diagnose.field.answer import (
    _alone,
    _met,
    borne_out,
    field_answer,
    with_field,
)
from stages.diagnose.field.evidence import scale_by_line
from stages.diagnose.gauge.fit import fit
from stages.diagnose.gauge.points import runs_across
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.scan import Scored
from stages.diagnose.gauge.search import prepare
from stages.diagnose.inference import Column, Evidence, Score, stated_belief
from stages.diagnose.result import Confirmation, Diagnosis, EffectFound, Location, Value, Verdict
from tests.gauge_runs import made_run, measured_run, stated_probe
from tests.unit.field_evidence import AZIMUTH, NOTHING_STATED, SIGMA, WAVE, field_with


def test_the_scale_of_distance_is_no_surer_than_the_place_of_the_line():
    probe = stated_probe()
    radius_mm, baseline_mm = 50.8, probe.laser.baseline_mm
    xyz_c = np.stack([radius_mm * np.cos(AZIMUTH), radius_mm * np.sin(AZIMUTH), baseline_mm + 0 * AZIMUTH], 1)
    uv = probe.camera.project(xyz_c).uv
    away = uv - probe.camera.centre_px
    outward = away / np.linalg.norm(away, axis=1)[:, None]
    points = SimpleNamespace(probe=probe, uv=uv, outward=outward, radius_mm=radius_mm)
    # 0.08 px are 0.02 to 0.04 mm of radius: dr/dθ is (l² + r²) / l, and a px some 1/360 rad.
    per_px = (baseline_mm**2 + radius_mm**2) / baseline_mm / 360
    assert scale_by_line(points) == pytest.approx(0.08 * per_px / radius_mm, rel=0.25)
    assert scale_by_line(SimpleNamespace(uv=np.zeros((0, 2)))) == 0.0


def test_noise_gives_no_finding():
    random = np.random.default_rng(0)
    for _ in range(30):
        answer = field_answer(field_with(SIGMA * random.standard_normal(400)), LIBRARY, NOTHING_STATED)
        assert answer.shown == ()
        assert answer.global_p > 1e-3


def test_a_tilt_is_a_class_with_its_sizes_and_a_gauge_run_is_recommended():
    noise = SIGMA * np.random.default_rng(1).standard_normal(400)
    field = field_with(2.0 * WAVE @ [0.3, 0.4] + noise)
    answer = field_answer(field, LIBRARY, NOTHING_STATED)
    assert answer.global_p < 1e-9
    assert {s.model.name for s in answer.shown} == {"laser_tilt", "principal_point"}
    assert "laser_cone" not in answer.members
    assert {"laser_tilt", "principal_point", "sensor_tilt"} <= set(answer.members)
    sizes = {s.model.name: np.linalg.norm(s.score.amplitude) for s in answer.shown}
    assert sizes["laser_tilt"] == pytest.approx(0.5, rel=0.02)
    assert sizes["principal_point"] == pytest.approx(2.5, rel=0.02)
    assert "The laser sheet is tilted" in answer.identifiable
    assert answer.next.startswith("A gauge run")
    bare = Diagnosis("field", "", Verdict.NOT_IDENTIFIABLE, 1.0)
    found = _alone(bare, answer, answer, field, with_gauge=False)
    assert found.verdict is Verdict.CLASS
    assert found.effects == ()


def met(agrees):
    return Confirmation("0.60", "0.59", agrees)


@pytest.mark.parametrize(("agrees", "verdict"), [(True, Verdict.NAMED), (False, Verdict.CLASS)])
def test_the_field_confirms_a_name_or_removes_it(agrees, verdict):
    tilt = EffectFound("laser_tilt", 0.99, {"tilt_deg": Value(0.6, 0.01)}, "A tilt.", "")
    named = Diagnosis("field", "gauge", Verdict.NAMED, 1e-9, effects=(tilt,))
    found = _met(named, {"laser_tilt": met(agrees)})
    assert found.verdict is verdict
    assert found.effects[0].confirmed_by[-1].agrees is agrees
    assert bool(found.record_next) is not agrees


def test_a_field_that_cannot_show_an_effect_says_so_and_changes_no_verdict():
    index = EffectFound("outside_index", 0.99, {}, "", "")
    named = Diagnosis("field", "gauge", Verdict.NAMED, 1e-9, effects=(index,))
    found = _met(named, {"outside_index": None})
    assert found.verdict is Verdict.NAMED
    assert "too little of outside_index" in found.shortcomings[0]


def test_no_shortcoming_is_reported_for_a_swing_that_was_not_searched_in_the_inspection(monkeypatch):
    rocking = Term(LIBRARY["laser_rocking"], (1.2,), np.ones(4))
    glass = Term(LIBRARY["outside_index"], (), np.ones(1))
    best = SimpleNamespace(fit=SimpleNamespace(terms=(rocking, glass)))
    monkeypatch.setattr(answer, "field_answer", lambda *_: SimpleNamespace(global_p=1.0))
    field = SimpleNamespace(field=SimpleNamespace(run=SimpleNamespace()), travel=None)
    before = Diagnosis("field", "gauge", Verdict.CLASS, 1e-9)
    gauge = SimpleNamespace(geometry=SimpleNamespace(best=best))
    found = with_field(before, field, gauge, (None, None), stated_probe(), LIBRARY)
    of_rocking, of_glass = found.shortcomings
    assert "laser_rocking" in of_rocking
    assert "neither confirm nor contradict" in of_rocking
    assert "shows too little of outside_index" in of_glass


def evidence_of(model, shape, size):
    """Evidence of one effect whose 1 σ is a hundredth of its plausible size."""
    (amplitude,) = model.amplitudes
    column, own = Column(model.name, amplitude.name, shape), np.array([[(100 / amplitude.plausible) ** 2]])
    return Evidence((column,), own, own @ [size], own, float(size**2 * own[0, 0]), np.array([np.inf]))


@pytest.mark.parametrize(
    ("name", "shape", "told"), [("baseline", (), True), ("baseline_drift", (4.0,), False)]
)
def test_an_inspection_contradicts_constant_effects_but_no_drift_of_the_gauge_run(name, shape, told):
    """A probe that has warmed up in the gauge run does not drift again in the inspection that follows."""
    model, size = LIBRARY[name], 0.2
    fitted = SimpleNamespace(terms=(Term(model, shape, np.array([size])),))
    best = SimpleNamespace(fit=fitted, evidence=evidence_of(model, shape, size))
    field = SimpleNamespace(run=SimpleNamespace(), about=lambda asked: evidence_of(model, shape, 0.02))
    (found,) = met_in_field(SimpleNamespace(best=best), field, NOTHING_STATED)
    assert [c.agrees for c in (found,) if c is not None] == [False] * told


def test_a_clock_that_is_late_in_the_inspection_contradicts_nothing():
    """Beside one of .2 s, a right cone of .357° was "-.740 ± .068 in the inspection alone"."""
    baseline, delay = (LIBRARY[name] for name in ("baseline", "time_offset"))
    columns = tuple(Column(m.name, m.amplitudes[0].name, ()) for m in (baseline, delay))
    information = np.array([[1e4, 3e3], [3e3, 2e3]])
    right = information @ [0.2, 0.2]
    whole = Evidence(columns, information, right, information, 0.0, np.full(2, np.inf))
    term = Term(baseline, (), np.array([0.2]))
    field = SimpleNamespace(run=SimpleNamespace(), about=lambda asked: whole)
    found = met_of(term, np.array([[1e-4]]), field, NOTHING_STATED)
    assert found is not None
    assert found.agrees


@pytest.fixture(scope="module")
def sound_gauge():
    run, start = prepare(measured_run(made_run(3, frames=40)))
    return SimpleNamespace(searched=SimpleNamespace(run=run, nothing=fit(run, start, ())))


def seen_in_the_field(law, size):
    amplitude, covariance = np.array([size]), np.array([[(0.05 * size) ** 2]])
    return Scored(LIBRARY[law], (), Score(amplitude, covariance, 400.0, 1e-80, 400.0), 1)


def test_the_gauge_refutes_effects_that_act_in_every_recording(sound_gauge):
    shown = [seen_in_the_field(*each) for each in (("focal_scale", 0.03), ("dome_axial", 8.0))]
    stated = stated_belief(sound_gauge.searched.nothing.state.stated)
    assert not_refuted(shown, sound_gauge, stated) == ()


def test_the_gauge_does_not_refute_effects_of_the_medium_small_ones_or_drifts(sound_gauge):
    shown = tuple(
        seen_in_the_field(*each)
        for each in (("outside_index", 3e-3), ("focal_scale", 1e-4), ("focal_drift", 0.03))
    )
    stated = stated_belief(sound_gauge.searched.nothing.state.stated)
    assert not_refuted(shown, sound_gauge, stated) == shown


@pytest.mark.parametrize(
    ("before_px", "after_px", "unexplained"),
    [
        (0.39, 0.38, True),
        (0.39, 0.12, False),
        (0.39, 0.2, False),
        (0.2, 0.19, False),
        (0.39, np.nan, False),
    ],
)
def test_a_residual_that_the_likeliest_cause_hardly_reduces_is_unexplained(
    before_px, after_px, unexplained, monkeypatch
):
    """Unstable rows of the sensor were called a wavy sheet, a pixel aspect or an oval pipe."""
    residual, shares = {0: before_px, 1: after_px}, []

    def against_texture(run, terms, encoder_share):
        shares.append(encoder_share)
        return SimpleNamespace(rms_px=residual[len(terms)], floor_px=0.12)

    monkeypatch.setattr(left, "rings_against_texture", against_texture)
    likeliest = seen_in_the_field("laser_cone", 0.1)
    seen = SimpleNamespace(run=SimpleNamespace(), encoder_scale=-0.012)
    doubt = left.why_unexplained(cast(Any, seen), likeliest)
    assert shares == [-0.012, -0.012]
    assert bool(doubt) is unexplained
    field = field_with(2.0 * WAVE @ [0.3, 0.4])
    answer = field_answer(field, LIBRARY, NOTHING_STATED)
    shown = replace(answer, shown=() if doubt else answer.shown)
    found = _alone(Diagnosis("field", "gauge", Verdict.CONSISTENT, 1.0), answer, shown, field, True, doubt)
    assert found.verdict is (Verdict.UNEXPLAINED if unexplained else Verdict.CLASS)
    assert ("no effect of the library" in found.identifiable) is unexplained


@pytest.mark.parametrize(("repeats", "verdict"), [(True, Verdict.UNEXPLAINED), (False, Verdict.CLASS)])
def test_with_an_unexplained_gauge_run_the_inspection_gives_no_class(repeats, verdict, monkeypatch):
    """A class of the inspection was reported, with the words "the gauge run shows none of it"."""
    monkeypatch.setattr(answer, "why_unexplained", lambda field, cause: "")
    monkeypatch.setattr(answer, "not_refuted", lambda shown, gauge, stated: shown)
    monkeypatch.setattr(answer, "location_in_field", lambda field, shown: None)
    where = Location("ring", "camera", None)
    before = Diagnosis(
        "field", "gauge", verdict if repeats else Verdict.CONSISTENT, 0.5, where, identifiable="It repeats."
    )
    field = replace(field_with(2.0 * WAVE @ [0.3, 0.4]), run=SimpleNamespace())
    gauge = SimpleNamespace(geometry=SimpleNamespace(best=None, repeats=repeats))
    found = with_field(before, SimpleNamespace(field=field, travel=None), gauge, (), stated_probe(), LIBRARY)
    assert found.verdict is verdict
    assert bool(found.members) is not repeats
    assert any("none of it" in note for note in found.notes) is not repeats
    assert "It repeats." in found.identifiable
    assert "tilted" in found.identifiable
    assert (found.location == where) is repeats


def test_an_effect_that_the_gauge_refutes_is_unexplained_and_the_text_says_what_it_looks_like():
    noise = SIGMA * np.random.default_rng(1).standard_normal(400)
    field = field_with(2.0 * WAVE @ [0.3, 0.4] + noise)
    answer = field_answer(field, LIBRARY, NOTHING_STATED)
    before = Diagnosis("field", "gauge", Verdict.CLASS, 1.0, members=("subsurface", "line_skew"))
    found = _alone(before, answer, replace(answer, shown=()), field, with_gauge=True)
    assert found.verdict is Verdict.UNEXPLAINED
    assert found.members == ()
    assert "looks like this: The laser sheet is tilted" in found.identifiable
    assert "tell" not in found.record_next
    assert "A gauge run with this probe" not in found.record_next
    assert not any("came or went" in note for note in found.notes)


def test_a_bin_of_an_off_centre_ring_extends_over_several_pixels():
    """Pixel locking is the smaller the farther a bin extends, in gauge run and inspection."""
    bins, azimuth = 72, -np.pi + 2 * np.pi * np.arange(1440) / 1440
    radius = (300 + 20 * np.cos(azimuth))[None].astype(np.float32)
    validity = np.full(radius.shape, RingValidity.VALID, np.uint8)
    validity[0, :100] = RingValidity.OUTLIER
    rings = RingSamples(np.array([7]), azimuth, np.zeros(2), radius, radius, radius, radius, validity)
    at = np.radians([-175.0, 0.0, 40.0, 90.0])
    outward = np.stack([np.cos(at), np.sin(at)], -1)
    across = runs_across(rings, np.array([7]), np.full(4, 7), outward, bins)
    expected = [0.0, *(-20 * np.sin(at[1:]) * 2 * np.pi / bins)]
    assert across == pytest.approx(expected, abs=0.02)


def field_with_step(at_s, size):
    """An inspection of 12 s whose sheet tilts at a time, measured at 40 places of each picture."""
    time, azimuth = np.repeat(np.linspace(0.0, 12.0, 120), 40), np.tile(AZIMUTH[::10], 120)
    wave = 2.0 * np.stack([np.cos(azimuth), np.sin(azimuth)], 1)
    noise = SIGMA * np.random.default_rng(3).standard_normal(len(time))
    signal = size * wave[:, 0] * (time > at_s) + noise

    def about(asked):
        asked = [(m, shape) for m, shape in asked if shape]  # clock and play show nothing here
        patterns = np.concatenate([wave * (time > shape[0])[:, None] for _, shape in asked], 1)
        columns = tuple(Column(m.name, a.name, shape) for m, shape in asked for a in m.amplitudes)
        information, right = patterns.T @ patterns / SIGMA**2, patterns.T @ signal / SIGMA**2
        return Evidence(columns, information, right, information, 0.0, np.full(len(right), np.inf))

    run = SimpleNamespace(measured=SimpleNamespace(time_s=time), recording=SimpleNamespace(frame_rate=30.0))
    return SimpleNamespace(run=run, about=about)


@pytest.mark.parametrize(("size", "told"), [(0.3, True), (0.0, False), (-0.3, False), (0.6, False)])
def test_a_step_of_the_gauge_run_is_confirmed_only_by_the_same_step_whatever_its_time(size, told):
    tilt = Coursed(LIBRARY["laser_tilt"], (), CourseKind.STEP)
    term = Term(tilt, (2.6,), np.array([0.3, 0.0]))
    found = met_of(term, 0.01**2 * np.eye(2), field_with_step(7.1, size), NOTHING_STATED)
    assert (found is not None and found.agrees) is told
    if found is not None:
        assert "at 7." in found.measured


@dataclass(frozen=True)
class Judged:
    """The parts of a gauge run's examination that count here."""

    confirmed: tuple[tuple[Confirmation, ...], ...]


def test_what_the_field_confirms_counts_for_the_gauge_and_what_it_contradicts_does_not():
    gauge = Seen("gauge", Judged(((), (met(True),))), None, None, ())
    assert borne_out(gauge, (met(True), met(False))).geometry.confirmed == ((met(True),), (met(True),))
    assert borne_out(gauge, (None, None)).geometry == gauge.geometry
    assert borne_out(None, ()) is None
