"""What the twin finds of effects added to recorded frames, and in frames to which nothing was added.

``python -m tests.benchmarks.bench_twin_hidden hidden RUN``: RUN is a run with ``premises.withhold=10``. Each
effect is added to the recorded frames, both measured and withheld ones, and the twin is made again; wall,
motion and photo stay those of the clean run. It prints what was located, named and sized, against what was
added, and the same counts with every case scored by the answer to another one, which must be bad.

``python -m tests.benchmarks.bench_twin_hidden nulls RUN...``: whole twins of runs to which nothing was added,
each of frames that no other twin compares; whatever is found is a false alarm.

``python -m tests.benchmarks.bench_twin_hidden cost RUN``: processor time of rendering a frame, and of all the
work on a compared one; the first comparison also decodes its frames.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, cast

import numpy as np

from pipeline.api.job import result_of, run_job
from pipeline.api.twin import twin_job
from pipeline.arrays import Int
from pipeline.artefacts.measured import RingSamples, Trajectory, Wall, WallTexture
from pipeline.artefacts.twin import Mismatch
from pipeline.instrument.probe import Probe
from pipeline.machine.display import SilentDisplay
from pipeline.machine.plan import Selection
from pipeline.machine.stage import Context
from pipeline.recording.base import Illumination, Recording
from pipeline.recording.checks import CheckedFrames
from stages.twin import PhotometryParameters, TwinParameters, compared_with, photometry_of
from stages.twin.render import Renderer
from stages.twin.scene import Scene, scene_of
from tests.hidden_effects import Change, Hidden, effects
from tests.hidden_shine import shining

Few = tuple[int, int]
"""Numbers of measured frames of each light that are sampled, and of withheld frames that are compared."""
_OTHER = 3
"""A case is also scored by the answer to the third case after it, which is of another kind."""


class KeptScene(Scene):
    """A scene that caches the geometry of its frames: added effects change pictures alone."""

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
    """A run's results, as inputs of the twin, with its frames' pictures."""

    frames: CheckedFrames
    rings: RingSamples
    scene: KeptScene
    recording: Recording
    pictures: dict[int, Any]

    def read(self, numbers: Int, planes: str) -> Iterator[tuple[int, Any]]:
        """Yield pictures as a recording does; each is read from the video once."""
        if planes == "bgr":
            yield from self.recording.read(numbers, "bgr")
            return
        missing = np.array([n for n in numbers if n not in self.pictures], np.int64)
        self.pictures.update(self.recording.read(missing, "grey"))
        yield from ((int(n), self.pictures[int(n)]) for n in numbers)


@dataclass
class Changed:
    """A recording with an effect added to its pictures."""

    opened: Opened
    change: Change

    def read(self, numbers: Int, planes: str) -> Iterator[tuple[int, Any]]:
        """Yield changed pictures as a recording does."""
        light = dict(zip(self.opened.frames.frame.tolist(), self.opened.frames.illumination, strict=True))
        for number, image in self.opened.read(numbers, "grey"):
            black = np.float32(np.quantile(image[::8, ::8], 0.05))
            made = self.change(number, str(light[number]), image - black) + black
            grey = np.clip(np.round(made), 0, 255).astype(np.uint8)
            yield number, grey if planes == "grey" else np.repeat(grey[..., None], 3, -1)


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
    return Context(lambda *_: None, lambda *_: None, np.random.default_rng(1))


def hidden(run: Opened, few: Few, seed: int, only: str) -> None:
    """Print what is found of each effect, and the counts with the right answers and with those of others."""
    made = (
        of(run.scene, run.scene.trajectory.frame, np.random.default_rng(seed)) for of in (effects, shining)
    )
    cases = [c for some in made for c in some if any(o in c.name for o in only.split("+"))]
    clean = _found(run, few, lambda number, light, image: image)
    print(f"nothing hidden: {len(clean)} found", *(f"\n  {m.statement}" for m in clean), flush=True)
    right, spoiled = np.zeros(5, int), np.zeros(5, int)
    for k, case in enumerate(cases):
        start = time.process_time()
        found = _found(run, few, case.change)
        score = _score(case, found)
        right += score
        spoiled += _score(cases[(k + _OTHER) % len(cases)], found)
        print(f"{case.name}: {_counts(score)}; {time.process_time() - start:.0f} s")
        for m in found:
            size = "".join(f" {p.name} {p.value:.3f} ± {p.sd:.3f}" for p in m.parameters[:1])
            where = "".join(f" {p.name} {p.value:.0f}" for p in m.place)
            fit = f"p {m.probability:.1e}, χ² {m.chi2_before:.2f} to {m.chi2_after:.2f}"
            print(f"  [{m.name}; {m.fixed_to};{where};{size}; {fit}]", flush=True)
    print(f"{len(cases)} cases: {_counts(right)}\nscored by another's answer: {_counts(spoiled)}")


def _counts(score: Any) -> str:
    located, named, within, sizes, false = score
    return f"located {located}, named {named}, size within 2 σ {within} of {sizes}, false alarms {false}"


def _found(run: Opened, few: Few, change: Change) -> tuple[Mismatch, ...]:
    recording: Any = Changed(run, change)
    parameters = PhotometryParameters(sampled=few[0])
    photometry = photometry_of(run.scene, recording, run.frames, run.rings, parameters, _context())
    parameters_of_twin = TwinParameters(compared=few[1])
    twin = compared_with(
        run.scene, recording, run.frames, run.rings, photometry, parameters_of_twin, _context()
    )
    for m in twin.withdrawn:
        print(f"    withdrawn: {m.statement}", flush=True)
    return twin.found


def _score(case: Hidden, found: tuple[Mismatch, ...]) -> Any:
    """Return whether a case is located, whether named, sizes within 2 σ, all sizes, and false alarms."""
    right = [m for m in found if _is_there(case, m)]
    named = [m for m in right if any(n in m.names for n in case.names)]
    told = named[0].parameters[0] if named and case.size is not None else None
    inside = told is not None and case.size is not None and abs(told.value - case.size) < 2 * told.sd
    # A flicker or a step of both lights may be reported for each; charge leaks from clipped pixels.
    alike = {"flicker": ("laser_flicker",), "exposure_step": ("lamp_step", "laser_step"),
             "bloom": ("saturation",)}  # fmt: skip
    allowed = {a for n in case.names for a in (n, *alike.get(n, ()))}
    false = [m for m in found if m not in right and not set(m.names) & allowed]
    return np.array([bool(right), bool(named), inside, told is not None, len(false)], int)


def _is_there(case: Hidden, found: Mismatch) -> bool:
    place, sd = ({p.name: getattr(p, of) for p in found.place} for of in ("value", "sd"))
    for name, (value, tolerance) in case.place.items():
        away = abs(place.get(name, np.inf) - value)
        away = min(away, abs(360 - away)) if name == "azimuth_deg" else away
        if not away <= max(tolerance, 2 * sd.get(name, 0.0)):
            return False
    # What affects the whole picture has no place: only its name shows that it was found.
    named = any(n in found.names for n in case.names if n or case.fixed_to == found.fixed_to)
    return named or (bool(case.place) and case.fixed_to in found.fixed_to)


def nulls(run: Opened, size: int) -> tuple[int, int]:
    """Return the numbers of disjoint sets of a run's frames that were compared, and of those with an alarm.

    Frames that the run has measured are among them: their noise is also in wall and photo.
    """
    kept, recording = run.scene, cast(Any, run)
    scene = Scene(kept.probe, kept.surface, kept.reflectance, kept.trajectory)
    photometry = photometry_of(scene, recording, run.frames, run.rings, PhotometryParameters(), _context())
    posed = np.flatnonzero(np.isin(run.frames.frame, scene.trajectory.frame))
    sets, false = len(posed) // size, 0
    for k in range(sets):
        withheld = np.zeros(len(run.frames.frame), bool)
        withheld[posed[k::sets]] = True
        frames = replace(run.frames, withheld=withheld)
        twin = compared_with(
            scene, recording, frames, run.rings, photometry, TwinParameters(compared=size + 1), _context()
        )
        false += bool(twin.found)
        for m in twin.found:
            print(f"  false: {m.statement} p {m.probability:.1e}", flush=True)
    return sets, false


def cost(run: Opened, few: Few) -> None:
    """Print the processor time of rendering a frame, and of comparing one with all its results."""
    kept, recording = run.scene, cast(Any, run)
    scene = Scene(kept.probe, kept.surface, kept.reflectance, kept.trajectory)
    photometry = photometry_of(
        scene, recording, run.frames, run.rings, PhotometryParameters(sampled=few[0]), _context()
    )
    state, parameters = photometry.state, TwinParameters(compared=few[1])
    for light in np.unique(run.frames.illumination):
        lit = np.isin(run.frames.frame, scene.trajectory.frame) & (run.frames.illumination == light)
        numbers = run.frames.frame[lit][: few[1]]
        renderer = Renderer(replace(scene, outside=state.outside), state)
        renderer.frame(int(numbers[0]), Illumination(light))  # compiles, and computes what all frames share
        start = time.process_time()
        for number in numbers[1:]:
            renderer.frame(int(number), Illumination(light))
        each = (time.process_time() - start) / (len(numbers) - 1)
        print(
            f"{light}: {each:.3f} s to render a frame of {state.outside.size / 1e6:.2f} megapixels",
            flush=True,
        )
    for said in ("first", "again"):
        start = time.process_time()
        twin = compared_with(scene, recording, run.frames, run.rings, photometry, parameters, _context())
        each = (time.process_time() - start) / len(twin.frame)
        print(f"{each:.3f} s to render and compare each of {len(twin.frame)} frames, {said}", flush=True)


if __name__ == "__main__":
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("what", choices=["hidden", "nulls", "cost"])
    words.add_argument("runs", type=Path, nargs="+")
    words.add_argument("--only", default="", help="cases whose name holds one of these words, joined by +")
    words.add_argument("--sampled", type=int, default=6, help="measured frames of each light")
    words.add_argument("--compared", type=int, default=36, help="withheld frames")
    words.add_argument("--seed", type=int, default=1)
    words.add_argument("--of-set", type=int, default=24, help="frames of a null, half of them lit")
    words.add_argument("--out", type=Path, default=Path("/tmp/bench_twin_hidden"))
    given = words.parse_args()
    if given.what == "hidden":
        for folder in given.runs:
            hidden(opened(folder, given.out), (given.sampled, given.compared), given.seed, given.only)
    elif given.what == "cost":
        cost(opened(given.runs[0], given.out), (given.sampled, given.compared))
    else:
        looked = np.sum([nulls(opened(r, given.out), given.of_set) for r in given.runs], 0)
        print(f"false alarms in {looked[1]} of {looked[0]} nulls of {len(given.runs)} runs")
