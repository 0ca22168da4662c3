"""The diagnosis as it is written to diagnosis.json."""

from __future__ import annotations

from dataclasses import is_dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from stages.diagnose.result import CourseFound, Diagnosis, EffectFound, Location, Verdict

_FORMAT = 1


def to_json(found: Diagnosis) -> dict[str, object]:
    """Return the contents of diagnosis.json: all of the diagnosis except what only the page shows."""
    fields = {k: v for k, v in _fields(found).items() if k != "causes" and not k.endswith("_picture")}
    return {
        "format": _FORMAT,
        **fields,
        "discrepancy": None,
        "effects": [_effect(e, found) for e in found.effects],
    }


def _effect(found: EffectFound, answer: Diagnosis) -> dict[str, object]:
    alone = answer.location if len(answer.effects) == 1 else None
    undecided = answer.verdict is Verdict.CLASS and found.name in answer.members
    return {
        **_fields(replace(found, location=found.location or alone)),
        "credible_set": list(answer.members) if undecided else [found.name],
    }


def _fields(record: object) -> dict[str, object]:
    """Return a record's fields: the known ones of a location, the numbers of a course beside its kind."""
    if isinstance(record, CourseFound):
        return {"kind": record.kind, **_plain(record.parameters), "probability": _plain(record.probability)}
    each = {"class" if k == "members" else k: _plain(v) for k, v in vars(record).items()}
    return {k: v for k, v in each.items() if v is not None} if isinstance(record, Location) else each


def _plain(value: Any) -> Any:
    """Return a value as JSON has it: numbers with six digits, None for NaN and infinity."""
    if isinstance(value, StrEnum):
        return str(value)
    if isinstance(value, float):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    return _fields(value) if is_dataclass(value) else value
