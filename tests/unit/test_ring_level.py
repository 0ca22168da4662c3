"""Gauge runs at ring level: exact by the simulator's own root finding, and repeatable with the same seed."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipeline.geometry.rigid import inverse, transform
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import Course, CourseKind
from pipeline.simulator.build import plain_truth
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import Switch, parse_switch
from pipeline.simulator.prior import read_prior
from stages.calibrate.gauge.geometry import gauge_of
from stages.diagnose.effects.courses import Coursed, with_courses
from stages.diagnose.effects.library import LIBRARY, without
from tests.benchmarks import ring_level
from tests.benchmarks.bench_diagnosis import of_positions, trial_from
from tests.benchmarks.identifiable import concealed_term
from tests.benchmarks.ring_level import Eye, Noise, ring_level_run, seen_at, traced_ring
from tests.benchmarks.ring_level_cases import PRIOR, Mode, drawn, with_a_course
from tests.benchmarks.ring_level_figures import more_figures
from tests.exact_rings import exact_rings

AZIMUTH = np.linspace(-np.pi, np.pi, 24, endpoint=False)
OUTWARD = np.stack([np.cos(AZIMUTH), np.sin(AZIMUTH)], -1)
QUIET = Noise(1e-6, 1e-6, 1e-6, 1e-6, 1e-6)


def scene_of(seed):
    """Return a drawn scene with few frames, and its file."""
    case = drawn(Mode.NULLS, seed)
    return case.scene.model_copy(update={"frames": 24}), case.file


@pytest.mark.parametrize("text", [None, "laser_tilt=0.5@40", "dome_lateral=2@10", "rolling_shutter=0.02"])
def test_a_traced_ring_is_where_the_simulator_finds_it_by_roots(text):
    scene, file = scene_of(3)
    truth = switch_on(plain_truth(scene, file), [parse_switch(text)] if text else ())
    gauge, frame = gauge_of(truth.facts, truth.facts.fiducials), 8
    centre = truth.stated.camera.centre_px
    rho, _ = traced_ring(Eye.at(truth, float(truth.frames.time_s[frame])), gauge, centre, OUTWARD)
    expected = exact_rings(truth, [frame], AZIMUTH, centre)[0]
    assert np.isfinite(rho).sum() > 18
    # The rendered wall has relief of a few µm, which the exact bore lacks.
    assert np.nanmax(np.abs(rho - expected)) < 0.06


def test_a_wall_point_is_seen_by_the_ray_through_it():
    scene, file = scene_of(4)
    truth = plain_truth(scene, file)
    eye = Eye.at(truth, float(truth.frames.time_s[5]))
    xyz_c = np.array([[30.0, 10.0, 25.0], [-20.0, 35.0, 40.0]])
    uv = truth.instrument.camera.model.project(xyz_c).uv
    seen = seen_at(eye, transform(eye.T_pc[0], xyz_c), uv + 2.0)
    assert np.abs(seen - uv).max() < 1e-6
    assert np.abs(transform(inverse(eye.T_pc[0]), transform(eye.T_pc[0], xyz_c)) - xyz_c).max() < 1e-9


@pytest.mark.parametrize("text", ["dome_lateral=2@10", "rolling_shutter=0.02"])
def test_a_fiducial_beyond_the_cameras_view_is_not_measured(text, monkeypatch):
    """A row of the image that is no number ended the benchmark; without a rolling shutter it was measured."""
    scene, file = scene_of(4)
    ray_through = ring_level.viewing_rays

    def none_above(camera, uv):
        origin, ray = ray_through(camera, uv)
        return origin, np.where(uv[:, 1:] < 300, np.nan, ray)

    whole = ring_level_run(scene, file, [parse_switch(text)]).measured.measured.edges
    monkeypatch.setattr(ring_level, "viewing_rays", none_above)
    cut = ring_level_run(scene, file, [parse_switch(text)]).measured.measured.edges
    assert 0 < len(cut.uv) < len(whole.uv)
    assert np.isfinite(cut.uv).all()
    of_one = np.unique(np.stack([cut.frame, cut.marker]), axis=1, return_counts=True)[1]
    assert len(set(of_one)) == 1


def test_the_same_seed_gives_the_same_case_and_another_another():
    one, again, other = drawn(Mode.PAIRS, 7), drawn(Mode.PAIRS, 7), drawn(Mode.PAIRS, 8)
    assert one == again
    assert one.scene.probe != other.scene.probe
    assert len(one.switches) == 2
    assert not drawn(Mode.NULLS, 7).switches


def test_an_effect_moves_the_measurements_and_the_noise_has_its_stated_size():
    scene, file = scene_of(5)
    plain, loud, tilted = (
        ring_level_run(scene, file, switches, noise).measured.source.rings.radius_px
        for switches, noise in (((), QUIET), ((), Noise()), ([parse_switch("laser_tilt=0.3@40")], QUIET))
    )
    spread = np.nanstd(loud - plain)
    assert 0.9 < spread / np.hypot(Noise().ring_px, Noise().ring_cell_px) < 1.1
    assert np.nanstd(tilted - plain) > 5 * spread


def test_effects_left_out_of_the_library_are_not_searched():
    name = drawn(Mode.LEFTOUT, 0).switches[0].name
    assert name == "laser_tilt"
    assert name in of_positions(without([]))
    assert name not in of_positions(without([name]))


def test_every_drawn_effect_can_be_measured_in_rings_or_travel():
    channels = {effect(e.name).channel for e in read_prior(PRIOR).effects}
    assert channels == {"ring", "motion"}


def test_a_scene_of_an_inspection_is_refused():
    scene, file = scene_of(6)
    facts = scene.model_copy(update={"pipe": scene.pipe.model_copy(update={"fiducials": None})})
    with pytest.raises(ValueError, match="no gauge run"):
        ring_level_run(facts, file, ())


def test_cases_of_several_effects_contain_look_alikes_and_repeated_laws():
    cases = [[s.name for s in drawn(Mode.SEVERAL, seed).switches] for seed in range(6)]
    assert all(2 <= len(names) <= 4 for names in cases)
    assert all(names[:2] == ["sheet_waviness"] * 2 for names in cases[2::3])
    assert drawn(Mode.SEVERAL, 5).switches == drawn(Mode.SEVERAL, 5).switches


def test_several_effects_are_scored_name_by_name_and_a_wrong_answer_scores_badly():
    def line(*names: str) -> dict[str, object]:
        effects = [{"name": n, "probability": 1.0} for n in names]
        sets = [{"names": list(names), "probability": 1.0}]
        answer = {"verdict": "named", "effects": effects, "candidates": sets}
        concealed = [["laser_tilt", [0.3, 20.0]], ["baseline", [0.2]]]
        return {"mode": "several", "seed": 1, "concealed": concealed, "left_out": [], "snr": [20.0, 30.0],
                "ideal": [0.999, 0.9], "cpu_s": 1.0, "answer": answer}  # fmt: skip

    cases = [[line("laser_tilt", "baseline")], [line("laser_cone")]]
    right, wrong = ("\n".join(more_figures(c, [trial_from(one) for one in c])) for c in cases)
    assert "names that are right 2 of 2" in right
    assert "could be named (rings, fiducials) 1 of 2" in right
    assert "that could be named, named 1 of 1" in right
    assert "that could not, named 1 of 1" in right
    assert "hold the truth: 1 of 1" in right
    assert "Brier score a case: 0.0000" in right
    assert "names that are right 0 of 1" in wrong
    assert "that could be named, named 0 of 1" in wrong
    assert "hold the truth: 0 of 1" in wrong
    assert "Brier score a case: 3.0000" in wrong


def test_a_concealed_swing_is_sought_at_the_frequency_that_its_frames_show():
    """At 5.73 Hz, in 10 frames a second, the truth was fitted as a swing of 5 Hz."""
    run = SimpleNamespace(time_s=np.arange(61) / 10)
    switch = Switch("laser_rocking", (0.5, 5.73, 20.0))
    term = concealed_term(cast(Any, run), switch, LIBRARY)
    assert term is not None
    assert term.shape[0] == pytest.approx(4.27, abs=0.05)
    order = concealed_term(cast(Any, run), Switch("sheet_waviness", (0.5, 3.0, 20.0)), LIBRARY)
    assert order is not None
    assert order.shape == (3.0,)
    stepping = Switch("laser_tilt", (0.5, 20.0), Course(CourseKind.STEP, (3.0,)))
    assert concealed_term(cast(Any, run), stepping, LIBRARY) is None
    assert concealed_term(cast(Any, run), switch, without(["laser_rocking"])) is None


def test_effects_that_rings_cannot_show_do_not_count_as_excluded():
    """A slip inside the class, and one that was not seen, counted as excluded at less than .001."""

    def told(true: str) -> str:
        effects = [{"name": "laser_tilt", "probability": 0.5}]
        sets = [{"names": ["laser_tilt"], "probability": 1.0}]
        answer = {"verdict": "class", "effects": effects, "candidates": sets, "class": ["laser_tilt", true]}
        line = {"mode": "singles", "seed": 1, "concealed": [[true, [0.3]]], "left_out": [], "snr": [20.0],
                "cpu_s": 1.0, "answer": answer}  # fmt: skip
        return "\n".join(more_figures([line], [trial_from(line)]))

    assert "told with 0 to 0.001 (mean 0.000): there in 1 of 1" in told("baseline")
    assert "told with 0 to 0.001" not in told("encoder_slip")
    assert "no probability is told of: 1" in told("encoder_slip")


@pytest.mark.parametrize(("seed", "key"), [(41, "baseline~ramp"), (66, "focal_scale~ramp")])
def test_courses_are_drawn_from_all_that_the_simulator_can_render(seed, key):
    """Courses no longer searched by the diagnosis were not concealed either: no figure showed the loss."""
    assert drawn(Mode.COURSES, seed).switches[0].key == key
    searched = {(m.law, m.kind) for m in with_courses(LIBRARY).values() if isinstance(m, Coursed)}
    assert searched < set(with_a_course())
