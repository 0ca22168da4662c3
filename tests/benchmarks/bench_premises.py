"""How well wrong tables of frames are repaired: wrong lights and times that remain, per kind of fault.

usage: python -m tests.benchmarks.bench_premises FRAMES SEEDS RECORDING...

The recordings are spoiled in memory; "warned" counts warnings of the stage. Prints one line per case.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.errors import UnusableError
from pipeline.instrument.probe_file import read_probe
from pipeline.recording import open_recording
from stages.premises import PremisesParameters, check_premises
from tests.quiet import quiet_context
from tests.spoiled_recordings import SPOILERS, first_frames


def main(frames: int, seeds: int, folders: list[str]) -> None:
    for folder in folders:
        whole = open_recording(Path(folder))
        assert whole.probe_file is not None
        probe = read_probe(whole.probe_file)
        good = first_frames(whole, frames)
        for name, spoil in SPOILERS.items():
            for seed in range(1, (seeds if name != "as it is" else 1) + 1):
                spoiled = spoil(good, np.random.default_rng(seed))
                told: list[str] = []
                started = time.monotonic()
                try:
                    context = replace(quiet_context(), warn=told.append)
                    found = check_premises(spoiled.recording, probe, PremisesParameters(), context)
                    lights, times = spoiled.wrong(found)
                    result = f"wrong lights {lights}, wrong times {times} of {len(found.frame)}"
                except UnusableError as error:
                    result = f"stopped: {str(error).splitlines()[0]}"
                seconds = time.monotonic() - started
                print(f"{whole.name}, {name}, seed {seed}: {result}, warned {len(told)}, {seconds:.1f} s")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
