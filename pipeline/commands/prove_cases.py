"""Cases of a proof: draws, renders, seals and diagnoses them, and checks the seal before reading the truth.

Wall errors are those of an inspection with the stated, the corrected and the true instrument.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from pipeline.adjustment.robust import root_mean_square, spread_about_median
from pipeline.api.job import Job, probe_source, recording_source, result_of, run_job
from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.drill.cases import (
    TIMING,
    Case,
    DiagnosisFailedError,
    concealed_in,
    diagnose_apart,
    trial_of,
)
from pipeline.drill.score import Trial
from pipeline.errors import BoresightError, InputError
from pipeline.files.disk import remove, replace_json
from pipeline.files.json_yaml import read_json
from pipeline.geometry.axis import to_pipe
from pipeline.geometry.rigid import transform
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe
from pipeline.machine.configuration import resolve
from pipeline.machine.display import SilentDisplay
from pipeline.machine.plan import Selection
from pipeline.machine.run_folder import RunFolder
from pipeline.recording import open_recording
from pipeline.simulator.build import build_truth
from pipeline.simulator.prior import draw_pair, read_prior
from pipeline.simulator.scene import read_scene
from pipeline.simulator.sheet import room_mm, wall_radius
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.truth_files import SEAL_FILE, open_seal
from pipeline.system.parallel import end_with_parent
from stages.premises import PREMISES
from stages.rings import RINGS

ANSWERS, ANSWERS_WITHOUT = "answers", "answers-without"
# Exit status of `boresight simulate` for a scene that cannot show what it is meant to show.
_REFUSED_SCENE = 3
_GO_ON = "correct what it names, then give the same command again: existing results are kept"


class NotRenderedError(BoresightError):
    """A drawn scene cannot show its effect."""


@dataclass(frozen=True)
class Drawing:
    """The prior of pairs, and the folders of recordings and truth."""

    prior: Path
    seed: int
    recordings: Path
    truth: Path


@dataclass(frozen=True)
class Worked:
    """A diagnosed case with its opened truth.

    Attributes
    ----------
    trials : tuple of Trial
        Diagnoses with the whole library and, if requested, without the concealed effect.
    seconds : float or None
        Duration of the diagnosis with the whole library; None if it was interrupted.
    failures : tuple of str
        Diagnoses that ended without an answer; they are scored as having identified nothing.
    wall : WallErrors or None
        Wall errors of the inspection, if its truth contains the scene.
    """

    trials: tuple[Trial, ...]
    seconds: float | None
    failures: tuple[str, ...]
    wall: WallErrors | None


def draw_case(drawing: Drawing, index: int) -> Case:
    """Return pair number ``index`` of a draw, rendered and sealed unless it is there already.

    Raises
    ------
    NotRenderedError
        When its effect would not show in its scene.
    InputError
        When it cannot be rendered for another reason: the disk is full, the renderer was killed.
    """
    pair = draw_pair(read_prior(drawing.prior), drawing.prior, drawing.seed, index)
    names = (pair.gauge.name, pair.field.name)
    folders = [root / name for name in names for root in (drawing.recordings, drawing.truth)]
    if not all(folder.is_dir() for folder in folders):
        for folder in folders:
            shutil.rmtree(folder, ignore_errors=True)
        _render(drawing, index)
    gauge, field = (drawing.recordings / name for name in names)
    return Case(gauge.name.removesuffix("-gauge"), gauge, field)


def _render(drawing: Drawing, index: int) -> None:
    words = ["simulate", "--draw", "1", "--first", str(index), "--seed", str(drawing.seed), "--seal"]
    words += ["--prior", str(drawing.prior), "-o", str(drawing.recordings), "--truth", str(drawing.truth)]
    command = [sys.executable, "-m", "pipeline.cli", *words]
    done = subprocess.run(command, check=False, capture_output=True, text=True, preexec_fn=end_with_parent)
    if done.returncode:
        last = "\n".join(done.stderr.strip().splitlines()[-6:])
        problem = f"pair {index} could not be rendered: simulate ended with {done.returncode}\n{last}"
        if done.returncode == _REFUSED_SCENE:
            raise NotRenderedError(problem)
        raise InputError(drawing.recordings, problem, hint=_GO_ON)


def require_seal(case: Case, truth: Path) -> None:
    """Refuse a sealed recording that was changed after the sealing, or whose truth was.

    Raises
    ------
    InputError
        With the names of the changed files.
    """
    for path in (case.gauge, case.field):
        if path is None or not (path / SEAL_FILE).is_file():
            continue
        broken = [f"{c.file} {c.problem}" for c in open_seal(path, truth / path.name) if c.problem]
        if broken:
            raise InputError(
                path, f"does not agree with its seal: {'; '.join(broken)}",
                hint="neither the recording nor its truth may be changed between sealing and scoring",
            )  # fmt: skip


def worked(case: Case, output: Path, truth: Path, leave_out: bool) -> Worked:
    """Diagnose a case, check its seal, open its truth; if requested, diagnose it without its effect."""
    answer, failures = output / ANSWERS / case.name, []
    failures += _answered(case, answer, ())
    require_seal(case, truth)
    trials = [trial_of(case, answer, truth)]
    concealed = concealed_in(case, truth)
    if leave_out and len(concealed) == 1:
        without = (concealed[0].name,)
        second = output / ANSWERS_WITHOUT / case.name
        failures += _answered(case, second, without)
        trials.append(trial_of(case, second, truth, without))
    done = Worked(tuple(trials), _seconds(answer), tuple(failures), wall_errors(case, answer, truth))
    # Intermediate results are large and not needed any more: a proof may have thousands of cases.
    for folder in (answer, output / ANSWERS_WITHOUT / case.name):
        remove(RunFolder(folder).internal)
    return done


def _answered(case: Case, answer: Path, without: tuple[str, ...]) -> list[str]:
    """Diagnose; return why there is no answer, if there is none."""
    try:
        diagnose_apart(case, answer, without)
    except DiagnosisFailedError as error:
        if error.was_stopped:
            raise InputError(answer, str(error), hint=_GO_ON) from error
        return [str(error)]
    return []


def _seconds(answer: Path) -> float | None:
    file = answer / TIMING
    return float(json.loads(file.read_text("utf-8"))["seconds"]) if file.is_file() else None


_SCENE = "truth_scene.yaml"
_CACHE = "wall_errors.json"
# Samples with errors above so many spreads lie on edges of the wall: the instrument is not the cause.
_OUTLYING = 5.0
# Of the samples of a ring only every so many-th is compared, to save time.
_EVERY = 4
_STAGES = (PREMISES, RINGS)


@dataclass(frozen=True)
class WallErrors:
    """R.m.s. radius errors of ring samples at the true poses, mm.

    Attributes
    ----------
    stated_mm, corrected_mm : float
        Errors with the stated probe and with the one that the diagnosis wrote.
    oracle_mm : float
        Error with the true instrument and all concealed effects: that of the line's extraction alone.
    """

    stated_mm: float
    corrected_mm: float
    oracle_mm: float


def wall_errors(case: Case, answer: Path, truth: Path) -> WallErrors | None:
    """Return the wall errors of a case's inspection; they are kept beside the answer.

    None without an inspection, a corrected probe, or the scene that it was rendered from.
    """
    probe_file, kept = answer / "probe.yaml", answer / _CACHE
    if (known := _kept(kept)) is not None:
        return known
    if case.field is None or not probe_file.is_file():
        return None
    scene_file = truth / case.field.name / _SCENE
    if not scene_file.is_file():
        return None
    truth_scene = build_truth(read_scene(scene_file), scene_file)
    found = _errors(case.field, read_probe(probe_file), truth_scene, answer)
    replace_json(kept, vars(found))
    return found


def _kept(file: Path) -> WallErrors | None:
    """Return the stored errors; None if they are missing or incomplete, so that they are computed again."""
    try:
        return WallErrors(**read_json(file))
    except (OSError, ValueError, TypeError):
        return None


def _errors(field: Path, corrected: Probe, truth: SceneTruth, folder: Path) -> WallErrors:
    rings = measured_rings(field, truth.stated, folder)
    uv = _uv(rings)
    oracle = np.stack([-room_mm(truth, int(frame), uv[k]) for k, frame in enumerate(rings.frame)])
    each = [oracle, *(_by_probe(truth, rings.frame, uv, probe) for probe in (truth.stated, corrected))]
    usable = rings.valid[:, ::_EVERY] & np.all(np.isfinite(each), axis=0)
    spread = spread_about_median(oracle[usable])
    usable &= np.abs(oracle) < _OUTLYING * spread
    oracle_mm, stated_mm, corrected_mm = (root_mean_square(e[usable]) for e in each)
    return WallErrors(stated_mm, corrected_mm, oracle_mm)


def measured_rings(field: Path, stated: Probe, folder: Path) -> RingSamples:
    """Return the rings of an inspection; the diagnosis in ``folder`` has measured them already."""
    sources = (recording_source(open_recording(field)), probe_source(stated))
    with TemporaryDirectory(dir=folder, prefix=".rings-") as own:
        job = Job("prove", sources, _STAGES, (), resolve(_STAGES), Path(own), lent=(folder,))
        run_job(job, Selection(), SilentDisplay())
        return result_of(job, RingSamples)


def _uv(rings: RingSamples) -> Float:
    """Return the ring samples (F, A, 2) in the image, px."""
    azimuth = rings.azimuth_rad[::_EVERY]
    outward = np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
    return np.asarray(rings.centre_px + rings.radius_px[:, ::_EVERY, None].astype(float) * outward)


def _by_probe(truth: SceneTruth, frames: Int, uv: Float, probe: Probe) -> Float:
    """Return the distance (F, A), mm, of samples triangulated with ``probe`` outside the true wall."""
    out = []
    for frame, at in zip(frames, uv, strict=True):
        T_pc = truth.motion.pose(truth.frames.time_s[frame], truth.wall.axis)
        s, psi, r = to_pipe(truth.wall.axis, transform(T_pc, probe.triangulate(at)))
        out.append(r - wall_radius(truth.wall, s, psi))
    return np.stack(out)
