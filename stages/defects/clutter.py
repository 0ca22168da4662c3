"""What is not the wall in the rings: how much there is, and how often it would look like a finding by chance.

A glint, a splash or a ghost stands in one ring at a place of its own. That two neighbouring rings show one in
the same place is then a meeting by chance, whose number follows from how many there are and how wide: over 18
drawn recordings (`python -m tests.benchmarks.bench_findings`) and four of an open one, easy and hard, 541
meetings were counted among the rejected samples where 546 follow from that. What meets is not rejected as
standing alone, so that some of it passes for a finding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Bool, Int
from pipeline.artefacts.measured import RingSamples, RingValidity

_CLUTTER = (RingValidity.GLINT, RingValidity.GHOST, RingValidity.OUTLIER, RingValidity.WIDTH)
# Some hundred rings show how much clutter there is as well as all of them.
_ENOUGH_RINGS = 400
# What is narrower than the millimetre over which a depth is a mean, or has fewer samples, makes no finding.
_LEAST_MM, _LEAST_SAMPLES = 1.0, 3


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
