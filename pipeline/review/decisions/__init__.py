"""The actions of an inspector on findings."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, field_validator

from pipeline.artefacts.findings import DefectKind
from pipeline.errors import InputError

FindingId = Annotated[str, Field(pattern=r"^(m|a)?[0-9]{1,9}(\.[0-9]{1,3})*$")]
Text = Annotated[str, Field(max_length=4000)]
# (distance mm, azimuth rad); the azimuth continues beyond ±π without a jump.
Point = tuple[
    Annotated[float, Field(ge=-1e7, le=1e7, allow_inf_nan=False)],
    Annotated[float, Field(ge=-13, le=13, allow_inf_nan=False)],
]
Outline = Annotated[tuple[Point, ...], Field(min_length=3, max_length=2000)]


class _Action(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Accept(_Action):
    """The finding is a defect as it stands."""

    do: Literal["accept"] = "accept"
    finding: FindingId


class Reject(_Action):
    """The finding is no defect, for a reason."""

    do: Literal["reject"] = "reject"
    finding: FindingId
    reason: Text = ""


class Reopen(_Action):
    """The finding must be decided again."""

    do: Literal["reopen"] = "reopen"
    finding: FindingId


class Reclassify(_Action):
    """The finding is of another kind."""

    do: Literal["reclassify"] = "reclassify"
    finding: FindingId
    kind: DefectKind


class Redraw(_Action):
    """The finding has another outline."""

    do: Literal["redraw"] = "redraw"
    finding: FindingId
    outline: Outline


class Merge(_Action):
    """Several findings are one."""

    do: Literal["merge"] = "merge"
    findings: Annotated[tuple[FindingId, ...], Field(min_length=2, max_length=50)]

    @field_validator("findings")
    @classmethod
    def _different(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(value)) < len(value):
            raise ValueError("a finding cannot be merged with itself")
        return value


class Split(_Action):
    """One finding is several."""

    do: Literal["split"] = "split"
    finding: FindingId
    outlines: Annotated[tuple[Outline, ...], Field(min_length=2, max_length=20)]


class Add(_Action):
    """A defect that was not found."""

    do: Literal["add"] = "add"
    kind: DefectKind
    outline: Outline


class Comment(_Action):
    """A remark on a finding."""

    do: Literal["comment"] = "comment"
    finding: FindingId
    text: Annotated[str, Field(min_length=1, max_length=4000)]


class Assume(_Action):
    """Assumed data of the pipe, for wall loss and strength."""

    do: Literal["assume"] = "assume"
    wall_thickness_mm: Annotated[float, Field(gt=0, le=1000)] | None = None
    yield_mpa: Annotated[float, Field(gt=0, le=5000)] | None = None


ShortText = Annotated[str, Field(max_length=200)]


class Describe(_Action):
    """Client, place and method of the inspection; empty entries are taken from the recording."""

    do: Literal["describe"] = "describe"
    client: ShortText = ""
    site: ShortText = ""
    asset: ShortText = ""
    line: ShortText = ""
    operator: ShortText = ""
    date: Annotated[str, Field(pattern=r"^([0-9]{4}-[0-9]{2}-[0-9]{2})?$")] = ""
    procedure: ShortText = ""
    equipment: ShortText = ""
    calibration: ShortText = ""


class Undo(_Action):
    """Undo the last action that still counts."""

    do: Literal["undo"] = "undo"


class Redo(_Action):
    """Do the last undone action again; not after another action."""

    do: Literal["redo"] = "redo"


Decision = Accept | Reject | Reopen | Reclassify | Redraw | Merge | Split | Add | Comment | Assume | Describe
Action = Decision | Undo | Redo
_ACTION: TypeAdapter[Action] = TypeAdapter(Annotated[Action, Field(discriminator="do")])


def action_of(text: str | bytes) -> Action:
    """Return the action of a JSON document.

    Raises
    ------
    InputError
        When it is not one.
    """
    try:
        return _ACTION.validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise InputError("action", first["msg"], place=place, expected="an action of the review") from error
