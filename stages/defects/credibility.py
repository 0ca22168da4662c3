"""The probability that a finding is real, from what the same recording shows where there is no defect.

Two things imitate defects, and the recording itself shows how frequent both are. Noise, compression and
texture that displaces the line make peaks of the wall: how their number falls with height is counted over
the wall without its findings (`stages.defects.noise_tail`). A glint or a splash is seen in a single ring.
Neighbouring rings show glints at the same place by chance only, and how often follows from the number and
the width of the findings that one ring alone shows. Where a codec repeats a glint in other pictures, several
rings show it. A glint is brighter than the line, a defect only by chance, so that the number of bright
findings tells the number of glints.

The probability is the ratio of the expected numbers of real and of false findings of that kind: of its height
against noise, and of its number of rings against chance (local false discovery rate: B. Efron, Large-Scale
Inference, 2010, ch. 5). The photo, taken under another light, raises it where it differs at that place, and
lowers it a little where it does not. Apart from that, a depth within its own σ of zero may be zero.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from pipeline.artefacts.findings import Defect
from stages.defects.corroborate import LEAST_RINGS, MANY_RINGS, Evidence
from stages.defects.noise_tail import NoiseTail

# Scores of real findings are taken to be log-uniform, from the least score to so many times it.
_SCORES = 20.0
# Least share of the real findings that is taken to be shown by each number of rings.
_LEAST_SHARE = 0.1
# A finding counts as surely real if noise is expected to have fewer peaks than this above its score.
_SURE = 0.05
# The photo stands out at a place by chance once in 41 times for darker and for brighter; it does at 6 of the
# 11 defects of open-1, 2 and 3: deposits and dents often have the wall's own colour.
_PHOTO_BY_CHANCE, _PHOTO_OF_REAL = 2 / 41, 6 / 11
# A tenth of all places count as bright, and so does a tenth of the defects, by chance. Beyond what follows
# from the dark ones, half a bright real finding is allowed for.
_BRIGHT_BY_CHANCE, _UNTOLD = 0.1, 0.5
# A corroborated finding counts from this probability on: it is more likely real than not.
COUNTED = 0.5
# Largest probability that is stated, as counted: of 319 painted findings with .95 and more, .975 were real
# [.951, .989] (`python -m tests.benchmarks.bench_painted_findings`).
MOST_SURE = 0.98
# A depth is known to be one from 1.96 σ: nothing lies outside its 95 % interval.
_KNOWN = 1.96


@dataclass(frozen=True)
class Credibility:
    """What is expected in one recording.

    Attributes
    ----------
    tail : NoiseTail
    sure : Counter
        How many findings that noise does not make are shown by 1 (or none), 2, 3, ... rings.
    meets : float
        Chance that a neighbouring ring shows, to the same side, something in the place of a given finding.
    bright, dark : int
        Of the sure ones of a few rings, those at which the line is bright, and the others.
    """

    tail: NoiseTail
    sure: Counter[int]
    meets: float
    bright: int
    dark: int

    def chance_against_clutter(self, evidence: Evidence) -> float:
        """Return the probability that a finding is neither noise nor a glint."""
        wrong = self._noise(evidence) + self._clutter(evidence)
        return 1 / (1 + wrong * _odds_by_photo(evidence.photo) + self._glints(evidence))

    def meetings(self, rings: int) -> float:
        """Return the expected number of places where so many neighbouring rings show glints by chance."""
        return float(self._alone * self.meets ** (rings - 1))

    def _noise(self, evidence: Evidence) -> float:
        """Return the expected number of noise peaks per real finding of such a score."""
        real = self._real / (max(evidence.score, 1.0) * np.log(_SCORES))
        return float(self.tail.density(evidence.score) / real)

    def _clutter(self, evidence: Evidence) -> float:
        """Return the expected number of glints that meet by chance per real finding of so many rings."""
        if evidence.rings < LEAST_RINGS:
            return float(self._alone / max(self.sure[1] - self._alone, self._few))
        false = self.meetings(evidence.rings)
        return float(false / max(self.sure[evidence.rings] - false, self._few))

    def _glints(self, evidence: Evidence) -> float:
        """Return the expected number of repeated glints per real finding at which the line is as bright."""
        real = self.dark * _BRIGHT_BY_CHANCE / (1 - _BRIGHT_BY_CHANCE) + _UNTOLD
        few = evidence.bright and evidence.rings < MANY_RINGS
        return max(self.bright - real, 0.0) / real if few else 0.0

    @property
    def _alone(self) -> float:
        """Findings of one ring, less as many real ones as two rings show."""
        return max(self.sure[1] - max(self.sure[2], self._few), 0.0)

    @property
    def _few(self) -> float:
        """Least number of real findings to expect in any number of rings."""
        return _LEAST_SHARE * (1.0 + sum(self.sure.values()))

    @property
    def _real(self) -> float:
        """Real findings to be expected: those that are sure, and one more."""
        return 1.0 + sum(self.sure.values())


def _odds_by_photo(stands_out: bool | None) -> float:
    """Return the likelihood ratio of such a photo without and with a defect."""
    if stands_out is None:
        return 1.0
    if stands_out:
        return _PHOTO_BY_CHANCE / _PHOTO_OF_REAL
    return (1 - _PHOTO_BY_CHANCE) / (1 - _PHOTO_OF_REAL)


def chance_of_depth(defect: Defect, min_depth_mm: float) -> float:
    """Return the probability that a finding is deeper than half of what is reported."""
    return float(ndtr((abs(defect.depth_mm) - min_depth_mm / 2) / defect.depth_sigma_mm))


def is_depth_known(defect: Defect) -> bool:
    """Return whether a depth differs from zero by more than its 95 % interval."""
    return abs(defect.depth_mm) >= _KNOWN * defect.depth_sigma_mm


def credibility_of(
    found: Sequence[Evidence], width_rad: Sequence[float], rings: int, tail: NoiseTail
) -> Credibility:
    """Return what to expect in a recording of so many rings, from its findings and their widths."""
    certain = [e for e in found if tail.above(e.score) < _SURE]
    sure = Counter(max(e.rings, 1) for e in certain)
    bright = Counter(e.bright for e in certain if e.rings < MANY_RINGS)
    alone = [w for e, w in zip(found, width_rad, strict=True) if e.rings < LEAST_RINGS]
    # Two findings meet if they overlap: each reaches half its width to either side. Half of them have the
    # same sign.
    overlap = 2 * float(np.mean(alone)) / (2 * np.pi) / 2 if alone else 0.0
    meets = min(overlap * len(alone) / max(rings, 1), 1.0)
    return Credibility(tail, sure, meets, bright[True], bright[False])
