"""Findings of two runs put together: which of the later run is which of the earlier one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.arrays import Float
from pipeline.artefacts.findings import DefectKind
from pipeline.review.comparison.registration import Registration
from pipeline.review.decisions.replay import Finding

# Outlines of one defect differ by a cell or two and by the registration, σ of which counts so often.
_SIGMAS = 3.0
_CELLS_MM = 1.0
# Kinds that look alike change names from run to run; of two equally good places the same name wins.
_OTHER_KIND = 0.1
_IMPOSSIBLE = 1e3


@dataclass(frozen=True)
class Place:
    """A finding of either run, or of both, where it lies in the later run.

    Attributes
    ----------
    now, earlier : Finding or None
    outlines : tuple of (V, 2)
        Of those that are there, (distance mm, azimuth rad) of the later run.
    """

    now: Finding | None
    earlier: Finding | None
    outlines: tuple[Float, ...]

    @property
    def kind(self) -> DefectKind:
        """Its kind, that of the later run when it has one."""
        return DefectKind(next(f.kind for f in (self.now, self.earlier) if f is not None))

    @property
    def middle(self) -> tuple[float, float]:
        """Distance and azimuth of the middle of its box."""
        corner = np.concatenate(self.outlines)
        s, psi = (corner.min(0) + corner.max(0)) / 2
        return float(s), float(psi)


def moved_outline(finding: Finding, registration: Registration) -> Float:
    """Return an earlier finding's outline (V, 2) where it lies in the later run."""
    point = np.asarray(finding.outline, float)
    s, psi = registration.to_now(point[:, 0], point[:, 1])
    turns = 2 * np.pi * np.round(psi.mean() / (2 * np.pi))
    return np.stack([s, psi - turns], -1)


def put_together(
    earlier: Sequence[Finding], now: Sequence[Finding], registration: Registration, radius_mm: float
) -> tuple[Place, ...]:
    """Return every finding of both runs once, in order of distance.

    Two are one when both go into the wall, or both inward, or both are welds, and their boxes, grown by what
    registration and grid leave open, overlap. Where several could be, the least cost over all decides.
    """
    before = [moved_outline(f, registration) for f in earlier]
    after = [np.asarray(f.outline, float) for f in now]
    pairs = _assigned(earlier, before, now, after, registration, radius_mm)
    places = [_pair(now[j], earlier[i], after[j], before[i]) for i, j in pairs]
    of_earlier, of_now = ({pair[k] for pair in pairs} for k in (0, 1))
    places += [Place(None, f, (before[i],)) for i, f in enumerate(earlier) if i not in of_earlier]
    places += [Place(f, None, (after[j],)) for j, f in enumerate(now) if j not in of_now]
    return tuple(sorted(places, key=lambda p: p.middle))


def _pair(now: Finding, earlier: Finding, after: Float, before: Float) -> Place:
    """Return a place of both, the earlier outline whole turns away from where it lies next to the other."""
    apart = before[:, 1].mean() - after[:, 1].mean()
    turned = before - np.array([0.0, 2 * np.pi * np.round(apart / (2 * np.pi))])
    return Place(now, earlier, (after, turned))


def _assigned(
    earlier: Sequence[Finding], before: list[Float], now: Sequence[Finding], after: list[Float],
    registration: Registration, radius_mm: float,
) -> list[tuple[int, int]]:  # fmt: skip
    cost = np.full((len(earlier), len(now)), _IMPOSSIBLE)
    for i, one in enumerate(earlier):
        gate = _gate(one, registration, radius_mm)
        for j, other in enumerate(now):
            if _way(one) == _way(other):
                apart = _apart(before[i], after[j], gate)
                cost[i, j] = apart + _OTHER_KIND * (one.kind != other.kind) if apart < 1 else _IMPOSSIBLE
    rows, columns = linear_sum_assignment(cost)
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if cost[i, j] < _IMPOSSIBLE]


def _gate(finding: Finding, registration: Registration, radius_mm: float) -> tuple[float, float]:
    """Return by how much boxes are grown along the pipe, mm, and around it, rad."""
    along, around = registration.sigma_at(float(np.mean([s for s, _ in finding.outline])))
    return _SIGMAS * along + _CELLS_MM, _SIGMAS * around + _CELLS_MM / radius_mm


def _apart(one: Float, other: Float, gate: tuple[float, float]) -> float:
    """Return 1 − overlap over union of two grown boxes: 0 where they are the same, 1 where they are apart."""
    common_area, areas = 1.0, np.ones(2)
    for k, room in enumerate(gate):
        (a0, a1), (b0, b1) = ((p[:, k].min() - room / 2, p[:, k].max() + room / 2) for p in (one, other))
        turn = 2 * np.pi * np.round((a0 + a1 - b0 - b1) / (4 * np.pi)) if k else 0.0
        common = min(a1 - turn, b1) - max(a0 - turn, b0)
        common_area *= max(common, 0.0)
        areas *= (a1 - a0, b1 - b0)
    return 1 - common_area / (float(areas.sum()) - common_area)


def _way(finding: Finding) -> int:
    """Return what can be one: welds, what takes wall away, what stands inward."""
    kind = DefectKind(finding.kind)
    return 0 if kind is DefectKind.WELD else 1 if kind.is_metal_loss else -1
