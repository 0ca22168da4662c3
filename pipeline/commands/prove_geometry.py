"""Wall errors of an inspection by the stated, the corrected and the true instrument."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from pipeline.adjustment.robust import spread_about_median
from pipeline.api.job import Job, probe_source, recording_source, result_of, run_job
from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.files.disk import replace_json
from pipeline.files.json_file import read_json
from pipeline.geometry.axis import to_pipe
from pipeline.geometry.rigid import transform
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe
from pipeline.machine.configuration import resolve
from pipeline.machine.display import SilentDisplay
from pipeline.machine.plan import Selection
from pipeline.recording import open_recording
from pipeline.simulator.build import build_truth
from pipeline.simulator.exact import room_mm, wall_radius
from pipeline.simulator.scene import read_scene
from pipeline.simulator.truth import SceneTruth
from stages.diagnose.drill.cases import Case
from stages.premises import PREMISES
from stages.rings import RINGS

_SCENE = "truth_scene.yaml"
_CACHE = "wall_errors.json"
# Samples beside the wall's own edges are no matter of the instrument.
_OUTLYING = 5.0
_EVERY = 4
_STAGES = (PREMISES, RINGS)


@dataclass(frozen=True)
class WallErrors:
    """R.m.s. radius errors of ring samples at the true poses, mm.

    Attributes
    ----------
    stated_mm, corrected_mm : float
        By the stated probe and by the one that the diagnosis wrote.
    oracle_mm : float
        By the true instrument with all that is concealed in it: what the extraction of the line leaves.
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
    """Return what was kept, None where it is not there or not whole: it is worked out again."""
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
    oracle_mm, stated_mm, corrected_mm = (float(np.sqrt(np.mean(e[usable] ** 2))) for e in each)
    return WallErrors(stated_mm, corrected_mm, oracle_mm)


def measured_rings(field: Path, stated: Probe, folder: Path) -> RingSamples:
    """Return the rings of an inspection; the diagnosis in ``folder`` has measured them already."""
    sources = (recording_source(open_recording(field)), probe_source(stated))
    with TemporaryDirectory(dir=folder, prefix=".rings-") as own:
        job = Job("prove", sources, _STAGES, (), resolve(_STAGES), Path(own), lent=(folder,))
        run_job(job, Selection(), SilentDisplay())
        return result_of(job, RingSamples)


def _uv(rings: RingSamples) -> Float:
    """Return (F, A, 2) the ring samples in the image."""
    azimuth = rings.azimuth_rad[::_EVERY]
    outward = np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
    return np.asarray(rings.centre_px + rings.radius_px[:, ::_EVERY, None].astype(float) * outward)


def _by_probe(truth: SceneTruth, frames: Int, uv: Float, probe: Probe) -> Float:
    """Return (F, A) by how much the samples lie outside the true wall when ``probe`` triangulates them."""
    out = []
    for frame, at in zip(frames, uv, strict=True):
        T_pc = truth.motion.pose(truth.frames.time_s[frame], truth.wall.axis)
        s, psi, r = to_pipe(truth.wall.axis, transform(T_pc, probe.triangulate(at)))
        out.append(r - wall_radius(truth.wall, s, psi))
    return np.stack(out)
