"""A diagnosis and its truth, as read from files of any origin."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from pipeline.errors import InputError
from pipeline.files.json_yaml import read_json

Verdict = Literal["consistent", "named", "partly", "class", "unexplained", "not_identifiable"]
# JSON has no NaN: a number that is not known is written as null.
Number = Annotated[float, BeforeValidator(lambda v: float("nan") if v is None else v)]


class _Read(BaseModel):
    model_config = ConfigDict(frozen=True, populate_by_name=True)


class Value(_Read):
    """A number and its 1 σ; NaN where unknown."""

    value: Number
    sd: Number


class NamedEffect(_Read):
    """One effect that a diagnosis names; ``course`` is None for a constant effect."""

    name: str
    probability: float = Field(ge=0, le=1)
    parameters: dict[str, Value] = {}
    statement: str = ""
    course: dict[str, Any] | None = None


class Location(_Read):
    """Where a diagnosis locates the mismatch."""

    channel: str = ""
    fixed_to: str = ""
    time: str = ""


class Fit(_Read):
    """Residuals before and after applying the diagnosis; NaN where unknown."""

    rms_before: Number
    rms_after: Number
    heldout_before: Number
    heldout_after: Number
    noise_floor: Number


class Feasibility(_Read):
    """What a diagnosis predicts that the recording could show of one effect.

    Attributes
    ----------
    detectable : float
        Size that would stand out by 5 σ.
    left : float
        Share of its information that remains when its closest rival is free.
    """

    name: str
    detectable: float | None
    left: float | None = 1.0


class Remainder(_Read):
    """What a diagnosis leaves beside the certain effects: a class, or something unexplained."""

    verdict: Literal["class", "unexplained"]
    members: tuple[str, ...] = Field((), alias="class")


class Answer(_Read):
    """The keys of a diagnosis.json that are read; others are ignored.

    Attributes
    ----------
    verdict : str
    global_p : float or None
        Probability of as large a mismatch if no physics is left out; None where unknown.
    location : Location or None
    effects : tuple of NamedEffect
        The effects named, each with its probability, and its parameters with 1 σ.
    members : tuple of str
        Effects that cannot be distinguished here; ``class`` in diagnosis.json.
    remainder : Remainder or None
        What is left beside the effects, when the verdict is ``partly``.
    fit : Fit or None
    feasibility : tuple of Feasibility
    record_next : str
        What to record to learn more; empty where nothing is needed.
    unexamined : tuple of str
        Parts of the recordings that could not be examined.
    """

    verdict: Verdict
    global_p: float | None = None
    location: Location | None = None
    effects: tuple[NamedEffect, ...] = ()
    members: tuple[str, ...] = Field((), alias="class")
    remainder: Remainder | None = None
    fit: Fit | None = None
    feasibility: tuple[Feasibility, ...] = ()
    record_next: str = ""
    unexamined: tuple[str, ...] = ()


class Concealed(_Read):
    """An effect that a recording conceals: its name and its numbers in the catalogue's order."""

    name: str
    values: tuple[float, ...]


def read_answer(file: Path) -> Answer:
    """Read a diagnosis.json.

    Raises
    ------
    InputError
        When it is missing, broken or not a diagnosis.
    """
    try:
        return Answer.model_validate(_json(file))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise InputError(file, first["msg"], place=place, expected="a diagnosis.json") from error


def read_concealed(file: Path) -> tuple[Concealed, ...]:
    """Read the concealed effects from a truth.json.

    Raises
    ------
    InputError
        When it is missing, broken or lists no effects.
    """
    document = _json(file)
    listed = document.get("effects") if isinstance(document, dict) else None
    try:
        return tuple(Concealed(name=name, values=_numbers(values)) for name, values, *_ in listed or ())
    except (TypeError, ValueError) as error:
        expected = '"effects": [["laser_tilt", [0.6, 40.0]]], a list of names and numbers'
        raise InputError(file, "its effects cannot be read", place="effects", expected=expected) from error


def _numbers(values: object) -> tuple[float, ...]:
    """Return one number or a list of them as a tuple, without any words among them."""
    listed = values if isinstance(values, list | tuple) else [values]
    return tuple(float(v) for v in listed if isinstance(v, int | float))


def _json(file: Path) -> object:
    try:
        return read_json(file)
    except OSError as error:
        raise InputError(file, error.strerror or "cannot be read", expected="a JSON file") from error
    except ValueError as error:
        hint = "it may be incomplete; delete it, and the same command makes it again"
        raise InputError(file, f"is not JSON: {error}", expected="a JSON file", hint=hint) from error
