"""Cases of a proof: drawn, rendered, sealed, diagnosed apart; the seal checked before the truth is read."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from pipeline.commands.prove_geometry import WallErrors, wall_errors
from pipeline.errors import BoresightError, InputError
from pipeline.files.disk import remove
from pipeline.machine.run_folder import RunFolder
from pipeline.simulator.prior import draw_pair, read_prior
from pipeline.simulator.truth_files import SEAL_FILE, open_seal
from pipeline.system.stopping import end_with_parent
from stages.diagnose.drill.cases import (
    TIMING,
    Case,
    DiagnosisFailedError,
    concealed_in,
    diagnose_apart,
    trial_of,
)
from stages.diagnose.drill.score import Trial

ANSWERS, ANSWERS_WITHOUT = "answers", "answers-without"
_REFUSED_SCENE = 3
_GO_ON = "mend what it names, then give the same command again: what is there is kept"


class NotRenderedError(BoresightError):
    """A drawn scene cannot show what it is meant to show."""


@dataclass(frozen=True)
class Drawing:
    """Where pairs are drawn from and where recordings and truth go."""

    prior: Path
    seed: int
    recordings: Path
    truth: Path


@dataclass(frozen=True)
class Worked:
    """A case diagnosed, its truth opened.

    Attributes
    ----------
    trials : tuple of Trial
        With the whole library and, where asked for, without the concealed effect.
    seconds : float or None
        That the diagnosis with the whole library took; None where it was stopped on the way.
    failures : tuple of str
        Diagnoses that ended without an answer; they are scored as having identified nothing.
    wall : WallErrors or None
        Of the inspection, where its truth tells the scene.
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
    """Refuse a recording that is sealed and not as it was sealed, or whose truth is not.

    Raises
    ------
    InputError
        Naming the files that were changed.
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
    """Diagnose a case, check its seal, open its truth; where asked, diagnose it without what it conceals."""
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
    # What the diagnoses measured is of no more use, and large: a proof may have thousands of cases.
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
