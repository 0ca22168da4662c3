"""Whether the stated confidence of findings is true.

Drawn recordings, easy and hard, compared with their truth. usage: python -m tests.benchmarks.bench_findings
OUT [--recordings N] [--first SEED] [--say-sure]

Every recording is drawn: texture, defects, speed, light, and how the footage was spoiled (compression,
glints, dust on the window, noise, exposure). It is rendered in small and processed up to its findings, and
each finding is compared with the drawn defects. Results in OUT are kept, so that the benchmark can be run in
parts. It prints, over all recordings, how often a finding of stated confidence is real, and the expected and
the counted number of false ones. ``--say-sure`` states 1 for every finding: then the table must be refused.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from scipy.stats import beta, poisson

from pipeline.api.job import open_job, run_job
from pipeline.errors import UnusableError
from pipeline.export.catalogue import EXPORTERS
from pipeline.machine.configuration import resolve
from pipeline.machine.display import SilentDisplay
from pipeline.machine.plan import Selection
from pipeline.simulator.scene import Scene, scene_from
from stages.catalogue import PIPELINE
from tests.benchmarks.bench_hard_footage import repaint
from tests.benchmarks.hard_kinds import Image
from tests.benchmarks.true_wall import TrueWall, true_wall
from tests.simulated import SCENES, rendered, shipped, smaller

_STAGES = tuple(s for s in PIPELINE if s.name not in ("overlays", "mesh", "sections"))
_FILES = tuple(e for e in EXPORTERS if e.name == "defects.json")
_SHRINK, _FRAMES, _WAY_MM = 3, 100, (50.0, 110.0)
_BASES = ("straight-4-inch", "oval-3-inch", "welded-4-inch")
_INTO = ("pit", "corrosion", "gouge")
_KINDS = (*_INTO, "deposit", "dent")
# Beside a joint, whose edges are relief too, nothing is counted.
_JOINT_MM = 14.0
_BINS = (0.0, 0.2, 0.5, 0.8, 0.95, 1.0)
# A table is refused where chance would give the counts of a bin less often than this.
_REFUSED = 1e-3


@dataclass(frozen=True)
class Footage:
    """How a recording was spoiled."""

    crf: int
    glints: int
    specks: int
    noise: float
    exposure: float
    blur_px: float


@dataclass(frozen=True)
class Counted:
    """One finding compared with the truth."""

    recording: str
    confirmed: bool
    stated: float
    real: bool
    depth_mm: float
    depth_sigma_mm: float


def drawn_footage(random: np.random.Generator) -> Footage:
    """Draw how hard the footage is: one in three is not spoiled."""
    if random.random() < 1 / 3:
        return Footage(16, 0, 0, 0.0, 1.0, 0.0)
    return Footage(
        int(random.integers(18, 33)), int(random.integers(0, 8)), int(random.integers(0, 12)),
        float(random.uniform(0, 3)), float(random.uniform(0.5, 1.6)), float(random.uniform(0, 1.2)),
    )  # fmt: skip


def drawn_scene(seed: int) -> Scene:
    """Draw a small scene: the wall's texture, its defects and the probe's speed."""
    random = np.random.default_rng(seed)
    base = smaller(shipped(_BASES[seed % len(_BASES)]), _SHRINK, _FRAMES)
    values = base.model_dump(mode="json", exclude_defaults=True)
    way = float(random.uniform(*_WAY_MM))
    pipe = values["pipe"]
    pipe["surface"] = {
        "albedo": float(random.uniform(0.25, 0.5)), "mottle": float(random.uniform(0.1, 0.5)),
        "grain": float(random.uniform(0.05, 0.25)), "rust": float(random.uniform(0, 0.6)),
        "streaks": float(random.uniform(0, 0.4)), "spots": float(random.uniform(0, 0.1)),
    }  # fmt: skip
    pipe["relief"] = {"roughness_mm": float(random.uniform(0.005, 0.04))}
    pipe["defects"] = _drawn_defects(random, way, pipe["diameter_mm"] / 2)
    values["motion"]["legs"] = [{"duration_s": _FRAMES / 30, "speed_mm_s": way / (_FRAMES / 30)}]
    values["light"] = {"level": 0.4}
    camera = values["probe"]["camera"]
    camera["image_size"] = [n // 2 * 2 for n in camera["image_size"]]
    changes = {"name": f"drawn-{seed}", "seed": seed, "probe_seed": seed}
    return scene_from(values | changes, SCENES / "scene.yaml")


def _drawn_defects(random: np.random.Generator, way_mm: float, radius_mm: float) -> list[dict[str, object]]:
    """Draw defects that do not touch each other, some of them too shallow to be found."""
    out: list[dict[str, object]] = []
    taken: list[tuple[float, float]] = []
    first, last = 28.0, 22.0 + way_mm
    for _ in range(60):
        z, turn = random.uniform(first, last), random.uniform(-180, 180)
        length, width = random.uniform(3, 14, 2)
        gap = [np.hypot(z - at, radius_mm * _apart(turn, around)) for at, around in taken]
        if min(gap, default=np.inf) < 24.0 or len(out) == 12:
            continue
        kind = str(random.choice(_KINDS))
        size = {"length_mm": float(length), "width_mm": 2.5 if kind == "gouge" else float(width)}
        taken.append((z, turn))
        place = {"kind": kind, "distance_mm": float(z), "azimuth_deg": float(turn)}
        out.append(place | size | {"depth_mm": float(np.exp(random.uniform(np.log(0.12), np.log(1.5))))})
    return out


def _apart(one_deg: float, other_deg: float) -> float:
    return abs(float(np.radians((one_deg - other_deg + 180) % 360 - 180)))


def painter(footage: Footage, seed: int, centre: tuple[float, float]):  # type: ignore[no-untyped-def]
    """Return a function that spoils a frame (H, W, 3); specks on the window stay at their places."""
    still = np.random.default_rng(seed)
    specks = still.uniform((0, 0.3, 0.3), (2 * np.pi, 0.95, 0.8), (footage.specks, 3))

    def paint(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
        h = image.shape[0]
        if laser:
            image = image + _glints(image, footage.glints, centre, random)
        if footage.blur_px > 0.3:
            image = cv2.GaussianBlur(image, (0, 0), footage.blur_px)
        v, u = np.mgrid[:h, : image.shape[1]]
        for turn, away, dark in specks:
            x, y = centre[0] + away * h / 2 * np.cos(turn), centre[1] + away * h / 2 * np.sin(turn)
            image *= (1 - dark * np.exp(-(((u - x) ** 2 + (v - y) ** 2) / 16.0)))[..., None]
        image *= footage.exposure
        return image + (footage.noise * random.standard_normal(image.shape[:2])[..., None]).astype(np.float32)

    return paint


def _glints(image: Image, count: int, centre: tuple[float, float], random: np.random.Generator) -> Image:
    """Return specular spots of the laser's colour, on the line or up to eight pixels beside it."""
    spots, half = np.zeros(image.shape[:2], np.float32), image.shape[0] // 2
    away = np.arange(half // 4, half - 2)
    for _ in range(count):
        turn = random.uniform(0, 2 * np.pi)
        u = np.rint(centre[0] + away * np.cos(turn)).astype(int)
        v = np.rint(centre[1] + away * np.sin(turn)).astype(int)
        at = away[image[v, u, 1].argmax()] + random.uniform(-8, 8)
        place = (centre[0] + at * np.cos(turn), centre[1] + at * np.sin(turn))
        size = (random.uniform(2, 5), random.uniform(4, 16))
        cv2.ellipse(spots, (place, size, float(np.degrees(turn))), float(random.uniform(200, 700)), -1)
    return cv2.GaussianBlur(spots, (0, 0), 1.2)[..., None] * np.array([0.25, 1.0, 0.15], np.float32)


def make(seed: int, out: Path) -> Path:
    """Render and spoil the recording of a seed, unless it exists; return its folder."""
    scene = drawn_scene(seed)
    folder = out / scene.name
    if not (out / f"{scene.name}.footage.json").is_file():
        rendered(scene, out)
        footage = drawn_footage(np.random.default_rng([seed, 1]))
        centre = scene.probe["camera"]["centre_px"]
        codec = {"crf": str(footage.crf), "preset": "veryfast"}
        repaint(folder, painter(footage, seed, (centre[0], centre[1])), seed, "libx264", codec)
        (out / f"{scene.name}.footage.json").write_text(json.dumps(asdict(footage)), "utf-8")
    return folder


def run(recording: Path, folder: Path) -> None:
    """Run a recording up to its findings."""
    job = open_job(recording, folder, None, _STAGES, _FILES, resolve(_STAGES, None, ()))
    run_job(job, Selection(), SilentDisplay())


def counted(scene: Scene, folder: Path, wall: TrueWall) -> list[Counted]:
    """Return the findings of a run, each compared with the true wall, without joints and welds."""
    ends = [w.distance_mm for w in (*scene.pipe.welds, *scene.pipe.joints)]
    out = []
    for name in ("defects", "unconfirmed"):
        for found in json.loads((folder / f"{name}.json").read_text("utf-8")):
            middle = (found["distance_from_mm"] + found["distance_to_mm"]) / 2
            if found["kind"] == "weld" or min((abs(middle - e) for e in ends), default=99.0) < _JOINT_MM:
                continue
            stated, depth, sigma = (found[n] for n in ("probability", "depth_mm", "depth_sigma_mm"))
            out.append(Counted(scene.name, name == "defects", stated, wall.shows(found), depth, sigma))
    return out


def table(every: Sequence[Counted]) -> bool:
    """Print how often findings of each stated confidence are real.

    Return whether chance may explain the differences.
    """
    stated, real = np.array([c.stated for c in every]), np.array([c.real for c in every])
    good = True
    print("stated        findings  mean stated  real   95 % of that")
    for low, high in pairwise(_BINS):
        here = (stated > low) & (stated <= high) if low else stated <= high
        n, k = int(here.sum()), int(real[here].sum())
        if not n:
            continue
        mean = float(stated[here].mean())
        # Exact interval of Clopper and Pearson, Biometrika 26, 1934.
        least = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
        most = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
        print(f"{low:.2f} to {high:.2f} {n:9d} {mean:12.3f} {k / n:6.3f}   {least:.3f} to {most:.3f}")
    expected, false = float((1 - stated).sum()), int((~real).sum())
    chance = (
        2 * min(poisson.cdf(false, expected), poisson.sf(false - 1, expected))
        if expected
        else float(not false)
    )
    good &= chance > _REFUSED or 0.5 <= false / max(expected, 1e-9) <= 2
    print(f"{len(every)} findings, {expected:.1f} false expected, {false} counted, p = {min(chance, 1):.2g}")
    return bool(good)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--recordings", type=int, default=40)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--say-sure", action="store_true")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    every: list[Counted] = []
    for seed in range(asked.first, asked.first + asked.recordings):
        scene, folder = drawn_scene(seed), asked.out / f"drawn-{seed}-run"
        try:
            run(make(seed, asked.out), folder)
        except UnusableError as error:
            print(f"{scene.name}: {str(error).splitlines()[0]}", flush=True)
            continue
        found = counted(scene, folder, true_wall(asked.out / "truth" / scene.name))
        every += found
        sure = [c for c in found if c.confirmed]
        expected = sum(1 - c.stated for c in sure)
        print(
            f"{scene.name}: {len(sure)} confirmed, {sum(not c.real for c in sure)} false where "
            f"{expected:.2f} are expected; {len(found) - len(sure)} unconfirmed",
            flush=True,
        )
    if asked.say_sure:
        every = [replace(c, stated=1.0) for c in every]
    for name, some in (("confirmed", True), ("unconfirmed", False)):
        print(f"\n{name}")
        chosen = [c for c in every if c.confirmed is some]
        if chosen and not table(chosen):
            raise SystemExit(f"the stated confidence of {name} findings is not borne out")


if __name__ == "__main__":
    main()
