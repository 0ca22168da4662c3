"""The gauge's diagnosis on runs traced ray by ray by the simulator, which shares no forward model with it."""

from pathlib import Path

import pytest

from pipeline.simulator.effects.switch import parse_switches
from pipeline.simulator.scene import read_scene
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.gauge.answer import effects_found, formula, verdict_of
from stages.diagnose.gauge.examine import Examined, examine
from stages.diagnose.inference import stated_belief
from stages.diagnose.result import Verdict
from tests.benchmarks.ring_level import ring_level_run

SCENE = Path(__file__).resolve().parents[2] / "configs" / "scenes" / "gauge-4-inch.yaml"
# Few effects keep the test short; among them what a tilt is taken for.
FEW = ("laser_tilt", "laser_cone", "baseline", "principal_point", "tube_tilt")


def seen(switches: tuple[str, ...], names: tuple[str, ...], seed: int) -> Examined:
    scene = read_scene(SCENE).model_copy(update={"seed": seed, "frames": 120, "frame_rate": 15.0})
    run = ring_level_run(scene, SCENE, parse_switches(switches) if switches else ())
    return examine(run.measured, {name: LIBRARY[name] for name in names}, run.truth.stated)


def test_a_run_with_nothing_hidden_is_consistent_and_tells_what_it_could_see():
    found = seen((), FEW, 61)
    assert verdict_of(found) is Verdict.CONSISTENT
    assert found.global_p > 1e-3
    assert {f.name for f in found.feasibility} == set(FEW)
    assert found.quality is not None
    assert found.quality.rms_after == pytest.approx(found.quality.noise_floor, rel=0.05)


def test_a_tilt_is_named_with_its_size():
    found = seen(("laser_tilt=0.3@-70",), FEW, 62)
    (effect,) = effects_found(found, stated_belief(found.searched.nothing.state.stated))
    assert verdict_of(found) is Verdict.NAMED
    size = effect.parameters["tilt_deg"]
    assert size.value == pytest.approx(0.3, abs=4 * size.sd)
    assert size.sd < 0.03


def test_a_tilt_that_the_library_lacks_is_not_misnamed_but_described():
    found = seen(("laser_tilt=0.3@-70",), tuple(n for n in FEW if n != "laser_tilt"), 62)
    assert verdict_of(found) is Verdict.UNEXPLAINED
    assert found.location is not None
    assert found.location.harmonic == 1
    assert "cos 1(ψ − ψ₀)" in formula(found)
