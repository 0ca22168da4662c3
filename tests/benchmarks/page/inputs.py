"""The recording, boresight's run of it, and its results: the inputs of all comparisons."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pipeline.api.job import open_job
from pipeline.artefacts.measured import PointCloud, Trajectory, Wall
from pipeline.export.catalogue import EXPORTERS
from pipeline.instrument.probe import Probe
from pipeline.machine.configuration import resolve
from pipeline.machine.run_folder import claimed
from pipeline.recording.base import Illumination, Recording
from stages.catalogue import PIPELINE
from tests.benchmarks.page.section import Spent, clocked
from tests.shared_data import PROJECT_ROOT


@dataclass(frozen=True)
class Inputs:
    """A recording with truth, and boresight's finished run of it.

    Attributes
    ----------
    spent : Spent
        Of ``boresight run``, started as people start it, with everything compiled before.
    results : dict
        Artefacts by class.
    """

    recording: Recording
    probe: Probe
    folder: Path
    run: Path
    spent: Spent
    results: dict[type, Any]

    @cached_property
    def stage_seconds(self) -> dict[str, float]:
        record = json.loads((self.run / "run.json").read_text("utf-8"))
        return {s["name"]: s["seconds"] for s in record["stages"]}

    @property
    def wall(self) -> Wall:
        return self.results[Wall]

    @property
    def cloud(self) -> PointCloud:
        return self.wall.cloud

    @property
    def trajectory(self) -> Trajectory:
        return self.results[Trajectory]

    @property
    def lit(self) -> np.ndarray:
        """Return the numbers of the frames lit by the LEDs."""
        return self.recording.frames.of(Illumination.LED, Illumination.BOTH)

    @cached_property
    def true_poses(self) -> np.ndarray:
        """Return the true poses (N, 4, 4) of all frames, camera to pipe."""
        truth = json.loads((self.folder / "truth.json").read_text("utf-8"))
        poses = np.zeros((len(truth["camera_pose_in_pipe"]), 4, 4))
        poses[:, :3], poses[:, 3, 3] = truth["camera_pose_in_pipe"], 1
        return poses

    def lit_images(self, step: int = 1) -> list[np.ndarray]:
        """Return every ``step``-th lit frame's grey picture."""
        return [image.copy() for _, image in self.recording.read(self.lit[::step], "grey")]

    def driven_mm(self, frames: np.ndarray) -> float:
        """Return how far the probe went by the encoder between the first and the last of ``frames``."""
        table, encoder = self.recording.frames, self.recording.encoder
        times = table.time_s[np.searchsorted(table.frame, frames[[0, -1]])]
        return float(np.ptp(np.interp(times, encoder.time_s, encoder.distance_mm)))


def prepare(folder: Path, work: Path) -> Inputs:
    """Run boresight twice, the first time to compile the code, and read its results."""
    cv2.setNumThreads(0)
    _run(folder, work / "first")
    with clocked() as spent:
        _run(folder, work / "run")
    job = open_job(folder, work / "run", None, PIPELINE, EXPORTERS, resolve(PIPELINE, None, ()))
    with claimed(work / "run") as claim:
        steps = job.plan.steps
        results = {s.output: claim.store.read(s.stage.name, s.key, s.output).artefact for s in steps}
    return Inputs(job.recording, job.probe, folder, work / "run", spent, results)


def _run(folder: Path, run: Path) -> None:
    command = [sys.executable, "-m", "pipeline.cli", "run", str(folder), "-o", str(run), "--no-resume"]
    subprocess.run(command, cwd=PROJECT_ROOT, check=True, capture_output=True)
