"""run.json: recording, probe, parameters, versions, stages and state of a run."""

from __future__ import annotations

import math
import resource
from collections.abc import Iterable, Mapping
from pathlib import Path

from pipeline.files.codec import Json
from pipeline.files.disk import disk_errors_named, replace_json
from pipeline.files.installed import program_version
from pipeline.files.provenance import library_versions
from pipeline.machine.configuration import Configuration
from pipeline.machine.outcome import Number, RunOutcome, StageOutcome, warnings_of
from pipeline.machine.plan import Plan

# Version of run.json's format.
_FORMAT = 1


def write_run_record(
    command: str,
    about: Mapping[str, Json],
    configuration: Configuration,
    plan: Plan,
    folder: Path,
    outcome: RunOutcome,
) -> None:
    """Replace ``run.json`` at one stroke; ``about`` is what it says of the sources beyond their hashes.

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
        replace_json(folder / "run.json", tree)


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
    """Return the value, None for what JSON cannot write."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
