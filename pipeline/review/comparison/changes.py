"""What became of every finding from the earlier run to the later one, judged all together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from scipy.stats import t as student

from pipeline.artefacts.findings import DefectKind
from pipeline.review.comparison.growth import Growth, Resolution, measure_growth
from pipeline.review.comparison.paired import PairedWalls
from pipeline.review.comparison.patch import Cutter, Patch, outline_mask
from pipeline.review.comparison.places import Place

# Probability that any one of all changes is declared where nothing changed.
FAMILY_ERROR = 0.01


class Fate(StrEnum):
    """What became of a finding."""

    GREW = "grew"
    SHRANK = "shrank"
    UNCHANGED = "no change shown"
    NEW = "new"
    VANISHED = "vanished"
    ONLY_NOW = "found now only, no change shown"
    ONLY_EARLIER = "found earlier only, no change shown"
    UNSEEN_EARLIER = "not seen earlier"
    UNSEEN_NOW = "not seen now"
    NOT_COMPARED = "not compared: too little clean wall beside it"
    WELD = "weld"


@dataclass(frozen=True)
class Change:
    """A finding of either run and what became of it.

    Attributes
    ----------
    place : Place
    fate : Fate
    seen_now, seen_earlier : float
        Share of it that each run saw.
    growth : Growth or None
        None for welds, which registered the runs, and where a run did not see it.
    z, p, p_adjusted : float
        Growth of the depth over its σ, how probable that is without any, and the same after Holm's step-down
        over all findings (Scand. J. Statist. 6, 1979); NaN without growth. A finding of one run only was
        found where that run stands out most, so that its p counts for all places of its size on the wall.
    """

    place: Place
    fate: Fate
    seen_now: float
    seen_earlier: float
    growth: Growth | None
    z: float = float("nan")
    p: float = float("nan")
    p_adjusted: float = float("nan")

    @property
    def is_significant(self) -> bool:
        """Whether it is declared a change, at `FAMILY_ERROR` over all findings."""
        return self.p_adjusted < FAMILY_ERROR


def changes(places: Sequence[Place], pair: PairedWalls, resolution: Resolution) -> tuple[Change, ...]:
    """Return what became of every place."""
    outlines = [o for place in places if place.kind is not DefectKind.WELD for o in place.outlines]
    cutter = Cutter(pair, outline_mask(outlines, pair))
    measured = [_measured(place, k, cutter, resolution) for k, place in enumerate(places)]
    tested = [c.p for c in measured]
    return tuple(_judged(c, p) for c, p in zip(measured, holm(tested), strict=True))


def holm(p: Sequence[float]) -> list[float]:
    """Return p-values adjusted for their number; NaN stays NaN and does not count."""
    values = np.asarray(p, float)
    order = [k for k in np.argsort(values) if np.isfinite(values[k])]
    out, highest = np.full(len(values), np.nan), 0.0
    for done, k in enumerate(order):
        highest = max(highest, min((len(order) - done) * values[k], 1.0))
        out[k] = highest
    return [float(v) for v in out]


def _measured(place: Place, number: int, cutter: Cutter, resolution: Resolution) -> Change:
    patch = cutter.patch(place.outlines, np.random.default_rng(number))
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
    # half the pieces overlap with the other half; so many are what the σ rests on
    freedom = len(patch.noise_mm) / 2
    p = min(2 * float(student.sf(abs(z), freedom)) * _places_alike(place, patch, cutter.pair), 1.0)
    return Change(place, Fate.UNCHANGED, seen_now, seen_earlier, growth, z, p)


def _places_alike(place: Place, patch: Patch, pair: PairedWalls) -> float:
    """Return among how many places of its size a finding was chosen: one where both runs have it."""
    if place.now is not None and place.earlier is not None:
        return 1.0
    return pair.now.radius_mm.size / float(patch.inside.sum())


def _growth(place: Place, patch: Patch, pair: PairedWalls, resolution: Resolution) -> Growth:
    s, psi = place.middle
    before_mm = float(pair.registration.to_earlier(np.array([s]), np.array([psi]))[0][0])
    along, turn = pair.registration.sigma_at(before_mm)
    around = turn * patch.cell_mm[1] / pair.now.step_rad
    sign = 1 if place.kind.is_metal_loss else -1
    return measure_growth(patch, sign, resolution, (along, around))


def _judged(change: Change, p_adjusted: float) -> Change:
    judged = replace(change, p_adjusted=p_adjusted)
    return replace(judged, fate=_fate(judged)) if change.growth is not None else judged


def _fate(change: Change) -> Fate:
    """Return the fate by what is significant; a deposit or dent grows inward, to the negative."""
    place, more = change.place, change.z * (1 if change.place.kind.is_metal_loss else -1) > 0
    if place.earlier is None:
        return Fate.NEW if change.is_significant and more else Fate.ONLY_NOW
    if place.now is None:
        return Fate.VANISHED if change.is_significant and not more else Fate.ONLY_EARLIER
    if not change.is_significant:
        return Fate.UNCHANGED
    return Fate.GREW if more else Fate.SHRANK
