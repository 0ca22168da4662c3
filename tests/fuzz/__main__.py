"""Search for inputs that break a parser: ``python -m tests.fuzz [--runs N] [TARGET ...]``.

Coverage-guided (``pip install atheris``). ``--runs`` is the sum over all targets; each has a share of it.
A parser that raises anything but `InputError`, hangs for 10 s or takes 2 GiB ends the search with the input
in ``tests/fuzz/corpus/<target>/``, where the tests replay it for good.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

CORPUS = Path(__file__).with_name("corpus")
ALONE = "--alone"


def search(target: str, runs: int) -> int:
    """Run one target in a separate process; return its exit code, 0 when nothing broke."""
    command = [sys.executable, "-m", "tests.fuzz", ALONE, target, str(runs)]
    return subprocess.run(command, capture_output=True).returncode


def search_alone(target: str, runs: int) -> None:
    """Let libFuzzer run one target; does not return."""
    import atheris

    with atheris.instrument_imports(include=["pipeline", "stages"], enable_loader_override=False):
        from tests.fuzz.targets import TARGETS, scratch

    from pipeline.errors import InputError

    chosen = TARGETS[target]
    seeds = scratch() / "seeds"
    seeds.mkdir()
    (seeds / "good").write_bytes(chosen.seed())
    kept = CORPUS / target.replace(" ", "_")
    kept.mkdir(parents=True, exist_ok=True)

    def once(data: bytes) -> None:
        try:
            chosen.take(data)
        except InputError:
            return

    limits = ["-timeout=10", "-rss_limit_mb=2048", "-max_len=20000", "-verbosity=0", "-seed=1"]
    atheris.Setup(
        ["fuzz", f"-runs={runs}", *limits, f"-artifact_prefix={kept}/", str(seeds), str(kept)], once
    )
    atheris.Fuzz()


def main() -> None:
    """Search all targets, or those named, and print a line each."""
    from tests.fuzz.targets import TARGETS

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("targets", nargs="*", default=list(TARGETS))
    parser.add_argument("--runs", type=int, default=1_000_000)
    told = parser.parse_args()
    shares = sum(TARGETS[name].share for name in told.targets)
    for name in told.targets:
        runs = int(told.runs * TARGETS[name].share / shares) + 1
        start = time.perf_counter()
        code = search(name, runs)
        ending = "nothing broke" if code == 0 else f"BROKE (exit {code}), see corpus"
        print(f"{name:<16} {runs:>8} inputs {time.perf_counter() - start:>7.0f} s  {ending}", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == [ALONE]:
        search_alone(sys.argv[2], int(sys.argv[3]))
    else:
        main()
