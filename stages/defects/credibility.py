"""The probability that a finding is there: how many of its kind are real, how many arise in such footage.

Findings shown by equally many rings are real or false in the ratio of two expected numbers. False ones arise
where clutter of neighbouring rings meets by chance, which follows from the clutter of the recording itself,
and where the wall's texture draws the line aside. The number of real ones follows from those that many rings
show, which hardly anything imitates, and from the counted ones less the false. Independent of that, a depth
within its own σ of nothing may be nothing.

A glint, a splash or a ghost stands in one ring at a place of its own. That two neighbouring rings show one in
the same place is a meeting by chance; the number of these follows from how many there are and how wide: over
18 drawn recordings (`python -m tests.benchmarks.bench_findings`) and four of an open one, 541 meetings
were counted among the rejected samples where 546 follow from that. What meets is not rejected as standing
alone, so that some of it passes for a finding.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from pipeline.arrays import Bool, Int
from pipeline.artefacts.findings import Defect
from pipeline.artefacts.measured import RingSamples, RingValidity
from stages.defects.corroborate import Evidence

# From four rings on hardly anything imitates a defect. For each defect so long, so many are seen in two
# rings, in three, and in four or any other number: 6, 17 and about 13 for 85 in the drawn recordings, whose
# defects are 3 to 14 mm long and whose rings are 1.1 to 2.2 mm apart.
_MANY_RINGS, _REAL_IN_RINGS, _REAL_IN_MANY = 4, {0: 0.07, 1: 0.07, 2: 0.07, 3: 0.2}, 0.15
# So many of the chance meetings pass for a finding: 9 of 92 in the drawn recordings with glints, the rest
# being on different sides of the wall or too shallow.
_PASSING = 0.1
# Findings that texture makes up, per ring of the recording: 7 of two rings, 5 of three and 5 of more in 21
# drawn recordings of 50 rings. Up to five σ of the wall they are as frequent at any depth, beyond it rarer.
_MADE_UP, _EACH_RING, _DEPTH_SIGMAS = 0.007, 0.6, 5.0
# The photo stands out at a place by chance once in 41 times for darker and for brighter.
_PHOTO_BY_CHANCE = 2 / 41
# Where there are so many findings of equally many rings that their number itself tells, it counts: less this
# many of its own σ, and less the false ones.
_CERTAIN = 2.0
# From here on a finding that is corroborated counts as one: rather real than not.
COUNTED = 0.5
_CLUTTER = (RingValidity.GLINT, RingValidity.GHOST, RingValidity.OUTLIER, RingValidity.WIDTH)
# Some hundred rings show how much clutter there is as well as all of them.
_ENOUGH_RINGS = 400
# What is narrower than the millimetre over which a depth is a mean, or has fewer samples, makes no finding.
_LEAST_MM, _LEAST_SAMPLES = 1.0, 3


@dataclass(frozen=True)
class Credibility:
    """What is expected in one recording.

    Attributes
    ----------
    clutter : Clutter
    ring_count : int
        Rings of the recording.
    shown_by : Counter
        How many findings are shown by 0, 1, 2, ... rings.
    """

    clutter: Clutter
    ring_count: int
    shown_by: Counter[int]

    def probability(self, evidence: Evidence, defect: Defect, min_depth_mm: float) -> float:
        """Return the probability that a finding is there."""
        deep_enough = float(ndtr((abs(defect.depth_mm) - min_depth_mm / 2) / defect.depth_sigma_mm))
        return deep_enough * self._real_share(evidence)

    def _real_share(self, evidence: Evidence) -> float:
        many = sum(n for rings, n in self.shown_by.items() if rings >= _MANY_RINGS)
        counted = self.shown_by[evidence.rings]
        false = self._false(evidence)
        likely = _REAL_IN_RINGS.get(evidence.rings, _REAL_IN_MANY) * (1 + many)
        real = max(likely, counted - _CERTAIN * counted**0.5 - false)
        return float(real / (real + false))

    def _false(self, evidence: Evidence) -> float:
        """Return how many false ones of so many rings to expect; the photo shows texture, but no glint."""
        rarer = min(1.0, (_DEPTH_SIGMAS / max(evidence.above_noise, 1e-9)) ** 2)
        made_up = _MADE_UP * self.ring_count * _EACH_RING ** (evidence.rings - 2) * rarer
        if evidence.rings >= 2:
            return _PASSING * self.clutter.meetings(evidence.rings) + made_up
        alone = self.shown_by[0] + self.shown_by[1]
        return alone * (_PHOTO_BY_CHANCE if evidence.photo else 1.0) + made_up


def credibility_of(found: Sequence[Evidence], clutter: Clutter, frames: Int) -> Credibility:
    """Return what to expect of a recording with these findings and the ``frames`` (M,) of its points."""
    return Credibility(clutter, len(np.unique(frames)), Counter(e.rings for e in found))


@dataclass(frozen=True)
class Clutter:
    """Runs of rejected samples that are wide enough to make a finding.

    Attributes
    ----------
    runs : float
        In all rings together.
    overlap : float
        Chance that a neighbouring ring shows one in the place of a given one.
    """

    runs: float = 0.0
    overlap: float = 0.0

    def meetings(self, rings: int) -> float:
        """Return how many places to expect in which so many neighbouring rings show clutter by chance."""
        return self.runs * self.overlap ** max(rings - 1, 0)


NO_CLUTTER = Clutter()


def clutter_of(rings: RingSamples, around_mm: float) -> Clutter:
    """Return the clutter of rings (F, A) on a wall of this circumference, mm."""
    count, azimuths = rings.validity.shape
    least = max(_LEAST_SAMPLES, int(np.ceil(_LEAST_MM * azimuths / around_mm)))
    some = slice(None, None, max(count // _ENOUGH_RINGS, 1))
    rejected = np.isin(rings.validity[some], _CLUTTER) & np.isfinite(rings.radius_px[some])
    widths = np.concatenate([np.empty(0, int), *map(_run_lengths, rejected)])
    widths = widths[widths >= least]
    if not widths.size:
        return NO_CLUTTER
    a_ring = len(widths) / len(rejected)
    overlap = min(a_ring * 2 * float(widths.mean()) / azimuths, 1.0)
    return Clutter(a_ring * count, overlap)


def _run_lengths(row: Bool) -> Int:
    """Return the lengths of the runs of true cells in a row that is not periodic."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(row, np.int8), [0]])))
    return np.asarray(edges[1::2] - edges[::2], np.int64)
