"""Tests the statistics of the comparison of two runs: ``python -m tests.benchmarks.bench_comparison``.

On simulated walls: how often growth lies within its 95 % interval, the spread of z, and how often any change
is declared in a family of twelve defects of which none has changed.

With ``--runs EARLIER LATER`` and the folders of their truths: growth measured in simulated runs beside the
true one, which is read from the true walls within the same outlines. The earlier run must begin at distance 0
and roll 0, so that its places are those of its truth.

``--simulate FOLDER`` renders and runs such runs of one pipe: ``earlier``, ``later`` (two defects grown, one
new, one gone), ``same`` (none changed), and ``other``, another pipe. It takes 5 minutes of CPU.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np

from pipeline.commands.staged_comparison import StagedComparison
from pipeline.review.compared import RunPair
from pipeline.review.review import open_review
from pipeline.review.run_files import RunFiles
from tests.simulated import rendered, shipped, smaller
from tests.two_walls import PLACES, RADIUS, family


def made_walls(families: int) -> None:
    """Print coverage and spread where pits grow, and the changes declared where none does."""
    z, declared = [], 0
    for seed in range(families):
        truth = np.random.default_rng(seed).uniform(-0.1, 0.3, len(PLACES))
        found = family(truth, 1000 + 2 * seed)
        growth = [found[k].growth.depth_mm for k in range(len(PLACES))]
        z += [(g.value - t) / g.sigma for g, t in zip(growth, truth, strict=True)]
        nothing = family(np.zeros(len(PLACES)), 5000 + 2 * seed, found_now=9)
        declared += any(c.is_significant for c in nothing.values())
    inside = np.abs(z) < 1.96
    print(f"{len(z)} pits that grow by -0.1 to 0.3 mm: {100 * inside.mean():.1f} % in the 95 % interval,")
    print(
        f"  (measured - true) / sigma: mean {np.mean(z):.2f}, 1 sigma {np.std(z):.2f}, "
        f"farthest {np.max(np.abs(z)):.1f}"
    )
    print(f"families of twelve without change in which any was declared: {declared} of {families}")


def simulated_runs(runs: list[Path], truths: list[Path]) -> None:
    """Print every change of two simulated runs beside the true one."""
    pair = RunPair(*(open_review(RunFiles(run.resolve())) for run in reversed(runs)))
    walls, comparison = StagedComparison.configured(None, ())(pair)
    registration = walls.registration
    walls = [_true_wall(folder) for folder in truths]
    for change in comparison.changes:
        if change.growth is None:
            continue
        s, psi = change.place.middle
        earlier = registration.to_earlier(np.array([s]), np.array([psi]))
        place = float(earlier[0][0]), float(earlier[1][0])
        corner = change.place.corners
        half = np.ptp(corner, axis=0) / 2 + [0.5, 0.5 / RADIUS]
        sign = 1 if change.place.kind.is_metal_loss else -1
        before, after = (_extreme(wall, place, half, sign) for wall in walls)
        growth, true = change.growth.depth_mm, sign * (after - before)
        print(
            f"{change.place.kind:10} {s:6.1f} mm  {change.fate:34} {growth.value:+.3f} ± {growth.sigma:.3f}  "
            f"true {true:+.3f}  {abs(growth.value - true) / growth.sigma:.1f} sigma"
        )


def _true_wall(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    with np.load(folder / "truth_wall.npz") as stored:
        radius = stored["radius_mm"].astype(float)
        return stored["distance_mm"], stored["azimuth_rad"], radius - np.median(radius, axis=1, keepdims=True)


def _extreme(wall, place, half, sign) -> float:
    s, psi, height = wall
    rows = np.abs(s - place[0]) <= half[0]
    columns = np.abs(np.mod(psi - place[1] + np.pi, 2 * np.pi) - np.pi) <= half[1]
    return float((sign * height[np.ix_(rows, columns)]).max())


def simulate(folder: Path) -> None:
    """Render four recordings of a welded 4 inch pipe, each with another drive, and run them."""
    stays = [
        _defect("pit", 70, -20, 8, 7, 0.9), _defect("gouge", 98, 50, 16, 3, 0.6, 20),
        _defect("dent", 64, -170, 24, 28, 1.2),
    ]  # fmt: skip
    before = [_defect("pit", 40, 122, 7, 6, 0.8), _defect("corrosion", 84, -110, 18, 20, 0.6), *stays]
    after = [_defect("pit", 40, 122, 8, 7, 1.1), _defect("corrosion", 84, -110, 22, 24, 0.9), *stays]
    gone, new = _defect("deposit", 132, 100, 12, 20, 1.0), _defect("pit", 104, -80, 7, 7, 0.8)
    for name, defects, seed, start_mm, roll_deg, phase_deg in (
        ("earlier", [*before, gone], 403, 0.0, 0.0, 0.0), ("later", [*after, new], 403, 7.0, 23.0, 77.0),
        ("same", [*before, gone], 403, -5.0, -40.0, 190.0), ("other", [*after, new], 977, 4.0, 10.0, 33.0),
    ):  # fmt: skip
        scene = _drive(name, defects, seed, start_mm, roll_deg, phase_deg)
        recording, _ = rendered(scene, folder)
        command = [
            sys.executable,
            "-m",
            "pipeline.cli",
            "run",
            str(recording),
            "-o",
            str(folder / "run" / name),
        ]
        subprocess.run(command, check=True)


def _defect(kind, distance_mm, azimuth_deg, length_mm, width_mm, depth_mm, angle_deg=0.0):
    names = ("kind", "distance_mm", "azimuth_deg", "length_mm", "width_mm", "depth_mm", "angle_deg")
    sizes = map(float, (distance_mm, azimuth_deg, length_mm, width_mm, depth_mm, angle_deg))
    return dict(zip(names, (kind, *sizes), strict=True))


def _drive(name, defects, seed, start_mm, roll_deg, phase_deg):
    """Return the welded pipe with these defects and another drive."""
    scene = shipped("welded-4-inch")
    values = scene.model_dump(mode="json", exclude_defaults=True)
    motion = values["motion"] | {"start_mm": start_mm, "legs": [{"duration_s": 20.0, "speed_mm_s": 18.0}]}
    for sway in ("x_mm", "y_mm", "yaw_deg", "pitch_deg"):
        for wave in motion[sway]["waves"]:
            wave["phase_deg"] = wave.get("phase_deg", 0.0) + phase_deg
    wave = {"amplitude": 7.0, "period_s": 8.0, "phase_deg": phase_deg}
    motion["roll_deg"] = {"mean": roll_deg, "waves": [wave]}
    pipe = values["pipe"] | {"joints": [], "defects": defects}
    return smaller(scene, 2, 200, name=name, seed=seed, motion=motion, pipe=pipe | {"texel_mm": 0.22})


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--families", type=int, default=20)
    parser.add_argument("--runs", type=Path, nargs=2, metavar=("EARLIER", "LATER"))
    parser.add_argument("--truths", type=Path, nargs=2, metavar=("EARLIER", "LATER"))
    parser.add_argument("--simulate", type=Path, metavar="FOLDER")
    wish = parser.parse_args()
    if wish.simulate:
        simulate(wish.simulate)
    elif wish.runs and wish.truths:
        simulated_runs(wish.runs, wish.truths)
    else:
        made_walls(wish.families)


if __name__ == "__main__":
    main()
