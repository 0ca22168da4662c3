"""Hard footage made of an open recording, run and scored: one line of the table for each kind and seed.

usage: python -m tests.benchmarks.bench_hard_footage OUT [KIND ...] [--recording NAME] [--frames N] [--seeds
N] [--probe FILE] [--spoil-answers]

Without KIND all kinds are made. Footage, runs and scores that are in OUT are not made again. The footage of
`SPOILT` is that of the shared `harder.py`; that of `hard_kinds` is ours, so that nothing is fitted to the
former. With `--spoil-answers` existing runs are scored once more with a wall 0.3 mm too wide and findings
moved by 30 mm: then every figure must be bad. "Not in the wall" counts the findings at whose place the true
wall has no such relief (`true_wall`); "false" is the shared score's figure, which counts some real ones too.
"""

from __future__ import annotations

import argparse
import csv
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import av
import numpy as np

from tests.benchmarks.hard_files import (
    CODED,
    DAMAGED,
    EXCHANGED,
    FILTERED,
    FROZEN,
    KINDS,
    LOST,
    REWRITTEN,
    exchanged,
    forget_lost,
    held_still,
)
from tests.benchmarks.hard_kinds import PAINTED, Paint, unspoilt
from tests.benchmarks.true_wall import errors, not_in_wall, true_wall
from tests.shared_data import shared

CAREFUL = {"crf": "16", "preset": "veryfast"}
SPOILT = {
    "clean": ["crf=18"],
    "crf30": ["crf=30"],
    "crf30-no-encoder": ["crf=30", "no-encoder"],
    "glint": ["glint=7"],
    "all": [
        "crf=28",
        "gamma=2.2",
        "glint=7",
        "dust=14",
        "vignetting=0.2",
        "defocus=1.5",
        "flicker=0.4",
        "blur=2",
    ],
}


def make(kind: str, source: Path, folder: Path, frames: int, seed: int) -> None:
    """Make the footage of a kind; our own kinds change what `harder.py` makes of the clean recording."""
    if kind in SPOILT:
        harder = [sys.executable, str(shared("harder.py")), str(source), str(folder), *SPOILT[kind]]
        subprocess.run([*harder, "--frames", str(frames), "--seed", str(seed)], check=True)
        return
    clean = folder.with_name(f"{source.name}-clean-{seed}")
    if not clean.is_dir():
        make("clean", source, clean, frames, seed)
    shutil.copytree(clean, folder)
    random, video = np.random.default_rng(seed), folder / "frames.mkv"
    if kind in PAINTED or kind in FROZEN:
        repaint(folder, PAINTED.get(kind) or held_still(FROZEN[kind]), seed)
    if kind in FILTERED:
        repaint(folder, FILTERED[kind](), seed)
    if kind in EXCHANGED:
        repaint(folder, unspoilt, seed, taken=EXCHANGED[kind])
    if kind in LOST:
        kept = LOST[kind](len((folder / "frames.csv").read_text("utf-8").splitlines()) - 1, random)
        repaint(folder, unspoilt, seed, taken=dict(enumerate(kept)))
        forget_lost(folder, kept)
    if kind in CODED:
        repaint(folder, unspoilt, seed, *CODED[kind])
    if kind in REWRITTEN:
        REWRITTEN[kind](folder, random)
    if kind in DAMAGED:
        video.write_bytes(DAMAGED[kind](video.read_bytes(), random))


def repaint(
    folder: Path, paint: Paint, seed: int, codec: str = "libx264", options: dict[str, str] = CAREFUL,
    taken: Mapping[int, int] | None = None,
) -> None:  # fmt: skip
    """Apply ``paint`` to every frame of a recording and encode them, perhaps in another order."""
    random, video, painted = np.random.default_rng(seed), folder / "frames.mkv", folder / "painted.mkv"
    rows = (folder / "frames.csv").read_text("utf-8").splitlines()[1:]
    laser = [not row.endswith("led") for row in rows]
    with av.open(str(video)) as old, av.open(str(painted), "w") as new:
        stream = new.add_stream(codec, rate=old.streams.video[0].average_rate)
        stream.pix_fmt, stream.options = "yuv420p", options
        for k, frame in enumerate(exchanged(old.decode(video=0), taken or {})):
            image = paint(frame.to_ndarray(format="bgr24").astype(np.float32), laser[k], k, random)
            if k == 0:
                stream.height, stream.width = image.shape[:2]
            stored = np.clip(image + 0.5, 0, 255).astype(np.uint8)
            new.mux(stream.encode(av.VideoFrame.from_ndarray(stored, format="bgr24")))
        new.mux(stream.encode())
    shutil.move(painted, video)


def scored(footage: Path, run: Path, more: list[str]) -> dict[str, dict[str, float]] | None:
    """Run a recording, score it against its truth, and keep the score beside the run; None if it failed."""
    kept = run.with_suffix(".score.json")
    if not kept.is_file():
        command = [sys.executable, "-m", "pipeline.cli", "run", str(footage), "-o", str(run), *more]
        with run.with_suffix(".log").open("w", encoding="utf-8") as log:
            if subprocess.run(command, check=False, stdout=log, stderr=subprocess.STDOUT).returncode:
                return None
        kept.write_text(json.dumps(score_of(run, footage)), "utf-8")
    out: dict[str, dict[str, float]] = json.loads(kept.read_text("utf-8"))
    return out


def spoilt_line(name: str, footage: Path, run: Path) -> str:
    """Return the line of the run's answers with a wrong wall and wrong findings."""
    with tempfile.TemporaryDirectory() as folder:
        wrong = Path(folder) / "run"
        shutil.copytree(run, wrong, ignore=shutil.ignore_patterns(".boresight", "tileset", "*.glb", "*.ply"))
        wall = dict(np.load(wrong / "radius_map.npz"))
        wall["radius_mm"] = wall["radius_mm"] + 0.3
        np.savez(wrong / "radius_map.npz", **wall)
        found = json.loads((wrong / "defects.json").read_text("utf-8"))
        for defect in found["defects"] if isinstance(found, dict) else found:
            defect["distance_from_mm"] += 30
            defect["distance_to_mm"] += 30
        (wrong / "defects.json").write_text(json.dumps(found), "utf-8")
        return line(name, score_of(wrong, footage), footage, wrong)


def score_of(run: Path, footage: Path) -> dict[str, dict[str, float]]:
    score = [sys.executable, str(shared("score_run.py")), str(run), str(footage)]
    out: dict[str, dict[str, float]] = json.loads(
        subprocess.run(score, check=True, capture_output=True, text=True).stdout
    )
    return out


def line(name: str, score: dict[str, dict[str, float]], footage: Path, run: Path) -> str:
    wall, defects, apart = score["wall"], score["defects"], json.loads((run / "unconfirmed.json").read_text())
    truth = true_wall(footage)
    off = errors(run, truth, wall)
    warned = json.loads((run / "run.json").read_text("utf-8"))["warnings"]
    return (
        f"{name:28s} random {wall['radius_mad_sigma_mm']:.3f} bias {wall['radius_bias_mm']:+.3f} mm, "
        f"inside 95 % {100 * wall['within_1.96_sigma']:.1f}, "
        f"mean {off.mean_sigmas:+.1f} of the common σ, {100 * off.inside_apart:.1f} apart from it, "
        f"axial {score['trajectory']['axial_end_error_percent']:+.2f} %, "
        f"that is {axial_sigmas(score, run):+.1f} σ, "
        f"missed {defects['missed']}, false {defects['unmatched']}, "
        f"not in the wall {len(not_in_wall(run, truth, wall))}, unconfirmed {len(apart)}, "
        f"registration {score['texture']['registration_median_mm']:.3f} mm, "
        f"warned by {', '.join(sorted({w.split(':')[0] for w in warned})) or 'none'}"
    )


def axial_sigmas(score: dict[str, dict[str, float]], run: Path) -> float:
    """Return the distance's error at the end over the σ that the run states there."""
    with (run / "trajectory.csv").open(encoding="utf-8", newline="") as file:
        last = list(csv.DictReader(file))[-1]
    return score["trajectory"]["axial_end_error_mm"] / float(last["sigma_z_mm"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("kinds", nargs="*", choices=[[], *SPOILT, *KINDS])
    parser.add_argument("--recording", default="open-1-field")
    parser.add_argument("--frames", type=int, default=170)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--probe")
    parser.add_argument("--spoil-answers", action="store_true")
    asked = parser.parse_args()
    more = ["--probe", asked.probe] if asked.probe else []
    asked.out.mkdir(parents=True, exist_ok=True)
    for kind in asked.kinds or [*SPOILT, *KINDS]:
        for seed in range(1, asked.seeds + 1):
            name = f"{asked.recording}-{kind}-{seed}"
            footage, run = asked.out / name, asked.out / f"{name}-run"
            if not footage.is_dir():
                make(kind, shared("recordings", asked.recording), footage, asked.frames, seed)
            score = scored(footage, run, more)
            if score is None:
                print(f"{name:28s} FAILED: {run.with_suffix('.log').read_text('utf-8')[-300:]}", flush=True)
                continue
            told = spoilt_line if asked.spoil_answers else partial(line, score=score)
            print(told(name, footage=footage, run=run), flush=True)


if __name__ == "__main__":
    main()
