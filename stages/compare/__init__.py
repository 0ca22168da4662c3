"""Compares two runs through one pipe: registers the walls, takes their difference, follows each finding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.stats import t as student

from pipeline.arrays import Float
from pipeline.artefacts.comparison import (
    Change,
    Comparison,
    Fate,
    FindingPair,
    Growth,
    Outline,
    OutlinedFinding,
    Place,
    RegisteredWalls,
    Registration,
    WallPair,
)
from pipeline.artefacts.findings import DefectKind
from pipeline.machine.stage import Context, Parameters, Progress, Stage
from stages.compare.growth import Resolution, measure_growth
from stages.compare.paired import PairedWalls, registered_walls
from stages.compare.patch import Cutter, Patch, outline_mask
from stages.compare.registration.by_marks import RegisterParameters, register
from stages.compare.registration.marks import Surface


class CompareParameters(Parameters):
    """The stage compare has no parameters."""


def register_walls(walls: WallPair, parameters: RegisterParameters, context: Context) -> RegisteredWalls:
    """Register an earlier wall on a later one and take their difference.

    Raises
    ------
    UnusableError
        When the two do not show the same wall.
    """
    before, after = (Surface(w.wall, w.texture) for w in (walls.earlier, walls.now))
    registration = register(before, after, walls.welds_mm, parameters)
    context.report("pieces of wall matched", registration.blocks)
    context.report("pieces of wall that agree", registration.agreeing)
    pair = PairedWalls(before.wall, after.wall, registration)
    return registered_walls(pair, walls.is_one_calibration, context.progress)


def compare_findings(
    walls: WallPair,
    registered: RegisteredWalls,
    findings: FindingPair,
    parameters: CompareParameters,
    context: Context,
) -> Comparison:
    """Match the findings of both runs and measure each on both walls."""
    pair = PairedWalls(walls.earlier.wall, walls.now.wall, registered.registration)
    places = put_together(findings.earlier, findings.now, pair.registration, pair.radius_mm)
    return Comparison(changes(places, pair, _resolution(walls, pair), context.progress))


def _resolution(walls: WallPair, pair: PairedWalls) -> Resolution:
    """Return the resolution of depths: smoothing of the coarser map, and calibration."""
    both = (walls.earlier, walls.now)
    smoothing, spacing = max(w.smoothing_mm for w in both), max(w.ring_spacing_mm for w in both)
    # the map joins neighbouring rings by a triangular kernel of that half width, whose 1 σ is width / √6
    along = float(np.hypot(smoothing, spacing / np.sqrt(6)))
    relative = pair.calibration_mm / pair.radius_mm
    return Resolution(along, smoothing, relative, walls.is_one_calibration)


REGISTER = Stage(
    "register", "5", RegisterParameters, register_walls, "Register an earlier run's wall on a later one's."
)
COMPARE = Stage("compare", "6", CompareParameters, compare_findings, "Find the change of every finding.")
COMPARISON: tuple[Stage, ...] = (REGISTER, COMPARE)


# Two outlines of one defect differ by a cell or two, 1 mm, and by the registration, of which 3 σ are allowed.
_SIGMAS, _CELLS_MM = 3.0, 1.0
# Cost of pairing two findings of different kinds, where 1 is the cost of boxes that do not overlap. Kinds
# that look alike change names from run to run, so it only decides between places that fit equally well
# (chosen).
_OTHER_KIND = 0.1
_IMPOSSIBLE = 1e3


def moved_outline(finding: OutlinedFinding, registration: Registration) -> Float:
    """Return an earlier finding's outline (V, 2) in the later run's coordinates."""
    point = np.asarray(finding.outline, float)
    s, psi = registration.to_now(point[:, 0], point[:, 1])
    turns = 2 * np.pi * np.round(psi.mean() / (2 * np.pi))
    return np.stack([s, psi - turns], -1)


def put_together(
    earlier: Sequence[OutlinedFinding],
    now: Sequence[OutlinedFinding],
    registration: Registration,
    radius_mm: float,
) -> tuple[Place, ...]:
    """Return every finding of both runs once, in order of distance.

    Two findings are one when both go into the wall, or both inward, or both are welds, and their boxes
    overlap after being grown by the uncertainty of registration and grid. Of all assignments the one of least
    total cost (`_apart`) counts.
    """
    before = [moved_outline(f, registration) for f in earlier]
    after = [np.asarray(f.outline, float) for f in now]
    pairs = _assigned(earlier, before, now, after, registration, radius_mm)
    places = [_pair(now[j], earlier[i], after[j], before[i]) for i, j in pairs]
    of_earlier, of_now = ({pair[k] for pair in pairs} for k in (0, 1))
    places += [Place(None, f, (_corners(before[i]),)) for i, f in enumerate(earlier) if i not in of_earlier]
    places += [Place(f, None, (_corners(after[j]),)) for j, f in enumerate(now) if j not in of_now]
    return tuple(sorted(places, key=lambda p: p.middle))


def _pair(now: OutlinedFinding, earlier: OutlinedFinding, after: Float, before: Float) -> Place:
    """Return a place of both findings, the earlier outline moved by whole turns to lie next to the other."""
    apart = before[:, 1].mean() - after[:, 1].mean()
    turned = before - np.array([0.0, 2 * np.pi * np.round(apart / (2 * np.pi))])
    return Place(now, earlier, (_corners(after), _corners(turned)))


def _assigned(
    earlier: Sequence[OutlinedFinding], before: list[Float],
    now: Sequence[OutlinedFinding], after: list[Float],
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


def _gate(finding: OutlinedFinding, registration: Registration, radius_mm: float) -> tuple[float, float]:
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


def _way(finding: OutlinedFinding) -> int:
    """Return the group within which findings can be the same: welds, loss of wall, inward features."""
    return 0 if finding.kind is DefectKind.WELD else 1 if finding.kind.is_metal_loss else -1


def _corners(outline: Float) -> Outline:
    return tuple((float(s), float(psi)) for s, psi in outline)


def changes(
    places: Sequence[Place], pair: PairedWalls, resolution: Resolution, progress: Progress
) -> tuple[Change, ...]:
    """Return the change of every place."""
    outlines = [np.asarray(o) for p in places if p.kind is not DefectKind.WELD for o in p.outlines]
    cutter = Cutter(pair, outline_mask(outlines, pair))
    measured = []
    for k, place in enumerate(places):
        progress(k, len(places))
        measured.append(_measured(place, k, cutter, resolution))
    tested = [c.p for c in measured]
    return tuple(_judged(c, p) for c, p in zip(measured, holm(tested), strict=True))


def holm(p: Sequence[float]) -> list[float]:
    """Return p-values adjusted for their number; NaN stays NaN and does not count.

    S. Holm, "A simple sequentially rejective multiple test procedure", 1979.
    """
    values = np.asarray(p, float)
    order = [k for k in np.argsort(values) if np.isfinite(values[k])]
    out, highest = np.full(len(values), np.nan), 0.0
    for done, k in enumerate(order):
        highest = max(highest, min((len(order) - done) * values[k], 1.0))
        out[k] = highest
    return [float(v) for v in out]


def _measured(place: Place, number: int, cutter: Cutter, resolution: Resolution) -> Change:
    patch = cutter.patch([np.asarray(o) for o in place.outlines], np.random.default_rng(number))
    seen_now, seen_earlier = patch.coverage
    if place.kind is DefectKind.WELD:
        return Change(place, Fate.WELD, seen_now, seen_earlier, None)
    if patch.is_seen_in_both and not patch.is_comparable:
        return Change(place, Fate.NOT_COMPARED, seen_now, seen_earlier, None)
    if not patch.is_seen_in_both:
        unseen = Fate.UNSEEN_EARLIER if seen_earlier <= seen_now else Fate.UNSEEN_NOW
        return Change(place, unseen, seen_now, seen_earlier, None)
    growth = _growth(place, patch, cutter.pair, resolution)
    z = growth.depth_mm.value / growth.depth_mm.sigma
    # half the pieces overlap with the other half, so that only this many are independent for σ
    freedom = len(patch.noise_mm) / 2
    p = min(2 * float(student.sf(abs(z), freedom)) * _places_alike(place, patch, cutter.pair), 1.0)
    return Change(place, Fate.UNCHANGED, seen_now, seen_earlier, growth, z, p)


def _places_alike(place: Place, patch: Patch, pair: PairedWalls) -> float:
    """Return the number of places of its size from which a finding was selected; 1 if both runs have it."""
    if place.now is not None and place.earlier is not None:
        return 1.0
    return pair.now.radius_mm.size / float(patch.inside.sum())


def _growth(place: Place, patch: Patch, pair: PairedWalls, resolution: Resolution) -> Growth:
    s, psi = place.middle
    before_mm = float(pair.registration.to_earlier(np.array([s]), np.array([psi]))[0][0])
    along, turn = pair.registration.sigma_at(before_mm)
    around = turn * patch.cell_mm[1] / pair.now.step_rad
    sign = 1 if place.kind.is_metal_loss else -1
    walls = (pair.now, s), (pair.earlier, before_mm)
    displaced = [float(wall.displaced_in(np.array([wall.row(at)]))[0]) for wall, at in walls]
    here = replace(resolution, displaced_mm=float(np.linalg.norm(displaced)))
    return measure_growth(patch, sign, here, (along, around))


def _judged(change: Change, p_adjusted: float) -> Change:
    judged = replace(change, p_adjusted=p_adjusted)
    return replace(judged, fate=_fate(judged)) if change.growth is not None else judged


def _fate(change: Change) -> Fate:
    """Return the fate of a place by the sign of a significant change.

    Depth is positive into the wall: metal loss grows where it rises, a deposit or dent where it falls.
    """
    place, more = change.place, change.z * (1 if change.place.kind.is_metal_loss else -1) > 0
    if place.earlier is None:
        return Fate.NEW if change.is_significant and more else Fate.ONLY_NOW
    if place.now is None:
        return Fate.VANISHED if change.is_significant and not more else Fate.ONLY_EARLIER
    if not change.is_significant:
        return Fate.UNCHANGED
    return Fate.GREW if more else Fate.SHRANK
