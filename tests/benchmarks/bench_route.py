"""σ along the route of drawn pose chains.

Coverage of the 95 % intervals of position and rotation, and spread of z. usage: python -m
tests.benchmarks.bench_route [--runs N] [KIND ...]

Kinds are straight, bent, and with an IMU imu-straight, imu-bent, imu-curve. Tubes lean, the camera's heading
drifts, and distance scale and IMU have errors, all drawn from the σ that the program states for them; nothing
is rendered. With ``--spoil-answers`` σ is doubled: then every figure must be bad.
"""

from __future__ import annotations

import argparse

import numpy as np

from pipeline.instrument.probe import ImuMount
from tests.pose_chain import bowed, chain, curved, drawn_imu, errors_in_sigma
from tests.unit.test_motion_route import BENT, MOUNT, UP, laid

AXES = {
    "straight": curved((3e4, 0.0, 0.0)),
    "bent": BENT,
    "curve": curved((3e4, 0.6, 0.5)),
}
KINDS = ("straight", "bent", "imu-straight", "imu-bent", "imu-curve")


def drawn(kind: str, seed: int) -> np.ndarray:
    """Return the errors (5, 6) in σ at five places of a drawn run."""
    drift = 1e-5 * np.random.default_rng(1000 + seed).standard_normal(2)
    imu = kind.startswith("imu-")
    mount: ImuMount | None = MOUNT if imu else None
    axis = bowed(AXES[kind.removeprefix("imu-")], seed + 50)
    run = chain(axis, (drift[0], drift[1]), seed + 7, rest_s=20.0 if imu else 0.0)
    found = laid(run, drawn_imu(run, MOUNT, UP, seed) if imu else None, mount=mount)
    frames = len(run.T_pc)
    return errors_in_sigma(found, run, np.linspace(0.2 * frames, frames - 1, 5).astype(int).tolist())


def main() -> None:
    """Print one line for each kind."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kind", nargs="*", default=KINDS)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--spoil-answers", action="store_true")
    given = parser.parse_args()
    for kind in given.kind:
        z = np.array([drawn(kind, seed) for seed in range(given.runs)])
        z = z / 2 if given.spoil_answers else z
        held, rms, most = np.mean(np.abs(z) < 1.96, (0, 1)), np.sqrt(np.mean(z**2, (0, 1))), np.abs(z).max()
        print(f"{kind:14s} {given.runs} runs; x, y, z, turns about C's x, y, z: in 95 %", end=" ")
        print(np.round(100 * held).astype(int), "rms z", np.round(rms, 2), f"largest {most:.1f}", flush=True)


if __name__ == "__main__":
    main()
