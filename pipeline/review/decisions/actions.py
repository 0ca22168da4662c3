"""What an inspector can do to a finding, and how decisions are carried over when a run is computed again."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, field_validator

from pipeline.artefacts.findings import DefectKind
from pipeline.errors import InputError
from pipeline.review.decisions import actions as do
from pipeline.review.decisions.ledger import Entry
from pipeline.review.decisions.replay import Finding

FindingId = Annotated[str, Field(pattern=r"^(m|a)?[0-9]{1,9}(\.[0-9]{1,3})*$")]
Text = Annotated[str, Field(max_length=4000)]
# (distance mm, azimuth rad); the azimuth runs on beyond ±π rather than jumping.
Point = tuple[
    Annotated[float, Field(ge=-1e7, le=1e7, allow_inf_nan=False)],
    Annotated[float, Field(ge=-13, le=13, allow_inf_nan=False)],
]
Outline = Annotated[tuple[Point, ...], Field(min_length=3, max_length=2000)]
# Two findings are the same when their middles are no farther apart than this, or than half their length.
_APART_MM = 5.0


def same_findings(old: Iterable[Finding], new: Iterable[Finding]) -> dict[str, str]:
    """Return which new finding each old one is: of the same kind, its middle within the other's extent."""
    free = list(new)
    found: dict[str, str] = {}
    for finding in old:
        near = [f for f in free if f.kind == finding.kind and _apart_mm(finding, f) <= _reach_mm(finding)]
        if near:
            match = min(near, key=lambda f: _apart_mm(finding, f))
            found[finding.id] = match.id
            free.remove(match)
    return found


def carried(
    entries: Sequence[Entry], basis: str, translations: dict[str, dict[str, str]]
) -> tuple[tuple[Entry, ...], tuple[Entry, ...]]:
    """Return the entries in the numbers of the findings ``basis``, and those that lost their finding.

    ``translations`` gives for each earlier basis the new number of each of its findings.
    """
    kept: list[Entry] = []
    lost: list[Entry] = []
    for entry in entries:
        names = {} if entry.basis == basis else translations[entry.basis]
        moved = entry if entry.basis == basis else _renamed(entry, names)
        (lost if moved is None else kept).append(moved or entry)
    return tuple(kept), tuple(lost)


def _renamed(entry: Entry, names: dict[str, str]) -> Entry | None:
    action = entry.action
    if isinstance(action, do.Merge):
        moved = [_translated(f, names) for f in action.findings]
        if not all(moved):
            return None
        return replace(entry, action=action.model_copy(update={"findings": tuple(moved)}))
    if isinstance(action, do.Add | do.Assume | do.Undo | do.Redo):
        return entry
    one = _translated(action.finding, names)
    return replace(entry, action=action.model_copy(update={"finding": one})) if one else None


def _translated(name: str, names: dict[str, str]) -> str | None:
    """Return the new number; findings made by hand keep theirs, parts follow what they were split from."""
    whole, dot, part = name.partition(".")
    if name[0] in "am":
        return name
    return names[whole] + dot + part if whole in names else None


def _middle(finding: Finding) -> tuple[float, float]:
    s, a = np.mean(np.asarray(finding.outline), axis=0)
    return float(s), float(a)


def _reach_mm(finding: Finding) -> float:
    return max(_APART_MM, finding.size.length_mm / 2)


def _apart_mm(one: Finding, other: Finding) -> float:
    """Return the distance along the pipe, and around it in units of the finding's own width."""
    (s0, a0), (s1, a1) = _middle(one), _middle(other)
    turn = (a1 - a0 + np.pi) % (2 * np.pi) - np.pi
    span = max(np.ptp([a for _, a in one.outline]), 1e-6)
    return float(np.hypot(s1 - s0, turn / span * max(one.size.width_mm, 1e-6)))


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
    """The finding is to be decided again."""

    do: Literal["reopen"] = "reopen"
    finding: FindingId


class Reclassify(_Action):
    """The finding is of another kind."""

    do: Literal["reclassify"] = "reclassify"
    finding: FindingId
    kind: DefectKind


class Redraw(_Action):
    """The finding reaches over another outline."""

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
    """What is taken for known of the pipe, for wall loss and strength."""

    do: Literal["assume"] = "assume"
    wall_thickness_mm: Annotated[float, Field(gt=0, le=1000)] | None = None
    yield_mpa: Annotated[float, Field(gt=0, le=5000)] | None = None


class Undo(_Action):
    """Take back the last action that still counts."""

    do: Literal["undo"] = "undo"


class Redo(_Action):
    """Do the last undone action again; not after another action."""

    do: Literal["redo"] = "redo"


Deed = Accept | Reject | Reopen | Reclassify | Redraw | Merge | Split | Add | Comment | Assume
Action = Deed | Undo | Redo
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
