"""How stages and runs end, with the numbers they leave for people."""

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
    """How a stage, or a whole run, stands."""

    WAITING = "waiting"
    RUNNING = "running"
    COMPLETED = "completed"
    REUSED = "reused"
    UNUSABLE = "unusable"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @classmethod
    def after(cls, error: BoresightError) -> State:
        """Return how a stage stands that ended with an error."""
        if isinstance(error, Cancelled):
            return cls.CANCELLED
        return cls.UNUSABLE if isinstance(error, UnusableError | InputError) else cls.FAILED


def state_word(state: str) -> str:
    """Return the word for a state that people are shown: what ends early is stopped, for whatever reason."""
    return "stopped" if state in (State.UNUSABLE, State.CANCELLED) else str(state)


@dataclass(frozen=True)
class Number:
    """A named number for people, with its unit (empty for plain counts and for words)."""

    name: str
    value: float | int | str
    unit: str = ""


@dataclass(frozen=True)
class StageOutcome:
    """How one stage stands.

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
    state: State = State.WAITING
    seconds: float = 0.0
    numbers: tuple[Number, ...] = ()
    problem: str = ""


@dataclass(frozen=True)
class RunOutcome:
    """How a run stands: its state, its stages in order, headline metrics, and why it did not complete."""

    state: State
    stages: tuple[StageOutcome, ...]
    metrics: tuple[Number, ...] = ()
    problem: str = ""


def warnings_of(stages: Iterable[StageOutcome]) -> tuple[str, ...]:
    """Return what stages warn of, each with the stage's name."""
    return tuple(f"{s.name}: {n.value}" for s in stages for n in s.numbers if n.name == WARNING)


@dataclass(frozen=True)
class Results:
    """A completed run: its outcome, and its sources and artefacts in the order they came."""

    outcome: RunOutcome
    artefacts: tuple[object, ...]

    def of(self, kind: type[Artefact]) -> Artefact | None:
        """Return the artefact of class ``kind``, None when no stage made one."""
        return next((a for a in self.artefacts if isinstance(a, kind)), None)
