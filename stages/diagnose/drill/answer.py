"""A diagnosis and its truth as read from files, whoever wrote them."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pipeline.errors import InputError
from pipeline.files.json_file import read_json

Verdict = Literal["consistent", "named", "class", "unexplained", "not_identifiable"]


class Value(BaseModel):
    """A number and its 1 σ."""

    model_config = ConfigDict(frozen=True)

    value: float
    sd: float


class NamedEffect(BaseModel):
    """One effect that a diagnosis names."""

    model_config = ConfigDict(frozen=True)

    name: str
    probability: float = Field(ge=0, le=1)
    parameters: dict[str, Value] = {}


class Location(BaseModel):
    """Where a diagnosis says the mismatch is."""

    model_config = ConfigDict(frozen=True)

    channel: str = ""
    fixed_to: str = ""
    time: str = ""


class Fit(BaseModel):
    """Residuals before and after the diagnosis' model."""

    model_config = ConfigDict(frozen=True)

    rms_before: float
    rms_after: float
    heldout_before: float
    heldout_after: float
    noise_floor: float


class Feasibility(BaseModel):
    """What a diagnosis says beforehand that the recording could show of one effect.

    Attributes
    ----------
    detectable : float
        Size that would stand out by 5 σ.
    left : float
        Share of its information that is left when its closest rival is free.
    """

    model_config = ConfigDict(frozen=True)

    name: str
    detectable: float | None
    left: float | None = 1.0


class Answer(BaseModel):
    """What is scored of a diagnosis.json; further keys are left alone."""

    model_config = ConfigDict(frozen=True, populate_by_name=True)

    verdict: Verdict
    global_p: float | None = None
    location: Location | None = None
    effects: tuple[NamedEffect, ...] = ()
    members: tuple[str, ...] = Field((), alias="class")
    fit: Fit | None = None
    feasibility: tuple[Feasibility, ...] = ()


class Concealed(BaseModel):
    """An effect that a recording conceals: its name and its numbers in the catalogue's order."""

    model_config = ConfigDict(frozen=True)

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
        return tuple(Concealed(name=name, values=_numbers(values)) for name, values in listed or ())
    except (TypeError, ValueError) as error:
        expected = '"effects": [["laser_tilt", [0.6, 40.0]]], a list of names and numbers'
        raise InputError(file, "its effects cannot be read", place="effects", expected=expected) from error


def _numbers(values: object) -> tuple[float, ...]:
    """Return one number or a list of them as a tuple; words among them are left out."""
    listed = values if isinstance(values, list | tuple) else [values]
    return tuple(float(v) for v in listed if isinstance(v, int | float))


def _json(file: Path) -> object:
    try:
        return read_json(file)
    except OSError as error:
        raise InputError(file, error.strerror or "cannot be read", expected="a JSON file") from error
    except ValueError as error:
        hint = "it may have been cut short; an answer that is removed is made again"
        raise InputError(file, f"is not JSON: {error}", expected="a JSON file", hint=hint) from error
