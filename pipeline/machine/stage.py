"""A stage: a named, versioned, pure function from typed inputs and parameters to one typed output."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from types import NoneType
from typing import Annotated, Any, Protocol, cast, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import BaseModel, ConfigDict

from pipeline.machine.scratch import Scratch


class Parameters(BaseModel):
    """Base of every stage's parameters: strict, immutable, unknown keys refused.

    Each field has a ``description`` (meaning and unit) and its range, from which the documentation and
    ``configs/default.yaml`` are made.
    """

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", allow_inf_nan=False)


class Progress(Protocol):
    """Receives the progress of a stage."""

    def __call__(self, done: int, total: int) -> None:
        """Report ``done`` of ``total`` units of work."""


def unheard(done: int, total: int) -> None:
    """Ignore progress."""


class Warn(Protocol):
    """Write-only sink of warnings for users: terminal, run.json, report and review show them."""

    def __call__(self, text: str) -> None:
        """Warn: ``text`` says what is wrong, in which frames, what it means and what to do."""


class Report(Protocol):
    """Write-only sink of numbers for users; no result may depend on it."""

    def __call__(self, name: str, value: float | int | str, unit: str = "") -> None:
        """Record one headline number, e.g. ``report("rejected: saturated", 12, "samples")``."""


@dataclass(frozen=True)
class Context:
    """Services of the runner for a running stage.

    Attributes
    ----------
    progress
        To be called regularly; raises `pipeline.errors.Cancelled` when the user stopped the run.
    report
        Receives numbers for users.
    warn
        Receives warnings for users.
    random
        Generator seeded from the stage's parameters and the sources, so that a repeated run draws the same
        numbers.
    workers
        Number of threads or processes that the stage may use.
    scratch
        Storage for arrays too large for memory.
    """

    progress: Progress
    report: Report
    random: np.random.Generator
    workers: int = 2
    scratch: Scratch = field(default_factory=Scratch)
    warn: Warn = lambda text: None


@dataclass(frozen=True)
class Of:
    """The recording to which an artefact belongs, of several: ``Annotated[RingSamples, Of("gauge")]``."""

    role: str


def of_role(kind: type, role: str) -> type:
    """Return the class for one of several recordings; the class itself for the role ""."""
    return cast(type, Annotated[kind, Of(role)]) if role else kind


def plain(kind: type) -> type:
    """Return the class without its recording."""
    return kind.__origin__ if get_origin(kind) is Annotated else kind  # type: ignore[attr-defined]


def role_of(kind: type) -> str:
    """Return the recording of the class; empty if there is one recording only."""
    marks = get_args(kind)[1:] if get_origin(kind) is Annotated else ()
    return next((m.role for m in marks if isinstance(m, Of)), "")


def _not_none(kind: type) -> type:
    """Return the class of an argument that may also be None."""
    kinds = get_args(kind)
    return next(k for k in kinds if k is not NoneType) if NoneType in kinds else kind


@dataclass(frozen=True)
class Stage:
    """A step of the pipeline as a plain, picklable, module-level constant.

    The runner wires stages by type: every argument of ``function`` other than ``parameters`` and
    ``context`` is an artefact class made by an earlier stage, or one of the sources `Recording`, `Probe`.
    An optional argument is None if neither exists.

    Attributes
    ----------
    name
        Unique name, used on the command line and in the configuration.
    version
        Must be raised whenever the result for the same inputs changes.
    parameters
        Class of its parameters.
    function
        ``function(**artefacts, parameters=..., context=...) -> artefact``; module level, fully annotated.
    summary
        One line for ``boresight stages``.
    section
        Section of the configuration with its parameters, if it is not ``name``: several stages may share a
        section.
    role
        The recording that it processes, of several: see `for_role`.
    """

    name: str
    version: str
    parameters: type[Parameters]
    function: Callable[..., Any] = field(repr=False)
    summary: str = ""
    section: str = ""
    role: str = ""

    @property
    def configured_as(self) -> str:
        """Section of the configuration that holds its parameters."""
        return self.section or self.name

    @property
    def label(self) -> str:
        """Name for users, with the recording that it processes."""
        return f"{self.role} {self.name}".strip()

    def for_role(self, role: str) -> Stage:
        """Return the stage for one of several recordings.

        The stage takes the artefacts of that recording; if there is no such artefact, it takes the one that
        all recordings share. Its results have the same keys as without a role, so that they can be reused
        from a run of that recording alone.
        """
        return replace(self, role=role)

    def inputs(self) -> dict[str, type]:
        """Return argument name to artefact class, in the order of the function's signature."""
        return {name: _not_none(kind) for name, kind in self._arguments().items()}

    def may_lack(self) -> set[str]:
        """Return the arguments that may be None."""
        return {name for name, kind in self._arguments().items() if NoneType in get_args(kind)}

    def _arguments(self) -> dict[str, type]:
        hints = get_type_hints(self.function, include_extras=True)
        return {k: v for k, v in hints.items() if k not in ("parameters", "context", "return")}

    def output(self) -> type:
        """Return the artefact class that the stage makes, with its recording."""
        return of_role(get_type_hints(self.function)["return"], self.role)
