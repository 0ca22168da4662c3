"""How many lost pictures are reported wrongly and rightly, in simulated runs of a probe pulled by hand.

usage: python -m tests.benchmarks.bench_losses RUNS FIRST_SEED

Of each kind of encoder RUNS are drawn without losses, and a quarter as many with three each of 1, 2 or 4
periods of the lights. A loss counts as found where as many pictures are reported as were lost, within one
period of the lights. While the probe stands still, as for a fifth of the time, none can be found.
"""

from __future__ import annotations

import sys

import numpy as np

from tests.hand_pulled import NOTHING, pulled

ENCODERS = ((100, 0.0), (100, 0.5), (100, 2.0), (30, 0.0), (10, 0.0), (10, 1.0), (5, 0.0), (0, 0.0))


def main(runs: int, first: int) -> None:
    for rhythm in (1, 2):
        for encoder_hz, quantum_mm in ENCODERS:
            kind = {"rhythm": rhythm, "encoder_hz": encoder_hz, "quantum_mm": quantum_mm}
            false = [pulled(seed, **kind).invented() for seed in range(first, first + runs)]
            found = lost = also = 0
            for seed in range(first, first + runs // 4):
                run = pulled(seed, lost=three_losses(seed, rhythm), **kind)
                said, true = (np.diff(r, prepend=-1) - 1 for r in (run.rows(), run.true_row))
                for place in np.flatnonzero(true):
                    near = slice(max(place - rhythm, 0), place + rhythm + 1)
                    found, lost = found + (said[near].sum() == true[place]), lost + 1
                    said[near] = 0
                also += bool(said.any())
            print(
                f"one picture in {rhythm} lit, encoder of {encoder_hz} Hz in counts of {quantum_mm:g} mm: "
                f"{np.count_nonzero(false)} of {runs} sound runs lose {sum(false)} pictures; {found} of "
                f"{lost} losses found, others beside them in {also} of {runs // 4} runs",
                flush=True,
            )


def three_losses(seed: int, rhythm: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Return the pictures that are lost, at three places."""
    random = np.random.default_rng(1000 + seed)
    at = np.sort(random.choice(np.arange(20, 380, 40), 3, replace=False))
    return np.concatenate([NOTHING, *(k + np.arange([1, 2, 4][seed % 3] * rhythm) for k in at)])


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
