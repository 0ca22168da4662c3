"""The recordings of a drill, where their truth is, and a diagnosis in a process that never sees it."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import pipeline
from pipeline.errors import BoresightError, InputError
from stages.diagnose.drill.answer import Concealed, read_answer, read_concealed
from stages.diagnose.drill.score import Trial

_KINDS = ("gauge", "field")


class DiagnosisFailedError(BoresightError):
    """A diagnosis ended without an answer."""


@dataclass(frozen=True)
class Case:
    """Recordings of one probe; at least one of ``gauge`` and ``field`` is there."""

    name: str
    gauge: Path | None
    field: Path | None


def find_cases(folder: Path) -> tuple[Case, ...]:
    """Return the cases of a folder of recordings named NAME-gauge and NAME-field.

    Raises
    ------
    InputError
        When there is none.
    """
    found: dict[str, dict[str, Path]] = {}
    for path in sorted(p for p in folder.glob("*") if (p / "recording.yaml").is_file()):
        name, _, kind = path.name.rpartition("-")
        if name and kind in _KINDS:
            found.setdefault(name, {})[kind] = path
    if not found:
        raise InputError(
            folder, "holds no recordings to diagnose", expected="folders NAME-gauge and NAME-field"
        )
    return tuple(Case(name, parts.get("gauge"), parts.get("field")) for name, parts in found.items())


def diagnose_apart(case: Case, output: Path, without: tuple[str, ...] = ()) -> None:
    """Diagnose a case in a process of its own that is told the recordings and nothing else.

    An answer that is there already is kept.

    Raises
    ------
    DiagnosisFailedError
        With the last lines that the process wrote.
    """
    if (output / "diagnosis.json").is_file():
        return
    environment = os.environ | {"PYTHONPATH": str(Path(pipeline.__file__).resolve().parents[1])}
    with tempfile.TemporaryDirectory() as elsewhere:
        done = subprocess.run(
            _command(case, output.resolve(), without),
            cwd=elsewhere, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
    if done.returncode:
        last = "\n".join(done.stderr.strip().splitlines()[-6:])
        raise DiagnosisFailedError(f"{case.name}: the diagnosis ended with {done.returncode}\n{last}")


def trial_of(case: Case, answer: Path, truth: Path, left_out: tuple[str, ...] = ()) -> Trial:
    """Open the truth of a case and put it beside the answer.

    Raises
    ------
    InputError
        When either cannot be read.
    """
    return Trial(case.name, concealed_in(case, truth), read_answer(answer / "diagnosis.json"), left_out)


def concealed_in(case: Case, truth: Path) -> tuple[Concealed, ...]:
    """Return what the recordings of a case conceal together, from ``truth``/NAME-KIND/truth.json."""
    effects: dict[str, Concealed] = {}
    for path in (case.gauge, case.field):
        if path is not None:
            effects |= {c.name: c for c in read_concealed(truth / path.name / "truth.json")}
    return tuple(effects.values())


def _command(case: Case, output: Path, without: tuple[str, ...]) -> list[str]:
    words = [sys.executable, "-m", "pipeline.cli", "diagnose"]
    words += [str(case.field.resolve())] if case.field else []
    words += ["--gauge", str(case.gauge.resolve())] if case.gauge else []
    return [*words, "-o", str(output), *(w for name in without for w in ("--without", name))]
