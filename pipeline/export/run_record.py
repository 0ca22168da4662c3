"""run.json, written and read: recording, probe, parameters, versions, stages, state, headline numbers."""

from __future__ import annotations

import math
import resource
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.arrays import Float
from pipeline.artefacts.findings import Defects, usual_limit
from pipeline.artefacts.measured import RingSamples, Trajectory, Wall
from pipeline.artefacts.wall_map import WallMap
from pipeline.errors import InputError
from pipeline.files.codec import Json
from pipeline.files.disk import disk_errors_named, replace_json
from pipeline.files.installed import program_version
from pipeline.files.json_yaml import read_json
from pipeline.files.provenance import library_versions
from pipeline.geometry.axis import distance_along
from pipeline.machine.configuration import Configuration
from pipeline.machine.outcome import Number, RunOutcome, StageOutcome, warnings_of
from pipeline.machine.plan import Plan

_RECORD = "run.json"
# Rows of a radius map taken at once: a bound on memory alone.
_ROWS = 2000
# Version of its format.
_FORMAT = 1


def write_run_record(
    command: str,
    about: Mapping[str, Json],
    configuration: Configuration,
    plan: Plan,
    folder: Path,
    outcome: RunOutcome,
) -> None:
    """Replace ``run.json`` atomically; ``about`` are its entries on the sources in addition to their hashes.

    Raises
    ------
    InputError
        When the disk is full or cannot be written.
    """
    tree: Json = {
        "format": _FORMAT,
        "program": {"name": "boresight", "version": program_version()},
        "command": command,
        "libraries": dict(library_versions()),
        "state": outcome.state.value,
        "problem": outcome.problem,
        **about,
        "input_sha256": dict(plan.input_hashes()),
        "configuration": configuration.tree(),
        "stages": [_stage(s) for s in outcome.stages],
        "metrics": _numbers(outcome.metrics),
        "warnings": list(warnings_of(outcome.stages)),
        "peak_memory_mib": {"program": _peak_mib()},
    }
    with disk_errors_named(folder):
        replace_json(folder / _RECORD, tree)


def _peak_mib() -> float:
    # On Linux a new process inherits its parent's ru_maxrss; VmHWM belongs to this process alone.
    status = Path("/proc/self/status")
    if not status.exists():
        return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, 1)
    peak = next(line for line in status.read_text("ascii").splitlines() if line.startswith("VmHWM:"))
    return round(int(peak.split()[1]) / 1024, 1)


def _stage(outcome: StageOutcome) -> Json:
    return {
        "name": outcome.name,
        "version": outcome.version,
        "key": outcome.key,
        "state": outcome.state.value,
        "seconds": outcome.seconds,
        "numbers": _numbers(outcome.numbers),
        "problem": outcome.problem,
    }


def _numbers(numbers: Iterable[Number]) -> list[Json]:
    return [{"name": n.name, "value": _finite(n.value), "unit": n.unit} for n in numbers]


def _finite(value: float | int | str) -> Json:
    """Return the value, or None if JSON cannot represent it."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def headline(artefacts: Mapping[type, object]) -> tuple[Number, ...]:
    """Return headline numbers, with units, of the existing artefacts."""
    return tuple(number for artefact in artefacts.values() for number in _of(artefact))


def _of(artefact: object) -> Iterable[Number]:
    match artefact:
        case RingSamples():
            return _of_rings(artefact)
        case Trajectory():
            return _of_trajectory(artefact)
        case Wall():
            return _of_wall(artefact)
        case Defects():
            return _of_defects(artefact)
    return ()


def _of_rings(rings: RingSamples) -> Iterator[Number]:
    used = np.any(rings.valid, axis=1)
    yield Number("laser frames", len(rings.frame), "frames")
    yield Number("laser frames without a usable ring", int(np.sum(~used)), "frames")
    yield Number("usable ring samples", round(100 * float(np.mean(rings.valid)), 2), "%")


def _of_trajectory(trajectory: Trajectory) -> Iterator[Number]:
    distance_mm = distance_along(trajectory.axis, trajectory.T_pc)
    yield Number("distance travelled", round(float(np.sum(np.abs(np.diff(distance_mm)))), 2), "mm")
    yield Number("relative 1 sigma of the distance scale", round(_scale_sigma(trajectory, distance_mm), 6))
    yield Number("motion events", len(trajectory.events))


def _scale_sigma(trajectory: Trajectory, distance_mm: Float) -> float:
    """Return the relative 1 σ of the distance to the farthest frame, at least that of the calibration.

    After a run to and fro the end is better known than the scale: the calibration's part does not cancel.
    The ways at cuts of the recording are no errors of the scale.
    """
    farthest_mm = float(np.abs(distance_mm - distance_mm[0]).max())
    if not np.isfinite(trajectory.distance_sigma_mm) or farthest_mm == 0:
        return trajectory.scale_sigma
    own_mm2 = trajectory.distance_sigma_mm**2 - trajectory.cut_sigma_mm**2
    return max(trajectory.scale_sigma, math.sqrt(max(own_mm2, 0.0)) / farthest_mm)


def _of_wall(wall: Wall) -> Iterator[Number]:
    radius = wall.radius_map
    seen = np.isfinite(radius.radius_mm)
    rows = np.flatnonzero(seen.any(axis=1))
    if not rows.size:
        return
    core = slice(rows[0], rows[-1] + 1)
    length = float(radius.distance_mm[rows[-1]] - radius.distance_mm[rows[0]])
    diameter, diameter_sigma = mean_diameter(radius)
    yield Number("inspected length", round(length, 2), "mm")
    yield Number("wall seen", round(100 * float(np.mean(seen[core])), 2), "%")
    yield Number("mean diameter", round(diameter, 3), "mm")
    yield Number("1 sigma of the mean diameter", round(diameter_sigma, 4), "mm")
    yield Number("median 1 sigma of the radius", round(float(np.median(radius.sigma_mm[seen])), 4), "mm")
    random = float(np.median(radius.sigma_random_mm[seen]))
    yield Number("median 1 sigma of the radius, random part", round(random, 4), "mm")


def mean_diameter(radius: WallMap) -> tuple[float, float]:
    """Return the mean diameter of the seen wall, mm, and its 1 σ.

    The calibration's error is common to all cells and stays in the mean; noise averages out.
    """
    seen = np.isfinite(radius.radius_mm)
    parts = [slice(k, k + _ROWS) for k in range(0, len(seen), _ROWS)]
    common = sum(float(radius.common_variance(rows)[seen[rows]].sum()) for rows in parts)
    sigma = 2 * float(np.sqrt(common / seen.sum()))
    return 2 * float(np.mean(radius.radius_mm[seen], dtype=np.float64)), sigma


def _of_defects(defects: Defects) -> Iterator[Number]:
    yield Number("defects", len(defects.items))
    if defects.detectable:
        usual = usual_limit(defects.detectable)
        yield Number("nine of ten defects are found from a diameter of", round(usual.size_mm, 1), "mm")
        yield Number("and from a depth of", round(usual.depth_mm, 2), "mm")
    if defects.deepest is not None:
        yield Number("deepest defect", round(abs(defects.deepest.depth_mm), 3), "mm")


@dataclass(frozen=True)
class RunRecord:
    """The provenance of a run in its record.

    Attributes
    ----------
    recording, probe : Path
    input_sha256 : mapping of str to str
        Hashes of ``recording`` and ``probe``.
    configuration : mapping of str to mapping
        Parameters by stage.
    libraries : mapping of str to str
        Versions; empty in records of older programs.
    """

    recording: Path
    probe: Path
    input_sha256: Mapping[str, str]
    configuration: Mapping[str, Mapping[str, Any]]
    libraries: Mapping[str, str]


def read_run_record(run: Path) -> RunRecord:
    """Return the record of a completed run.

    Raises
    ------
    InputError
        When there is none, it is damaged, or the run did not complete.
    """
    file = run / _RECORD
    try:
        tree: dict[str, Any] = read_json(file)
        record = RunRecord(
            Path(tree["recording"]["path"]), Path(tree["probe"]["path"]), dict(tree["input_sha256"]),
            dict(tree["configuration"]), dict(tree.get("libraries", {})),
        )  # fmt: skip
        state = tree["state"]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        missing = isinstance(error, FileNotFoundError)
        problem = "does not exist" if missing else "is not the record of a run"
        raise InputError(
            file, problem, expected="run.json of boresight run", hint="state a run folder"
        ) from error
    if state != "completed":
        raise InputError(file, f"the run is {state}", expected="a completed run", hint="complete it first")
    return record


def check_inputs_unchanged(record: RunRecord, now: Mapping[str, str]) -> None:
    """Refuse to compare results of other inputs.

    Raises
    ------
    InputError
        When the recording or the probe differs from the one of the run.
    """
    places = {"recording": record.recording, "probe": record.probe}
    for name, place in places.items():
        stated = record.input_sha256.get(name, "no hash in run.json")
        if now[name] != stated:
            raise InputError(
                place,
                f"the {name} differs from the one of the run",
                expected=stated,
                hint="restore it: a run of other inputs gives other results",
            )
