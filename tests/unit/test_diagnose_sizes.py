"""Sizes of effects: free shapes, inexact laws, and scores whose spread a large effect must not widen."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipeline.adjustment.normal_equations import Marginal
from stages.diagnose.effects.base import ImagePoints
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.effects.vocabulary import SWINGS
from stages.diagnose.gauge import fit as fitting
from stages.diagnose.gauge.altered_laws import OtherGrowth, other_course
from stages.diagnose.gauge.confirm import Sized, partial_of, quantities
from stages.diagnose.gauge.elimination import Reduced
from stages.diagnose.gauge.fit import Fit
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.scan import freed
from stages.diagnose.gauge.score_spread import score_inflation
from stages.diagnose.inference import Column, Evidence, Stated
from tests.unit.test_diagnose_inference import FRAMES, GLOBALS, equations
from tests.unit.wall_points import Bore, plain_probe, ring_points

DRIFT, TILT = LIBRARY["focal_drift"], LIBRARY["laser_tilt"]


def points_of_a_bore() -> ImagePoints:
    return ring_points(plain_probe(), Bore(50.8), 90, 1.3)


def test_an_effect_with_a_free_shape_equals_the_effect_at_that_shape():
    points = points_of_a_bore()
    free = Term(DRIFT, (3.0,), np.array([0.002, 0.6]), (0.5, 40.0))
    assert len(free.amplitudes) == 2
    shape, amplitude = free.at(free.amplitude)
    moved = DRIFT.image_shift_px(points, shape, amplitude)
    assert moved == pytest.approx(DRIFT.image_shift_px(points, (3.6,), np.array([0.002])))
    assert DRIFT.quantities(shape, amplitude) == {"relative": 0.002, "time_s": 3.6}
    assert free.at(np.array([0.002, -10.0]))[0] == (0.5,)
    assert replace(free, amplitude=np.array([0.002]), bounds=None).at(np.array([0.002]))[0] == (3.0,)


def test_a_law_with_another_growth_has_another_exponent_at_the_reference_and_the_same_pattern():
    reference, size = 50.0, np.array([0.2, 0.1])
    other = OtherGrowth("other", TILT, (), size, of_line=True, reference=reference)
    near, far = (ring_points(plain_probe(), Bore(r), 90, 1.3) for r in (reference, 1.01 * reference))
    law, more = (m.sheet_shift_mm(far, (), a) for m, a in ((TILT, size), (other, np.array([0.3, 0.0]))))
    assert more == pytest.approx(0.3 * (far.radius_mm / reference - 1) * law)
    assert np.log1p(more / law).mean() / np.log(1.01) == pytest.approx(0.3, abs=0.01)
    assert other.sheet_shift_mm(near, (), np.array([0.3, 0.1])) == pytest.approx(0 * law, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "shape", "size"),
    [
        ("laser_tilt", (), [0.2, 0.1]),
        ("centre_drift", (50.0,), [3.0, -4.0]),
        ("laser_rocking", (0.5,), [0.6, 0.0, 0.0, 0.8]),
    ],
)
def test_the_size_of_a_course_is_that_within_the_run(name, shape, size):
    """For a slow drift it is the part reached in the run; for a swing it is the longer axis."""
    random, run_s = np.random.default_rng(2), 8.0
    points = ring_points(plain_probe(), Bore(50.8), 2000, 1.3)
    points = replace(points, time_s=random.uniform(0, run_s, len(points.uv)))
    term = Term(LIBRARY[name], shape, np.array(size))
    other = other_course(term, cast(Any, SimpleNamespace(rings=points)), run_s)

    def mean_square(model, own, amplitude):
        shift = np.column_stack(
            [model.image_shift_px(points, own, amplitude), model.sheet_shift_mm(points, own, amplitude)]
        )
        return np.mean(shift**2)

    waves = [mean_square(other, (), wave) for wave in np.eye(len(other.amplitudes))[1:]]
    longer = {"laser_rocking": np.array([0, 0, 0, 0.8])}.get(name, term.amplitude)
    # Eight waves contain all but 7 % of the course.
    assert sum(waves) == pytest.approx(0.93 * mean_square(term.model, shape, longer), rel=0.05)


def test_sigma_of_a_readout_time_includes_what_errors_of_the_motion_take_from_it():
    """Sizes came out 1 to 9 % too small with a σ of 1 %, as the rates of the fitted poses err."""
    random, model = np.random.default_rng(5), LIBRARY["rolling_shutter"]
    points = ring_points(plain_probe(), Bore(50.8), 2000, 1.3)
    points = replace(points, velocity_px=random.normal(0, 171.0, (2000, 2)))
    # Both as in a simulated run of 10 frames/s that turns.
    fitted = replace(points, velocity_px=points.velocity_px + random.normal(0, 25.0, (2000, 2)))
    true, law = (model.image_shift_px(p, (), np.array([0.03])).ravel() for p in (points, fitted))
    assert 0.01 < 1 - law @ true / (law @ law) < model.law_sigma


def test_sigma_of_a_time_constant_includes_that_of_its_shape():
    free = Term(DRIFT, (3.0,), np.array([0.002, 0.0]), (0.5, 40.0))
    found = quantities(Sized(free, np.diag([1e-5, 0.2]) ** 2))
    assert found["time_s"].value == 3.0
    assert found["time_s"].sd == pytest.approx(0.2, rel=0.15)
    assert found["relative"].sd == pytest.approx(1e-5, rel=0.15)


def test_the_spread_of_scores_is_not_widened_by_a_large_effect_itself():
    random = np.random.default_rng(3)
    e = replace(equations(random, 3000), by_pose=np.zeros((3000, 6)))
    # The effect is strong in some cells and absent in others, as a swing is from frame to frame.
    pattern = np.where(e.cell % 2 == 0, 1.0, 0.0)
    e.by_global[:, 2] = pattern
    e = replace(e, residual=e.residual / np.sqrt(e.weight) - 3 * pattern)
    reduced = Reduced(
        np.eye(GLOBALS),
        np.zeros(GLOBALS),
        0.0,
        np.zeros((FRAMES, 6, GLOBALS)),
        np.zeros((FRAMES, 6)),
        np.zeros(FRAMES),
    )
    left = Marginal(np.eye(GLOBALS), np.zeros(GLOBALS), np.eye(GLOBALS), np.zeros(GLOBALS), 0.0)
    none, fast = np.zeros(0, np.int64), 1e12 * np.eye(GLOBALS)
    alone, degrees = score_inflation(e, reduced, left, none, np.full(GLOBALS, -1), fast)
    explained, _ = score_inflation(e, reduced, left, none, np.array([-1, -1, 0, -1, -1]), fast[1:, 1:])
    assert alone[2] > 5
    # Half of the cells contain all of it.
    assert degrees[2] == pytest.approx(len(np.unique(e.cell)) / 2, rel=0.2)
    assert explained[2] == pytest.approx(1.0, abs=0.5)
    assert explained[[0, 1, 3, 4]] == pytest.approx(alone[[0, 1, 3, 4]])


@pytest.mark.parametrize("swing", SWINGS, ids=lambda s: s.name)
def test_a_swing_repeats_after_its_period_and_is_zero_away_from_the_line(swing):
    points = points_of_a_bore()
    amplitude = np.linspace(0.1, 0.2, len(swing.amplitudes))
    here = swing.wall_shift_mm(points, (4.0,), amplitude)
    later = swing.wall_shift_mm(replace(points, time_s=points.time_s + 0.25), (4.0,), amplitude)
    half = swing.wall_shift_mm(replace(points, time_s=points.time_s + 0.125), (4.0,), amplitude)
    assert np.abs(here).max() > 0.05
    assert later == pytest.approx(here)
    assert half == pytest.approx(-here)
    assert not swing.wall_shift_mm(replace(points, on_line=False), (4.0,), amplitude).any()


def test_a_fit_with_discrete_shapes_stays_and_one_with_a_continuous_shape_gets_one_more_amplitude():
    found = Fit(SimpleNamespace(time_s=np.linspace(0, 8, 81)), None, (Term(TILT, (), np.zeros(2)),), 1.0)
    assert freed(found.run, found) is found
    drifting = replace(found, terms=(*found.terms, Term(DRIFT, (3.0,), np.array([0.002]))))
    tilt, drift = freed(found.run, drifting).terms
    assert tilt is found.terms[0]
    assert (drift.shape, list(drift.amplitude), len(drift.amplitudes)) == ((3.0,), [0.002, 0.0], 2)


@pytest.mark.parametrize("spread", [-0.5, 0.5, 1.0])
def test_after_fiducials_are_removed_rings_have_at_least_independent_errors(spread):
    columns = tuple(Column(TILT.name, a.name) for a in TILT.amplitudes)
    information = 4.0 * np.eye(2)
    of = Evidence(columns, information, information @ [1.0, 2.0], spread * information, 0.0, np.ones(2))
    term = Term(TILT, (), np.array([1.0, 2.0]))
    judged = cast(Any, SimpleNamespace(fit=SimpleNamespace(terms=(term,))))
    found = partial_of("rings", of, judged, term, Stated((), np.zeros((0, 0))))
    assert found is not None
    assert np.diag(found.covariance) == pytest.approx(0.25, rel=0.01)


def test_a_fit_whose_predicted_gain_needs_large_pose_steps_is_not_kept(monkeypatch):
    cost = {"promised": 1.0, "worse": 3.0, "settled": 2.0, "best": 0.5}
    reduced = SimpleNamespace(information=np.eye(1), right=np.array([3.0]))

    def moved(found, step):
        after = "settled" if not step.any() else "worse"
        return (after if found.state == "promised" else "best"), ()

    monkeypatch.setattr(
        fitting, "_at", lambda run, state, terms: SimpleNamespace(
            run=run, state=state, terms=terms, cost=cost[state], reduced=reduced
        )
    )  # fmt: skip
    monkeypatch.setattr(fitting, "_moved", moved)
    monkeypatch.setattr(fitting, "_prior", lambda *_: (np.zeros((1, 1)), np.zeros(1), np.zeros(1)))
    monkeypatch.setattr(fitting, "_still", lambda found: found.state != "promised")
    assert fitting.fit(cast(Any, None), cast(Any, "promised"), ()).state == "best"


def test_the_numbers_below_a_formula_have_its_letters_and_units() -> None:
    """The page said "amplitude = 0.47983, frequency_hz = 0.15075 mm" below a formula in a and f."""
    rocking = next(s for s in SWINGS if s.harmonic == 1)
    told = rocking.equation((0.1512,), np.array([0.3, 0.0, 0.4, 0.0]))
    assert told == "(δr = a (r/50)^2 cos 1(ψ − ψ₀)) × (sin(2π 0.151 Hz t + phase)), a = 0.5 mm"
