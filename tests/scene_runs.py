"""Shipped scenes rendered, run by the whole pipeline, and compared with their truth."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from pipeline.api.job import open_job, run_job
from pipeline.artefacts.measured import RadiusMap
from pipeline.export.catalogue import EXPORTERS
from pipeline.machine.configuration import resolve
from pipeline.machine.display import SilentDisplay
from pipeline.machine.plan import Selection
from pipeline.simulator.scene import Scene
from stages.catalogue import PIPELINE
from tests.simulated import rendered
from tests.truth_comparison import compare_wall


@dataclass(frozen=True)
class SceneScore:
    """How well a run measured a scene; ``stated_mm`` is the median stated 1 σ of a cell's radius.

    ``radius_mm`` is the median radius of the map. ``distance_percent`` is the error of the camera's distance
    along z from first to last frame, in percent of the path driven; ``distance_sigma_percent`` is the σ that
    the run states for it, of its end and its scale together.
    """

    radius_mm: float
    bias_mm: float
    median_mm: float
    rms_mm: float
    stated_mm: float
    inside_95: float
    coverage: float
    distance_percent: float
    distance_sigma_percent: float


def run_scene(scene: Scene, folder: Path, assignments: Sequence[str] = ()) -> SceneScore:
    """Render, run and score a scene below ``folder``."""
    recording, truth = rendered(scene, folder)
    run = folder / f"{scene.name}-run"
    job = open_job(recording, run, None, PIPELINE, EXPORTERS, resolve(PIPELINE, None, assignments))
    run_job(job, Selection(), SilentDisplay())
    return score(run, truth)


def score(run: Path, truth: Path) -> SceneScore:
    """Return the comparison of a run folder with a folder of truth."""
    with np.load(run / "radius_map.npz") as file:
        found = RadiusMap(**{f.name: file[f.name] for f in fields(RadiusMap) if f.name in file})
    wall = compare_wall(found, truth)
    error, rms = wall.error_mm, float(np.sqrt(np.mean(wall.error_mm**2)))
    return SceneScore(
        float(np.nanmedian(found.radius_mm)),
        float(error.mean()), float(np.median(error)), rms, float(np.median(wall.sigma_mm)),
        wall.inside_95, wall.coverage, *_distance(run, truth),
    )  # fmt: skip


def _distance(run: Path, truth: Path) -> tuple[float, float]:
    rows = np.genfromtxt(run / "trajectory.csv", delimiter=",", names=True)
    poses = np.array(json.loads((truth / "truth.json").read_text())["camera_pose_in_pipe"])
    true = poses[rows["frame"].astype(int), 2, 3]
    path = float(np.sum(np.abs(np.diff(true))))
    off = (rows["z_mm"][-1] - rows["z_mm"][0]) - (true[-1] - true[0])
    record = json.loads((run / "run.json").read_text())
    numbers = [*record["metrics"], *(n for stage in record["stages"] for n in stage["numbers"])]
    told = {n["name"]: n["value"] for n in numbers}
    return 100 * float(off) / path, 100 * float(told["relative 1 sigma of the distance scale"])
