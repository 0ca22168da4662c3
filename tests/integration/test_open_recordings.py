"""Motion and wall of the sample's run against the truth, with and without the encoder."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.api.run import open_run
from pipeline.artefacts.measured import Trajectory, Wall
from pipeline.export.arrays import write_radius_map
from pipeline.export.tables import write_trajectory
from pipeline.instrument.probe_file import read_probe
from pipeline.recording.folder import open_folder
from stages.accumulate import AccumulateParameters, accumulate_wall
from stages.motion import MotionParameters, estimate_motion
from tests.quiet import quiet_context
from tests.shared_data import PROJECT_ROOT, scorer
from tests.truth_comparison import compare_motion, compare_wall

pytestmark = pytest.mark.slow
SAMPLE = PROJECT_ROOT / "data" / "sample"


@dataclass(frozen=True)
class Run:
    """The results for the sample."""

    trajectory: Trajectory
    wall: Wall


@pytest.fixture(scope="module")
def runs(sample: Path) -> dict[str, Run]:
    finished, probe, context = open_run(sample), read_probe(SAMPLE / "probe.yaml"), quiet_context()
    rings, points = finished.rings, finished.ring_points
    blind = replace(open_folder(SAMPLE), encoder=None)
    trajectory = estimate_motion(blind, probe, rings, points, MotionParameters(), context)
    wall = accumulate_wall(probe, rings, points, trajectory, AccumulateParameters(), context)
    return {"encoder": Run(finished.trajectory, finished.wall), "no encoder": Run(trajectory, wall)}


@pytest.mark.parametrize(("name", "limit_percent"), [("encoder", 0.1), ("no encoder", 0.3)])
def test_distance_and_roll_at_the_end(runs: dict[str, Run], name: str, limit_percent: float) -> None:
    got = compare_motion(runs[name].trajectory, SAMPLE)
    assert abs(got.distance_mm[-1]) <= limit_percent / 100 * got.path_mm
    assert np.degrees(abs(got.roll_rad[-1])) <= 0.2


@pytest.mark.parametrize("name", ["encoder", "no encoder"])
def test_distance_and_roll_lie_within_their_sigma(runs: dict[str, Run], name: str) -> None:
    run = runs[name].trajectory
    got = compare_motion(run, SAMPLE)
    assert abs(got.distance_mm[-1]) < 3 * np.sqrt(run.covariance[-1, 2, 2])
    assert abs(got.roll_rad[-1]) < 3 * np.sqrt(run.covariance[-1, 5, 5])


@pytest.mark.parametrize("name", ["encoder", "no encoder"])
def test_wall_lies_within_its_sigma(runs: dict[str, Run], name: str) -> None:
    got = compare_wall(runs[name].wall.radius_map, SAMPLE)
    assert abs(got.error_mm.mean()) < 3 * np.median(got.sigma_mm)
    assert got.robust_sigma_mm <= 0.035
    assert got.coverage >= 0.98
    assert got.inside_95 >= 0.93


def test_sigma_is_small_enough_to_be_useful(runs: dict[str, Run]) -> None:
    run = runs["encoder"]
    got = compare_wall(run.wall.radius_map, SAMPLE)
    assert np.median(got.sigma_mm) < 5 * np.sqrt(np.mean(np.minimum(np.abs(got.error_mm), 0.2) ** 2))
    assert (
        np.sqrt(run.trajectory.covariance[-1, 2, 2]) < 0.005 * compare_motion(run.trajectory, SAMPLE).path_mm
    )


def test_encoder_scale_is_found(runs: dict[str, Run]) -> None:
    run = runs["encoder"].trajectory
    assert abs(run.encoder_scale - 1) < 4 * run.encoder_scale_sigma + 0.01
    assert np.isnan(runs["no encoder"].trajectory.encoder_scale)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # it leaves files open
def test_the_shared_scoring_program_agrees(runs: dict[str, Run], tmp_path: Path) -> None:
    tool = scorer()
    write_trajectory(runs["encoder"].trajectory, tmp_path)
    thin = _every_fourth_column(runs["encoder"].wall)
    write_radius_map(thin, tmp_path)
    truth = tool.truth_of(str(SAMPLE))
    wall = tool.wall_error(str(tmp_path), *truth[1:4])
    motion = tool.trajectory_error(str(tmp_path), truth[0])
    own = compare_wall(thin.radius_map, SAMPLE)
    assert wall["coverage"] == pytest.approx(own.coverage, abs=0.01)
    assert wall["radius_bias_mm"] == pytest.approx(own.error_mm.mean(), abs=0.01)
    assert wall["radius_mad_sigma_mm"] == pytest.approx(own.robust_sigma_mm, abs=0.003)
    assert wall["within_1.96_sigma"] == pytest.approx(own.inside_95, abs=0.02)
    distance = compare_motion(runs["encoder"].trajectory, SAMPLE).distance_mm[-1]
    assert motion["axial_end_error_mm"] == pytest.approx(distance, abs=1e-3)


def _every_fourth_column(wall: Wall) -> Wall:
    full = wall.radius_map
    part = {n: v[:, ::4] for n, v in vars(full).items() if np.ndim(v) == 2}
    return replace(wall, radius_map=replace(full, azimuth_rad=full.azimuth_rad[::4], **part))
