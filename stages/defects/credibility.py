"""The probability that a finding is real, estimated from the recording itself.

Two things imitate defects, and the recording shows how frequent both are. Noise, compression and texture that
displaces the line make peaks: how their number falls with height is counted over the wall without its
findings (`stages.defects.noise_tail`). A glint or a splash is seen in a single ring. Neighbouring rings show
glints at the same place by chance only; how often follows from the number and the width of the findings that
one ring alone shows. Where a codec repeats a glint in other pictures, several rings show it. A glint is
brighter than the line, a defect only by chance, so that the number of bright findings gives the number of
glints.

The probability compares the expected numbers of real and of false findings of the same kind: of the same
height against noise, and in as many rings against chance (local false discovery rate: B. Efron, Large-Scale
Inference, 2010, ch. 5). The photo, taken under other light, raises it where it differs at that place, and
lowers it a little where it does not. In pictures full of streaks and noise the photo differs at many places:
how often it does at findings that one ring alone shows tells what that is worth. Independently of that, a
depth within its own σ may be zero.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from pipeline.artefacts.findings import Defect
from stages.defects.corroborate import LEAST_RINGS, MANY_RINGS, Evidence
from stages.defects.depth import KNOWN
from stages.defects.noise_tail import NoiseTail

# The scores of real findings are taken to be log-uniform over this factor.
_SCORES = 20.0
# Each number of rings is taken to show at least this share of the real findings.
_LEAST_SHARE = 0.1
# A finding counts as certain if noise is expected to have fewer peaks than this above its score.
_SURE = 0.05
# By chance, the photo stands out at a place once in 41 times for darker and once for brighter. It stands out
# at 6 of the 11 defects of open-1, 2 and 3: deposits and dents often have the wall's own colour.
_PHOTO_BY_CHANCE, _PHOTO_OF_REAL = 2 / 41, 6 / 11
# The recording's own share counts against that chance as so many findings against five. Chosen: with two or
# three others the chance hardly changes.
_AS_USUAL = 5
# A tenth of all places counts as bright, and so does a tenth of the defects, by chance. Besides the bright
# ones that the dark ones imply, half a bright real finding is allowed for.
_BRIGHT_BY_CHANCE, _UNTOLD = 0.1, 0.5
# A corroborated finding is counted from this probability on: it is more likely real than not.
COUNTED = 0.5
# Largest stated probability, as counted: of 319 painted findings with .95 and more, .975 were real [.951,
# .989] (`python -m tests.benchmarks.bench_painted_findings`).
MOST_SURE = 0.98


@dataclass(frozen=True)
class Credibility:
    """How many findings of each sort to expect in one recording.

    Attributes
    ----------
    tail : NoiseTail
    sure : Counter
        Number of findings, certain not to be noise, that are shown by 1 (or no), 2, 3, ... rings.
    overlap_chance : float
        Probability that a neighbouring ring happens to show a glint of the same sign at a finding's place.
    bright, dark : int
        Among the certain findings with less than six rings: number with a bright line, and number of others.
    photo_alone : Counter
        What the photo says of the findings that one ring alone (or none) shows, certain or not.
    """

    tail: NoiseTail
    sure: Counter[int]
    overlap_chance: float
    bright: int
    dark: int
    photo_alone: Counter[bool | None]

    def chance_against_clutter(self, evidence: Evidence) -> float:
        """Return the probability that a finding is neither noise nor a glint."""
        wrong = self._noise(evidence) + self._clutter(evidence)
        return 1 / (1 + wrong * self._odds_by_photo(evidence) + self._glints(evidence))

    def chance_overlaps(self, rings: int) -> float:
        """Return the expected number of places where ``rings`` neighbouring rings show glints by chance."""
        return float(self._alone * self.overlap_chance ** (rings - 1))

    def _noise(self, evidence: Evidence) -> float:
        """Return the expected number of noise peaks per real finding of such a score."""
        real = self._real / (max(evidence.score, 1.0) * np.log(_SCORES))
        return float(self.tail.density(evidence.score) / real)

    def _clutter(self, evidence: Evidence) -> float:
        """Return the expected number of coinciding glints per real finding in as many rings."""
        if evidence.rings < LEAST_RINGS:
            return float(self._alone / max(self.sure[1] - self._alone, self._few))
        false = self.chance_overlaps(evidence.rings)
        return float(false / max(self.sure[evidence.rings] - false, self._few))

    def _glints(self, evidence: Evidence) -> float:
        """Return the expected number of repeated glints per real finding with as bright a line."""
        real = self.dark * _BRIGHT_BY_CHANCE / (1 - _BRIGHT_BY_CHANCE) + _UNTOLD
        few = evidence.bright and evidence.rings < MANY_RINGS
        return max(self.bright - real, 0.0) / real if few else 0.0

    def _odds_by_photo(self, evidence: Evidence) -> float:
        """Return the likelihood of what the photo shows, without a defect over with one."""
        if evidence.photo is None:
            return 1.0
        by_chance = self._photo_by_chance(evidence)
        if evidence.photo:
            return by_chance / _PHOTO_OF_REAL
        return (1 - by_chance) / (1 - _PHOTO_OF_REAL)

    def _photo_by_chance(self, evidence: Evidence) -> float:
        """Return how often the photo stands out where there is no defect, from other single-ring findings."""
        others = self.photo_alone.copy()
        others[evidence.photo] -= evidence.rings < LEAST_RINGS
        false, seen = self._alone / max(self.sure[1], 1), others[True] + others[False]
        stands_out = max(others[True] - (1 - false) * seen * _PHOTO_OF_REAL, 0.0)
        chance = (_AS_USUAL * _PHOTO_BY_CHANCE + stands_out) / (_AS_USUAL + false * seen)
        return float(np.clip(chance, _PHOTO_BY_CHANCE, _PHOTO_OF_REAL))

    @property
    def _alone(self) -> float:
        """Number of single-ring findings, less as many real ones as two rings show."""
        return max(self.sure[1] - max(self.sure[2], self._few), 0.0)

    @property
    def _few(self) -> float:
        """Least number of real findings to expect for any number of rings."""
        return _LEAST_SHARE * (1.0 + sum(self.sure.values()))

    @property
    def _real(self) -> float:
        """Number of real findings to expect: the certain ones, plus one."""
        return 1.0 + sum(self.sure.values())


def chance_of_depth(defect: Defect, min_depth_mm: float) -> float:
    """Return the probability that a finding is deeper than half of the smallest depth to be reported."""
    return float(ndtr((abs(defect.depth_mm) - min_depth_mm / 2) / defect.depth_sigma_mm))


def is_depth_known(defect: Defect) -> bool:
    """Return whether zero is outside the 95 % interval of a depth."""
    return abs(defect.depth_mm) >= KNOWN * defect.depth_sigma_mm


def credibility_of(
    found: Sequence[Evidence], width_rad: Sequence[float], rings: int, tail: NoiseTail
) -> Credibility:
    """Return what to expect in a recording of ``rings`` rings, from the findings' evidence and widths."""
    certain = [e for e in found if tail.above(e.score) < _SURE]
    sure = Counter(max(e.rings, 1) for e in certain)
    bright = Counter(e.bright for e in certain if e.rings < MANY_RINGS)
    alone = [w for e, w in zip(found, width_rad, strict=True) if e.rings < LEAST_RINGS]
    # Two findings overlap if their distance is less than half the sum of their widths. Half of them have the
    # same sign.
    overlap = 2 * float(np.mean(alone)) / (2 * np.pi) / 2 if alone else 0.0
    overlap_chance = min(overlap * len(alone) / max(rings, 1), 1.0)
    photo_alone = Counter(e.photo for e in found if e.rings < LEAST_RINGS)
    return Credibility(tail, sure, overlap_chance, bright[True], bright[False], photo_alone)
