"""One recording of a batch, run in a process of its own by whichever worker takes it."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pipeline
from pipeline.files.json_file import read_json
from pipeline.machine.stopping import end_with_parent

_REFUSED = 2
_BUSY = "is at work in this run folder"
_WAIT_S, _PATIENCE_S = 2.0, 120.0
_TOLD_LINES = 4


@dataclass(frozen=True)
class Work:
    """A recording, where its run goes, and the words for ``boresight run`` beside these two."""

    name: str
    recording: Path
    folder: Path
    options: tuple[str, ...]


@dataclass(frozen=True)
class Ending:
    """How a recording of a batch ended.

    Attributes
    ----------
    name : str
    state : str
        That of run.json, or ``refused`` when the recording could not be opened.
    problem : str
        Empty when it completed.
    metrics : tuple of (name, value, unit)
    warnings : tuple of str
        What the reader mended and what stages warn of: a completed run that wants a look.
    """

    name: str
    state: str
    problem: str
    metrics: tuple[tuple[str, Any, str], ...] = ()
    warnings: tuple[str, ...] = ()


def run_one(work: Work) -> Ending:
    """Run one recording; whatever happens to it becomes an ending, never an error of the batch."""
    code, told = _run(work)
    until = time.monotonic() + _PATIENCE_S
    while code == _REFUSED and _BUSY in told and time.monotonic() < until:
        # A lost worker's process may hold the folder until the system has ended it.
        time.sleep(_WAIT_S)
        code, told = _run(work)
    return ending_of(work, code, told)


def _run(work: Work) -> tuple[int, str]:
    words = [sys.executable, "-m", "pipeline.cli", "run", str(work.recording), "-o", str(work.folder)]
    environment = os.environ | {"PYTHONPATH": str(Path(pipeline.__file__).resolve().parents[1])}
    done = subprocess.run(
        [*words, *work.options], env=environment, capture_output=True, text=True, check=False,
        preexec_fn=end_with_parent,
    )  # fmt: skip
    return done.returncode, done.stderr


def ending_of(work: Work, code: int, told: str) -> Ending:
    """Return how a run ended, from its exit status, what it said, and the record that it left."""
    record = _record(work.folder)
    if code and (record is None or not record.get("problem") or record["problem"] not in told):
        # The record is of an earlier call, or could not be brought up to date: the disk may be the cause.
        last = " ".join(told.strip().splitlines()[-_TOLD_LINES:]) or f"it ended with status {code}"
        return Ending(work.name, "refused" if code == _REFUSED else "failed", last)
    if record is None:
        return Ending(work.name, "failed", "the run left no record")
    metrics = tuple((m["name"], m["value"], m["unit"]) for m in record.get("metrics", ()))
    warnings = tuple(map(str, (*record.get("reader_warnings", ()), *record.get("warnings", ()))))
    return Ending(work.name, str(record["state"]), str(record.get("problem", "")), metrics, warnings)


def _record(folder: Path) -> dict[str, Any] | None:
    try:
        record: dict[str, Any] = read_json(folder / "run.json")
    except (OSError, ValueError):
        return None
    return record
