"""What the twin finds of effects hidden in recorded frames by hand, and what it finds where nothing is hidden.

``python -m tests.benchmarks.bench_twin_hidden hidden RUN``: RUN is a run with ``premises.withhold=10``. Each
effect is put into the recorded frames, those measured and those withheld alike, and the twin is made again;
wall, motion and photo stay those of the clean run. Printed are what was located, named and how large, against
what was put in. ``--spoil-answers`` scores every case by the next one's answer: counts must collapse.

``python -m tests.benchmarks.bench_twin_hidden nulls RUN...``: false alarms in random two thirds of the compared
frames of runs in which nothing is hidden. Subsets of one recording are not independent of each other.
"""

from __future__ import annotations

import argparse
import logging
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np

from pipeline.api.job import result_of, run_job
from pipeline.api.twin import twin_job
from pipeline.arrays import Float32, Int
from pipeline.artefacts.measured import RingSamples, Trajectory, Wall, WallTexture
from pipeline.artefacts.twin import Mismatch
from pipeline.instrument.probe import Probe
from pipeline.machine.display import SilentDisplay
from pipeline.machine.plan import Selection
from pipeline.machine.stage import Context
from pipeline.recording.base import Illumination, Recording
from pipeline.recording.checked_frames import CheckedFrames
from stages.twin import PhotometryParameters, Sums, TwinParameters, compared_with, photometry_of
from stages.twin.causes import causes
from stages.twin.locate import places_in_image
from stages.twin.reference import BlocksOfFrames, unnamed
from stages.twin.scene import Scene, scene_of

Change = Callable[[int, str, Float32], Float32]


@dataclass(frozen=True)
class Hidden:
    """An effect put in by hand.

    Attributes
    ----------
    name : str
    change : callable
        Makes a recorded picture, of a frame and a light, the one with the effect.
    names : tuple of str
        What it may be called; any one is right.
    fixed_to : str
    place : dict
        What the answer's place must be, as name: (value, tolerance).
    size : float or None
        Of the first parameter.
    """

    name: str
    change: Change
    names: tuple[str, ...]
    fixed_to: str
    place: dict[str, tuple[float, float]]
    size: float | None = None


class KeptScene(Scene):
    """A scene that keeps what frames look at: effects by hand change pictures alone."""

    kept: ClassVar[dict[tuple[str, bytes], Any]] = {}

    def lit(self, T_pc):  # type: ignore[no-untyped-def]
        """Return what a lit frame looks at."""
        return self._once("lit", T_pc)

    def line(self, T_pc):  # type: ignore[no-untyped-def]
        """Return the pixels near the line."""
        return self._once("line", T_pc)

    def _once(self, name, T_pc):  # type: ignore[no-untyped-def]
        key = (name, np.asarray(T_pc).tobytes())
        if key not in self.kept:
            self.kept[key] = getattr(Scene, name)(self, T_pc)
        return self.kept[key]


@dataclass
class Opened:
    """A run's results, as the twin takes them, with its frames' pictures."""

    frames: CheckedFrames
    rings: RingSamples
    scene: KeptScene
    recording: Recording
    pictures: dict[int, Any]

    def read(self, numbers: Int, planes: str) -> Iterator[tuple[int, Any]]:
        """Yield pictures as a recording does, each read from the video once."""
        missing = np.array([n for n in numbers if n not in self.pictures], np.int64)
        self.pictures.update(self.recording.read(missing, "grey"))
        yield from ((int(n), self.pictures[int(n)]) for n in numbers)


@dataclass
class Changed:
    """A recording with an effect in its pictures."""

    opened: Opened
    change: Change

    def read(self, numbers: Int, planes: str) -> Iterator[tuple[int, Any]]:
        """Yield changed pictures as a recording does."""
        light = dict(zip(self.opened.frames.frame.tolist(), self.opened.frames.illumination, strict=True))
        for number, image in self.opened.read(numbers, planes):
            made = self.change(number, str(light[number]), image.astype(np.float32))
            yield number, np.clip(np.round(made), 0, 255).astype(np.uint8)


def opened(run: Path, folder: Path) -> Opened:
    """Return a run's results."""
    job = twin_job(run, folder / run.name, None, (), SilentDisplay())
    stages = tuple(s for s in job.stages if s.name not in ("photometry", "twin"))
    job = replace(job, stages=stages, exporters=())
    run_job(job, Selection(), SilentDisplay())

    def of(kind: type) -> Any:
        return result_of(job, kind)

    probe, trajectory = job.source(Probe), of(Trajectory)
    scene = scene_of(probe, trajectory, of(Wall), of(WallTexture), PhotometryParameters().blur_px)
    kept = KeptScene(scene.probe, scene.surface, scene.reflectance, scene.trajectory)
    return Opened(of(CheckedFrames), of(RingSamples), kept, job.source(Recording), {})


def _context() -> Context:
    return Context(logging.getLogger("bench"), lambda *_: None, lambda *_: None, np.random.default_rng(1))


def effects(run: Opened, random: np.random.Generator) -> list[Hidden]:
    """Return the effects that are hidden, two sizes of each, at random places."""
    ring, middle = run.scene.ring, int(np.median(run.frames.frame))
    height, width = run.scene.polar[0].shape
    v, u = np.mgrid[0:height, 0:width].astype(np.float32)
    phi, theta = run.scene.polar[1], run.scene.polar[0]
    found = []
    for weak in (False, True):
        azimuth = float(random.uniform(-np.pi, np.pi))
        at_u, at_v = (
            c + 0.9 * ring.radius_px * f(azimuth)
            for c, f in zip(ring.centre_px, (np.cos, np.sin), strict=True)
        )
        near = np.hypot(u - at_u, v - at_v)
        here = {"u_px": (at_u, 24.0), "v_px": (at_v, 24.0)}
        deg = float(np.degrees(azimuth))
        kind = "weak" if weak else "strong"
        loss = 0.12 if weak else 0.35
        spot = (1 - loss * np.exp(-0.5 * (near / 16) ** 2)).astype(np.float32)
        found.append(Hidden(f"dust, {kind}", _times(spot), ("window_dirt",), "image", here))
        share = 0.35 if weak else 0.8
        mask = (share * np.exp(-0.5 * (near / 20) ** 2)).astype(np.float32)
        found.append(Hidden(f"scatter, {kind}", _scattering(mask), ("window_scatter",), "image", here))
        found.append(
            Hidden(
                f"droplet, {kind}",
                _droplet(u, v, at_u, at_v, 24.0 if weak else 40.0),
                ("droplet",),
                "image",
                here,
            )
        )
        spread = 0.025 if weak else 0.08
        each = spread * random.standard_normal(int(run.frames.frame.max()) + 1)
        found.append(Hidden(f"flicker, {kind}", _by_frame(1 + each), ("flicker",), "time", {}, spread))
        step = 1.06 if weak else 1.25
        when = {"frame_from": (middle, 15.0)}
        found.append(
            Hidden(f"exposure step, {kind}", _from(middle, step), ("exposure_step",), "time", when, step - 1)
        )
        found.append(
            Hidden(
                f"laser step, {kind}",
                _from(middle, 1 / step, "laser"),
                ("laser_step",),
                "time",
                when,
                1 / step - 1,
            )
        )
        lost = 0.5 if weak else 1.0
        dim = 1 - lost * _led_share(theta, phi, azimuth, run.scene)
        found.append(
            Hidden(f"LED fails, {kind}", _from(middle, dim, "led"), ("led_dead",), "time",
                   when | {"azimuth_deg": (deg, 20.0)}, lost)
        )  # fmt: skip
        lost, half = (0.4, 20.0) if weak else (0.85, 12.0)
        away = np.abs(np.angle(np.exp(1j * (phi - azimuth)))) * 180 / np.pi
        dim = (1 - lost / (1 + np.exp((away - half) / 1.5))).astype(np.float32)
        found.append(
            Hidden(
                f"dim sector, {kind}",
                _from(0, dim, "laser"),
                ("laser_sector",),
                "line",
                {"azimuth_deg": (deg, 10.0)},
                lost,
            )
        )
        limit = 140.0 if weak else 100.0
        found.append(
            Hidden(
                f"clipping, {kind}",
                lambda n, k, i, limit=limit: np.minimum(i, limit),
                ("saturation",),
                "image",
                {},
            )
        )
        power = 1.15 if weak else 1.4
        found.append(
            Hidden(
                f"gamma, {kind}",
                lambda n, k, i, power=power: 255 * (i / 255) ** (1 / power),
                ("response",),
                "image",
                {},
            )
        )
        blur = 1.0 if weak else 2.0
        found.append(
            Hidden(
                f"defocus, {kind}",
                lambda n, k, i, blur=blur: cv2.GaussianBlur(i, (0, 0), blur),
                ("defocus",),
                "image",
                {},
            )
        )
    return found


def _times(factor: Float32) -> Change:
    return lambda number, light, image: factor * image


def _by_frame(factor: Any) -> Change:
    return lambda number, light, image: np.float32(factor[number]) * image


def _from(first: int, factor: Any, only: str = "") -> Change:
    return lambda number, light, image: (
        np.float32(1) * factor * image if number >= first and only in ("", light) else image
    )


def _scattering(mask: Float32) -> Change:
    return lambda number, light, image: (1 - mask) * image + mask * cv2.GaussianBlur(image, (0, 0), 25)


def _droplet(u: Float32, v: Float32, at_u: float, at_v: float, radius: float) -> Change:
    square = ((u - at_u) ** 2 + (v - at_v) ** 2) / radius**2
    scale = np.where(square < 1, 1 - 1.6 * (1 - square), 1).astype(np.float32)
    map_u, map_v = ((at + (x - at) * scale).astype(np.float32) for x, at in ((u, at_u), (v, at_v)))
    return lambda number, light, image: cv2.remap(image, map_u, map_v, cv2.INTER_LINEAR)


def _led_share(theta: Float32, phi: Float32, azimuth: float, scene: Scene) -> Float32:
    """Return an LED's share of the light on a straight, round bore, each LED shining as cos of its angle."""
    lamp, radius = scene.probe.lighting, scene.surface.mean_radius_mm
    ahead = radius / np.tan(np.clip(theta, 0.2, 2.4))
    total, own = np.zeros_like(theta), np.zeros_like(theta)
    for k in range(lamp.leds):
        turn = phi - azimuth - 2 * np.pi * k / lamp.leds
        x, y, z = radius * np.cos(turn) - lamp.radius_mm, radius * np.sin(turn), ahead - lamp.z_mm
        square = x**2 + y**2 + z**2
        toward = np.maximum(radius - lamp.radius_mm * np.cos(turn), 0)
        light = toward * np.maximum(z, 0.05 * np.sqrt(square)) / square**2
        total += light
        own = light if k == 0 else own
    return np.nan_to_num(own / total).astype(np.float32)


def hidden(run: Opened, seed: int, only: str, spoil: bool) -> None:
    """Print what is found of each effect, and counts."""
    cases = effects(run, np.random.default_rng(seed))
    cases = [c for c in cases if only in c.name]
    clean = _found(run, lambda number, light, image: image)
    print("nothing hidden:", *(f"\n  {m.statement}" for m in clean), flush=True)
    counts = np.zeros(5, int)
    for k, case in enumerate(cases):
        start = time.process_time()
        found = _found(run, case.change)
        answer = cases[(k + 3) % len(cases)] if spoil else case
        score = _score(answer, found)
        counts += score
        print(
            f"{case.name}: located {score[0]} named {score[1]} size {score[2]} of {score[3]}, false {score[4]}"
        )
        for m in found:
            size = "".join(f" {p.name} {p.value:.3f} ± {p.sd:.3f}" for p in m.parameters[:1])
            where = "".join(f" {p.name} {p.value:.0f}" for p in m.place)
            print(
                f"  [{m.name}; {m.fixed_to};{where};{size}; p {m.probability:.1e}; χ² {m.chi2_before:.2f} {m.chi2_after:.2f}]"
            )
        print(f"  {time.process_time() - start:.0f} s", flush=True)
    print(
        f"{'answers spoiled: ' if spoil else ''}{len(cases)} cases: located {counts[0]}, named {counts[1]}, sizes within "
        f"2 σ {counts[2]} of {counts[3]}, false {counts[4]}"
    )


def _found(run: Opened, change: Change) -> tuple[Mismatch, ...]:
    recording: Any = Changed(run, change)
    photometry = photometry_of(
        run.scene, recording, run.frames, run.rings, PhotometryParameters(), _context()
    )
    twin = compared_with(
        run.scene, recording, run.frames, run.rings, photometry, TwinParameters(), _context()
    )
    return twin.found


def _score(case: Hidden, found: tuple[Mismatch, ...]) -> Any:
    """Return located, named, size within 2 σ, sizes, and false alarms of a case."""
    right = [m for m in found if _is_there(case, m)]
    named = [m for m in right if any(n in m.name.split(" or ") for n in case.names)]
    told = named[0].parameters[0] if named and case.size is not None else None
    inside = told is not None and case.size is not None and abs(told.value - case.size) < 2 * told.sd
    # What a flicker or a step does to both lights may be told of each.
    alike = {"flicker": ("laser_flicker",), "exposure_step": ("lamp_step", "laser_step")}
    allowed = {a for n in case.names for a in (n, *alike.get(n, ()))}
    false = [m for m in found if m not in right and not set(m.name.split(" or ")) & allowed]
    return np.array([bool(right), bool(named), inside, told is not None, len(false)], int)


def _is_there(case: Hidden, found: Mismatch) -> bool:
    place = {p.name: p.value for p in found.place}
    for name, (value, tolerance) in case.place.items():
        away = abs(place.get(name, np.inf) - value)
        away = min(away, abs(360 - away)) if name == "azimuth_deg" else away
        if not away <= tolerance:
            return False
    return case.fixed_to in found.fixed_to or any(n in found.name for n in case.names)


def nulls(run: Opened, count: int, seed: int) -> tuple[int, int]:
    """Return subsets of a run's compared frames that were looked at, and those with a false alarm."""
    random, scene = np.random.default_rng(seed), run.scene
    recording: Any = run
    photometry = photometry_of(scene, recording, run.frames, run.rings, PhotometryParameters(), _context())
    sums = Sums(scene, photometry)
    light = dict(zip(run.frames.frame.tolist(), run.frames.illumination, strict=True))
    posed = np.isin(run.frames.frame, scene.trajectory.frame)
    withheld = run.frames.frame[posed & (run.frames.withheld if run.frames.withheld is not None else True)]
    for number, image in run.read(withheld, "grey"):
        sums.add(number, Illumination(str(light[number])), image)
    lit, line = sums.cells()
    false = 0
    for _ in range(count):
        lit_use, line_use = (
            np.sort(random.permutation(len(c.frame))[: 2 * len(c.frame) // 3]) for c in (lit, line)
        )
        blocks = BlocksOfFrames(sums.blocks.mean_radius_mm, [sums.blocks.parts[k] for k in lit_use])
        few = [
            replace(c, **{n: getattr(c, n)[k] for n in ("frame", "square", "cross", "own", "pixels")})
            for c, k in ((lit, lit_use), (line, line_use))
        ]
        places, _ = places_in_image([p[0] for p in blocks.parts])
        found = (*causes(*few, scene.probe.lighting, scene.ring), *unnamed(blocks.samples()))
        false += bool(places or found)
        for m in found:
            print(f"  false: {m.statement} p {m.probability:.1e}")
        for p in places:
            print(f"  false place: {p}")
    return count, false


if __name__ == "__main__":
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("what", choices=["hidden", "nulls"])
    words.add_argument("runs", type=Path, nargs="+")
    words.add_argument("--only", default="", help="cases whose name holds this")
    words.add_argument("--seed", type=int, default=1)
    words.add_argument("--nulls", type=int, default=100, help="subsets, shared among the runs")
    words.add_argument("--spoil-answers", action="store_true")
    words.add_argument("--out", type=Path, default=Path("/tmp/bench_twin_hidden"))
    given = words.parse_args()
    if given.what == "hidden":
        for folder in given.runs:
            hidden(opened(folder, given.out), given.seed, given.only, given.spoil_answers)
    else:
        looked = [nulls(opened(r, given.out), given.nulls // len(given.runs), given.seed) for r in given.runs]
        print(
            f"false alarms in {sum(f for _, f in looked)} of {sum(n for n, _ in looked)} nulls of {len(looked)} runs"
        )
