"""An inspection decides whether the probe file gets the correction that a gauge run suggests."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from stages.diagnose.inference import INSTRUMENT, Column, Evidence
from stages.diagnose.result import FitQuality
from stages.diagnose.written_probe import decided, log_ratio

NAMES = ("tilt_x", "tilt_y")
PROBE = SimpleNamespace(
    parameter_names=NAMES, parameters=np.zeros(2), covariance=np.eye(2), encoder_scale_sigma=1e-3
)
TILT = np.array([0.3, 0.0])
WORSE = FitQuality("px", 0.364, 0.064, 2.776, 2.862, 0.83)
BETTER = FitQuality("px", 0.364, 0.064, 0.143, 0.081, 0.83)


def inspection(true: Any, information: float, alike: float = 1.0, noise: float = 0.0) -> Any:
    """Return evidence of a probe whose parameters are off by ``true``; ``alike`` errors count as one."""
    size = information * np.eye(2)
    right = size @ np.asarray(true) + noise * np.sqrt(alike * information)
    columns = tuple(Column(INSTRUMENT, n) for n in NAMES)
    whole = Evidence(columns, size, right, alike * size, 0.0, np.full(2, np.inf))
    return SimpleNamespace(about=lambda asked: whole)


def correction(step: Any, inexpressible: str = "") -> Any:
    return SimpleNamespace(
        probe=SimpleNamespace(parameters=np.asarray(step)), applied=("laser_tilt",),
        inexpressible=(inexpressible,) if inexpressible else (), beyond_probe=inexpressible,
    )  # fmt: skip


def answer(*probability: float, fit: FitQuality = WORSE) -> Any:
    effects = tuple(SimpleNamespace(name="laser_tilt", probability=p) for p in probability)
    return cast(Any, SimpleNamespace(fit=fit, effects=effects))


def test_the_likelihoods_of_both_probes_are_those_of_the_scores() -> None:
    """Of independent errors, ln of the ratio is half the difference of the sums of squares."""
    seen = inspection([0.25, 0.1], 400.0)
    squares = [400 * np.sum((np.array([0.25, 0.1]) - at) ** 2) for at in (np.zeros(2), TILT)]
    assert log_ratio(seen, correction(TILT), cast(Any, PROBE)) == pytest.approx((squares[0] - squares[1]) / 2)
    four_alike = log_ratio(inspection([0.25, 0.1], 400.0, 4.0), correction(TILT), cast(Any, PROBE))
    assert four_alike == pytest.approx((squares[0] - squares[1]) / 8)


def test_a_right_correction_is_kept_although_rings_by_poses_of_bare_steel_lie_farther_off() -> None:
    """Beside a tilt of 13 σ, 2.78 px with an error of the poses became 2.86 px: the right probe was withheld.

    The inspection itself tells 1.7 σ apart, and says for the correction what it can.
    """
    seen = inspection(TILT, 32.0, noise=-0.6)
    kept = decided(answer(0.997), seen, correction(TILT), cast(Any, PROBE))
    assert kept.written
    # Beside a step of the gauge run, what was held out is of that run, and no rings of the inspection.
    assert "although held-out measurements lie 2.86 px" in kept.notes[0]


@pytest.mark.parametrize("probability", [0.5, 0.997])
def test_a_correction_that_the_inspection_excludes_is_withheld(probability: float) -> None:
    seen = inspection([0.0, 0.0], 400.0)
    withheld = decided(answer(probability), seen, correction(TILT), cast(Any, PROBE))
    assert not withheld.written
    assert "times as likely" in withheld.notes[0]


def test_what_the_inspection_hardly_shows_is_decided_by_the_gauge_run() -> None:
    seen = inspection([0.0, 0.0], 32.0)
    assert not decided(answer(0.5), seen, correction(TILT), cast(Any, PROBE)).written
    assert decided(answer(0.997), seen, correction(TILT), cast(Any, PROBE)).written


@pytest.mark.parametrize("delay_s", [-0.2, 0.2])
def test_a_clock_that_is_late_in_the_inspection_does_not_speak_about_the_probe(delay_s: float) -> None:
    """Of a right cone, one that was .2 s late made the inspection e^72 times as likely instead of e^26."""
    columns = (*(Column(INSTRUMENT, n) for n in NAMES), Column("time_offset", "delay_s"))
    size = np.array([[100.0, 0, 90], [0, 100, 0], [90, 0, 1e3]])
    right = size @ np.array([*TILT, delay_s])
    whole = Evidence(columns, size, right, size, 0.0, np.full(3, np.inf))
    seen: Any = SimpleNamespace(about=lambda asked: whole)
    alone = 100 - 90**2 / 1e3
    assert log_ratio(seen, correction(TILT), cast(Any, PROBE)) == pytest.approx(0.3**2 * alone / 2)


def test_a_correction_withheld_although_the_inspection_is_for_it_says_how_unlikely_it_is() -> None:
    """A cone of .35: the stated probe was "0.84 times as likely, which outweighs" the gauge run."""
    seen = inspection(TILT, 4.0)
    (note,) = decided(answer(0.15), seen, correction(TILT), cast(Any, PROBE)).notes
    assert "1.2 times as likely with the corrected probe as with the stated one" in note
    assert "a probability of 0.15" in note


def test_the_least_certain_of_two_effects_of_a_name_counts() -> None:
    """Of waves of two orders, the last one counted; and of probability 0, the odds were the log of 0."""
    seen = inspection(TILT, 4.0)
    for each in ((0.2, 0.997), (0.997, 0.2), (0.0,)):
        assert not decided(answer(*each), seen, correction(TILT), cast(Any, PROBE)).written


@pytest.mark.parametrize("toward", [-1e-9, 1e-9])
@pytest.mark.parametrize(("fit", "written"), [(WORSE, False), (BETTER, True)])
def test_where_the_odds_are_even_held_out_measurements_decide(toward: float, fit: Any, written: bool) -> None:
    """A correction without a name was written or not by the sign of 1e-9."""
    seen = inspection(TILT * (0.5 + toward), 32.0)
    assert decided(answer(fit=fit), seen, correction(TILT), cast(Any, PROBE)).written == written


@pytest.mark.parametrize("seen", [None, inspection(TILT, 400.0)])
def test_a_written_probe_that_cannot_express_an_effect_says_so(seen: Any) -> None:
    """A window of glass was named, and the probe file without it was called corrected."""
    made = correction(TILT, "housing_glass")
    told = decided(answer(0.9, fit=BETTER), seen, made, cast(Any, PROBE))
    assert told.written
    assert "cannot express housing_glass" in told.notes[-1]


def test_an_inspection_that_determines_nothing_leaves_the_decision_to_the_gauge_run() -> None:
    def undetermined(asked: Any) -> Evidence:
        raise np.linalg.LinAlgError

    seen: Any = SimpleNamespace(about=undetermined)
    (note,) = decided(answer(0.997), seen, correction(TILT), cast(Any, PROBE)).notes
    assert "2.78 without" in note


def test_without_an_inspection_held_out_parts_of_the_gauge_run_decide() -> None:
    withheld = decided(answer(0.997), None, correction(TILT), cast(Any, PROBE))
    assert not withheld.written
    (note,) = withheld.notes
    assert "2.86 px" in note
    assert "2.78 without" in note
    assert "refutes no effect" in note
