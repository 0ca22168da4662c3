"""The conditions for a name in a gauge run, and for the confirmation of an event."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from stages.diagnose.combine import shown
from stages.diagnose.combine.shown import verdict_of_rings
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.effects.vocabulary import VOCABULARY
from stages.diagnose.gauge import answer, doubts
from stages.diagnose.gauge.confirm import passes_again
from stages.diagnose.gauge.examine import Examined, chance_of
from stages.diagnose.gauge.hypotheses import Instead, Judged
from stages.diagnose.gauge.judge import Unfitted, Verdicts
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.sets import PATTERNS, Member
from stages.diagnose.gauge.unknown_laws import Unknown
from stages.diagnose.result import Confirmation, FitQuality, Location, Value, Verdict

NAMES = "laser_cone", "baseline", "dome_axial", "principal_point", "housing_glass"
AGREES, DIFFERS = Confirmation("1", "1", True), Confirmation("1", "2", False)


def examined(
    shifts_px: tuple[float, ...] = (1.0,), patterns_px: tuple[float, ...] = (), chance: float = 0.9999,
    left: float = 0.5, confirmed: tuple[tuple[Confirmation, ...], ...] = ((AGREES,),), heldout: float = 0.11,
    unknown: float = 0.0, rival_heldout: float = 1.0, grown: float = 0.0, changed: float = 0.0,
) -> Any:  # fmt: skip
    """Return a gauge run in which effects and patterns were found that move rings by so much."""
    law = SimpleNamespace(law="laser_tilt")
    terms = tuple(SimpleNamespace(model=law, shift_px=s) for s in (*shifts_px, *patterns_px))
    library = terms[: len(shifts_px)]
    fit = SimpleNamespace(terms=terms)
    best = SimpleNamespace(
        named=bool(library) and not patterns_px, library_terms=library, fit=fit, heldout=0.0
    )
    rival = SimpleNamespace(named=True, library_terms=terms[:1], laws=("cone",), heldout=rival_heldout)
    other = unknown / (1 + unknown)
    verdicts = SimpleNamespace(
        adequacy=left,
        judged=(best, rival),
        chance_of=lambda term: chance / (1 + unknown),
        instead_of=lambda term: Instead({"image outward": other}, other, 1 - chance / (1 + unknown) - other),
    )
    quality = FitQuality("px", 1.0, 0.1, 1.0, heldout, 0.1)
    return cast(
        Any,
        SimpleNamespace(
            best=best,
            verdicts=verdicts,
            confirmed=confirmed,
            quality=quality,
            unknown_laws=(Unknown(grown, changed),) * len(library),
        ),
    )


@pytest.mark.parametrize(("chance", "verdict"), [(0.986, Verdict.UNEXPLAINED), (0.6, Verdict.CLASS)])
def test_patterns_that_are_each_unlikely_make_a_name_unexplained_unless_other_names_are_likelier(
    chance, verdict, monkeypatch
):
    """A focal length that drifted as no law does was a class of the cone and its companions."""
    monkeypatch.setattr(doubts, "shift_px", lambda fit, term: term.shift_px)
    seen = examined()
    seen.verdicts.chance_of = lambda term: chance
    patterns = {"image outward: a θ^1": 0.008, "image outward: a(θ)": 0.006}
    seen.verdicts.instead_of = lambda term: Instead(patterns, 0.014, 1 - chance - 0.014)
    assert answer.verdict_of(seen) is verdict
    assert answer.unknown_rivals(seen)[:1] == ("image outward: a θ^1",) * (verdict is Verdict.UNEXPLAINED)


@pytest.mark.parametrize(
    ("chance", "heldout", "known"), [(0.986, 0.11, "A cone."), (0.986, 0.3, ""), (0.6, 0.11, "")]
)
def test_known_effects_that_explain_a_run_as_well_as_a_pattern_are_told(chance, heldout, known, monkeypatch):
    """Of a cone beside a shorter focal length, the page said that no known effect explains it."""
    monkeypatch.setattr(doubts, "shift_px", lambda fit, term: term.shift_px)
    monkeypatch.setattr(answer, "effects_found", lambda of: (SimpleNamespace(statement="A cone."),))
    seen = examined(heldout=heldout)
    seen.verdicts.chance_of = lambda term: chance
    seen.verdicts.instead_of = lambda term: Instead({"a θ": 0.008, "a(θ)": 0.006}, 0.014, 0.986 - chance)
    assert answer.known_explanation(seen) == known


def hypotheses(fitted, weighed, laws=25):
    """Return verdicts on sets of effects and of patterns, by name and by number, each with a probability."""
    models = {name: (LIBRARY[name], ()) for name in NAMES} | dict(enumerate(PATTERNS))
    judged = []
    for of, _ in fitted:
        terms = tuple(Term(*models[k], np.zeros(len(models[k][0].amplitudes))) for k in of)
        judged.append(Judged(cast(Any, SimpleNamespace(terms=terms)), cast(Any, None), (), 0.0, 0.0, 0.0))
    sizes = {k: np.zeros(len(model.amplitudes)) for k, (model, _) in models.items()}
    unfitted = tuple(
        Unfitted(tuple(Member(*models[k], 0.0) for k in of), tuple(sizes[k] for k in of), 0.0, p)
        for of, p in weighed
    )
    chance = np.array([p for _, p in fitted])
    return Verdicts((), tuple(judged), chance, 1.0, cast(Any, None), unfitted, laws)


CONE = ("laser_cone",)


@pytest.mark.parametrize(
    ("beside", "class_"),
    [
        # As likely beside the cone as without any run, or less: one in 25 laws.
        (0.03, {"laser_cone", "principal_point"}),
        # The run speaks for it, though it is less likely than the cone alone.
        (0.3, {"laser_cone", "principal_point", "baseline"}),
    ],
)
def test_a_class_leaves_out_laws_that_join_others_without_explaining_more(beside, class_):
    """A tilt that went with distance gave a class of 24 names: all that could not be excluded beside it."""
    weighed = [((*CONE, "baseline"), beside), ((*CONE, "dome_axial"), 0.02), (("principal_point",), 0.06)]
    rest = [((*CONE, "housing_glass"), 0.005), ((*CONE, 3), 0.01)]
    alone = 1 - sum(p for _, p in (*weighed, *rest))
    assert set(hypotheses([(CONE, alone)], [*weighed, *rest]).likely_laws(0.99)) == class_


def test_a_cause_is_left_out_only_if_fewer_explain_the_run_without_a_pattern():
    """A baseline of 2 % was left out beside a cone that took a pattern to explain the run at all."""
    fitted = [((*CONE, "dome_axial"), 0.74), ((*CONE, 0), 0.24), ((*CONE, "baseline"), 0.02)]
    assert set(hypotheses(fitted, [], laws=12).likely_laws(0.99)) == {*CONE, "dome_axial", "baseline"}


@pytest.mark.parametrize(
    ("fitted", "weighed", "nameless", "named", "doubts"),
    [
        # Another name that needs two patterns counts as a name.
        ([(CONE, 0.6)], [(("baseline", 0, 1), 0.4)], 0.0, 0.4, 0),
        # A fitted formula counts as patterns; the set without any effect is neither.
        ([(CONE, 0.51), ((0,), 0.3)], [((k,), 0.0095) for k in range(1, 21)], 0.49, 0.0, 21),
        ([(CONE, 0.51), ((), 0.3), (("baseline",), 0.1)], [((1,), 0.09)], 0.09, 0.1, 1),
        # Sets of two patterns count once.
        ([(CONE, 0.55), (("baseline",), 0.25)], [((k, k + 20), 0.01) for k in range(20)], 0.2, 0.25, 0),
        (
            [(CONE, 0.975), (("baseline",), 0.013)],
            [((k, k + 20), 0.0012) for k in range(10)],
            0.012,
            0.013,
            0,
        ),
    ],
)
def test_each_set_counts_once_with_the_patterns_or_with_other_names(fitted, weighed, nameless, named, doubts):
    """Two patterns beside another name of .4 counted as .8 of patterns, and −.4 of names."""
    verdicts = hypotheses(fitted, weighed)
    instead = verdicts.instead_of(verdicts.judged[0].fit.terms[0])
    assert instead.nameless == pytest.approx(nameless)
    assert instead.named == pytest.approx(named)
    seen = cast(Any, SimpleNamespace(best=verdicts.judged[0], verdicts=verdicts))
    assert len(answer.unknown_rivals(seen)) == doubts


def test_the_pattern_that_is_likelier_summed_over_all_names_comes_first():
    seen = examined((1.0, 1.0))
    each = iter([{"a": 0.3, "b": 0.2}, {"a": 0.02, "b": 0.2}])
    seen.verdicts.instead_of = lambda term: Instead(next(each), 0.3, 0.0)
    assert answer.unknown_rivals(seen) == ("a", "b")


@pytest.mark.parametrize(
    ("heldout_px", "floor_px", "verdict"),
    [
        (0.284, 0.126, Verdict.UNEXPLAINED),
        (0.17, 0.126, Verdict.CONSISTENT),
        (0.284, np.nan, Verdict.CONSISTENT),
        (np.nan, 0.126, Verdict.CONSISTENT),
    ],
)
def test_a_residual_that_repeats_elsewhere_is_not_consistent_though_no_effect_was_found(
    heldout_px, floor_px, verdict
):
    """Unstable sensor rows left .28 px in a gauge run alone, where noise was .13 px: "consistent"."""
    run = SimpleNamespace(width_px=np.full(9, 1.7))
    searched = cast(Any, SimpleNamespace(by_chance=0.5, run=run))
    quality = FitQuality("px", 0.31, 0.3, 0.29, heldout_px, floor_px)
    seen = Examined(searched, None, (), (), quality=quality)
    assert answer.verdict_of(seen) is verdict
    # 15 sound runs, none of which passed the limit, cannot show a smaller probability by chance.
    assert (seen.global_p == pytest.approx(1 / 16)) is (verdict is Verdict.UNEXPLAINED)
    assert bool(seen.shortcomings) is bool(np.isnan([heldout_px, floor_px]).any())
    assert ("0.28 px" in answer.formula(seen)) is (verdict is Verdict.UNEXPLAINED)
    # A second line may cause it if it is bright enough to pull the line that far; effects on poses may not.
    by_motion, faint, high = (
        cast(Any, SimpleNamespace(
            name=name, sure=True, location=Location(channel, None, None),
            parameters={"relative": Value(size, 0.01)},
        ))
        for channel, name, size in (
            ("motion", "encoder_play", 1.0), ("profile", "tube_ghost", 0.05), ("profile", "tube_ghost", 0.3)
        )
    )  # fmt: skip
    assert verdict_of_rings(seen, [by_motion, faint]) is verdict
    assert verdict_of_rings(seen, [by_motion, high]) is Verdict.CONSISTENT


@pytest.mark.parametrize(
    ("seen", "verdict"),
    [
        (examined(), Verdict.NAMED),
        (examined((), (0.5,), confirmed=()), Verdict.UNEXPLAINED),
        (examined(patterns_px=(0.5,)), Verdict.PARTLY),
        (examined(patterns_px=(2.0,)), Verdict.UNEXPLAINED),
        (examined(patterns_px=(0.5,), chance=0.98), Verdict.UNEXPLAINED),
        (examined((1.0, 1.0), confirmed=((AGREES,),) * 2), Verdict.NAMED),
        (examined(left=1e-9), Verdict.UNEXPLAINED),
        (examined(heldout=0.2), Verdict.UNEXPLAINED),
        # Another law predicts held-out parts better, but all measurements together exclude it.
        (examined(rival_heldout=-1.0), Verdict.NAMED),
        (examined(unknown=0.5), Verdict.UNEXPLAINED),
        (examined(confirmed=((AGREES, DIFFERS),)), Verdict.UNEXPLAINED),
        (examined((1.0, 1.0), confirmed=((AGREES,), (AGREES, DIFFERS))), Verdict.PARTLY),
        (examined(confirmed=((),)), Verdict.CLASS),
        (examined(chance=0.98), Verdict.CLASS),
        (examined(grown=0.005), Verdict.NAMED),
        (examined(grown=0.015), Verdict.CLASS),
        (examined(grown=1.5), Verdict.UNEXPLAINED),
        (examined(changed=0.015), Verdict.CLASS),
        (examined(changed=1.5), Verdict.UNEXPLAINED),
    ],
)
def test_a_name_needs_probability_adequacy_separation_and_a_second_prediction(seen, verdict, monkeypatch):
    monkeypatch.setattr(doubts, "shift_px", lambda fit, term: term.shift_px)
    assert answer.verdict_of(seen) is verdict


@pytest.mark.parametrize(("sizes", "possible"), [((-0.1, 0.01), True), ((-0.1, -0.01), False), ((), True)])
def test_a_hypothesis_is_possible_only_if_all_its_sizes_are(sizes, possible):
    # No exposure is shorter than zero; a baseline may be off either way.
    baseline, blur = LIBRARY["baseline"], LIBRARY["motion_blur"]
    each = zip((baseline, blur), sizes, strict=False)
    terms = tuple(Term(m, (), np.full(len(m.amplitudes), size)) for m, size in each)
    fit = cast(Any, SimpleNamespace(terms=terms))
    assert Judged(fit, cast(Any, None), (), 0.0, 0.0, 0.0).possible is possible


@pytest.mark.parametrize(
    ("step_s", "turns_s", "again"), [(3.0, 9.0, False), (3.0, 6.0, True), (0.0, 6.0, False)]
)
def test_a_step_is_confirmed_only_if_the_probe_returns_to_the_wall_before_it(step_s, turns_s, again):
    time_s = np.arange(100) / 10
    T_pc = np.tile(np.eye(4), (100, 1, 1))
    T_pc[:, 2, 3] = 20 * (turns_s - np.abs(time_s - turns_s))
    run = cast(Any, SimpleNamespace(time_s=time_s))
    assert passes_again(run, T_pc, step_s) is again


@pytest.mark.parametrize(("exposure_s", "possible"), [(0.01, True), (-0.01, False)])
def test_an_exposure_shorter_than_zero_is_no_explanation(exposure_s, possible):
    sizes = (np.array([exposure_s]), np.array([0.3, -0.2]))
    members = tuple(Member(LIBRARY[name], (), 0.0) for name in ("motion_blur", "laser_tilt"))
    assert Unfitted(members, sizes, 0.0, 0.0).possible is possible


def test_a_run_in_which_nothing_is_rarer_than_expected_has_a_probability_of_one():
    """The largest p of 144 sound runs was .88."""
    expected = np.linspace(0.0, 8.0, 400)
    p = np.array([chance_of(e) for e in expected])
    assert p[0] == 0.0
    assert p[-1] == 1.0
    assert np.all(np.diff(p) > 0)
    assert chance_of(1e-4) == pytest.approx(0.265e-4, rel=1e-3)
    # Between these, the counts of sound runs are uniform.
    assert p[expected > 2] == pytest.approx(expected[expected > 2] / 8, abs=0.01)


@pytest.mark.parametrize(("pattern", "told"), [("generic_outward_2_0", None), ("generic_line_2_1", "laser")])
def test_what_has_no_name_is_fixed_to_a_place_only_if_effects_and_pattern_agree(pattern, told):
    """A window that shifted the line in one sector was unexplained, but "fixed to the laser"."""
    waves = Term(LIBRARY["sheet_waviness"], (2.0,), np.ones(2))
    model = next(m for m, _ in VOCABULARY if m.name == pattern)
    fits = (SimpleNamespace(fit=SimpleNamespace(terms=(t,))) for t in (waves, Term(model, (), np.ones(2))))
    best, formula = cast(Any, tuple(fits))
    where = Location("ring", "laser", "static", 2)
    seen = cast(Any, SimpleNamespace(best=best, verdicts=SimpleNamespace(formula=formula), location=where))
    found = answer.location(seen, Verdict.UNEXPLAINED)
    assert (found.fixed_to, found.harmonic, found.time) == (told, told and 2, "static")
    assert bool(shown.undecided_place(seen, Verdict.UNEXPLAINED)) is (told is None)
    assert answer.location(seen, Verdict.NAMED) == where
    assert shown.undecided_place(seen, Verdict.NAMED) == ()


@pytest.mark.parametrize(
    ("members", "told"),
    [
        (("laser_cone", "focal_scale", "pupil_shift"), (None, 0, None)),
        (("laser_cone",), ("laser", 0, (1.92, 0.12))),
    ],
)
def test_of_a_class_only_what_all_members_share_is_told(monkeypatch, members, told):
    """A focal length off by .3 % was a class of laser and lens, "fixed to the laser", as r^1.92 ± .12."""
    monkeypatch.setattr(answer, "members", lambda examined: members)
    where = Location("ring", "laser", "static", 0, (1.92, 0.12))
    found = answer.location(cast(Any, SimpleNamespace(location=where)), Verdict.CLASS)
    assert (found.fixed_to, found.harmonic, found.radial_exponent) == told
