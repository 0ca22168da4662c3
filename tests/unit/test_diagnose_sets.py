"""Sets of effects about one linearisation, against dense brute force."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy import stats

from pipeline.physics.effect import CourseKind
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.effects.courses import Coursed
from stages.diagnose.effects.free_profile import FREE_PROFILES
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.effects.nameless import STEADY, PatternInCourse
from stages.diagnose.effects.vocabulary import GENERIC
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.sets import Member, Sets, believed, cause_of, members_of
from stages.diagnose.inference import INSTRUMENT, PRIOR_PLAUSIBLE, Column, Evidence, Stated
from tests.unit.wall_points import Bore, plain_probe, ring_points

CONE, BASELINE, FOCAL = (LIBRARY[name] for name in ("laser_cone", "baseline", "focal_scale"))
LINE = next(t for t in GENERIC if t.name == "generic_line_0_2")
EFFECTS: tuple[tuple[EffectModel, Shape], ...] = ((CONE, ()), (BASELINE, ()), (FOCAL, ()), (LINE, STEADY))
STATED = Stated(("fx",), np.array([[4.0]]))
ROWS = 300


def columns_of(effects: tuple[tuple[EffectModel, Shape], ...]) -> tuple[Column, ...]:
    return (
        Column(INSTRUMENT, "fx"),
        *(Column(m.name, a.name, shape) for m, shape in effects for a in m.amplitudes),
    )


def evidence_of(design: np.ndarray, measured: np.ndarray, columns: tuple[Column, ...]) -> Evidence:
    a = design.T @ design
    return Evidence(columns, a, design.T @ measured, a, float(measured @ measured), np.full(len(a), np.inf))


def drawn(true: dict[int, float], like: float = 0.0) -> tuple[Sets, np.ndarray, np.ndarray]:
    """Return sets of four with rows and measurements, of which the amplitudes ``true`` are present.

    The pattern equals the cone except for a share ``1 - like`` of noise in its rows.
    """
    random = np.random.default_rng(5)
    sigma = PRIOR_PLAUSIBLE * np.array([m.amplitudes[0].plausible for m, _ in EFFECTS])
    design = random.normal(size=(ROWS, 5)) / np.array([1.0, *sigma])
    if like:
        design[:, 4] = (design[:, 1] * sigma[0] + (1 - like) * design[:, 4] * sigma[3]) / sigma[3]
    measured = random.normal(size=ROWS) + sum(design[:, 1 + k] * size * sigma[k] for k, size in true.items())
    members = [Member(m, shape, 2 * np.log(40)) for m, shape in EFFECTS]
    of = evidence_of(design, np.asarray(measured), columns_of(EFFECTS))
    return Sets.of(of, members, STATED, 1.0), design * np.array([1.0, *sigma]), np.asarray(measured)


def test_the_evidence_of_a_set_is_its_marginal_likelihood_and_its_prior():
    sets, rows, measured = drawn({0: 0.5})

    def exact(chosen: frozenset[int], nameless: bool) -> float:
        used = rows[:, [0, *(1 + k for k in chosen)]]
        covariance = np.eye(ROWS) + used @ np.diag([0.25, *np.ones(len(chosen))]) @ used.T
        likelihood = stats.multivariate_normal(np.zeros(ROWS), covariance).logpdf(measured)
        return float(-2 * likelihood + 2 * len(chosen) * np.log(40) + 2 * np.log(50) * nameless)

    nothing = exact(frozenset(), False)
    for chosen, nameless in ((frozenset({0}), False), (frozenset({1, 2}), False), (frozenset({0, 3}), True)):
        assert sets.deviance(chosen) == pytest.approx(exact(chosen, nameless) - nothing, abs=1e-6)


def test_the_true_set_is_reached_from_a_wrong_one_with_the_right_amplitudes():
    sets, _, _ = drawn({0: 0.6, 1: -0.7})
    met = sets.likely([frozenset({2, 3})], 3)
    best = min(met, key=met.__getitem__)
    assert best == {0, 1}
    told = [a[0] / (PRIOR_PLAUSIBLE * m.amplitudes[0].plausible)
            for m, a in zip((CONE, BASELINE), sets.amplitudes(best), strict=True)]  # fmt: skip
    # 300 rows of noise 1 determine an amplitude to 0.06.
    assert told == pytest.approx([0.6, -0.7], abs=0.25)
    assert max(map(len, met)) == 3


def test_sets_reached_by_adding_a_member_have_their_own_evidence():
    """Two effects and two patterns without a cause: the first pattern alone makes a set less likely."""
    four, _, _ = drawn({0: 0.6})
    other = next(t for t in GENERIC if t.name == "generic_line_0_1")
    sets = replace(four, members=(*four.members[:2], replace(four.members[2], model=other), four.members[3]))
    met = sets.likely([frozenset(), frozenset({0, 3})], 4)
    assert {frozenset({3}), frozenset({0, 2, 3}), frozenset({0, 1})} <= met.keys()
    for chosen, deviance in met.items():
        assert deviance == pytest.approx(sets.deviance(chosen), abs=1e-6)


@pytest.mark.parametrize(
    ("pattern", "like", "left"),
    [
        ("generic_outward_0_2", 0.99, 3),
        ("generic_outward_0_2", 0.8, 4),
        ("generic_line_0_1", 0.8, 3),
        ("generic_line_1_2", 0.8, 4),
    ],
)
def test_a_pattern_that_describes_an_effect_or_is_one_like_it_is_not_its_rival(pattern, like, left):
    """A cone and a line displaced all round are one kind: a wave lost 1 % to a pattern of its order."""
    sets, _, _ = drawn({0: 1.0}, like)
    other = next(t for t in GENERIC if t.name == pattern)
    sets = replace(sets, members=(*sets.members[:3], replace(sets.members[3], model=other)))
    assert len(sets.without_describing_patterns(frozenset({0})).members) == left


def test_differences_are_believed_only_as_far_as_the_spread_of_the_scores_found():
    of = evidence_of(np.eye(5), np.zeros(5), columns_of(EFFECTS))
    assert believed(of, 2.0) == pytest.approx(3.0)
    assert believed(replace(of, score_covariance=9.0 * of.information), 2.0) == pytest.approx(9.0)


def test_a_name_is_a_law_and_an_order_whatever_its_course():
    waves = LIBRARY["sheet_waviness"]
    assert cause_of(waves, (2.0,)) != cause_of(waves, (3.0,))
    assert cause_of(CONE, ()) == ("laser_cone", ())


def test_waves_of_every_order_may_be_in_a_set_whichever_was_best_alone():
    waves = LIBRARY["sheet_waviness"]
    run, found = SimpleNamespace(time_s=np.arange(10.0)), SimpleNamespace(terms=())
    scores = [SimpleNamespace(model=waves, shape=(3.0,)), SimpleNamespace(model=CONE, shape=())]
    members = members_of(cast(Any, run), cast(Any, found), cast(Any, scores), 30)
    assert {m.shape[0] for m in members if m.model is waves} == {2.0, 3.0, 4.0, 5.0, 6.0}
    assert sum(m.model is CONE for m in members) == 1


SETTLING = Coursed(CONE, (), CourseKind.EXPONENTIAL)


def members_beside(model: EffectModel, shape: Shape) -> tuple[Member, ...]:
    """Return the candidates beside one effect that was found in a run of 10 s."""
    run = SimpleNamespace(time_s=np.arange(10.0))
    found = SimpleNamespace(terms=(Term(model, shape, np.full(len(model.amplitudes), 0.5)),))
    return members_of(cast(Any, run), cast(Any, found), (), 30)


def as_found(members: tuple[Member, ...]) -> list[PatternInCourse]:
    """Return the patterns with the course of an effect."""
    models = (m.model for m in members)
    return [m for m in models if isinstance(m, PatternInCourse) and m.like is not None]


def test_beside_an_exponential_effect_patterns_of_the_other_kind_with_its_course_are_candidates():
    """A focal length that changed as no law of the library does was called a cone at .996."""
    members = members_beside(SETTLING, (12.6,))
    beside = as_found(members)
    names = {p.name for p in beside}
    powers = ("0", "1", "2", "3", "any")
    assert names == {f"generic_outward_0_{p} as {SETTLING.name}" for p in powers}
    drift = LIBRARY["focal_drift"]
    beside_drift = as_found(members_beside(drift, (12.6,)))
    assert {p.name for p in beside_drift} == {f"generic_line_0_{p} as focal_drift" for p in powers}
    assert all(m.nameless and m.shape == (12.6,) for m in members if m.model in beside)
    points = ring_points(plain_probe(), Bore(50.8), 90, 1.3)
    outward = next(p for p in beside if p.name.startswith("generic_outward_0_1"))
    steady = next(t for t in GENERIC if t.name == "generic_outward_0_1")
    share = -np.expm1(-points.time_s / 12.6)[:, None]
    moved = share * steady.image_shift_px(points, STEADY, np.array([0.3]))
    assert outward.image_shift_px(points, (12.6,), np.array([0.3])) == pytest.approx(moved)
    assert outward.formula((12.6,)) == "(image outward: a θ^1) × (1 − exp(−t / 12.6 s))"


def test_such_a_pattern_has_the_prior_of_a_steady_one_beside_a_steady_effect():
    def beside(name: str, model: EffectModel, shape: Shape) -> float:
        before = {m.model.name: m.prior_deviance for m in members_beside(model, shape)}
        return before[name] - before[model.name]

    settles = beside(f"generic_outward_0_1 as {SETTLING.name}", SETTLING, (12.6,))
    assert settles == pytest.approx(beside("generic_outward_0_1", CONE, ()))


def test_a_constant_effect_adds_no_patterns_and_a_swing_adds_sine_and_cosine_of_each():
    assert as_found(members_beside(CONE, ())) == []
    beside = as_found(members_beside(LIBRARY["laser_rocking"], (0.7,)))
    assert {len(p.amplitudes) for p in beside if p.name.startswith("generic_outward_1_2")} == {4}
    points = ring_points(plain_probe(), Bore(50.8), 90, 1.3)
    sine, cosine = beside[0].factored(points, (0.7,))[0]
    assert sine**2 + cosine**2 == pytest.approx(np.ones(len(sine)))
    assert beside[0].quantities((0.7,), np.array([3.0, 0.0, 0.0, 4.0])) == {"amplitude": 5.0}


def test_a_free_profile_contains_every_power_of_its_harmonic():
    names = {model.name: len(model.amplitudes) for model, _ in FREE_PROFILES}
    assert names["generic_line_0_any"] == 4
    assert names["generic_outward_1_any"] == 8
