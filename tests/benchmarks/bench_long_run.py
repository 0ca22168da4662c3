"""A real recording of 1, 10 and 100 m through `boresight run`: time per metre and memory of every stage.

    python -m tests.benchmarks.bench_long_run OUT --metres 1,10,100

Writes into OUT, per length, the scene (pulled_4_inch.yaml made longer), the recording with its
truth beside it (`boresight simulate`) and the run (`boresight run --config configs/long.yaml`); what is there
already of scene and recording is kept. 100 m are 20 000 frames: about half an hour of rendering on one core
and 7 GiB of memory, which are not counted. Nothing is extrapolated: a length that was not run has no line.

The run is one process with its helpers. Printed are the largest private memory that they held at one moment
(RssAnon, without pages mapped from files, which the system can drop), and the processor time of all of them.
Exported files are written while the next stages work, and count there; the last of them count as ``files``.
Stages that work at the same time share a line.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.artefacts.measured import Trajectory, Wall
from pipeline.geometry.axis import to_pipe
from pipeline.review.run_files import RunFiles
from pipeline.simulator.scene import read_scene, write_scene
from tests.benchmarks.bench_findings import counted
from tests.benchmarks.long_scene import lengthened
from tests.benchmarks.true_wall import true_wall
from tests.benchmarks.watch import Progress, Watch

ROOT = Path(__file__).resolve().parents[2]
TEMPLATE, CONFIG = Path(__file__).with_name("pulled_4_inch.yaml"), ROOT / "configs/long.yaml"


@dataclass(frozen=True)
class Place:
    """Where the files of one length lie."""

    folder: Path

    @property
    def scene(self) -> Path:
        """The scene file."""
        return self.folder / "scene.yaml"

    @property
    def recording(self) -> Path:
        """The recording's folder."""
        return self.folder / "recording"

    @property
    def truth(self) -> Path:
        """The folder of its truth."""
        return self.folder / "recording-truth"

    @property
    def run(self) -> Path:
        """The run folder."""
        return self.folder / "run"


def main() -> None:
    """Render, run, and print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, help="where everything is written")
    parser.add_argument("--metres", default="1,10,100")
    parser.add_argument("--config", type=Path, default=CONFIG)
    given = parser.parse_args()
    lengths = [int(n) for n in given.metres.split(",")]
    found: dict[int, Watch] = {}
    for metres in lengths:
        place = Place(given.out.resolve() / f"{metres}m")
        require_recording(place, metres)
        found[metres] = watched_run(place, given.config)
        print(f"{metres} m against the truth: {against_truth(place)}", flush=True)
    print(table(found))


def require_recording(place: Place, metres: int) -> None:
    """Render the recording of a length unless it is there."""
    place.folder.mkdir(parents=True, exist_ok=True)
    if not place.recording.is_dir():
        write_scene(lengthened(read_scene(TEMPLATE), metres), place.scene)
        boresight("simulate", str(place.scene), "-o", str(place.recording)).wait()


def watched_run(place: Place, config: Path) -> Watch:
    """Process a recording from the start; return what each stage took."""
    log = place.run / ".boresight" / "run.log"
    log.unlink(missing_ok=True)
    command = ("run", str(place.recording), "-o", str(place.run), "--config", str(config), "--no-resume")
    process = boresight(*command)
    with Watch(process.pid, Progress(log)) as watch:
        if process.wait():
            raise SystemExit(f"the run of {place.recording} failed: see {log}")
    return watch


def boresight(*arguments: str) -> subprocess.Popen[bytes]:
    """Start the program as its user does."""
    command = [sys.executable, "-m", "pipeline.cli", *arguments]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def against_truth(place: Place) -> str:
    """Return the errors of distance and roll at the end, and of the mean radius, in words."""
    truth = json.loads((place.truth / "truth.json").read_text())
    with np.load(place.truth / "truth_wall.npz") as wall:
        true_radius_mm = float(np.mean(wall["radius_mm"], dtype=float))
    files = RunFiles(place.run)
    motion, radius_map = files.artefact(Trajectory), files.artefact(Wall).radius_map
    T_pc = np.array(truth["camera_pose_in_pipe"])[motion.frame]
    distance_mm = to_pipe(motion.axis, motion.T_pc[:, :3, 3])[0]
    off_mm = distance_mm - distance_mm[0] - (T_pc[:, 2, 3] - T_pc[0, 2, 3])
    seen = np.isfinite(radius_map.radius_mm)
    bias_mm = float(np.mean(radius_map.radius_mm[seen], dtype=float)) - true_radius_mm
    return (
        f"distance {off_mm[-1]:+.2f} mm at the end of {np.ptp(T_pc[:, 2, 3]):.0f} mm "
        f"(1 sigma {motion.distance_sigma_mm:.2f}), mean radius {bias_mm:+.4f} mm, "
        f"seen {100 * np.mean(seen[seen.any(1)]):.1f} %; {findings(place)}"
    )


def findings(place: Place) -> str:
    """Return how many findings are false, and how many of the drawn defects are found, in words."""
    scene, wall = read_scene(place.scene), true_wall(place.truth)
    found = counted(scene, place.run, wall)
    sure = [c for c in found if c.confirmed]
    expected = sum(1 - c.stated for c in sure)
    return (
        f"findings: {len(sure)} for {len(scene.pipe.defects)} drawn defects, {sum(not c.real for c in sure)} "
        f"false where {expected:.2f} are expected, {len(found) - len(sure)} unconfirmed"
    )


def table(found: dict[int, Watch]) -> str:
    """Return processor seconds per metre and the largest memory, MiB, of every stage, one column a length."""
    stages = list(dict.fromkeys(s for watch in found.values() for s in watch.cpu_s))
    lines = ["| stage, processor s per m (most MiB) | " + " | ".join(f"{n} m" for n in found) + " |"]
    lines.append("|---" * (len(found) + 1) + "|")
    for stage in stages:
        cells = [f"{w.cpu_s.get(stage, 0) / n:.2f} ({w.mib.get(stage, 0):.0f})" for n, w in found.items()]
        lines.append(f"| {stage} | " + " | ".join(cells) + " |")
    cells = [f"{w.all_cpu_s / n:.2f} ({w.most_mib:.0f})" for n, w in found.items()]
    return "\n".join([*lines, "| **all** | " + " | ".join(cells) + " |"])


if __name__ == "__main__":
    main()
