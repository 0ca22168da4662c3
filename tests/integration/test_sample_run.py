"""One command makes a whole run folder of the sample recording; the same command again does nothing."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from stages.catalogue import PIPELINE
from tests.sample_run import run_sample
from tests.shared_data import PROJECT_ROOT

FILES = (
    "run.json",
    "rings.zarr",
    "trajectory.csv",
    "centreline.csv",
    "route.csv",
    "cloud.ply",
    "radius_map.npz",
    "model.glb",
    "unrolled.png",
    "unrolled.json",
    "sections.csv",
    "defects.csv",
    "defects.json",
    "unconfirmed.csv",
    "unconfirmed.json",
    "report.html",
)


def record(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "run.json").read_text("utf-8"))
    return content


def test_every_file_is_there(sample: Path) -> None:
    assert [name for name in FILES if not (sample / name).exists()] == []


def test_every_stage_completed_within_the_memory_allowed(sample: Path) -> None:
    told = record(sample)
    assert told["state"] == "completed"
    assert [(s["name"], s["state"]) for s in told["stages"]] == [(s.name, "completed") for s in PIPELINE]
    assert max(told["peak_memory_mib"].values()) < 2048


def test_the_summary_of_the_run_is_that_of_the_recording(sample: Path) -> None:
    metrics = {m["name"]: m["value"] for m in record(sample)["metrics"]}
    with (PROJECT_ROOT / "data" / "sample" / "frames.csv").open() as stream:
        lit = [row["illumination"] for row in csv.DictReader(stream)]
    assert metrics["laser frames"] == sum(light != "led" for light in lit)
    assert metrics["wall seen"] > 98


def test_the_tables_are_consistent_with_each_other(sample: Path) -> None:
    with np.load(sample / "radius_map.npz") as wall:
        shape = (len(wall["distance_mm"]), len(wall["azimuth_rad"]))
        assert all(wall[n].shape == shape for n in ("radius_mm", "sigma_mm", "count", "misalignment_mm"))
        seen = np.isfinite(wall["radius_mm"])
        assert np.all(seen[wall["count"] > 0])
        assert np.mean(wall["count"][seen] > 0) > 0.99, "hardly any wall may be interpolated"
        assert np.all(wall["sigma_mm"][seen] >= wall["sigma_random_mm"][seen])


def test_the_same_command_again_does_nothing(sample: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shutil.copytree(sample, run)

    def files() -> dict[str, tuple[int, int]]:
        told = ("run.json", "run.log", "lock")
        paths = (p for p in run.rglob("*") if p.is_file() and p.name not in told)
        return {str(p.relative_to(run)): (p.stat().st_ino, p.stat().st_mtime_ns) for p in paths}

    before = files()
    assert str(run / "report.html") in run_sample(run)
    assert files() == before
    assert {s["state"] for s in record(run)["stages"]} == {"reused"}
