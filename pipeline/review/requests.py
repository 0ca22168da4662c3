"""What the page may ask of the server, checked before anything is done."""

from __future__ import annotations

from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pipeline.errors import InputError
from pipeline.review.decisions.actions import Point
from pipeline.review.measuring.tools import Tool

_Request = TypeVar("_Request", bound=BaseModel)
_Name = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]*\S[^\x00-\x1f\x7f]*$")]
_Revision = Annotated[int, Field(ge=0, le=2**53)]


class Deed(BaseModel):
    """An action, by whom, and the number of the last one that its author saw."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    action: dict[str, Any]
    who: _Name
    revision: _Revision


class Signing(BaseModel):
    """A signature of the state at a revision."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: _Name
    standard: Annotated[str, Field(max_length=200)]
    remarks: Annotated[str, Field(max_length=4000)]
    revision: _Revision


class Measuring(BaseModel):
    """A tool at points of the wall."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    tool: Tool
    points: Annotated[tuple[Point, ...], Field(min_length=1, max_length=2000)]


def parsed(kind: type[_Request], body: bytes) -> _Request:
    """Return the request of a JSON body.

    Raises
    ------
    InputError
        When it is not one.
    """
    try:
        return kind.model_validate_json(body)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise InputError("request", first["msg"], place=place, expected=kind.__name__.lower()) from error
