"""What is reported of all findings together."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.artefacts.findings import Defect, Defects, clock_of_azimuth

PIT = Defect(
    id=1, kind="pit", distance_from_mm=10.0, distance_to_mm=14.0, clock_from=3.0, clock_to=3.2,
    peak_distance_mm=12.0, peak_clock=3.1, length_mm=4.0,
    width_mm=4.0, depth_mm=0.8, depth_sigma_mm=0.05, wall_loss_percent=float("nan"), probability=1.0,
    confidence=0.9, frames=np.array([1]), outline=np.zeros((3, 2)), pof_class="", pacp_suggestion="",
    en13508_suggestion="", statement="",
)  # fmt: skip


@pytest.mark.parametrize(
    ("depth_mm", "sigma_mm", "is_it"),
    [(-1.0, 0.3, True), (1.0, 0.3, True), (32.9, 46.7, False), (-0.7, 0.01, False)],
)
def test_the_deepest_finding_is_one_with_a_known_depth(depth_mm: float, sigma_mm: float, is_it: bool) -> None:
    other = replace(PIT, id=2, depth_mm=depth_mm, depth_sigma_mm=sigma_mm)
    deepest = Defects((PIT, other), 0.05).deepest
    assert deepest is not None
    assert deepest.id == (2 if is_it else 1)


def test_no_finding_is_deepest_where_no_depth_is_known() -> None:
    assert Defects((replace(PIT, depth_sigma_mm=1.0),), 0.05).deepest is None
    assert Defects((), 0.05).deepest is None


def test_clock_runs_clockwise_from_the_top() -> None:
    # P has x right and y down: 12 o'clock is −y, 3 o'clock +x.
    assert clock_of_azimuth(np.array([-np.pi / 2, 0.0, np.pi / 2, np.pi])) == pytest.approx([0, 3, 6, 9])
