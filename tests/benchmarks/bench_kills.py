"""Kill -9 at random moments of a run, a batch and a review, go on, and compare with an undisturbed one.

``python -m tests.benchmarks.bench_kills [RUN_KILLS BATCH_KILLS REVIEW_KILLS]`` prints how often each was
killed, in which stages, and what was lost or came out different; it fails when anything was.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.bad_recordings import cut_sample
from tests.review_server import ReviewServer
from tests.run_content import run_content
from tests.shared_data import PROJECT_ROOT

SEED = 20261121
QUICK = ("--set", "rings.azimuths=360")


def main(kills: tuple[int, int, int]) -> int:
    """Return the number of results lost or different."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for name in ("one", "two"):
            cut_sample(folder / "recordings" / name, frames=16)
        run, batch, review = kills
        wrong = killed_runs(folder, run) + killed_batches(folder, batch) + killed_reviews(folder, review)
    print(f"{sum(kills)} kills: {wrong} results lost or different")
    return wrong


def killed_runs(folder: Path, kills: int) -> int:
    """Return how many files of runs came out different."""
    recording = str(folder / "recordings" / "one")
    return _killed(folder, "run", ["run", recording, *QUICK], kills)


def killed_batches(folder: Path, kills: int) -> int:
    """Return how many files of batches came out different."""
    return _killed(folder, "batch", ["batch", str(folder / "recordings"), "--workers", "2", *QUICK], kills)


def killed_reviews(folder: Path, kills: int) -> int:
    """Kill the server before, while or after it answers; return how many acknowledged actions were lost."""
    chance = random.Random(SEED)
    with ReviewServer(folder / "whole-run") as server:
        answered = sum(_added(server, k) for k in range(3))
        for _ in range(kills):
            # A busy machine answers late: about every second kill is to come before the answer.
            began = time.perf_counter()
            answered += _added(server, answered)
            stop = _kill_soon(server, 2 * (time.perf_counter() - began) * chance.random())
            answer = _added(server, answered)
            stop()
            server.start()
            kept = server.ask("/api/state").json()["revision"]
            if kept < answered + answer:
                print(f"review: {kept} actions kept, {answered + answer} were acknowledged")
                return 1
            answered = kept
    print(f"review: {kills} kills, {answered} actions kept, none of the acknowledged lost")
    return 0


def _added(server: ReviewServer, revision: int) -> int:
    try:
        outline = [[1, 0], [2, 0], [2, 0.1]]
        return int(server.act(revision, do="add", kind="pit", outline=outline).code == 200)
    except OSError:
        return 0


def _kill_soon(server: ReviewServer, delay_s: float):
    import threading

    timer = threading.Timer(delay_s, server.kill)
    timer.start()
    return timer.join


def _killed(folder: Path, name: str, words: list[str], kills: int) -> int:
    """Kill one command again and again, finishing now and then; return the number of files that differ."""
    started = time.perf_counter()
    _finish(words, folder / f"whole-{name}")
    duration, whole = time.perf_counter() - started, run_content(folder / f"whole-{name}")
    chance, stages, wrong, done = random.Random(SEED), Counter[str](), 0, 0
    while done < kills:
        output = folder / f"{name}-{done}"
        for _ in range(min(8, kills - done)):
            process = _start(words, output)
            try:
                process.wait(chance.uniform(0.1, duration))
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                stages[_stage(output)] += 1
                done += 1
            else:
                break
        _finish(words, output)
        found = run_content(output)
        different = sorted(k for k in whole.keys() | found.keys() if whole.get(k) != found.get(k))
        print("".join(f"  {name}: {file} differs\n" for file in different), end="")
        wrong += len(different)
    print(f"{name}: {done} kills, {wrong} files different; last in the log: {dict(stages)}")
    return wrong


def _start(words: list[str], output: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "pipeline.cli", *words, "-o", str(output)]
    quiet = subprocess.DEVNULL
    return subprocess.Popen(command, cwd=PROJECT_ROOT, stdout=quiet, stderr=quiet, start_new_session=True)


def _finish(words: list[str], output: Path) -> None:
    if _start(words, output).wait():
        raise RuntimeError(f"{words} failed in {output}")


def _stage(output: Path) -> str:
    logs = sorted(output.rglob("run.log"), key=lambda p: p.stat().st_mtime)
    told = [
        line.split(" stage ")[1] for log in logs for line in log.read_text().splitlines() if " stage " in line
    ]
    return told[-1] if told else "before the first stage"


if __name__ == "__main__":
    asked = tuple(map(int, sys.argv[1:4])) or (140, 40, 40)
    sys.exit(bool(main(asked)))
