"""When within its exposure a picture is stamped, and how an encoder's own delay stands beside that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.instrument.probe import Probe
from stages.diagnose.result import Verdict
from stages.diagnose.travel.model import TravelFit
from tests.diagnosed import answer
from tests.unit.late_pictures import late, sizes


@pytest.mark.parametrize("delay_s", [0.0055, 0.0075])
def test_a_delay_explained_by_stamps_between_start_and_middle_is_not_the_encoders(
    real_probe: Probe, thirty_a_second: TravelFit, delay_s: float
) -> None:
    """Of 5.5 ms found beside 30 ms of exposure, −9.5 ms were reported as an encoder that is early."""
    found = answer(real_probe, None, late("gauge", thirty_a_second, delay_s, (30.0, 0.5)))
    assert sizes(found) == pytest.approx({"motion_blur": 0.030})
    assert found.effects[0].parameters["late_s"].value == pytest.approx(delay_s)


def test_beside_an_encoders_own_delay_half_of_the_exposure_is_corrected_as_well(
    real_probe: Probe, thirty_a_second: TravelFit
) -> None:
    found = answer(real_probe, None, late("gauge", thirty_a_second, 0.018, (16.0, 1.0)))
    of_name = {e.name: e.parameters for e in found.effects}
    assert of_name["motion_blur"]["late_s"].value == pytest.approx(0.008)
    assert of_name["time_offset"]["delay_s"].value == pytest.approx(0.010)
    assert of_name["motion_blur"]["late_s"].sd == pytest.approx(np.sqrt(0.5**2 + 8**2 / 3) * 1e-3)


@pytest.mark.parametrize(
    ("delay_s", "sigma_s", "of_gauge_s"), [(0.0, 2e-4, 0.018), (0.007, 2e-3, 0.018), (0.0, 2.4e-3, 0.014)]
)
def test_the_meaning_of_stamps_does_not_explain_a_difference_between_two_recordings(
    real_probe: Probe, thirty_a_second: TravelFit, delay_s: float, sigma_s: float, of_gauge_s: float
) -> None:
    """10 ± 4.8 ms beside 0 ± 1 ms counted as equal.

    The delay was named, and a sound inspection's readings were moved by 18 ms.
    """
    field = late("field", thirty_a_second, delay_s, (16.0, 1.0), sigma_s=sigma_s)
    assert field.travel is not None
    of_field = (replace(field.travel.estimates[0], p_value=0.8),)
    field = replace(field, travel=replace(field.travel, estimates=of_field))
    found = answer(real_probe, field, late("gauge", thirty_a_second, of_gauge_s, (16.0, 1.0)))
    assert found.verdict is Verdict.PARTLY
    assert sizes(found) == pytest.approx({"motion_blur": 0.016})
    assert found.effects[0].parameters["late_s"].value == 0.0


def test_recordings_with_a_common_own_delay_confirm_it_by_the_whole_delay(
    real_probe: Probe, thirty_a_second: TravelFit
) -> None:
    both = [late(source, thirty_a_second, 0.018, (16.0, 1.0)) for source in ("field", "gauge")]
    (own,) = (e for e in answer(real_probe, both[0], both[1]).effects if e.name == "time_offset")
    assert own.parameters["delay_s"].value == pytest.approx(0.010)
    assert own.parameters["delay_s"].sd > 8e-3 / 3**0.5
    (told,) = (c for c in own.confirmed_by if "gauge" in c.prediction + c.measured)
    assert told.agrees
    assert "whole delay_s 0.018" in told.prediction
    assert "whole delay_s 0.018" in told.measured


def test_a_delay_beyond_half_the_exposure_widens_its_uncertainty_and_is_mentioned(
    real_probe: Probe, thirty_a_second: TravelFit
) -> None:
    """13 ± 1 ms, of which the width allows 8, were stated as 8.0 ± 1.0, "as the encoder shows"."""
    found = answer(real_probe, late("field", thirty_a_second, 0.013, (16.0, 1.0)), None)
    (exposure,) = found.effects
    late_s = exposure.parameters["late_s"]
    assert (late_s.value, late_s.sd) == pytest.approx((0.008, 0.005))
    assert "The encoder is later than the exposure accounts for, by 5.0 ms (± 1.1)." in exposure.statement
    near = answer(real_probe, late("field", thirty_a_second, 0.0085, (16.0, 1.0)), None)
    assert "later than" not in near.effects[0].statement
