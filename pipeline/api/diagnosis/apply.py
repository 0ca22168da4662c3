"""``boresight diagnose --apply``: reconstructs the run with the corrected probe, and compares both."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.adjustment.robust import root_mean_square
from pipeline.api.job import Job, recording_job, run_job
from pipeline.arrays import Float
from pipeline.artefacts.findings import clock_of_azimuth
from pipeline.export.catalogue import EXPORTERS
from pipeline.files.codec import digest
from pipeline.instrument.probe_file import read_with_source
from pipeline.machine.configuration import Configuration
from pipeline.machine.display import Display
from pipeline.machine.plan import Selection
from pipeline.recording.base import Recording
from stages.catalogue import PIPELINE
from stages.diagnose.correct import encoder_effects, with_true_readings
from stages.diagnose.result import EffectFound

# Defects of two runs that lie closer than this, mm along the pipe and hours on the clock, are the same one
# (chosen).
_NEAR_MM, _NEAR_HOURS = 8.0, 1.5
# Radius changes that scatter by less than this share of their size are reported as one "all round" (chosen).
_EVEN = 0.2
# Depth and radius changes below these, mm, are not reported: no inspection decides on less (chosen).
_LEAST_DEPTH_CHANGE_MM, _LEAST_RADIUS_CHANGE_MM = 0.01, 0.005
# Stages and files that show the geometry: for the stated probe, only these are computed.
_GEOMETRY = frozenset({"rings", "triangulate", "motion", "accumulate", "texture", "defects"})
_FILES = frozenset({"trajectory.csv", "radius_map.npz", "defects.json"})


@dataclass(frozen=True)
class DefectChange:
    """One defect's depth, mm, positive into the wall, with the stated and with the corrected instrument."""

    kind: str
    distance_mm: float
    clock: float
    before_mm: float
    after_mm: float
    sigma_mm: float


@dataclass(frozen=True)
class GeometryChange:
    """Changes of the pipe's geometry by the correction.

    Attributes
    ----------
    mean_mm, max_mm : (12,)
        Change of radius (corrected minus stated) around clock positions 12, 1 … 11: mean, and the largest
        with its sign; NaN where nothing was seen.
    rms_mm : float
    defects : tuple of DefectChange
    """

    mean_mm: Float
    max_mm: Float
    rms_mm: float
    defects: tuple[DefectChange, ...]


@dataclass(frozen=True)
class Uncorrected:
    """The inspection with the stated instrument.

    Attributes
    ----------
    recording : Recording
    probe_file : Path
        File of the stated probe.
    configuration : Configuration
    run : Path or None
        A run with the same probe and configuration; without one the inspection is reconstructed.
    """

    recording: Recording
    probe_file: Path
    configuration: Configuration
    run: Path | None


def apply_correction(
    effects: Sequence[EffectFound], field: Uncorrected, folder: Path, display: Display
) -> GeometryChange:
    """Reconstruct the field with the corrected instrument into run, and with the stated one into run-stated.

    Results that the diagnosis or an earlier run of the field holds are used again.

    Raises
    ------
    BoresightError
        In the same cases as a run.
    """
    stated = _job(field.recording, field.probe_file, field.configuration, folder / "run-stated")
    stated = replace(
        stated, stages=tuple(s for s in PIPELINE if s.name in _GEOMETRY), lent=(folder,),
        exporters=tuple(e for e in EXPORTERS if e.name in _FILES),
    )  # fmt: skip
    true = _true_field(effects, field.recording)
    corrected = _job(true, folder / "probe.yaml", field.configuration, folder / "run")
    if field.run is None:
        run_job(stated, Selection(), display)
    run_job(replace(corrected, lent=(folder,)), Selection(), display)
    return geometry_change(field.run or stated.folder, corrected.folder)


def _job(recording: Recording, probe_file: Path, configuration: Configuration, folder: Path) -> Job:
    probe, source = read_with_source(probe_file)
    return recording_job(recording, probe, source, PIPELINE, EXPORTERS, configuration, folder)


def _true_field(effects: Sequence[EffectFound], field: Recording) -> Recording:
    """Return the field with its encoder's readings corrected."""
    of_encoder = encoder_effects(effects)
    if not of_encoder:
        return field
    true = with_true_readings(field, of_encoder)
    readings = true.encoder.distance_mm.tobytes() if true.encoder is not None else b""
    return replace(true, content_key=digest((field.content_key, readings.hex())))


def geometry_change(before: Path, after: Path) -> GeometryChange:
    """Return the changes from one run folder to another of the same recording."""
    change, azimuth = _radius_change(before, after)
    hour = np.round(clock_of_azimuth(azimuth)).astype(int) % 12
    mean, largest = np.full(12, np.nan), np.full(12, np.nan)
    for k in range(12):
        here = change[:, hour == k]
        here = here[np.isfinite(here)]
        if here.size:
            mean[k], largest[k] = here.mean(), here[np.argmax(np.abs(here))]
    seen = change[np.isfinite(change)]
    rms = root_mean_square(seen) if seen.size else float("nan")
    return GeometryChange(mean, largest, rms, _defect_changes(before, after))


def consequence(change: GeometryChange) -> str:
    """Return the consequence of the correction for the inspection, in a sentence."""
    least_mm = _LEAST_DEPTH_CHANGE_MM
    changed = [d for d in change.defects if abs(d.after_mm - d.before_mm) > max(2 * d.sigma_mm, least_mm)]
    if changed:
        worst = max(changed, key=lambda d: abs(d.after_mm - d.before_mm))
        return _of_defect(worst)
    if not np.isfinite(change.max_mm).any():
        return ""
    k = int(np.nanargmax(np.abs(change.mean_mm)))
    size = float(change.mean_mm[k])
    if abs(size) < _LEAST_RADIUS_CHANGE_MM:
        return f"The geometry changes by {change.rms_mm:.3f} mm (r.m.s.), which does not matter for depths."
    seemed = "understated" if size > 0 else "overstated"
    most = int(np.nanargmax(np.abs(change.max_mm)))
    everywhere = float(np.nanstd(change.mean_mm)) < _EVEN * abs(size)
    where = "all round" if everywhere else f"at {k or 12} o'clock"
    up_to = f"{abs(change.max_mm[most]):.2f} mm"
    return (
        f"The radius was {seemed} by {abs(size):.2f} mm {where}, and by up to {up_to} "
        f"at {most or 12} o'clock; no defect's depth changes beyond its own σ."
    )


def _of_defect(d: DefectChange) -> str:
    more = abs(d.after_mm) > abs(d.before_mm)
    sense = "understated" if more else "overstated"
    what = "Wall loss" if d.after_mm > 0 else "Intrusion"
    return (
        f"{what} at {round(d.clock) % 12 or 12} o'clock, {d.distance_mm:.0f} mm, was "
        f"{sense} by {abs(d.after_mm - d.before_mm):.2f} mm: the {d.kind} is "
        f"{abs(d.after_mm):.2f} ± {d.sigma_mm:.2f} mm, not {abs(d.before_mm):.2f} mm."
    )


def _radius_change(before: Path, after: Path) -> tuple[Float, Float]:
    """Return (S, A) and azimuth (A,), on the corrected run's grid; NaN where either saw nothing."""
    old, new = (np.load(folder / "radius_map.npz") for folder in (before, after))
    between = (old["distance_mm"][1:] + old["distance_mm"][:-1]) / 2
    row = np.searchsorted(between, new["distance_mm"])
    change = new["radius_mm"].astype(float) - old["radius_mm"].astype(float)[row]
    outside = (new["distance_mm"] < old["distance_mm"][0]) | (new["distance_mm"] > old["distance_mm"][-1])
    change[outside] = np.nan
    return change, np.asarray(new["azimuth_rad"], float)


def _defect_changes(before: Path, after: Path) -> tuple[DefectChange, ...]:
    old, new = (_defects(folder) for folder in (before, after))
    out = []
    for d in new:
        matches = [o for o in old if _same(o, d)]
        if matches:
            match = min(matches, key=lambda o: abs(o.distance_mm - d.distance_mm))
            out.append(replace(d, before_mm=match.after_mm))
    return tuple(out)


def _defects(folder: Path) -> list[DefectChange]:
    """Return a run's defects, with their depths as ``after_mm``."""
    entries = json.loads((folder / "defects.json").read_text("utf-8"))
    return [_defect(entry) for entry in entries]


def _defect(entry: dict[str, Any]) -> DefectChange:
    span = (entry["clock_to"] - entry["clock_from"]) % 12 or 12.0
    return DefectChange(
        str(entry["kind"]), (entry["distance_from_mm"] + entry["distance_to_mm"]) / 2,
        (entry["clock_from"] + span / 2) % 12, np.nan, entry["depth_mm"], entry["depth_sigma_mm"],
    )  # fmt: skip


def _same(one: DefectChange, other: DefectChange) -> bool:
    hours = abs((one.clock - other.clock + 6) % 12 - 6)
    near = abs(one.distance_mm - other.distance_mm) < _NEAR_MM
    return near and (hours < _NEAR_HOURS or one.kind == other.kind == "weld")
