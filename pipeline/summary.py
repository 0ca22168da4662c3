"""What is known of a run when it ends: the stages' outcomes, their artefacts and the numbers for people."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TypeVar

from pipeline.config import Configuration
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Recording

Artefact = TypeVar("Artefact")


class State(StrEnum):
    """How a stage, or a whole run, stands."""

    WAITING = "waiting"
    RUNNING = "running"
    COMPLETED = "completed"
    REUSED = "reused"
    UNUSABLE = "unusable"
    FAILED = "failed"
    CANCELLED = "cancelled"


@dataclass(frozen=True)
class Number:
    """A named number for people, with its unit (empty for counts of nothing in particular and for words)."""

    name: str
    value: float | int | str
    unit: str = ""


@dataclass(frozen=True)
class StageOutcome:
    """How one stage ended.

    Attributes
    ----------
    name, version, key
        Which result it is.
    state
        `State.REUSED` when the result was there from an earlier call.
    seconds
        Time of the computation, also when that was in an earlier call.
    numbers
        What the stage reported: rejections by reason, residuals, and so on.
    problem
        Why it did not complete; empty when it did.
    """

    name: str
    version: str
    key: str
    state: State
    seconds: float = 0.0
    numbers: tuple[Number, ...] = ()
    problem: str = ""


@dataclass(frozen=True)
class RunSummary:
    """Everything that `run.json` and `report.html` are made from.

    Attributes
    ----------
    state
        Of the run: as that of the stage that ended it, `State.COMPLETED` when all did.
    recording, probe
        What was inspected, and with what.
    probe_file
        Where the probe was read from.
    configuration
        Resolved parameters of every stage.
    stages
        Outcomes in the order of the pipeline.
    metrics
        Headline numbers of the whole run.
    artefacts
        Results of the completed stages, in order; see `artefact`.
    problem
        Why the run did not complete; empty when it did.
    """

    state: State
    recording: Recording
    probe: Probe
    probe_file: str
    configuration: Configuration
    stages: tuple[StageOutcome, ...]
    metrics: tuple[Number, ...]
    artefacts: tuple[object, ...]
    problem: str = ""

    def artefact(self, kind: type[Artefact]) -> Artefact | None:
        """Return the artefact of class ``kind``, or None when its stage did not complete."""
        return next((a for a in self.artefacts if type(a) is kind), None)  # type: ignore[misc]
