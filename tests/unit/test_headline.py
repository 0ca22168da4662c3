"""The summary numbers of a run, as in run.json and on the terminal."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.artefacts.measured import Trajectory
from pipeline.export.run_record import headline
from pipeline.geometry.axis import straight_axis


def trajectory(z_mm: np.ndarray, scale_sigma: float, end_sigma_mm: float) -> Trajectory:
    T_pc = np.broadcast_to(np.eye(4), (len(z_mm), 4, 4)).copy()
    T_pc[:, 2, 3] = z_mm
    number, covariance = np.arange(len(z_mm)), np.zeros((len(z_mm), 6, 6))
    return Trajectory(
        number, number / 30, T_pc, covariance, straight_axis(-100, 300), 50.0, 1.0, 0.0, scale_sigma, (),
        distance_sigma_mm=end_sigma_mm,
    )  # fmt: skip


def scale_told(run: Trajectory) -> float:
    told = {n.name: n.value for n in headline({Trajectory: run})}
    return float(told["relative 1 sigma of the distance scale"])


def test_the_scale_is_no_surer_than_the_distance_at_the_end() -> None:
    way = np.linspace(0, 200, 50)
    # the probe is calibrated to 6e-5, but errors that matches of texture share leave 0.1 mm of 200 mm
    assert scale_told(trajectory(way, 6e-5, 0.1)) == pytest.approx(5e-4)
    assert scale_told(trajectory(way, 8e-4, 0.1)) == pytest.approx(8e-4)


def test_the_scale_error_of_a_way_forth_and_back_refers_to_its_farthest_place() -> None:
    way = np.concatenate([np.linspace(0, 200, 50), np.linspace(200, 0, 50)])
    assert scale_told(trajectory(way, 6e-5, 0.1)) == pytest.approx(5e-4)


def test_the_unknown_distance_at_a_cut_is_not_an_error_of_the_scale() -> None:
    """With any cut, σ of the scale was 1."""
    cut = replace(trajectory(np.linspace(0, 200, 50), 6e-5, np.hypot(0.1, 200.0)), cut_sigma_mm=200.0)
    assert scale_told(cut) == pytest.approx(5e-4)


def test_a_run_that_stood_or_was_not_adjusted_states_the_uncertainty_of_calibration() -> None:
    way = np.linspace(0, 200, 50)
    assert scale_told(trajectory(0 * way, 6e-5, 0.0)) == pytest.approx(6e-5)
    assert scale_told(replace(trajectory(way, 6e-5, 0.1), distance_sigma_mm=float("nan"))) == pytest.approx(
        6e-5
    )
