"""Longer exposures make pictures late: the line's width separates that from late readings, or cannot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from pipeline.instrument.probe import Probe
from pipeline.recording.base import Encoder, Recording
from stages.diagnose.combine.late_pictures import Exposure, how_late
from stages.diagnose.correct import with_true_readings
from stages.diagnose.result import Value, Verdict
from stages.diagnose.travel.events import with_events
from stages.diagnose.travel.evidence import TravelEstimate, _estimates
from stages.diagnose.travel.model import TravelFit
from tests.diagnosed import DIFFERS, answer
from tests.travel_cases import read
from tests.travel_cases import seen as sight
from tests.unit.late_pictures import late, sizes


@pytest.mark.parametrize(
    ("delay_s", "width_ms", "named"),
    [
        (0.008, (0.0, 1.0), {"time_offset": 0.008}),
        (0.008, (16.0, 1.0), {"motion_blur": 0.016}),
        # The delay beyond half of the exposure is the encoder's own.
        (0.018, (16.0, 1.0), {"motion_blur": 0.016, "time_offset": 0.010}),
        (-0.010, (16.0, 1.0), {"motion_blur": 0.016, "time_offset": -0.018}),
        # Early readings, and exposures longer than the time between pictures, are not explained by an
        # exposure.
        (-0.008, None, {"time_offset": -0.008}),
        (0.05, None, {"time_offset": 0.05}),
    ],
)
def test_pictures_late_by_half_an_exposure_are_distinguished_from_late_readings(
    real_probe: Probe, thirty_a_second: TravelFit, delay_s: float, width_ms: tuple[float, float] | None,
    named: dict[str, float],
) -> None:  # fmt: skip
    found = answer(real_probe, None, late("gauge", thirty_a_second, delay_s, width_ms))
    assert found.verdict is Verdict.NAMED
    assert found.members == ()
    assert sizes(found) == pytest.approx(named)


@pytest.mark.parametrize("width_ms", [None, (16.0, 9.0)])
def test_late_pictures_and_late_readings_are_a_class_where_the_width_does_not_decide(
    real_probe: Probe, thirty_a_second: TravelFit, width_ms: tuple[float, float] | None
) -> None:
    found = answer(real_probe, None, late("gauge", thirty_a_second, 0.008, width_ms))
    assert found.verdict is Verdict.CLASS
    assert set(found.members) == {"time_offset", "motion_blur"}
    assert sizes(found) == pytest.approx({"time_offset": 0.008})
    assert 0.45 < found.effects[0].probability < 0.5
    assert found.location is not None
    assert (found.location.fixed_to, found.location.time) == (None, "speed")


@pytest.mark.parametrize(
    ("width_ms", "named"),
    [((16.0, 1.0), {"motion_blur": 0.016, "time_offset": 0.007}), ((0.0, 1.0), {"time_offset": 0.015})],
)
def test_the_width_in_one_recording_is_used_for_the_delay_in_the_other(
    real_probe: Probe, thirty_a_second: TravelFit, width_ms: tuple[float, float], named: dict[str, float]
) -> None:
    field = late("field", thirty_a_second, 0.015, None)
    found = answer(real_probe, field, late("gauge", thirty_a_second, None, width_ms))
    assert found.verdict is Verdict.NAMED
    assert sizes(found) == pytest.approx(named)


def test_an_exposure_longer_than_the_time_between_pictures_is_unsure_and_changes_no_delay(
    real_probe: Probe, thirty_a_second: TravelFit
) -> None:
    """60 ms of 33 were named, and half of it was subtracted from a delay of 8 ms: -22 ms, stated as sure."""
    found = answer(real_probe, None, late("gauge", thirty_a_second, 0.008, (60.0, 5.0)))
    assert sizes(found).get("time_offset", 0.008) == pytest.approx(0.008)
    assert all(e.probability < 0.6 for e in found.effects if e.name == "motion_blur")
    alone = answer(real_probe, None, late("gauge", thirty_a_second, None, (60.0, 5.0)))
    assert alone.verdict is Verdict.CLASS
    assert "encoder" not in alone.identifiable, "without an encoder the delay would be unknown"
    assert "no picture has time: the next begins after 33.3 ms" in alone.identifiable


@pytest.mark.parametrize(("delay_s", "late_s"), [(0.0, 0.0), (0.0004, 0.0), (0.008, 0.008), (0.0085, 0.008)])
def test_an_exposure_is_corrected_only_as_far_as_the_encoder_shows_it(
    real_probe: Probe, thirty_a_second: TravelFit, delay_s: float, late_s: float
) -> None:
    """Stamps of the middle of 16 ms.

    An "own delay" of -8 ms was named, or all readings were shifted by it.
    """
    found = answer(real_probe, None, late("gauge", thirty_a_second, delay_s, (16.0, 1.0)))
    assert sizes(found) == pytest.approx({"motion_blur": 0.016})
    assert found.effects[0].parameters["late_s"].value == pytest.approx(late_s)
    encoder = Encoder(np.arange(0.0, 8.0, 0.01), 20 * np.arange(0.0, 8.0, 0.01))
    recording = Recording(
        "r", "inspection", Path(), cast(Any, None), encoder, cast(Any, None), 30.0, cast(Any, None), None, ""
    )  # fmt: skip
    true = with_true_readings(recording, found.effects).encoder
    assert true is not None
    assert true.distance_mm - encoder.distance_mm == pytest.approx(20 * late_s, abs=1e-6)


def test_sigma_of_the_encoders_own_delay_includes_the_uncertainty_of_the_width(
    real_probe: Probe, thirty_a_second: TravelFit
) -> None:
    named = answer(real_probe, None, late("gauge", thirty_a_second, 0.018, (16.0, 2.0)))
    (own,) = (e for e in named.effects if e.name == "time_offset")
    # Stamps at any time between the start of the exposure and its middle leave 10 to 18 ms: 3⁻½ × 8 ms about
    # 10.
    assert own.parameters["delay_s"].sd == pytest.approx(np.sqrt(0.2**2 + 1 + 1 + 8**2 / 3) * 1e-3)
    within = answer(real_probe, None, late("gauge", thirty_a_second, 0.012, (16.0, 2.0)))
    assert sizes(within) == pytest.approx({"motion_blur": 0.016})
    # An exposure that the two halves of the frames do not confirm leaves the delay open.
    open_ = answer(real_probe, None, late("gauge", thirty_a_second, 0.018, (16.0, 2.0), (DIFFERS,)))
    assert open_.verdict is Verdict.CLASS
    assert set(open_.members) == {"time_offset", "motion_blur"}


def test_an_exposure_needs_time_between_pictures_beyond_the_stated_one(
    real_probe: Probe, thirty_a_second: TravelFit
) -> None:
    """Of 33 ms from picture to picture, a longer exposure would take 28 ms."""
    recording = late("gauge", thirty_a_second, 0.014, None)
    assert answer(real_probe, None, recording).verdict is Verdict.CLASS
    long = replace(real_probe, shutter=replace(real_probe.shutter, exposure_s=0.015))
    assert sizes(answer(long, None, recording)) == pytest.approx({"time_offset": 0.014})
    assert answer(long, None, recording).verdict is Verdict.NAMED


@pytest.mark.parametrize(("delay_s", "verdict"), [(0.018, Verdict.CLASS), (0.022, Verdict.NAMED)])
def test_an_exposure_is_excluded_only_if_it_is_surely_longer_than_the_time_between_pictures(
    real_probe: Probe, thirty_a_second: TravelFit, delay_s: float, verdict: Verdict
) -> None:
    """With 33 ms between pictures, 36 ± 2 ms (1.7 σ too long) was excluded; only 44 ± 2 ms must be."""
    assert answer(real_probe, None, late("gauge", thirty_a_second, delay_s, None)).verdict is verdict


def test_a_class_says_that_all_of_it_may_be_wrong_where_something_else_fits_as_well(
    real_probe: Probe, thirty_a_second: TravelFit
) -> None:
    """Play, left out of the library, looked like a delay or an exposure; no other cause was mentioned."""
    recording = late("gauge", thirty_a_second, 0.008, None)
    assert "in another way" not in answer(real_probe, None, recording).identifiable
    assert recording.travel is not None
    otherwise = (replace(recording.travel.estimates[0], other_courses=0.2),)
    recording = replace(recording, travel=replace(recording.travel, estimates=otherwise))
    found = answer(real_probe, None, recording)
    assert found.verdict is Verdict.CLASS
    assert "or a cause that the library does not have" in found.identifiable
    assert "in another way" in found.identifiable


def sizes_told(estimate: TravelEstimate) -> list[float]:
    """Return the delays, s, that confirmations quote: "... delay_s 0.018 ± ..."."""
    told = (t for a in estimate.agreements for t in (a.confirmation.prediction, a.confirmation.measured))
    return [float(t.split("delay_s ")[1].split()[0]) for t in told]


def test_confirmations_of_the_encoders_own_delay_quote_it_and_not_the_whole_delay(real_probe: Probe) -> None:
    """Halves that agreed on the whole delay were quoted as confirmations of the remaining one."""
    fit = with_events(sight(np.random.default_rng(8)), read(delay_s=0.018))
    (whole,) = (e for e in _estimates("gauge", fit, 0.002, 0.05) if e.effect == "time_offset")
    recording = late("gauge", fit, 0.018, (16.0, 1.0))
    assert recording.travel is not None
    recording = replace(recording, travel=replace(recording.travel, estimates=(whole,)))
    own = Exposure.of(0.0, (recording,)).taken_off(recording)
    assert own is not None
    assert own.travel is not None
    (estimate,) = own.travel.estimates
    assert estimate.value == pytest.approx(whole.value - 0.008)
    assert whole.agreements
    assert sizes_told(estimate) == pytest.approx([s - 0.008 for s in sizes_told(whole)], abs=2e-4)


def test_without_an_encoder_nothing_is_said_of_how_late_an_exposure_makes_pictures(
    real_probe: Probe, thirty_a_second: TravelFit
) -> None:
    """Formerly 0 ± .5 ms, "as the encoder shows"."""
    size = {"exposure_s": Value(0.016, 0.001)}
    assert how_late(size, (None, None), own_delay=False) == (size, "")
    unknown = late("gauge", thirty_a_second, 0.0, None, sigma_s=np.inf)
    assert how_late(size, (unknown,), own_delay=False) == (size, "")
    found = answer(real_probe, None, late("gauge", thirty_a_second, None, (16.0, 1.0)))
    assert "late_s" not in found.effects[0].parameters


def test_sigma_of_late_pictures_includes_that_of_the_encoder(thirty_a_second: TravelFit) -> None:
    """An encoder known to 10 ms gave 0 ± .5 ms, and hid the 8 ± 1 ms of the other recording."""
    size = {"exposure_s": Value(0.020, 0.001)}
    unsure = late("field", thirty_a_second, 0.004, None, sigma_s=0.010)
    shown = how_late(size, (unsure, None), own_delay=False)[0]["late_s"]
    assert (shown.value, shown.sd) == pytest.approx((0.0, np.hypot(0.010, 0.001)))
    sure = late("gauge", thirty_a_second, 0.008, None)
    # If later than half of the exposure, pictures are late by at most that half: both uncertainties count.
    for exposure_sd, sd in ((0.001, np.hypot(0.0002, 0.001)), (0.004, 0.002)):
        size = {"exposure_s": Value(0.015, exposure_sd)}
        shown = how_late(size, (sure,), own_delay=False)[0]["late_s"]
        assert (shown.value, shown.sd) == pytest.approx((0.0075, sd))
    size = {"exposure_s": Value(0.020, 0.001)}
    for both in ((unsure, sure), (sure, unsure)):
        shown = how_late(size, both, own_delay=False)[0]["late_s"]
        assert (shown.value, shown.sd) == pytest.approx((0.008, np.hypot(0.0002, 0.001)))
