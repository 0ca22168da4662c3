"""Errors of lens and encoder added to a sound pair of another renderer, and their names by diagnosis.

usage: python -m tests.benchmarks.bench_warped OUT [CASE ...] [--pair blind-a/a10] [--others]

The pictures of gauge and inspection are warped as the error of a lens would move them, or the readings of the
encoder are changed; neither renderer nor warp shares code with the diagnosis. A case is right when exactly
its names are given with a probability of .99 or more. Cases without a name lie outside the library: any sure
name is wrong, and "unexplained" is right. ``--others`` compares every answer with the next case that has
other names or another verdict instead: the count of right ones must fall to nearly none.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from pipeline.arrays import Float, Float32
from tests.benchmarks.bench_hard_footage import repaint
from tests.shared_data import shared

RATE = 30.0
Shift = Callable[[Float32, Float32, float], tuple[Float32, Float32]]
"""Where the light of the place (x, y), in focal lengths from the centre, appears at a time in s: dx, dy."""
Reading = Callable[[Float, Float], Float]


@dataclass(frozen=True)
class Case:
    """An added error, and the names that are right; ``where`` lists the recordings that have it.

    Without a name ``verdict`` is the right one.
    """

    names: tuple[str, ...]
    shift: Shift | None = None
    reading: Reading | None = None
    copied: float = 0.0
    where: tuple[str, ...] = ("gauge", "field")
    verdict: str = "unexplained"


def scale(x: Float32, y: Float32, t: float, by: float) -> tuple[Float32, Float32]:
    return by * x, by * y


def settling_scale(x: Float32, y: Float32, t: float, by: float) -> tuple[Float32, Float32]:
    return scale(x, y, t, by * (1 - math.exp(-t / 2.5)))


def centre(x: Float32, y: Float32, t: float, by: tuple[float, float]) -> tuple[Float32, Float32]:
    return np.full_like(x, by[0]), np.full_like(y, by[1])


def knocked_centre(
    x: Float32, y: Float32, t: float, by: tuple[float, float], at: float
) -> tuple[Float32, Float32]:
    return centre(x, y, t, by if t > at else (0.0, 0.0))


def swinging_centre(
    x: Float32, y: Float32, t: float, by: tuple[float, float], hz: float
) -> tuple[Float32, Float32]:
    share = np.sin(2 * np.pi * hz * t)
    return centre(x, y, t, (by[0] * share, by[1] * share))


def tilt(x: Float32, y: Float32, t: float, by: tuple[float, float]) -> tuple[Float32, Float32]:
    near = by[0] * x + by[1] * y
    return near * x, near * y


def aspect(x: Float32, y: Float32, t: float, by: float) -> tuple[Float32, Float32]:
    return 0.5 * by * x, -0.5 * by * y


def radial(x: Float32, y: Float32, t: float, by: float) -> tuple[Float32, Float32]:
    square = x**2 + y**2
    return by * square * x, by * square * y


def trefoil(x: Float32, y: Float32, t: float, by: float) -> tuple[Float32, Float32]:
    return by * (x**2 - y**2), -2 * by * x * y


def wavy_rows(x: Float32, y: Float32, t: float, by: float) -> tuple[Float32, Float32]:
    return (by * np.sin(9 * y)).astype(np.float32), np.zeros_like(y)


def trembling(x: Float32, y: Float32, t: float, by: float) -> tuple[Float32, Float32]:
    drawn = np.random.default_rng(round(t * RATE)).normal(0, by, 2)
    return centre(x, y, t, (drawn[0], drawn[1]))


def slipped(time: Float, way: Float, at: float, by: float) -> Float:
    return way - by * np.clip((time - at) / 0.08, 0, 1)


def late(time: Float, way: Float, by: float) -> Float:
    return np.interp(time - by, time, way)


def counted_short(time: Float, way: Float, by: float) -> Float:
    return way * (1 - by)


def eccentric_wheel(time: Float, way: Float, by: float) -> Float:
    return way + by * np.sin(2 * np.pi * way / 31.0)


PX = 1 / 366.0
CASES = {
    "nothing": Case((), verdict="consistent"),
    "resampled": Case((), partial(scale, by=0.0), verdict="consistent"),
    "focal": Case(("focal_scale",), partial(scale, by=0.003)),
    "focal_small": Case(("focal_scale",), partial(scale, by=-0.001)),
    "focal_settles": Case(("focal_drift",), partial(settling_scale, by=0.003)),
    "centre": Case(("principal_point",), partial(centre, by=(1.2 * PX, -0.7 * PX))),
    "centre_knocked": Case(("principal_point",), partial(knocked_centre, by=(1.0 * PX, 0.8 * PX), at=2.6)),
    "centre_swings": Case((), partial(swinging_centre, by=(0.8 * PX, -0.6 * PX), hz=0.6)),
    "sensor_tilt": Case(("sensor_tilt",), partial(tilt, by=(0.003, 0.002))),
    "aspect": Case(("pixel_aspect",), partial(aspect, by=0.003)),
    "radial": Case(("radial_distortion",), partial(radial, by=0.002)),
    "trefoil": Case((), partial(trefoil, by=1.0 * PX)),
    "wavy_rows": Case((), partial(wavy_rows, by=0.7 * PX)),
    "trembling": Case((), partial(trembling, by=0.6 * PX)),
    "copy": Case(("ghost_ring",), partial(scale, by=0.06), copied=0.012),
    "encoder_scale": Case(("encoder_scale",), reading=partial(counted_short, by=0.012)),
    "encoder_late": Case(("time_offset",), reading=partial(late, by=0.045)),
    "encoder_slips": Case(("encoder_slip",), reading=partial(slipped, at=3.1, by=1.5), where=("field",)),
    "wheel_eccentric": Case((), reading=partial(eccentric_wheel, by=0.4)),
    "focal_and_slip": Case(
        ("focal_scale", "encoder_slip"), partial(scale, by=0.003), partial(slipped, at=2.2, by=2.0), 0.0
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Warp:
    """Warps pictures as a case defines; ``x`` and ``y`` are the places of the pixels, in focal lengths."""

    case: Case
    x: Float32
    y: Float32
    focal_px: float

    @staticmethod
    def of(case: Case, camera: dict[str, Any]) -> Warp:
        width, height = camera["image_size"]
        (cu, cv), focal = camera["centre_px"], camera["focal_px"][0]
        v, u = np.mgrid[0:height, 0:width].astype(np.float32)
        return Warp(case, (u - np.float32(cu)) / focal, (v - np.float32(cv)) / focal, focal)

    def __call__(self, image: Float32, laser: bool, k: int, random: np.random.Generator) -> Float32:
        if self.case.shift is None:
            return image
        dx, dy = self.case.shift(self.x, self.y, k / RATE)
        v, u = np.mgrid[0 : image.shape[0], 0 : image.shape[1]].astype(np.float32)
        back = u - np.float32(self.focal_px) * dx, v - np.float32(self.focal_px) * dy
        stored = np.clip(image + 0.5, 0, 255).astype(np.uint8)
        moved: Float32 = cv2.remap(stored, *back, cv2.INTER_LANCZOS4).astype(np.float32)
        return image + self.case.copied * moved if self.case.copied else moved


def make(case: Case, source: Path, folder: Path, kind: str) -> None:
    """Make one recording of a case.

    A copy of the source with warped pictures and changed encoder readings.
    """
    shutil.copytree(source, folder, ignore=shutil.ignore_patterns("truth*"))
    camera = yaml.safe_load((folder / "probe.yaml").read_text("utf-8"))["camera"]
    if kind not in case.where:
        return
    repaint(folder, Warp.of(case, camera), 1)
    if case.reading is not None:
        _rewrite(folder / "encoder.csv", case.reading)


def _rewrite(path: Path, reading: Reading) -> None:
    with path.open(encoding="utf-8", newline="") as file:
        rows = [[float(a) for a in row] for row in list(csv.reader(file))[1:]]
    time, way = np.array(rows).T
    changed = reading(time, way)
    lines = [f"{t:.4f},{w:.3f}" for t, w in zip(time, changed, strict=True)]
    path.write_text("\n".join(["time_s,distance_mm", *lines, ""]), "utf-8")


def answered(case: Case, pair: str, folder: Path) -> dict[str, object]:
    """Diagnose a case, unless its answer exists, and return the answer."""
    told = folder / "answer" / "diagnosis.json"
    if not told.is_file():
        for kind in ("gauge", "field"):
            if not (folder / kind).is_dir():
                # Moved into place when complete: a recording made only in part must not count as the case.
                half = folder / f"{kind}-half"
                shutil.rmtree(half, ignore_errors=True)
                make(case, shared("recordings", f"{pair}-{kind}"), half, kind)
                half.rename(folder / kind)
        command = [sys.executable, "-m", "pipeline.cli", "diagnose", str(folder / "field")]
        with (folder / "log").open("w", encoding="utf-8") as log:
            more = ["--gauge", str(folder / "gauge"), "-o", str(folder / "answer")]
            subprocess.run([*command, *more], check=False, stdout=log, stderr=log)
    out: dict[str, object] = json.loads(told.read_text("utf-8")) if told.is_file() else {"verdict": "failed"}
    return out


def line(name: str, case: Case, told: dict[str, object]) -> tuple[str, str]:
    """Return the result of a case in a word (right, silent, WRONG or failed), and a line about it."""
    effects = told.get("effects") or []
    assert isinstance(effects, list)
    sure = {e["name"] for e in effects if e["probability"] >= 0.99}
    if told["verdict"] == "failed":
        return "failed", f"{name:16s} failed: see its log"
    exact = sure == set(case.names) and (bool(sure) or told["verdict"] == case.verdict)
    word = "WRONG" if sure - set(case.names) else "right" if exact else "silent"
    shown = ", ".join(f"{e['name']} {e['probability']:.3f} {_sizes(e)}" for e in effects)
    rest = f"class {told.get('class')}; {told.get('identifiable')}"
    return word, f"{name:16s} {word:6s} {told['verdict']}: {shown}; {rest}"


def _sizes(effect: dict[str, dict[str, dict[str, float]]]) -> str:
    return " ".join(f"{k} {v['value']:.4g}±{v['sd']:.2g}" for k, v in effect["parameters"].items())


def another(name: str) -> Case:
    """Return the next case of all, requested or not, whose right answer differs from that of a name's."""
    own, every = CASES[name], [*CASES]
    after = every[every.index(name) :] + every
    return next(c for c in map(CASES.__getitem__, after) if (c.names, c.verdict) != (own.names, own.verdict))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("cases", nargs="*", choices=[[], *CASES])
    parser.add_argument("--pair", default="open-1")
    parser.add_argument("--others", action="store_true")
    asked = parser.parse_args()
    names, words = asked.cases or [*CASES], []
    for name in names:
        folder = asked.out / f"{asked.pair.replace('/', '-')}-{name}"
        folder.mkdir(parents=True, exist_ok=True)
        told = answered(CASES[name], asked.pair, folder)
        held = another(name) if asked.others else CASES[name]
        word, text = line(name, held, told)
        words.append(word)
        print(text, flush=True)
    counted = (f"{words.count(w)} {w}" for w in ("right", "silent", "WRONG", "failed"))
    print(f"{', '.join(counted)} of {len(words)}")


if __name__ == "__main__":
    main()
