"""Decisions carried over to the findings of a run that was computed again."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from pipeline.review.decisions import actions as do
from pipeline.review.decisions.ledger import Entry
from pipeline.review.decisions.replay import Finding

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
    if isinstance(action, do.Add | do.Assume | do.Describe | do.Undo | do.Redo):
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
