"""The answer of a diagnosis as diagnosis.json holds it."""

from __future__ import annotations

import numpy as np

from stages.diagnose.result import CourseFound, Diagnosis, EffectFound, Location, Remainder

FORMAT = 1


def to_json(found: Diagnosis) -> dict[str, object]:
    """Return what diagnosis.json holds."""
    out: dict[str, object] = {
        "format": FORMAT, "recording": found.recording, "gauge": found.gauge, "verdict": str(found.verdict),
        "global_p": _number(found.global_p),
        "location": None if found.location is None else _location(found.location),
        "effects": [_effect(e) for e in found.effects],
        "class": list(found.members), "identifiable": found.identifiable, "discrepancy": None,
        "remainder": None if found.remainder is None else _remainder(found.remainder),
        "fit": None if found.fit is None else _plain(found.fit),
        "record_next": found.record_next,
        "feasibility": [_plain(f) for f in found.feasibility],
        "inseparable": [list(names) for names in found.inseparable],
        "candidates": [_plain(c) for c in found.candidates],
        "shortcomings": list(found.shortcomings), "notes": list(found.notes),
    }  # fmt: skip
    return out


def _effect(found: EffectFound) -> dict[str, object]:
    return {
        "name": found.name, "probability": _number(found.probability),
        "parameters": {k: _plain(v) for k, v in found.parameters.items()},
        "statement": found.statement, "equation": found.equation,
        "confirmed_by": [_plain(c) for c in found.confirmed_by],
        "course": None if found.course is None else _course(found.course), "recording": found.recording,
    }  # fmt: skip


def _remainder(left: Remainder) -> dict[str, object]:
    return {
        "verdict": str(left.verdict), "location": None if left.location is None else _location(left.location),
        "class": list(left.members), "formula": left.formula,
    }  # fmt: skip


def _course(found: CourseFound) -> dict[str, object]:
    numbers = {k: _plain(v) for k, v in found.parameters.items()}
    return {"kind": found.kind, **numbers, "probability": _number(found.probability)}


def _location(found: Location) -> dict[str, object]:
    return {k: v for k, v in _plain(found).items() if v is not None}


def _plain(record: object) -> dict[str, object]:
    return {k: _value(v) for k, v in vars(record).items()}


def _value(value: object) -> object:
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, tuple):
        return [_value(v) for v in value]
    return value


def _number(value: float) -> float | None:
    """Return the number in six figures; None for what is no number, which JSON does not have."""
    return float(f"{value:.6g}") if np.isfinite(value) else None
