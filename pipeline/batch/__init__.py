"""Many recordings, each a run of its own, on local workers or a cluster; none that fails stops the others."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pipeline
from pipeline.errors import InputError
from pipeline.files.codec import Json
from pipeline.files.disk import disk_errors_named, replace_json, replace_text
from pipeline.files.json_yaml import read_json
from pipeline.machine.outcome import state_word
from pipeline.pages import page_template
from pipeline.system.parallel import end_with_parent

_BAGS = (".bag", ".mcap")


def find_recordings(folder: Path) -> dict[str, Path]:
    """Return all recordings below a folder, each under a name that can also name a folder.

    Raises
    ------
    InputError
        When there is none, or the folder cannot be read.
    """
    if not folder.is_dir():
        raise InputError(folder, "is not a folder", expected="a folder of recordings")
    found = sorted({p.parent for p in folder.rglob("recording.yaml")})
    found += sorted(p for p in folder.rglob("*") if p.suffix in _BAGS and p.is_file())
    found += sorted({p.parent for p in folder.rglob("metadata.yaml")} - set(found))
    if not found:
        raise InputError(folder, "holds no recordings", expected="recording folders, ROS bags or MCAP files")
    return {_name(p, folder): p for p in found}


def _name(path: Path, folder: Path) -> str:
    parts = path.relative_to(folder).parts
    return "-".join(parts) if parts else folder.name


# Exit status of `boresight run` for input that cannot be used.
_REFUSED = 2
_BUSY = "is at work in this run folder"
# Time between two attempts at a run folder that another process still holds, and how long to try, s.
_WAIT_S, _PATIENCE_S = 2.0, 120.0
# Lines of a failed run's error output that are kept.
_STDERR_LINES = 4


@dataclass(frozen=True)
class Work:
    """A recording, the folder of its run, and further options of ``boresight run``."""

    name: str
    recording: Path
    folder: Path
    options: tuple[str, ...]


@dataclass(frozen=True)
class BatchOutcome:
    """How the run of one recording of a batch ended.

    Attributes
    ----------
    name : str
    state : str
        That of run.json, or ``refused`` when the recording could not be opened.
    problem : str
        Empty when it completed.
    metrics : tuple of (name, value, unit)
    warnings : tuple of str
        What the reader corrected and what stages warn of: look at the run before its figures are used.
    """

    name: str
    state: str
    problem: str
    metrics: tuple[tuple[str, Any, str], ...] = ()
    warnings: tuple[str, ...] = ()


def run_one(work: Work) -> BatchOutcome:
    """Run one recording; whatever happens is reported in the outcome and is never an error of the batch."""
    code, stderr = _run(work)
    until = time.monotonic() + _PATIENCE_S
    while code == _REFUSED and _BUSY in stderr and time.monotonic() < until:
        # The process of a lost worker may hold the folder until the system has ended it.
        time.sleep(_WAIT_S)
        code, stderr = _run(work)
    return outcome_of(work, code, stderr)


def _run(work: Work) -> tuple[int, str]:
    words = [sys.executable, "-m", "pipeline.cli", "run", str(work.recording), "-o", str(work.folder)]
    environment = os.environ | {"PYTHONPATH": str(Path(pipeline.__file__).resolve().parents[1])}
    done = subprocess.run(
        [*words, *work.options], env=environment, capture_output=True, text=True, check=False,
        preexec_fn=end_with_parent,
    )  # fmt: skip
    return done.returncode, done.stderr


def outcome_of(work: Work, code: int, stderr: str) -> BatchOutcome:
    """Return how a run ended, from its exit status, what it said, and the record that it left."""
    record = _record(work.folder)
    if code and (record is None or not record.get("problem") or record["problem"] not in stderr):
        # The record belongs to an earlier call, or could not be updated because the disk is full.
        last = " ".join(stderr.strip().splitlines()[-_STDERR_LINES:]) or f"it ended with status {code}"
        return BatchOutcome(work.name, "refused" if code == _REFUSED else "failed", last)
    if record is None:
        return BatchOutcome(work.name, "failed", "the run left no record")
    metrics = tuple((m["name"], m["value"], m["unit"]) for m in record.get("metrics", ()))
    warnings = tuple(map(str, (*record.get("reader_warnings", ()), *record.get("warnings", ()))))
    return BatchOutcome(work.name, str(record["state"]), str(record.get("problem", "")), metrics, warnings)


def _record(folder: Path) -> dict[str, Any] | None:
    try:
        record: dict[str, Any] = read_json(folder / "run.json")
    except (OSError, ValueError):
        return None
    return record


SHOWN_METRICS = ("inspected length", "wall seen", "mean diameter", "defects", "deepest defect")


def write_summary(outcomes: Iterable[BatchOutcome], folder: Path) -> None:
    """Write batch.json and batch.html, ordered by name, whichever run ended first.

    Raises
    ------
    InputError
        When the disk is full or cannot be written.
    """
    ordered = sorted(outcomes, key=lambda e: e.name)
    runs: list[Json] = [_document(e) for e in ordered]
    rows = [(e, {name: (value, unit) for name, value, unit in e.metrics}) for e in ordered]
    warned = sum(bool(e.warnings) for e in ordered)
    text = page_template("batch").render(
        rows=rows, states=_states(ordered), metrics=SHOWN_METRICS, warned=warned, word=state_word
    )
    with disk_errors_named(folder):
        replace_json(folder / "batch.json", {"format": 1, "runs": runs, "states": dict(_states(ordered))})
        replace_text(folder / "batch.html", text)


def _states(outcomes: list[BatchOutcome]) -> Counter[str]:
    return Counter(e.state for e in outcomes)


def _document(outcome: BatchOutcome) -> Json:
    metrics: list[Json] = [{"name": n, "value": v, "unit": u} for n, v, u in outcome.metrics]
    return {
        "name": outcome.name, "state": outcome.state, "problem": outcome.problem, "metrics": metrics,
        "warnings": list(outcome.warnings),
    }  # fmt: skip
