"""Outcomes of stages and runs, with the numbers that they report."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeVar

from pipeline.errors import BoresightError, Cancelled, InputError, UnusableError

Artefact = TypeVar("Artefact")
# Name of an entry whose value is a sentence, shown before the numbers.
WARNING = "warning"


class State(StrEnum):
    """State of a stage, or of a whole run."""

    WAITING = "waiting"
    RUNNING = "running"
    COMPLETED = "completed"
    REUSED = "reused"
    UNUSABLE = "unusable"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @classmethod
    def after(cls, error: BoresightError) -> State:
        """Return the state of a stage that ended with an error."""
        if isinstance(error, Cancelled):
            return cls.CANCELLED
        return cls.UNUSABLE if isinstance(error, UnusableError | InputError) else cls.FAILED


def state_word(state: str) -> str:
    """Return the displayed word for a state: any run that ends early is "stopped", for whatever reason."""
    return "stopped" if state in (State.UNUSABLE, State.CANCELLED) else str(state)


@dataclass(frozen=True)
class Number:
    """A named number for people, with its unit (empty for plain counts and for words)."""

    name: str
    value: float | int | str
    unit: str = ""


@dataclass(frozen=True)
class StageOutcome:
    """State of one stage.

    Attributes
    ----------
    name, version, key
        Identification of the result.
    state
        `State.REUSED` when the result existed from an earlier call.
    seconds
        Time of the computation, also when that was in an earlier call.
    numbers
        Reported numbers: rejections by reason, residuals, and so on.
    problem
        Why it did not complete; empty when it did.
    """

    name: str
    version: str
    key: str
    state: State = State.WAITING
    seconds: float = 0.0
    numbers: tuple[Number, ...] = ()
    problem: str = ""


@dataclass(frozen=True)
class RunOutcome:
    """State of a run: its state, its stages in order, headline metrics, and why it did not complete."""

    state: State
    stages: tuple[StageOutcome, ...]
    metrics: tuple[Number, ...] = ()
    problem: str = ""


def warnings_of(stages: Iterable[StageOutcome]) -> tuple[str, ...]:
    """Return the warnings of stages, each with the stage's name."""
    return tuple(f"{s.name}: {n.value}" for s in stages for n in s.numbers if n.name == WARNING)


@dataclass(frozen=True)
class Results:
    """A completed run: its outcome, and its sources and artefacts in the order they came."""

    outcome: RunOutcome
    artefacts: tuple[object, ...]

    def of(self, kind: type[Artefact]) -> Artefact | None:
        """Return the artefact of class ``kind``, None when no stage made one."""
        return next((a for a in self.artefacts if isinstance(a, kind)), None)
