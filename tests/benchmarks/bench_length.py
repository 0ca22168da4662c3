"""Processor time per metre and memory of each stage, for a pipe of 1, 10 and 100 m.

    python -m tests.benchmarks.bench_length RUN --metres 1,10,100          # RUN: a finished run
    python -m tests.benchmarks.bench_length RUN --only motion --metres 1,10
    python -m tests.benchmarks.bench_length RUN --recording FOLDER         # rings and texture, from video

Inputs of the stages: ``motion`` (its adjustment, not the tracking of texture in pictures) gets simulated
tracks, rings and encoder readings of every ``--coarser``-th frame, one each 0.6 mm. ``triangulate`` and all
stages after it get the rings and the motion of RUN repeated end to end along a straight pipe, every
``--coarser``-th azimuth of them, on a map as much coarser. With ``--recording``, ``rings`` and ``texture``
get a real video once and then repeated, decoded anew each time. Nothing is extrapolated: a length that was
not run has no line.

Each stage runs in a separate process, which fails beyond 4 GiB of private memory (RLIMIT_DATA). Printed are
the largest memory that it and its helpers held (RssAnon, without pages mapped from files, which the system
can drop), and the processor time of all of them.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from pipeline.artefacts.findings import Defects, Sections
from pipeline.artefacts.measured import RingPoints, RingSamples, Trajectory, Wall, WallTexture
from pipeline.artefacts.model import Overlays, TexturedMesh
from pipeline.export.arrays import write_cloud, write_radius_map
from pipeline.export.glb import write_model
from pipeline.export.pictures import write_overlays, write_unrolled
from pipeline.export.tileset import write_tileset
from pipeline.instrument.probe_file import read_probe
from pipeline.machine.scratch import Scratch
from pipeline.machine.stage import Context
from pipeline.machine.store import Provenance, Store
from pipeline.recording import open_recording
from pipeline.recording.base import FrameTable, Recording
from pipeline.review.run_files import RunFiles
from stages.accumulate import AccumulateParameters, accumulate_wall
from stages.defects import DefectParameters, find_defects
from stages.mesh import MeshParameters, make_mesh
from stages.motion.bundle_adjustment.solver import Estimate
from stages.motion.parameters import MotionParameters
from stages.motion.windows.sliding_window import adjust_run
from stages.overlays import OverlayParameters, draw_overlays
from stages.rings import RingParameters, extract_rings
from stages.sections import SectionParameters, measure_sections
from stages.texture import TextureParameters, photograph_wall
from stages.triangulate import TriangulateParameters, triangulate_rings
from tests.benchmarks.long_inputs import (
    RepeatedFrames,
    even_wall,
    repeated_motion,
    repeated_photo,
    repeated_rings,
)
from tests.benchmarks.watch import Watch
from tests.long_motion import long_motion
from tests.quiet import quiet_context
from tests.synthetic_wall import bare_recording

MEMORY_BYTES = 4 << 30
KEY = "0" * 64
STEP_MM, LANDMARKS_PER_MM = 0.6, 20.0
CHAIN = (
    "motion", "triangulate", "accumulate", "overlays", "mesh", "sections", "defects", "exports", "tileset",
)  # fmt: skip
FROM_VIDEO = ("rings", "texture")
KINDS = {"rings": RingSamples, "trajectory": Trajectory, "triangulate": RingPoints, "accumulate": Wall,
         "photo": WallTexture, "overlays": Overlays, "mesh": TexturedMesh, "sections": Sections,
         "defects": Defects}  # fmt: skip


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, help="a finished run of a straight pipe")
    parser.add_argument("--metres", default="1,10,100")
    parser.add_argument("--coarser", type=int, default=4, help="every n-th azimuth, a map as much coarser")
    parser.add_argument("--only", default="", help="stages, separated by commas")
    parser.add_argument("--recording", type=Path, help="the recording of RUN: measure rings and texture too")
    parser.add_argument("--repeats", default="1,5", help="how often the recording is repeated")
    parser.add_argument("--keep", type=Path, help="where results lie, to go on with")
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        _child(given, *given.child)
        return
    only = tuple(filter(None, given.only.split(",")))
    with TemporaryDirectory() as folder:
        kept = given.keep or Path(folder)
        print(
            "| stage | length m | CPU s | CPU s per m | most memory MiB |\n|---|---|---|---|---|", flush=True
        )
        for metres in map(float, given.metres.split(",")):
            for stage in only or CHAIN:
                if stage in CHAIN:
                    _measure(given, kept / f"{metres:g}m", stage, metres)
        for times in map(float, given.repeats.split(",") if given.recording else ()):
            for stage in only or FROM_VIDEO:
                if stage in FROM_VIDEO:
                    _measure(given, kept / f"{times:g}x", stage, times)


def _measure(given: argparse.Namespace, folder: Path, stage: str, size: float) -> None:
    """Run one stage in a separate process and print its line."""
    command = [sys.executable, "-m", "tests.benchmarks.bench_length", *sys.argv[1:], "--keep", str(folder)]
    done = subprocess.run(
        [*command, "--child", stage, f"{size:g}"], stdout=subprocess.PIPE, text=True, check=False
    )
    if done.returncode:
        print(f"| {stage} | {size:g} | failed | | |", flush=True)
        return
    found = json.loads(done.stdout.splitlines()[-1])
    line = f"{found['cpu_s']:.1f} | {found['cpu_s'] / found['metres']:.2f} | {found['mib']:.0f}"
    print(f"| {stage} | {found['metres']:.3g} | {line} |", flush=True)


def _child(given: argparse.Namespace, stage: str, size: str) -> None:
    store = Store(given.keep)
    store.folder.mkdir(parents=True, exist_ok=True)
    work, metres = _work(given, store, stage, float(size))
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_BYTES, MEMORY_BYTES))
    with Watch() as watch:
        made = work()
        if stage in KINDS and made is not None:
            store.write(made, Provenance(stage, "1", KEY, 0.0, ()))
    print(json.dumps({"cpu_s": watch.all_cpu_s, "mib": watch.most_mib, "metres": metres}))


def _work(
    given: argparse.Namespace, store: Store, stage: str, size: float
) -> tuple[Callable[[], Any], float]:
    """Return the function to measure, with all its inputs prepared, and the length that it covers."""
    context = replace(quiet_context(workers=1), scratch=Scratch(store.folder))
    if stage in FROM_VIDEO:
        return _from_video(given, stage, int(size), context)
    if stage == "motion":
        step_mm = STEP_MM * given.coarser
        drawn = long_motion(round(1000 * size / step_mm), step_mm, LANDMARKS_PER_MM / given.coarser)
        parameters = MotionParameters.model_validate({})
        return lambda: adjust_run(drawn.run, parameters, _agree, context.progress), size
    needed = Inputs(given, store, size)
    made = Made(store)
    work: dict[str, Callable[[], Any]] = {
        "triangulate": lambda: triangulate_rings(
            made(RingSamples), needed.probe, TriangulateParameters.model_validate({}), context
        ),
        "accumulate": lambda: accumulate_wall(
            needed.probe, made(RingSamples), made(RingPoints), made(Trajectory),
            AccumulateParameters.model_validate(
                {"distance_step_mm": 0.5 * given.coarser, "azimuth_samples": 720 // given.coarser}
            ), context,
        ),
        "overlays": lambda: draw_overlays(
            needed.recording, made(Wall), OverlayParameters.model_validate({}), context
        ),
        "mesh": lambda: make_mesh(
            made(Wall), made(WallTexture), made(Overlays),
            MeshParameters.model_validate(
                {"texel_mm": 0.1 * given.coarser, "tile_mm": 100.0 * given.coarser}
            ), context,
        ),
        "sections": lambda: measure_sections(
            needed.recording, made(Wall), SectionParameters.model_validate({}), context
        ),
        "defects": lambda: find_defects(
            needed.recording, made(Wall), made(WallTexture), DefectParameters.model_validate({}), context
        ),
        "exports": lambda: _exports(made, store.folder / "files"),
        "tileset": lambda: _tileset(needed.recording, made, store.folder / "files"),
    }  # fmt: skip
    return work[stage], size


def _agree(estimate: Estimate) -> None:
    """Report no problem with any window."""


class Made:
    """The results of earlier stages, read from the store when they are needed."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def __call__(self, kind: type, lacking: Any = None) -> Any:
        name = next(n for n, k in KINDS.items() if k is kind)
        found = self._store.look(name, KEY, kind)
        found = lacking if found is None else found
        if found is None:
            raise FileNotFoundError(f"no {kind.__name__}: run the stages in their order, with --keep")
        return found


def _exports(made: Made, folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    write_radius_map(made(Wall), folder)
    write_cloud(made(Wall), made(WallTexture), folder)
    write_unrolled(made(WallTexture), folder)
    write_overlays(made(Overlays), folder)
    write_model(made(TexturedMesh), folder)


def _tileset(recording: Recording, made: Made, folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    wall, photo, defects = made(Wall), made(WallTexture), made(Defects, Defects((), 0.0))
    write_tileset(recording, made(TexturedMesh), wall, photo, made(Overlays), defects, folder)


class Inputs:
    """A run repeated to a length: probe, recording, and a store with its rings, motion and photo."""

    def __init__(self, given: argparse.Namespace, store: Store, metres: float) -> None:
        run = RunFiles(given.run.resolve())
        self.probe = read_probe(Path(run.record()["probe"]["path"]))
        self.recording = bare_recording(101.6)
        if store.has("rings", KEY):
            return
        motion, rings = run.artefact(Trajectory), run.artefact(RingSamples)
        length = float(np.ptp(motion.T_pc[:, 2, 3])) + STEP_MM
        times, scratch = max(round(1000 * metres / length), 1), Scratch(store.folder)
        made = (
            ("rings", repeated_rings(rings, times, given.coarser, scratch)),
            ("trajectory", repeated_motion(motion, times, length)),
            ("photo", repeated_photo(run.artefact(WallTexture), times, length, given.coarser, scratch)),
        )
        for name, artefact in made:
            store.write(artefact, Provenance(name, "1", KEY, 0.0, ()))


def _from_video(
    given: argparse.Namespace, stage: str, times: int, context: Context
) -> tuple[Callable[[], Any], float]:
    """Return rings or texture of a recording repeated end to end."""
    recording, run = open_recording(given.recording), RunFiles(given.run.resolve())
    probe, motion = read_probe(recording.probe_file), run.artefact(Trajectory)
    length = float(np.ptp(motion.T_pc[:, 2, 3])) + STEP_MM
    long_motion_ = repeated_motion(motion, times, length)
    table = FrameTable(long_motion_.frame, long_motion_.time_s, np.tile(recording.frames.illumination, times))
    long = replace(recording, frames=table, source=RepeatedFrames(recording))
    metres = times * length / 1000
    if stage == "rings":
        return lambda: extract_rings(long, probe, RingParameters.model_validate({}), context), metres
    wall = even_wall(run.artefact(Wall), times, length)
    parameters = TextureParameters.model_validate({})
    return lambda: photograph_wall(long, probe, long_motion_, wall, parameters, context), metres


if __name__ == "__main__":
    main()
