"""Kill boresight with -9 at random moments, continue, and compare with undisturbed results.

``python -m tests.benchmarks.bench_kills [run=140 batch=40 review=40 calibrate=20 diagnose=10 prove=10]``
prints how often each command was killed, in which stages, and what was lost or came out different; it fails
if anything was. Calibrate, diagnose and prove use a pair drawn from the small prior, which takes minutes
each.
"""

from __future__ import annotations

import os
import random
import re
import shutil
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
PRIOR, PAIR = PROJECT_ROOT / "configs" / "priors" / "small.yaml", "small-001"
TIMED = re.compile(r"^(timing\.json|proof\.(json|html)|nonce\.txt|sealed\.yaml)$")


def main(kills: dict[str, int]) -> int:
    """Return the number of results that were lost or different."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for name in ("one", "two"):
            cut_sample(folder / "recordings" / name, frames=16)
        wrong = sum(KILLED[name](folder, number) for name, number in kills.items())
    print(f"{sum(kills.values())} kills: {wrong} results lost or different")
    return wrong


def killed_runs(folder: Path, kills: int) -> int:
    """Return how many files of runs were different."""
    recording = str(folder / "recordings" / "one")
    return _killed(folder, "run", ["run", recording, *QUICK], kills)


def killed_batches(folder: Path, kills: int) -> int:
    """Return how many files of batches were different."""
    return _killed(folder, "batch", ["batch", str(folder / "recordings"), "--workers", "2", *QUICK], kills)


def killed_reviews(folder: Path, kills: int) -> int:
    """Kill the server before, while or after it answers; return how many acknowledged actions were lost."""
    chance = random.Random(SEED)
    with ReviewServer(folder / "whole-run") as server:
        answered = sum(_added(server, k) for k in range(3))
        for _ in range(kills):
            # A busy machine answers late: about every second kill must come before the answer.
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


def killed_calibrations(folder: Path, kills: int) -> int:
    """Return how many files of calibrations were different."""
    return _killed_command(folder, ["calibrate", str(_pair(folder) / f"{PAIR}-gauge")], "probe.yaml", kills)


def killed_diagnoses(folder: Path, kills: int) -> int:
    """Return how many files of diagnoses were different."""
    field, gauge = (str(_pair(folder) / f"{PAIR}-{kind}") for kind in ("field", "gauge"))
    return _killed_command(folder, ["diagnose", field, "--gauge", gauge], "diagnosis.json", kills)


def killed_proofs(folder: Path, kills: int) -> int:
    """Return how many files of proofs were different; kills come while rendering, diagnosing and scoring."""
    return _killed_command(folder, ["prove", "--cases", "1", "--prior", str(PRIOR)], "proof.json", kills)


def _pair(folder: Path) -> Path:
    """Return the folder of a drawn pair of recordings."""
    pairs = folder / "pairs"
    if not pairs.exists():
        _finish(["simulate", "--draw", "1", "--prior", str(PRIOR), "--truth", str(folder / "truth")], pairs)
    return pairs


def _killed_command(folder: Path, words: list[str], answer: str, kills: int) -> int:
    """Kill a command repeatedly; whenever its answer exists, all its files must be the right ones."""
    started = time.perf_counter()
    _finish(words, folder / f"whole-{words[0]}")
    duration, whole = time.perf_counter() - started, _files(folder / f"whole-{words[0]}")
    chance, answers, wrong = random.Random(SEED), 0, set[str]()
    output = folder / words[0]
    for _ in range(kills):
        process = _start(words, output)
        try:
            process.wait(chance.uniform(0.1, 1.1 * duration))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        if (output / answer).exists():
            answers += 1
            wrong |= _different(whole, output)
            shutil.rmtree(output)
    _finish(words, output)
    wrong |= _different(whole, output)
    print("".join(f"  {words[0]}: {file} differs\n" for file in sorted(wrong)), end="")
    print(
        f"{words[0]}: {kills} kills in {duration:.0f} s of work, {answers} ended before, "
        f"{len(wrong)} files different"
    )
    return len(wrong)


def _files(folder: Path) -> dict[str, bytes]:
    """Return the files that must be equal: all without times and without the random nonces of seals."""
    return {
        str(p.relative_to(folder)): p.read_bytes()
        for p in sorted(folder.rglob("*"))
        if p.is_file() and not TIMED.search(p.name)
    }


def _different(whole: dict[str, bytes], output: Path) -> set[str]:
    found = _files(output)
    return {name for name in whole.keys() | found.keys() if whole.get(name) != found.get(name)}


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
    """Kill one command repeatedly and let it finish now and then; return the number of files that differ."""
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


KILLED = {
    "run": killed_runs, "batch": killed_batches, "review": killed_reviews,
    "calibrate": killed_calibrations, "diagnose": killed_diagnoses, "prove": killed_proofs,
}  # fmt: skip

if __name__ == "__main__":
    words = sys.argv[1:] or ["run=140", "batch=40", "review=40", "calibrate=20", "diagnose=10", "prove=10"]
    sys.exit(bool(main({name: int(number) for name, number in (word.split("=") for word in words)})))
