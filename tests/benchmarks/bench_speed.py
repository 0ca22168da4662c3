"""Processor time of whole runs, as a multiple of the time that decoding the video takes, and their scores.

    python -m tests.benchmarks.bench_speed OUT RECORDING... [--apart] [--score FILE] [--flame]

All frames of every recording are decoded with PyAV on one thread; then it is run from the start, and decoded
again: the ratio takes the mean of both decodings, so that a busy machine slows down both sides of it. Printed
are the processor time of each stage, the ratio, the largest memory, and which part of the cores was busy.
Stages that work at the same time share a line, unless ``--apart`` runs them one after the other.
``--score`` names a script that is called with run folder and recording and prints figures as JSON, from the
truth beside the recording. Modules are loaded from bytecode in OUT, as those of an installed program are.
``--flame`` draws OUT/NAME.svg with py-spy where it is installed, which slows the run down.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import av

from pipeline.api.job import run_job
from pipeline.api.run import configuration, prepare
from pipeline.files.json_yaml import read_yaml
from pipeline.machine.display import SilentDisplay
from pipeline.machine.plan import Selection
from tests.benchmarks.watch import Progress, Watch

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Measured:
    """What a run took, and decoding its video before and after it, s of processor time."""

    name: str
    frames: int
    decoding_s: tuple[float, float]
    watch: Watch
    wall_s: float
    scores: str

    @property
    def ratio(self) -> float:
        """Processor time of the run over that of decoding once."""
        return self.watch.all_cpu_s * 2 / sum(self.decoding_s)

    def lines(self) -> list[str]:
        """Return the lines of output."""
        once = sum(self.decoding_s) / 2
        stages = [
            f"| {stage} | {cpu:.2f} | {cpu / once:.2f} | {self.watch.mib[stage]:.0f} |"
            for stage, cpu in self.watch.cpu_s.items()
        ]
        busy = self.watch.all_cpu_s / (self.wall_s * len(os.sched_getaffinity(0)))
        total = f"{self.watch.all_cpu_s:.2f} | {self.ratio:.2f} | {self.watch.most_mib:.0f}"
        return [
            f"| {self.name} | processor s | times decoding | most MiB |", "|---|---|---|---|",
            *stages, f"| **all** | {total} |", "",
            f"decoding {self.frames} frames once: {self.decoding_s[0]:.2f} s before, "
            f"{self.decoding_s[1]:.2f} s after; cores busy {100 * busy:.0f} %", self.scores, "",
        ]  # fmt: skip


def main() -> None:
    """Measure every recording and print its table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, help="where run folders are written")
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--apart", action="store_true", help="stages one after the other")
    parser.add_argument("--score", type=Path, help="script that scores a run folder against its recording")
    parser.add_argument("--flame", action="store_true", help="draw a flame graph with py-spy")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        run(given.recordings[0], given.out, given.apart)
        return
    for recording in given.recordings:
        print("\n".join(measured(recording.resolve(), given).lines()), flush=True)


def run(recording: Path, folder: Path, apart: bool) -> None:
    """Run a recording from the start."""
    job = prepare(recording, folder, probe=None, configuration=configuration())
    gc.freeze()  # as the command does
    run_job(replace(job, at_once=1 if apart else job.at_once), Selection(resume=False), SilentDisplay())
    gc.freeze()


def measured(recording: Path, given: argparse.Namespace) -> Measured:
    """Decode, run, decode again, score."""
    folder = given.out.resolve() / recording.name
    video = recording / read_yaml(recording / "recording.yaml").text("video")
    frames, before_s = decoding(video)
    log = folder / ".boresight" / "run.log"
    log.unlink(missing_ok=True)
    command = [sys.executable, "-m", "tests.benchmarks.bench_speed", str(folder), str(recording), "--child"]
    environment = with_bytecode(given.out)
    started = time.monotonic()
    process = subprocess.Popen(
        [*flame(given, recording.name), *command, *["--apart"] * given.apart], cwd=ROOT, env=environment
    )
    with Watch(process.pid, Progress(log)) as watch:
        if process.wait():
            raise SystemExit(f"the run of {recording} failed: see {log}")
    wall_s = time.monotonic() - started
    _, after_s = decoding(video)
    return Measured(
        recording.name, frames, (before_s, after_s), watch, wall_s, scores(given.score, folder, recording)
    )


def flame(given: argparse.Namespace, name: str) -> Sequence[str]:
    """Return the arguments that draw a flame graph of the command after them."""
    if not given.flame:
        return ()
    return ("py-spy", "record", "--threads", "--output", str(given.out.resolve() / f"{name}.svg"), "--")


def with_bytecode(out: Path) -> dict[str, str]:
    """Return an environment in which modules are loaded from bytecode, after writing that bytecode."""
    environment = os.environ | {"PYTHONPYCACHEPREFIX": str(out.resolve() / "bytecode")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    once = [sys.executable, "-c", "import pipeline.api.run, tests.benchmarks.bench_speed"]
    subprocess.run(once, cwd=ROOT, env=environment, check=True)
    return environment


def decoding(video: Path) -> tuple[int, float]:
    """Return how many frames a video has, and the processor time of decoding them on one thread, s."""
    with av.open(str(video)) as container:
        stream = container.streams.video[0]
        stream.thread_type, stream.thread_count = "NONE", 1
        start = time.process_time()
        frames = sum(1 for _ in container.decode(stream))
        return frames, time.process_time() - start


def scores(script: Path | None, folder: Path, recording: Path) -> str:
    """Return the scores of a run in a line."""
    if script is None:
        return ""
    command = [sys.executable, str(script), str(folder), str(recording)]
    said = json.loads(subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout)
    return json.dumps(said)


if __name__ == "__main__":
    main()
