"""What the twin can detect, in figures.

``python -m tests.benchmarks.bench_twin swaps OUT``: every gauge run of the shared recordings; its line is
re-rendered with the stated probe, with its own answer, with the true effects, and with the answers of other
probes. A right answer must fit better than any other. The truth is opened for scoring alone.

``python -m tests.benchmarks.bench_twin like OUT --run RUN``: a recording like that of a run, with an added
pit, is rendered and run again: its wall is compared with the one that was measured, and the pit must be
found.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.api.diagnosis.simulated import moves_line, switches_of
from pipeline.api.job import Job, probe_source, recording_source, result_of, run_job
from pipeline.api.run import open_run
from pipeline.api.run import run as run_recording
from pipeline.api.simulate import simulate_like
from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.probe_file import read_with_source
from pipeline.machine.configuration import resolve
from pipeline.machine.display import SilentDisplay
from pipeline.machine.plan import Selection
from pipeline.machine.stage import of_role
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import Course, CourseKind
from pipeline.recording import open_recording
from pipeline.recording.checks import CheckedFrames
from pipeline.simulator.effects.switch import Switch
from stages.diagnose.channels import FIDUCIALS, GaugeMeasured
from stages.premises import PREMISES
from stages.rings import RINGS
from stages.twin.cells import sigmas
from stages.twin.gauge_line import GaugeLine, GaugeLineParameters, gauge_line_of
from tests.shared_data import PROJECT_ROOT

_OPEN = ("open-1", "open-2")
_BLIND = tuple(f"a{k:02d}" for k in range(1, 13))
_KNOCK = "mount_knock"
_PIT = (45.0, 1.2)
_SEEN_AHEAD_MM = 60.0
_FRAMES = 24
_WRONG = 3
_STAGES = tuple(s.for_role("gauge") for s in (PREMISES, RINGS, FIDUCIALS))


@dataclass(frozen=True)
class Case:
    """A gauge run, what its committed diagnosis says, and what is true."""

    name: str
    gauge: Path
    answer: tuple[Switch, ...]
    truth: tuple[Switch, ...]


def cases(answers: Path) -> list[Case]:
    """Return the shared gauge runs; one that has no diagnosis gets the true effects as its answer."""
    root = PROJECT_ROOT.parent / "shared" / "recordings"
    found = []
    for name in _OPEN:
        truth = _true(json.loads((root / f"{name}-gauge" / "truth.json").read_text("utf-8"))["effects"])
        own = answers / name / "diagnosis.json"
        said = switches_of(own).of_line if own.is_file() else truth
        found.append(Case(name, root / f"{name}-gauge", said, truth))
    for name in _BLIND:
        said = switches_of(answers / name / "diagnosis.json").of_line
        truth = json.loads((root / "blind-a" / "truth" / f"{name}.json").read_text("utf-8"))["effects"]
        found.append(Case(name, root / "blind-a" / f"{name}-gauge", said, _true(truth)))
    return found


def _true(effects: list[list[Any]]) -> tuple[Switch, ...]:
    """Return the true effects that move the line, in the catalogue's units."""
    return tuple(_true_switch(name, values) for name, values in effects if name == _KNOCK or moves_line(name))


def _true_switch(name: str, values: Any) -> Switch:
    v = [float(x) for x in (values if isinstance(values, list) else [values])]
    if name == _KNOCK:
        return Switch("laser_tilt", (v[1], v[2]), Course(CourseKind.STEP, (v[0],)))
    if name == "sheet_waviness":
        return Switch(name, (1e3 * math.radians(v[1]), v[0], v[2]))
    if name == "principal_point":
        return Switch(name, (math.hypot(*v), math.degrees(math.atan2(v[1], v[0]))))
    return Switch(name, tuple(v[: len(effect(name).quantities)]))


def gauge_line(case: Case, folder: Path) -> GaugeLine:
    """Return the line of a case's gauge run; rings and fiducials are kept in a folder."""
    recording = open_recording(case.gauge)
    assert recording.probe_file is not None
    probe, _ = read_with_source(recording.probe_file)
    sources = (recording_source(recording, "gauge"), probe_source(probe))
    job = Job("twin", sources, _STAGES, (), resolve(_STAGES, None, ()), folder / case.name)
    run_job(job, Selection(), SilentDisplay())
    frames, rings, measured = (
        result_of(job, of_role(kind, "gauge")) for kind in (CheckedFrames, RingSamples, GaugeMeasured)
    )
    assert measured.run is not None, measured.problem
    parameters = GaugeLineParameters.model_validate({"frames": _FRAMES})
    return gauge_line_of(frames.applied_to(recording), rings, measured.run, parameters)


def swaps(folder: Path, answers: Path, only: str) -> None:
    """Print χ² per pixel of each gauge's line with each instrument, and how many wrong ones fit worse."""
    every = cases(answers)
    different = [c for c in every if c.answer]
    worse = better_than_stated = pairs = named = 0
    for k, case in enumerate(every):
        if only and case.name not in only.split("+"):
            continue
        start = time.process_time()
        line = gauge_line(case, folder)
        nowhere = np.zeros(len(line.blocks.of_frame))
        least = float(line.chi2(nowhere).mean())
        stated = line.chi2(line.displacement_px(()))
        own = line.chi2(line.displacement_px(case.answer)) if case.answer else stated
        true = line.chi2(line.displacement_px(case.truth)) if case.truth else stated
        print(
            f"{case.name}: measured {least:.3f}, stated {stated.mean():.3f}, own answer {own.mean():.3f} "
            f"({' '.join(s.text for s in case.answer) or 'nothing'}), true effects {true.mean():.3f}",
            flush=True,
        )
        if case.answer:
            named += 1
            better_than_stated += sigmas(stated - own) > 0
        others = [o for o in different[k % len(different) :] + different if o.name != case.name][:_WRONG]
        for other in others:
            wrong = line.chi2(line.displacement_px(other.answer))
            told = sigmas(wrong - own)
            pairs, worse = pairs + 1, worse + (told > 0)
            print(f"  with the answer of {other.name}: {wrong.mean():.3f}, worse by {told:.1f} σ", flush=True)
        print(f"  {time.process_time() - start:.0f} s of processor time", flush=True)
    print(f"answers that move the line fit better than the stated probe: {better_than_stated} of {named}")
    print(f"swapped answers fit worse than a probe's own: {worse} of {pairs}")


def like(folder: Path, run: Path, frames: int) -> None:
    """Render a recording like a run with an added pit, run it, and print how similar the two walls are."""
    first, last = (float(open_run(run).wall.radius_map.distance_mm[k]) for k in (0, -1))
    at = min(first + 0.5 * _SEEN_AHEAD_MM, (first + last) / 2)
    start = time.process_time()
    made = simulate_like(
        run, folder / "recording", frames=frames, defects=[f"pit,{at:.0f},{_PIT[0]},6,6,{_PIT[1]}"], seed=3
    )
    print(f"rendered {made.frames} frames, {time.process_time() - start:.0f} s of processor time", flush=True)
    run_recording(made.recording, folder / "run")
    again = open_run(folder / "run")
    true = open_run(run).wall.radius_map
    seen = again.wall.radius_map
    # Distance and roll are counted from the first frame in both runs.
    at_rows = np.round((seen.distance_mm - true.distance_mm[0]) / (true.distance_mm[1] - true.distance_mm[0]))
    inside = (at_rows >= 0) & (at_rows < len(true.distance_mm))
    off = seen.radius_mm[inside] - true.radius_mm[at_rows[inside].astype(int)]
    off = off[np.isfinite(off)]
    print(f"radius, again less measured: median {np.median(off):+.4f} mm, robust {robust_spread(off):.4f} mm")
    for finding in again.findings():
        place = np.array(finding.outline).mean(0)
        print(f"found {finding.kind} at {place[0]:.0f} mm, depth {finding.size.depth_mm:.2f} mm")
    print(f"put in: pit at {at:.0f} mm, {_PIT[1]} mm deep")
    for warning in again.warnings:
        print(f"warning: {warning}")


if __name__ == "__main__":
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("what", choices=["swaps", "like"])
    words.add_argument("--only", default="", help="cases of swaps, joined by +")
    words.add_argument("--run", type=Path, help="run folder for like")
    words.add_argument("--frames", type=int, default=100, help="frames of the recording for like")
    words.add_argument("folder", type=Path)
    words.add_argument("--answers", type=Path, default=Path("data/blind-a"), help="folder of diagnoses")
    given = words.parse_args()
    if given.what == "swaps":
        swaps(given.folder, given.answers, given.only)
    else:
        like(given.folder, given.run, given.frames)
