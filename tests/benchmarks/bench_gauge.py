"""Simulated gauge runs with drawn probes: coverage of the 95 % intervals, and bias.

Usage: bench_gauge [RUNS]
"""

from __future__ import annotations

import sys

import numpy as np
from threadpoolctl import threadpool_limits

from tests.gauge_runs import calibrated, in_sigma, made_run


def main(runs: int) -> None:
    with threadpool_limits(1):
        drawn = []
        for seed in range(runs):
            run = made_run(seed)
            result = calibrated(run)
            drawn.append(in_sigma(run, result))
            print(seed, result.sheet.name, {n: round(v, 2) for n, v in drawn[-1].items()}, flush=True)
    names = [n for n in drawn[0] if all(n in d for d in drawn)]
    z = np.array([[d[n] for n in names] for d in drawn])
    for name, values in zip(names, z.T, strict=True):
        inside = np.mean(np.abs(values) < 1.96)
        mean = f"{values.mean():+.2f} ± {values.std() / np.sqrt(len(values)):.2f}"
        print(f"{name:<14} bias {mean} σ  sd {values.std():.2f}  within 95 % {inside:.3f}")
    print(f"all: {np.mean(np.abs(z) < 1.96):.3f} within their 95 % interval")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
