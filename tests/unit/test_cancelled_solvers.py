"""When the user asks to stop, every solver ends at its next step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from pipeline.errors import Cancelled
from stages.calibrate.gauge.solve import solve
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.gauge.examine import examine
from stages.motion import MotionParameters
from stages.motion.bundle_adjustment.solver import estimate_state
from tests.gauge_runs import USUAL, GaugeRun, made_run, measured_run
from tests.motion_scene import displaced, scene


@dataclass
class Wish:
    """A request to stop ``after`` some steps of a part; it also records the reported progress."""

    after: int
    part: int = 0
    told: list[tuple[int, ...]] = field(default_factory=list)

    def __call__(self, *progress: int) -> None:
        self.told.append(progress)
        if sum(told[:1] in ((), (self.part,)) for told in self.told) > self.after:
            raise Cancelled("stopped")


@pytest.fixture(scope="module")
def gauge_run() -> GaugeRun:
    return made_run(1, frames=40)


def adjust_motion(gauge_run: GaugeRun, wish: Wish) -> None:
    given = scene(7, 9, noise=1.0, seed=3)
    start = displaced(given.truth, np.random.default_rng(0))
    estimate_state(start, given.measured, MotionParameters(alike=1.0), wish)


def calibrate_gauge(gauge_run: GaugeRun, wish: Wish) -> None:
    run = measured_run(gauge_run)
    solve(run.start, run.measured, run.source, run.posed, USUAL, wish)


def diagnose_gauge(gauge_run: GaugeRun, wish: Wish) -> None:
    few = {name: LIBRARY[name] for name in ("laser_tilt", "baseline")}
    examine(measured_run(gauge_run), few, gauge_run.stated, courses=(), progress=wish)


@pytest.mark.parametrize("solver", [adjust_motion, calibrate_gauge, diagnose_gauge])
def test_a_solver_stops_at_its_next_step(
    gauge_run: GaugeRun, solver: Callable[[GaugeRun, Wish], None]
) -> None:
    wish = Wish(after=3)
    with pytest.raises(Cancelled):
        solver(gauge_run, wish)
    assert len(wish.told) == 4


def test_a_diagnosis_reports_its_progress_and_stops_within_its_search(gauge_run: GaugeRun) -> None:
    wish = Wish(after=3, part=1)
    with pytest.raises(Cancelled):
        diagnose_gauge(gauge_run, wish)
    assert wish.told == sorted(wish.told)
    assert wish.told[-4:] == [(1, 3)] * 4
