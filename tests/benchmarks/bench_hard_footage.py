"""Hard footage made of an open recording, run and scored: one line of the table for each kind and seed.

usage: python -m tests.benchmarks.bench_hard_footage OUT [KIND ...]
           [--recording NAME] [--frames N] [--seeds N] [--probe FILE] [--spoil-answers]

Without KIND all are made. What is there in OUT is kept: footage, run and score are made once. The footage of
`SPOILT` is the shared `harder.py`'s; that of `OWN` is made here, so that nothing is fitted to the former.

With `--spoil-answers` runs that are there are scored once more with a wall 0.3 mm too wide and findings moved
by 30 mm: every figure must then be bad.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

from tests.shared_data import shared

Image = NDArray[np.float32]

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


def hot_pixels(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """One pixel in 500 white or black, anew in each frame."""
    struck = random.random(image.shape[:2])
    image[struck < 0.001] = 255.0
    image[struck > 0.999] = 0.0
    return image


def static_reflection(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """A bright spot of the laser's colour beside the line, at one place of the image in all frames."""
    if laser:
        h, w = image.shape[:2]
        v, u = np.mgrid[:h, :w]
        away = ((u - w / 2 - 0.42 * h * 0.95) / 5) ** 2 + ((v - h / 2) / 14) ** 2
        image += (300 * np.exp(-0.5 * away))[..., None] * np.array([0.25, 1.0, 0.15], np.float32)
    return image


def droplet(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """A drop on the window draws what is behind it aside by up to four pixels."""
    h, w = image.shape[:2]
    top, left, size = int(0.1 * h), w // 2 - 45, 90
    v, u = np.mgrid[:size, :size].astype(np.float32) - size / 2
    lens = 4 * np.exp(-((np.hypot(u, v) / 25) ** 2)) / np.maximum(np.hypot(u, v), 1)
    rows = np.clip(np.rint(v + size / 2 + lens * v), 0, size - 1).astype(int)
    columns = np.clip(np.rint(u + size / 2 + lens * u), 0, size - 1).astype(int)
    patch = image[top : top + size, left : left + size].copy()
    image[top : top + size, left : left + size] = patch[rows, columns]
    return image


def banding(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Exposure that varies by a third over the rows and rolls from frame to frame."""
    rows = np.arange(len(image)) / 140 + 0.37 * k
    return image * (1 + 0.33 * np.sin(2 * np.pi * rows))[:, None, None].astype(np.float32)


def interlaced(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Every second row is half a pixel aside."""
    image[1::2] = 0.5 * (image[1::2] + np.roll(image[1::2], 1, axis=1))
    return image


def dim_sector(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """The laser is ten times weaker over 40 degrees, and over 10 of these it is not there at all."""
    if laser:
        h, w = image.shape[:2]
        psi = np.arctan2(*(np.mgrid[:h, :w] - np.array([h, w])[:, None, None] / 2))
        image[np.abs(psi - 1.2) < np.radians(20)] *= 0.1
        image[np.abs(psi - 1.2) < np.radians(5)] *= 0.0
    return image


def second_ring(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """A reflection of the ring, a quarter as bright and 6 % smaller."""
    if laser:
        h, w = image.shape[:2]
        v = np.clip(np.rint((np.arange(h) - h / 2) / 0.94 + h / 2), 0, h - 1).astype(int)
        u = np.clip(np.rint((np.arange(w) - w / 2) / 0.94 + w / 2), 0, w - 1).astype(int)
        image = image + 0.25 * image[np.ix_(v, u)]
    return image


OWN: dict[str, Callable[[Image, bool, int, np.random.Generator], Image]] = {
    f.__name__.replace("_", "-"): f
    for f in (hot_pixels, static_reflection, droplet, banding, interlaced, dim_sector, second_ring)
}


def make(kind: str, source: Path, folder: Path, frames: int, seed: int) -> None:
    """Make the footage of a kind; one's own kinds spoil what `harder.py` makes of the clean recording."""
    spoil = SPOILT.get(kind, SPOILT["clean"])
    harder = [sys.executable, str(shared("harder.py")), str(source), str(folder), *spoil]
    subprocess.run([*harder, "--frames", str(frames), "--seed", str(seed)], check=True)
    if kind in OWN:
        repaint(folder, OWN[kind], seed)


def repaint(folder: Path, paint: Callable[..., Image], seed: int, crf: int = 16) -> None:
    """Put every frame of a recording through ``paint``, and store them at a constant rate factor."""
    random, video = np.random.default_rng(seed), folder / "frames.mkv"
    rows = (folder / "frames.csv").read_text("utf-8").splitlines()[1:]
    laser = [not row.endswith("led") for row in rows]
    painted = folder / "painted.mkv"
    with av.open(str(video)) as old, av.open(str(painted), "w") as new:
        first = old.streams.video[0]
        stream = new.add_stream("libx264", rate=first.average_rate)
        stream.width, stream.height, stream.pix_fmt = first.width, first.height, "yuv420p"
        stream.options = {"crf": str(crf), "preset": "veryfast"}
        for k, frame in enumerate(old.decode(video=0)):
            image = paint(frame.to_ndarray(format="bgr24").astype(np.float32), laser[k], k, random)
            made = av.VideoFrame.from_ndarray(np.clip(image + 0.5, 0, 255).astype(np.uint8), format="bgr24")
            new.mux(stream.encode(made))
        new.mux(stream.encode())
    shutil.move(painted, video)


def scored(footage: Path, run: Path, more: list[str]) -> dict[str, dict[str, float]]:
    """Run a recording, score it against its truth, and keep the score beside the run."""
    kept = run.with_suffix(".score.json")
    if not kept.is_file():
        command = [sys.executable, "-m", "pipeline.cli", "run", str(footage), "-o", str(run), *more]
        with run.with_suffix(".log").open("w", encoding="utf-8") as log:
            subprocess.run(command, check=True, stdout=log, stderr=subprocess.STDOUT)
        kept.write_text(json.dumps(score_of(run, footage)), "utf-8")
    out: dict[str, dict[str, float]] = json.loads(kept.read_text("utf-8"))
    return out


def spoilt(footage: Path, run: Path) -> dict[str, dict[str, float]]:
    """Score the run's answers when wall and findings are wrong."""
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
        return score_of(wrong, footage)


def score_of(run: Path, footage: Path) -> dict[str, dict[str, float]]:
    score = [sys.executable, str(shared("score_run.py")), str(run), str(footage)]
    out: dict[str, dict[str, float]] = json.loads(
        subprocess.run(score, check=True, capture_output=True, text=True).stdout
    )
    return out


def line(name: str, score: dict[str, dict[str, float]], run: Path) -> str:
    wall, defects, apart = score["wall"], score["defects"], json.loads((run / "unconfirmed.json").read_text())
    warned = json.loads((run / "run.json").read_text("utf-8"))["warnings"]
    return (
        f"{name:28s} random {wall['radius_mad_sigma_mm']:.3f} bias {wall['radius_bias_mm']:+.3f} mm, "
        f"inside 95 % {100 * wall['within_1.96_sigma']:.1f}, "
        f"axial {score['trajectory']['axial_end_error_percent']:+.2f} %, "
        f"missed {defects['missed']}, false {defects['unmatched']}, unconfirmed {len(apart)}, "
        f"registration {score['texture']['registration_median_mm']:.3f} mm, "
        f"warned by {', '.join(sorted({w.split(':')[0] for w in warned})) or 'none'}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("kinds", nargs="*", choices=[[], *SPOILT, *OWN])
    parser.add_argument("--recording", default="open-1-field")
    parser.add_argument("--frames", type=int, default=170)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--probe")
    parser.add_argument("--spoil-answers", action="store_true")
    asked = parser.parse_args()
    more = ["--probe", asked.probe] if asked.probe else []
    asked.out.mkdir(parents=True, exist_ok=True)
    for kind in asked.kinds or [*SPOILT, *OWN]:
        for seed in range(1, asked.seeds + 1):
            name = f"{asked.recording}-{kind}-{seed}"
            footage, run = asked.out / name, asked.out / f"{name}-run"
            if not footage.is_dir():
                make(kind, shared("recordings", asked.recording), footage, asked.frames, seed)
            score = scored(footage, run, more)
            print(line(name, spoilt(footage, run) if asked.spoil_answers else score, run), flush=True)


if __name__ == "__main__":
    main()
