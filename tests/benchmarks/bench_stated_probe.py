"""Whether the wall's σ is true over many instruments: one recording, run with drawn probe files.

The instrument's error is the same in all samples of a recording: one draw. The share of samples inside their
intervals is therefore near 0 or near 100 % in most single recordings, and no test of that part of σ. Here
probe files are drawn about a calibrated one by the uncertainty that the recording's own file states, as a
maker's certificate would be off, and each is run: over the draws 95 % must be inside, and the mean error of
the radius must be one of its stated σ, rms.

usage: python -m tests.benchmarks.bench_stated_probe OUT RECORDING CALIBRATED [--draws N] [--understate F]

With ``--understate 3`` the files state a third of what was drawn: the share inside must then be bad.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import yaml

from tests.benchmarks.bench_hard_footage import axial_sigmas, scored


def drawn(stated: Path, centre: Path, understate: float, random: np.random.Generator) -> dict[str, object]:
    """Return a probe file's content: ``stated``, with camera and laser drawn about those of ``centre``."""
    probe, at = (yaml.safe_load(path.read_text("utf-8")) for path in (stated, centre))
    sigma, camera, laser = probe["standard_uncertainty"], probe["camera"], probe["laser"]
    focal = random.normal(0, sigma["focal_px"])
    camera["focal_px"] = [f + focal for f in at["camera"]["focal_px"]]
    for name in ("centre_px", "distortion"):
        camera[name] = [float(v) for v in random.normal(at["camera"][name], sigma[name])]
    for name in ("baseline_mm", "opening_angle_deg"):
        laser[name] = float(random.normal(at["laser"][name], sigma[name]))
    across = np.radians(at["laser"]["tilt_direction_deg"])
    tilt = at["laser"]["tilt_deg"] * np.array([np.cos(across), np.sin(across)])
    tilt = random.normal(tilt, sigma["tilt_deg"])
    laser["tilt_deg"], laser["tilt_direction_deg"] = (
        float(np.hypot(*tilt)),
        float(np.degrees(np.arctan2(*tilt[::-1]))),
    )
    probe["standard_uncertainty"] = {n: (np.array(v) / understate).tolist() for n, v in sigma.items()}
    return dict(probe)


def calibration_sigma_mm(run: Path) -> float:
    """Return the median σ of the radius that a run states for its instrument."""
    stages = json.loads((run / "run.json").read_text("utf-8"))["stages"]
    numbers = {n["name"]: n["value"] for s in stages for n in s["numbers"]}
    return float(numbers["1 σ of the radius, calibration, median"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("recording", type=Path)
    parser.add_argument("calibrated", type=Path)
    parser.add_argument("--draws", type=int, default=12)
    parser.add_argument("--understate", type=float, default=1.0)
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for draw in range(asked.draws):
        name = f"{asked.recording.name}-{draw}" + f"-by-{asked.understate:g}" * (asked.understate != 1)
        file, run = asked.out / f"{name}.yaml", asked.out / f"{name}-run"
        probe = drawn(
            asked.recording / "probe.yaml", asked.calibrated, asked.understate, np.random.default_rng(draw)
        )
        file.write_text(yaml.safe_dump(probe), "utf-8")
        score = scored(asked.recording, run, ["--probe", str(file)])
        if score is None:
            print(f"{name} FAILED: {run.with_suffix('.log').read_text('utf-8')[-300:]}", flush=True)
            continue
        bias, sigma = score["wall"]["radius_bias_mm"], calibration_sigma_mm(run)
        rows.append((score["wall"]["within_1.96_sigma"], bias / sigma, axial_sigmas(score, run)))
        print(
            f"{name} bias {bias:+.3f} mm ({rows[-1][1]:+.2f} of its σ {sigma:.3f}), "
            f"inside {100 * rows[-1][0]:.1f} %, axial {rows[-1][2]:+.2f} σ", flush=True,
        )  # fmt: skip
    inside, radius, axial = np.array(rows).T
    print(
        f"{len(rows)} draws: inside {100 * inside.mean():.1f} % (single ones {100 * inside.min():.1f} to "
        f"{100 * inside.max():.1f}), radius rms {np.sqrt(np.mean(radius**2)):.2f} σ, "
        f"axial rms {np.sqrt(np.mean(axial**2)):.2f} σ"
    )


if __name__ == "__main__":
    main()
