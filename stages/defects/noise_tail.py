"""Estimate how many peaks of noise the search finds: counted below its threshold, extrapolated above it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter
from scipy.optimize import minimize_scalar

from pipeline.arrays import Bool, Float
from stages.defects.along import widened
from stages.defects.detect import Detection, scores, seen_mm2
from stages.defects.relief import WallRelief
from stages.defects.weight import weighed

# Two peaks closer than 4 cells, 2 mm, the reach of the smaller templates, count as one.
_BESIDE = 4
# As many peaks of Gaussian noise are added to those of the wall as a weak prior: they change a tail of fifty
# peaks by a tenth.
_AS_GAUSSIAN = 5
# Bounds of ln(scale): from a third of Gaussian noise to noise of which any peak may be as high as a defect.
_SCALES = (math.log(0.1), math.log(30.0))


@dataclass(frozen=True)
class Law:
    """The share of peaks above a height h: exp(−x / scale), x = (h^power − FROM^power) / power, h in σ."""

    power: int
    scale: float
    share: float = 1.0

    def excess(self, score: float) -> float:
        """Return x of a score in σ."""
        return max(score**self.power - NoiseTail.FROM**self.power, 0.0) / self.power

    def above(self, score: float) -> float:
        """Return the share of all peaks that exceed a score, times the law's own weight ``share``."""
        return self.share * math.exp(-self.excess(score) / self.scale)

    def density(self, score: float) -> float:
        """Return minus the derivative of `above` at a score, per σ."""
        return self.above(score) * score ** (self.power - 1) / self.scale


@dataclass(frozen=True)
class NoiseTail:
    """How many peaks of a given height the same search finds on this wall where there are no findings.

    Gaussian noise falls off as exp(−h² / 2 w²) with w = 1. Where its size varies from place to place, and
    where a codec carries errors over, high peaks are more frequent, up to exp(−h / λ). Below the threshold
    both laws look alike; each gets a weight by its likelihood there.

    Attributes
    ----------
    peaks : float
        Number of peaks above `FROM` σ on the whole wall.
    laws : tuple of Law
    """

    peaks: float
    laws: tuple[Law, ...]
    FROM = 3.0

    def above(self, score: float) -> float:
        """Return the expected number of noise peaks above a score, σ."""
        return self.peaks * sum(law.above(score) for law in self.laws)

    def density(self, score: float) -> float:
        """Return the expected number of noise peaks at a score, per σ."""
        return self.peaks * sum(law.density(score) for law in self.laws)


def noise_tail(relief: WallRelief, seeds: Detection, known: Bool) -> NoiseTail:
    """Return the noise of the search away from its findings: sampled rows without ``known`` cells (S, A)."""
    overlap = max(len(f.kernel) for f in seeds.filters) // 2
    heights, seen = [np.empty(0)], 0
    for rows in relief.sampled:
        part = widened(rows, relief.shape[0], overlap)
        wide = relief.rows(part.wide)
        free = np.where(known[part.wide], np.nan, wide.sigma_mm)
        wall = weighed(replace(wide, sigma_mm=free), overlap)
        score = np.max([np.abs(s) for s in scores(seeds.filters, wall)], axis=0)[part.inner]
        heights.append(_peaks(np.where(known[rows], 0.0, score)))
        seen += int(wall.seen[part.inner].sum())
    whole = seen_mm2(relief) / (seen * relief.cell_mm[0] * relief.cell_mm[1])
    return tail_of(np.concatenate(heights), seeds.threshold, whole)


def tail_of(peaks: Float, threshold: float, whole: float = 1.0) -> NoiseTail:
    """Return the noise tail from its peaks (n,), σ, in a part of a wall that is ``whole`` times as large.

    Peaks above the threshold became findings, whatever made them, so that the laws are fitted to those below
    as a sample truncated at the threshold. Treated as a complete sample, it gave too thin a tail and too much
    trust in findings that noise makes.
    """
    below = peaks[peaks <= threshold]
    fits = [_fitted_law(power, below, threshold) for power in (2, 1)]
    best = min(loss for _, loss in fits)
    weight = np.array([math.exp(best - loss) for _, loss in fits])
    laws = [replace(law, share=float(w)) for (law, _), w in zip(fits, weight / weight.sum(), strict=True)]
    missing = sum(law.above(threshold) for law in laws)
    return NoiseTail((len(below) + 0.5) / (1 - missing) * whole, tuple(laws))


def _fitted_law(power: int, below: Float, threshold: float) -> tuple[Law, float]:
    """Return a fitted law and the −ln of its likelihood for the peaks (n,) below the threshold."""
    unit = Law(power, 1.0)
    most = max(unit.excess(threshold), 1e-6)
    excess = np.array([unit.excess(float(h)) for h in below])
    # The mean of x over Gaussian noise: 1 for power 2, and 1 / FROM for power 1.
    usual = NoiseTail.FROM ** (power - 2)

    def loss(log_scale: float) -> float:
        scale = math.exp(log_scale)
        cut = len(excess) * math.log(-math.expm1(-most / scale))
        few = _AS_GAUSSIAN * (log_scale + usual / scale)
        return len(excess) * log_scale + float(excess.sum()) / scale + cut + few

    found = minimize_scalar(loss, bounds=_SCALES, method="bounded")
    # The likelihood is a density in h, not in x: dx / dh = h^(power − 1).
    slope = (power - 1) * float(np.log(below).sum())
    lost = _AS_GAUSSIAN * (float(found.x) + usual / math.exp(found.x))
    return Law(power, math.exp(float(found.x))), float(found.fun) - lost - slope


def _peaks(score: Float) -> Float:
    """Return the heights (n,) of the local maxima of a score (rows, A) above `NoiseTail.FROM`."""
    wide = np.concatenate([score[:, -_BESIDE:], score, score[:, :_BESIDE]], 1)
    top = maximum_filter(wide, 2 * _BESIDE + 1)[:, _BESIDE:-_BESIDE]
    return np.asarray(score[(score == top) & (score > NoiseTail.FROM)])
