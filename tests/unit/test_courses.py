"""Courses of effects over time or motion.

What they mean in the simulator and in the library of the diagnosis.
"""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import COURSES, Course, CourseKind
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import parse_switch, parse_switches, switches_from_mapping
from pipeline.simulator.laws import bench_truth
from pipeline.simulator.prior import Concealable, draw_pair, read_prior
from stages.diagnose.effects.courses import SEARCHED, Coursed, with_courses
from stages.diagnose.effects.free_profile import patterns_in_course
from stages.diagnose.effects.library import LIBRARY, columns, ring_shift_px, texture_shift_px, without
from stages.diagnose.gauge.answer import _in_the_end
from stages.diagnose.gauge.confirm import Sized
from stages.diagnose.gauge.run import Term
from tests.shared_data import PROJECT_ROOT
from tests.unit.wall_points import Bore, plain_probe, ring_points, texture_points

RING_LEVEL = PROJECT_ROOT / "tests" / "benchmarks" / "ring_level.yaml"
BORE = Bore(42.0, (4.0, -7.0, 0.0), (0.03, -0.02, 1.0))


@pytest.mark.parametrize(
    ("course", "factor"),
    [
        (Course(), 1.0),
        (Course(CourseKind.STEP, (2.9,)), 1.0),
        (Course(CourseKind.STEP, (3.1,)), 0.0),
        (Course(CourseKind.RAMP, (6.0,)), 0.5),
        (Course(CourseKind.EXPONENTIAL, (3.0,)), 1 - np.exp(-1)),
        (Course(CourseKind.SINUSOID, (0.25, 0.0)), -1.0),
        (Course(CourseKind.SINUSOID, (0.25, 90.0)), 0.0),
        (Course(CourseKind.SPEED, (20.0,)), -0.4),
        (Course(CourseKind.REVERSAL), -1.0),
        (Course(CourseKind.DISTANCE, (100.0,)), 0.3),
    ],
)
def test_a_course_scales_the_size_of_its_effect(course, factor):
    assert course.factor(3.0, 30.0, -8.0) == pytest.approx(factor, abs=1e-12)
    assert course.factor(np.full(4, 3.0), np.full(4, 30.0), np.full(4, -8.0)).shape == (4,)


def test_a_course_with_a_wrong_number_is_refused():
    with pytest.raises(InputError, match="time_s"):
        Course(CourseKind.STEP)
    with pytest.raises(InputError, match="does not fit"):
        Course(CourseKind.SPEED, (0.0,))


def test_a_switch_with_a_course_is_read_back_from_its_text():
    switch = parse_switch("laser_tilt~step=0.35@25/4.6s")
    assert switch.course == Course(CourseKind.STEP, (4.6,))
    assert parse_switch(switch.text) == switch
    assert switch.truth == ["laser_tilt", [0.35, 25.0], {"kind": "step", "time_s": 4.6}]
    assert switches_from_mapping({switch.key: switch.numbers}, "scene") == (switch,)
    assert len(parse_switches(["laser_tilt=0.1@0", switch.text])) == 2
    with pytest.raises(InputError, match="given twice"):
        parse_switches([switch.text, switch.text])
    with pytest.raises(InputError, match="constant, step"):
        parse_switch("laser_tilt~jump=0.35")


def test_the_simulated_sheet_is_displaced_at_its_time_and_other_changes_stay():
    texts = ["laser_tilt~step=0.35@25/4.6s", "baseline~ramp=0.2/8s", "laser_tilt=0.1@115"]
    truth = switch_on(bench_truth(50.8), parse_switches(texts))
    start = float(truth.frames.time_s[0])
    before, after = (truth.instrument_at(start + t).laser.sheet for t in (4.5, 4.7))
    along = np.array([np.cos(np.radians(25)), np.sin(np.radians(25))])
    leap = np.array([after.tilt_x - before.tilt_x, after.tilt_y - before.tilt_y])
    assert np.degrees(np.arctan(leap @ along)) == pytest.approx(0.35, rel=1e-4)
    assert np.hypot(before.tilt_x, before.tilt_y) == pytest.approx(np.tan(np.radians(0.1)), rel=1e-6)
    assert after.baseline_mm - before.baseline_mm == pytest.approx(0.2 * 0.2 / 8, rel=1e-6)


@pytest.mark.parametrize("drift", ["baseline_drift", "focal_drift", "centre_drift"])
def test_a_ramp_and_a_slow_drift_are_nearly_the_same_curve_and_both_are_searched(drift):
    """With one of them alone, the other got a wrong name, or none where its size was out of range."""
    points = ring_points(plain_probe(), BORE, 90, 1.3)
    run_s = 8.0
    points = replace(points, time_s=np.linspace(0, run_s, len(points.uv)))
    model = LIBRARY[drift]
    ramp = with_courses(LIBRARY)[f"{model.static.name}, ramp"]
    slow = model.shapes(run_s, 15.0)[-1]
    drifting, even = columns(model, points, slow), columns(ramp, points, (run_s,))
    left = drifting - even @ np.linalg.lstsq(even, drifting)[0]
    assert np.linalg.norm(left) < 0.02 * np.linalg.norm(drifting)


@pytest.mark.parametrize("text", ["ovality~step=0.1", "encoder_scale~ramp=0.01"])
def test_effects_outside_the_instrument_have_no_course(text):
    with pytest.raises(InputError, match="cannot change with time"):
        switch_on(bench_truth(50.8), [parse_switch(text)])


def coursed(name, kind, own=()):
    return Coursed(LIBRARY[name], own, kind)


@pytest.mark.parametrize("name", ["laser_tilt", "principal_point", "sensor_tilt"])
def test_a_step_is_zero_before_its_time_and_the_law_itself_after(name):
    model, law = coursed(name, CourseKind.STEP), LIBRARY[name]
    size = np.array([a.plausible for a in law.amplitudes])
    for points, shift in (
        (ring_points(plain_probe(), BORE, 40), ring_shift_px),
        (texture_points(plain_probe(), BORE), texture_shift_px),
    ):
        assert not np.any(shift(model, points, (5.1,), size))
        assert np.array_equal(shift(model, points, (4.9,), size), shift(law, points, (), size))


def test_a_swing_has_the_phase_and_size_of_its_sine_and_cosine():
    model = coursed("principal_point", CourseKind.SINUSOID)
    sine, cosine = np.array([0.3, 0.4]) * np.cos(0.7), np.array([0.3, 0.4]) * np.sin(0.7)
    amplitude = np.concatenate([sine, cosine])
    assert model.course((1.3,), amplitude)["frequency_hz"] == 1.3
    size, phase = model.quantities((1.3,), amplitude), model.course((1.3,), amplitude)["phase_deg"]
    along = size["shift_px"] * np.exp(1j * np.radians(size["direction_deg"]))
    # The other end of the axis with the opposite phase is the same swing.
    back = np.cos(np.radians(phase) - 0.7)
    assert along * back == pytest.approx(0.3 + 0.4j, abs=1e-9)
    points = ring_points(plain_probe(), BORE, 40, time_s=2.0)
    moved = model.image_shift_px(points, (1.3,), amplitude)
    assert moved[0] == pytest.approx(np.array([0.3, 0.4]) * np.sin(2 * np.pi * 1.3 * 2.0 + 0.7))


def test_a_course_over_distance_uses_the_cameras_distance_not_that_of_the_wall_it_sees():
    points = ring_points(plain_probe(), BORE, 40)
    ahead = np.sum(points.xyz_c * points.along_c, axis=1)
    points = replace(points, distance_mm=75.0 + ahead)
    model = coursed("baseline", CourseKind.DISTANCE)
    assert model.sheet_shift_mm(points, (150.0,), np.array([0.2])) == pytest.approx(0.1)


def test_the_library_has_every_movable_law_with_every_course_and_no_combination_twice():
    every = with_courses(LIBRARY)
    assert len({m.name for m in every.values()}) == len(every)
    assert {m.kind for m in every.values()} >= set(SEARCHED)
    assert "baseline, exponential" not in every
    assert "laser_tilt, step" in every
    left = with_courses(without(["laser_tilt"]))
    assert not any(m.law == "laser_tilt" for m in left.values())


def test_sentences_and_equations_state_the_course_and_columns_its_derivative():
    points = ring_points(plain_probe(), BORE, 24)
    for model in with_courses(LIBRARY).values():
        if not isinstance(model, Coursed):
            continue
        shape = model.shapes(8.0, 30.0)[0]
        size = np.array([a.plausible for a in model.amplitudes])
        numbers = model.course(shape, size)
        assert set(numbers) == {q.name for q in COURSES[model.kind]}
        assert all(name in model.equation(shape, size) for name in numbers)
        assert model.statement(shape, size).endswith(").")
        if shape:
            assert np.isfinite(columns(model, points, shape)).all()


def test_a_prior_draws_an_effect_with_its_course():
    knocked = {"name": "laser_tilt", "course": "step", "others": {"time_s": (1.0, 6.0)}}
    drawn_from = read_prior(RING_LEVEL).model_copy(
        update={"effects": (Concealable.model_validate(knocked),), "concealed": (0.0, 1.0)}
    )
    ((name, values),) = draw_pair(drawn_from, RING_LEVEL, 3, 0).gauge.effects.items()
    assert name == "laser_tilt~step"
    assert 1.0 <= values["time_s"] <= 6.0
    with pytest.raises(ValueError, match="has no quantity 'period_s'"):
        Concealable.model_validate(knocked | {"others": {"period_s": (1.0, 6.0)}})


@pytest.mark.parametrize(("name", "per_s"), [("baseline_drift", "0.0128 mm"), ("focal_drift", "1.2766%")])
def test_a_drift_slower_than_its_run_is_described_by_its_initial_growth(name, per_s):
    """Formerly the sentence gave only its size in the end, .66 ± 1.06 mm after a growth of .1 mm."""
    told = LIBRARY[name].statement((51.2,), np.array([-0.66]))
    assert f"shorter, by {per_s} in the first second" in told
    assert "-" not in told
    assert "end" not in told


def test_an_exponential_law_without_a_separate_name_is_described_by_its_initial_growth():
    settles = Coursed(LIBRARY["laser_tilt"], (), CourseKind.EXPONENTIAL)
    told = settles.statement((51.2,), np.array([0.0, -10.0]))
    assert "tilted by 0.193°" in told
    assert "in the first second, with a time constant of 51.2 s" in told


@pytest.mark.parametrize(
    ("name", "shape", "sigma", "words"),
    [
        ("baseline_drift", (3.5,), 0.0013, "0.301 mm nearer to the camera than stated, ± 0.001 mm."),
        (
            "focal_drift",
            (3.5,),
            0.0013,
            "30.100% shorter than stated, and the image that much smaller, ± 0.1%.",
        ),
        (
            "pixel_aspect, exponential",
            (3.5,),
            0.0013,
            "30.100% narrower against its height than stated, ± 0.1%.",
        ),
        ("baseline_drift", (3.5,), 0.2, ""),
        ("baseline_drift", (3.5,), np.nan, ""),
        ("baseline_drift", (8.1,), 0.0013, ""),
        ("baseline", (), 0.0013, ""),
    ],
)
def test_the_end_of_a_drift_is_stated_with_its_sigma_where_it_is_known(name, shape, sigma, words):
    term = Term(with_courses(LIBRARY)[name], shape, np.array([-0.301]))
    told = _in_the_end(Sized(term, np.array([[sigma**2]])), duration_s=8.0)
    assert told.startswith(" In the end, the ") is bool(words)
    assert told.endswith(words)
    assert bool(told) is bool(words)


def test_the_end_of_a_tilt_with_a_free_time_constant_is_stated_by_its_two_components():
    """The fitted time constant is one more amplitude; taken for a third component it ended the program."""
    model = with_courses(LIBRARY)["laser_tilt, exponential"]
    term = Term(model, (3.5,), np.array([3.0, 4.0, 0.1]), bounds=(1.0, 20.0))
    told = _in_the_end(Sized(term, np.diag([1e-4, 1e-4, 1e-4])), duration_s=8.0)
    same = Sized(Term(model, (3.6,), np.array([3.0, 4.0])), np.diag([1e-4, 1e-4]))
    assert told.split(" ±")[0] == _in_the_end(same, duration_s=8.0).split(" ±")[0] != ""


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("baseline_drift", "by 0.00190 mm in the first 60 s, with a time constant of 600.0 s"),
        ("centre_drift", "by 0.00190 px in the first 60 s, with a time constant of 600.0 s"),
        ("laser_cone, exponential", "lean 0.002° more forward"),
    ],
)
def test_the_growth_of_a_drift_over_ten_minutes_is_not_stated_as_zero(name, words):
    """A baseline that grew by .02 mm in ten minutes was longer "by 0.0000 mm in the first second"."""
    model = with_courses(LIBRARY)[name]
    size = np.array([0.02, 0.0])[: len(model.amplitudes)]
    assert words in model.statement((600.0,), size)
    assert "in the first 60 s" in model.statement((600.0,), size)


@pytest.mark.parametrize(
    ("like", "goes_with"),
    [
        ("laser_rocking", ("camera", "periodic")),
        ("focal_drift", ("time", "drift")),
        ("laser_tilt, step", ("camera", "event")),
        ("laser_tilt, speed", ("camera", "speed")),
    ],
)
def test_a_generic_pattern_follows_its_course(like, goes_with):
    model = with_courses(LIBRARY)[like]
    harmonic = effect(model.law).harmonic
    for pattern in patterns_in_course(model, harmonic):
        fixed_to, time, order = pattern.goes_with((1.2,))
        assert (str(fixed_to), time, order) == (*goes_with, harmonic)
