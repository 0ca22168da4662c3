"""The probability that a finding is there: what the same recording shows where nothing is.

Two things imitate defects, and of both the recording itself tells how often. Noise, compression and texture
that draws the line aside make peaks of the wall: how their number falls off with height is counted over the
wall without its findings (`stages.defects.noise_tail`). A glint or a splash stands in one ring at a
place of its own; that neighbouring rings show some in one place is a meeting by chance, and its frequency
follows from how many findings one ring alone shows, and how wide they are. Where the codec hands it on to
other pictures, several rings show it; it is brighter than the line, as a defect is by chance only, and how
many are brighter tells how many are glints.

A finding is real or false in the ratio of the numbers that are expected of its kind: of its height against
the noise, and of so many rings against the meetings (local false discovery rate: B. Efron, Large-Scale
Inference, 2010, ch. 5). The photo, taken under another light, speaks for it where it stands out there, and a
little against it where it does not. Independent of that, a depth within its own σ of nothing may be nothing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from pipeline.artefacts.findings import Defect
from stages.defects.corroborate import LEAST_RINGS, Evidence
from stages.defects.noise_tail import NoiseTail

# Real findings are as frequent at any score up to so many times the least, on a logarithmic scale.
_SCORES = 20.0
# Of the real ones, at least this share is taken to be shown by any number of rings.
_LEAST_SHARE = 0.1
# Noise has fewer peaks than this above the score of a finding that is counted as surely real.
_SURE = 0.05
# The photo stands out at a place by chance once in 41 times for darker and for brighter; it does at 6 of the
# 11 defects of open-1, 2 and 3: deposits and dents often have the wall's own colour.
_PHOTO_BY_CHANCE, _PHOTO_OF_REAL = 2 / 41, 6 / 11
# A defect lies at one of the tenth of all places at which the line is brightest, and one more may.
_BRIGHT_BY_CHANCE, _UNTOLD = 0.1, 0.5
# A codec hands a glint on to a picture or two after it and before it: up to four or five rings show it.
_MANY_RINGS = 6
# From here on a finding that is corroborated counts as one: rather real than not.
COUNTED = 0.5
# No finding is told to be surer than was counted: of 319 painted ones with .95 and more, .975 were real
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
        """Return the probability that a finding is none of what imitates defects here."""
        wrong = self._noise(evidence) + self._clutter(evidence)
        return 1 / (1 + wrong * _odds_by_photo(evidence.photo) + self._glints(evidence))

    def meetings(self, rings: int) -> float:
        """Return how many places to expect in which so many neighbouring rings show clutter by chance."""
        return float(self._alone * self.meets ** (rings - 1))

    def _noise(self, evidence: Evidence) -> float:
        """Return how many peaks of noise there are to one real finding of such a score."""
        real = self._real / (max(evidence.score, 1.0) * np.log(_SCORES))
        return float(self.tail.density(evidence.score) / real)

    def _clutter(self, evidence: Evidence) -> float:
        """Return how much clutter there is to one real finding of so many rings."""
        if evidence.rings < LEAST_RINGS:
            return float(self._alone / max(self.sure[1] - self._alone, self._few))
        false = self.meetings(evidence.rings)
        return float(false / max(self.sure[evidence.rings] - false, self._few))

    def _glints(self, evidence: Evidence) -> float:
        """Return how many glints there are to one real finding at which the line is as bright."""
        real = self.dark * _BRIGHT_BY_CHANCE / (1 - _BRIGHT_BY_CHANCE) + _UNTOLD
        few = evidence.bright and evidence.rings < _MANY_RINGS
        return max(self.bright - real, 0.0) / real if few else 0.0

    @property
    def _alone(self) -> float:
        """What one ring shows beyond as many real findings as two rings show."""
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
    """Return how many times likelier such a photo is where nothing is than at a defect."""
    if stands_out is None:
        return 1.0
    if stands_out:
        return _PHOTO_BY_CHANCE / _PHOTO_OF_REAL
    return (1 - _PHOTO_BY_CHANCE) / (1 - _PHOTO_OF_REAL)


def chance_of_depth(defect: Defect, min_depth_mm: float) -> float:
    """Return the probability that a finding is deeper than half of what is reported."""
    return float(ndtr((abs(defect.depth_mm) - min_depth_mm / 2) / defect.depth_sigma_mm))


def is_depth_known(defect: Defect) -> bool:
    """Return whether a depth lies outside its own 95 % interval about nothing."""
    return abs(defect.depth_mm) >= _KNOWN * defect.depth_sigma_mm


def credibility_of(
    found: Sequence[Evidence], width_rad: Sequence[float], rings: int, tail: NoiseTail
) -> Credibility:
    """Return what to expect of so many rings with these findings, of each of which the width is known."""
    certain = [e for e in found if tail.above(e.score) < _SURE]
    sure = Counter(max(e.rings, 1) for e in certain)
    bright = Counter(e.bright for e in certain if e.rings < _MANY_RINGS)
    alone = [w for e, w in zip(found, width_rad, strict=True) if e.rings < LEAST_RINGS]
    # Two meet where they overlap, each reaching half of its width to either side; half are on the same side.
    overlap = 2 * float(np.mean(alone)) / (2 * np.pi) / 2 if alone else 0.0
    meets = min(overlap * len(alone) / max(rings, 1), 1.0)
    return Credibility(tail, sure, meets, bright[True], bright[False])
