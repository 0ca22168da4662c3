"""The recordings of a drill, their truth, and a diagnosis in a process that never sees that truth."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pipeline
from pipeline.drill.answer import Answer, Concealed, read_answer, read_concealed
from pipeline.drill.score import Trial
from pipeline.errors import BoresightError, InputError
from pipeline.files.disk import disk_errors_named, remove, sync_tree
from pipeline.system.parallel import end_with_parent

ANSWER, TIMING = "diagnosis.json", "timing.json"
_APART = ".apart-"
_KINDS = ("gauge", "field")


class DiagnosisFailedError(BoresightError):
    """A diagnosis ended without an answer, with the exit status ``code``."""

    def __init__(self, problem: str, code: int) -> None:
        super().__init__(problem)
        self.code = code

    @property
    def was_stopped(self) -> bool:
        """Whether a signal ended it, so that the same command can continue it."""
        return self.code < 0 or self.code == 128 + signal.SIGINT


@dataclass(frozen=True)
class Case:
    """Recordings of one probe; at least one of ``gauge`` and ``field`` exists."""

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
    """Diagnose a case in a separate process that is given the recordings and nothing else.

    The recordings are in a folder without any truth beside it. An existing answer is kept; a diagnosis that
    was stopped continues from the results of its completed stages.

    Raises
    ------
    DiagnosisFailedError
        With the last lines that the process wrote.
    InputError
        When the disk is full or cannot be written.
    """
    with disk_errors_named(output.parent):
        if not (output / ANSWER).is_file():
            _diagnose_into(case, output, without)
        remove(_apart(output))


def _apart(output: Path) -> Path:
    """Return the folder in which the diagnosis with this output works."""
    return output.with_name(_APART + output.name)


def _diagnose_into(case: Case, output: Path, without: tuple[str, ...]) -> None:
    elsewhere = _apart(output)
    recordings, answer = elsewhere / "recordings", elsewhere / "answer"
    remove(recordings)
    recordings.mkdir(parents=True)
    environment = os.environ | {"PYTHONPATH": str(Path(pipeline.__file__).resolve().parents[1])}
    in_one_go, start = not answer.exists(), time.monotonic()
    done = subprocess.run(
        _command(_alone(case, recordings), answer.resolve(), without),
        cwd=elsewhere, env=environment, capture_output=True, text=True, check=False,
        preexec_fn=end_with_parent,
    )  # fmt: skip
    if done.returncode:
        last = "\n".join(done.stderr.strip().splitlines()[-6:])
        problem = f"{case.name}: the diagnosis ended with {done.returncode}\n{last}"
        failure = DiagnosisFailedError(problem, done.returncode)
        if not failure.was_stopped:
            remove(elsewhere)
        raise failure
    if in_one_go:
        (answer / TIMING).write_text(json.dumps({"seconds": round(time.monotonic() - start, 1)}), "utf-8")
    sync_tree(answer)
    remove(output)
    answer.rename(output)


def _alone(case: Case, folder: Path) -> Case:
    """Return the case with its recordings in a folder of their own, by hard links where possible."""
    parts = {}
    for kind, path in (("gauge", case.gauge), ("field", case.field)):
        parts[kind] = None if path is None else folder / path.name
        if path is not None:
            shutil.copytree(path, folder / path.name, copy_function=_link)
    return Case(case.name, parts["gauge"], parts["field"])


def _link(source: str, target: str) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def trial_of(case: Case, answer: Path, truth: Path, left_out: tuple[str, ...] = ()) -> Trial:
    """Read the truth of a case and combine it with the answer; without an answer, nothing was identified.

    Raises
    ------
    InputError
        When either cannot be read.
    """
    file = answer / ANSWER
    said = read_answer(file) if file.is_file() else Answer.model_validate({"verdict": "not_identifiable"})
    return Trial(case.name, concealed_in(case, truth), said, left_out)


def concealed_in(case: Case, truth: Path) -> tuple[Concealed, ...]:
    """Return the effects concealed in all recordings of a case, from ``truth``/NAME-KIND/truth.json."""
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
