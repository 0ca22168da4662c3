"""The findings after all actions were applied, each with its measurement by the run."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np

from pipeline.errors import BoresightError
from pipeline.review import decisions as do
from pipeline.review.decisions.ledger import Entry

Outline = tuple[tuple[float, float], ...]
OPEN, ACCEPTED, REJECTED, GONE = "open", "accepted", "rejected", "gone"
_MADE = {"m": "merged", "a": "added"}
_ID = re.compile(r"([ma]?)(\d+)(.*)")


class ImpossibleError(BoresightError):
    """An action that does not fit the current findings."""


@dataclass(frozen=True)
class Measured:
    """Size of an outline on the wall; ``depth_mm`` positive into the wall, NaN where nothing was seen.

    The peak is the place where the depth was measured; NaN for an older run whose findings do not state it.
    """

    distance_from_mm: float
    distance_to_mm: float
    clock_from: float
    clock_to: float
    length_mm: float
    width_mm: float
    depth_mm: float
    depth_sigma_mm: float
    peak_distance_mm: float = float("nan")
    peak_clock: float = float("nan")


class Gauge(Protocol):
    """Measures an outline on the run's wall."""

    def measure(self, outline: Outline) -> Measured:
        """Return its size."""


@dataclass(frozen=True)
class Remark:
    """A comment with its author and time."""

    who: str
    at: str
    text: str


@dataclass(frozen=True)
class Finding:
    """A finding after all actions.

    Attributes
    ----------
    id : str
        Number of the measured defect; ``a1`` is added by hand, ``m1`` merged, ``3.1`` split off.
    kind : str
    outline : tuple of (distance mm, azimuth rad)
    size : Measured
    status : str
        ``open``, ``accepted``, ``rejected``, or ``gone``: merged or split into others.
    original : int or None
        Number of its measured defect, None when it was added by hand.
    edited : bool
        Whether kind or outline differ from the measured ones.
    decided_by, decided_at, reason : str
    remarks : tuple of Remark
    made_of : tuple of str
        Findings from which it was merged or split.
    """

    id: str
    kind: str
    outline: Outline
    size: Measured
    status: str = OPEN
    original: int | None = None
    edited: bool = False
    decided_by: str = ""
    decided_at: str = ""
    reason: str = ""
    remarks: tuple[Remark, ...] = ()
    made_of: tuple[str, ...] = ()


def counting(entries: Sequence[Entry]) -> tuple[tuple[Entry, ...], tuple[Entry, ...]]:
    """Return the entries that count, and the undone ones that may be redone, the next one last."""
    done: list[Entry] = []
    undone: list[Entry] = []
    for entry in entries:
        if isinstance(entry.action, do.Undo):
            if done:
                undone.append(done.pop())
        elif isinstance(entry.action, do.Redo):
            if undone:
                done.append(undone.pop())
        else:
            done.append(entry)
            undone.clear()
    return tuple(done), tuple(undone)


def replay(measured: Iterable[Finding], entries: Sequence[Entry], gauge: Gauge) -> tuple[Finding, ...]:
    """Return the findings after all entries that count, in order of distance.

    Raises
    ------
    ImpossibleError
        When an action names a finding that does not exist, or no longer exists.
    """
    findings = {f.id: f for f in measured}
    for entry in counting(entries)[0]:
        findings |= _after(findings, entry, gauge)
    return tuple(sorted(findings.values(), key=lambda f: (f.size.distance_from_mm, f.id)))


def _after(findings: Mapping[str, Finding], entry: Entry, gauge: Gauge) -> dict[str, Finding]:
    """Return the findings that an entry changes or makes."""
    action = entry.action
    if isinstance(action, do.Add):
        made = Finding(
            f"a{entry.id}", action.kind.value, action.outline, gauge.measure(action.outline), ACCEPTED,
            edited=True, decided_by=entry.who, decided_at=entry.at,
        )  # fmt: skip
        return {made.id: made}
    if isinstance(action, do.Merge):
        return _merged([_there(findings, name) for name in action.findings], entry, gauge)
    if isinstance(action, do.Split):
        return _split(_there(findings, action.finding), action.outlines, entry, gauge)
    if isinstance(action, do.Undo | do.Redo | do.Assume | do.Describe):
        return {}
    old = _there(findings, action.finding)
    return {old.id: _changed(old, entry, gauge)}


def _there(findings: Mapping[str, Finding], name: str) -> Finding:
    if name not in findings or findings[name].status == GONE:
        raise ImpossibleError(f"finding {name} no longer exists; look again")
    return findings[name]


def _changed(old: Finding, entry: Entry, gauge: Gauge) -> Finding:
    action = entry.action
    by = replace(old, decided_by=entry.who, decided_at=entry.at)
    match action:
        case do.Accept():
            return replace(by, status=ACCEPTED, reason="")
        case do.Reject():
            return replace(by, status=REJECTED, reason=action.reason)
        case do.Reopen():
            return replace(by, status=OPEN, reason="")
        case do.Reclassify():
            return replace(by, kind=action.kind.value, edited=True)
        case do.Redraw():
            return replace(by, outline=action.outline, size=gauge.measure(action.outline), edited=True)
        case do.Comment():
            return replace(old, remarks=(*old.remarks, Remark(entry.who, entry.at, action.text)))
    raise ImpossibleError(f"{action.do} does not concern one finding")


def _merged(parts: list[Finding], entry: Entry, gauge: Gauge) -> dict[str, Finding]:
    outline = hull([point for part in parts for point in beside(part.outline, parts[0].outline)])
    deepest = max(parts, key=lambda f: abs(np.nan_to_num(f.size.depth_mm)))
    made = Finding(
        f"m{entry.id}", deepest.kind, outline, gauge.measure(outline), edited=True,
        made_of=tuple(p.id for p in parts), remarks=tuple(r for p in parts for r in p.remarks),
    )  # fmt: skip
    return {p.id: replace(p, status=GONE) for p in parts} | {made.id: made}


def _split(old: Finding, outlines: tuple[Outline, ...], entry: Entry, gauge: Gauge) -> dict[str, Finding]:
    made = [
        Finding(f"{old.id}.{k}", old.kind, outline, gauge.measure(outline), edited=True, made_of=(old.id,))
        for k, outline in enumerate(outlines, 1)
    ]
    return {old.id: replace(old, status=GONE)} | {f.id: f for f in made}


def beside(outline: Outline, other: Outline) -> Outline:
    """Return an outline turned by whole circles so that it lies next to another."""
    apart = np.mean([a for _, a in outline]) - np.mean([a for _, a in other])
    turns = 2 * np.pi * np.round(apart / (2 * np.pi))
    return tuple((s, float(a - turns)) for s, a in outline)


def hull(points: Sequence[tuple[float, float]]) -> Outline:
    """Return the convex hull of points (A. M. Andrew, 1979)."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        raise ImpossibleError("an outline needs three different points")

    def half(run: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        chain: list[tuple[float, float]] = []
        for p in run:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], p) <= 0:
                chain.pop()
            chain.append(p)
        return chain[:-1]

    return tuple(half(ordered) + half(ordered[::-1]))


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def covered(finding: Finding, others: Iterable[Finding]) -> tuple[str, ...]:
    """Return the other findings whose outlines reach into the finding's own."""
    return tuple(f.id for f in others if f.id != finding.id and _near(finding, f) and _meet(finding, f))


def _near(one: Finding, other: Finding) -> bool:
    a, b = one.size, other.size
    return a.distance_from_mm <= b.distance_to_mm and b.distance_from_mm <= a.distance_to_mm


def _meet(one: Finding, other: Finding) -> bool:
    """Return whether a corner of one lies inside the other; outlines that only cross do not count."""
    moved = beside(other.outline, one.outline)
    return _any_inside(moved, one.outline) or _any_inside(one.outline, moved)


def _any_inside(points: Outline, outline: Outline) -> bool:
    scale = np.array([1.0, 100.0])  # about mm in both directions; the result does not depend on it
    polygon = (np.asarray(outline) * scale).astype(np.float32)
    return any(
        cv2.pointPolygonTest(polygon, tuple(map(float, p * scale)), False) > 0 for p in np.asarray(points)
    )


def labels(findings: Iterable[Finding]) -> dict[str, str]:
    """Return the name of each finding, by its id: ``3``, ``4 (merged)``, ``5 (added)``, ``3.1 (split)``.

    Findings made by hand are numbered after the measured ones, in the order in which they were made;
    ``findings`` are all of a review, including merged and split ones.
    """
    parts = {f.id: _parts(f.id) for f in findings}
    measured = max((number for made, number, _ in parts.values() if not made), default=0)
    by_hand = sorted({number for made, number, _ in parts.values() if made})
    counted = {number: measured + k for k, number in enumerate(by_hand, 1)}
    out = {}
    for name, (made, number, rest) in parts.items():
        how = "split" if rest else _MADE.get(made, "")
        out[name] = f"{counted[number] if made else number}{rest}" + (f" ({how})" if how else "")
    return out


def _parts(name: str) -> tuple[str, int, str]:
    found = _ID.fullmatch(name)
    assert found is not None, f"{name} is no id of a finding"
    return found[1], int(found[2]), found[3]
