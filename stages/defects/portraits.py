"""What each kind of defect looks like, and how probable each kind is given a defect's features."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.artefacts.findings import DefectKind
from stages.defects.segment import Region

# Outlines are drawn on the wall averaged over 1 mm: half of that may be missing from or added to an edge.
_EDGE_MM = 0.5
# Smaller features are raised to this before their logarithm is taken.
_LEAST = 1e-3
# The sizes below are for a pipe of 4 inch. It is not known whether defects grow with the pipe: sizes are
# scaled with the square root of the radius, and half of the full scaling's logarithm is added to their
# spread.
_PIPE_RADIUS_MM = 50.8


@dataclass(frozen=True)
class Features:
    """Features of a defect's shape.

    Attributes
    ----------
    length_mm, width_mm : float
        Extent along the pipe and around it.
    slim_mm : float
        Smaller axis of the ellipse of the same second moments.
    elongation : float
        Larger axis over smaller.
    roughness, roughness_sigma : float
        RMS distance from a smooth (quartic) surface over depth, and its 1 σ.
    direction_rad : float
        Angle between the larger axis and the pipe's axis, in [0, π/2].
    """

    length_mm: float
    width_mm: float
    slim_mm: float
    elongation: float
    roughness: float
    roughness_sigma: float
    direction_rad: float


@dataclass(frozen=True)
class Likeness:
    """Lognormal distribution of a feature for a kind: its median, and exp(1 σ) as a factor.

    If ``open``, values above the median count like the median: a groove all round is longer than any gouge.
    """

    median: float
    factor: float
    open: bool = False

    def log_likelihood(self, value: float, sigma: float) -> float:
        """Return the log likelihood of a value, with a floor so that no single feature excludes a kind.

        ``sigma``, 1 σ of the value, widens the distribution; a value below its σ may be anything up to that
        σ.
        """
        width = np.hypot(np.log(self.factor), sigma / max(value, sigma, _LEAST))
        value = max(value, min(sigma, self.median), _LEAST)
        z = np.log((min(value, self.median) if self.open else value) / self.median) / width
        return float(np.log(np.exp(-0.5 * z * z) / width + 1e-4))

    def in_pipe(self, radius_mm: float) -> Likeness:
        """Return the distribution of a size in a pipe of another radius, mm."""
        half = 0.5 * np.log(radius_mm / _PIPE_RADIUS_MM)
        factor = np.exp(np.hypot(np.log(self.factor), half))
        return Likeness(self.median * float(np.exp(half)), float(factor), self.open)


@dataclass(frozen=True)
class Portrait:
    """The distributions of a kind's features; ``sign`` is +1 for kinds into the wall, −1 for inward ones."""

    kind: DefectKind
    sign: float
    slim_mm: Likeness
    elongation: Likeness
    roughness: Likeness


_PORTRAITS = (
    Portrait(DefectKind.PIT, 1.0, Likeness(5.0, 1.7), Likeness(1.3, 1.4), Likeness(0.08, 2.0)),
    Portrait(DefectKind.CORROSION, 1.0, Likeness(20.0, 1.8), Likeness(1.4, 1.4), Likeness(0.12, 2.0)),
    Portrait(DefectKind.GOUGE, 1.0, Likeness(2.5, 1.5), Likeness(7.0, 1.7, open=True), Likeness(0.12, 2.0)),
    Portrait(DefectKind.CRACK, 1.0, Likeness(1.0, 1.4), Likeness(14.0, 1.8, open=True), Likeness(0.15, 2.0)),
    Portrait(DefectKind.DENT, -1.0, Likeness(22.0, 1.6), Likeness(1.3, 1.3), Likeness(0.03, 1.7)),
    Portrait(DefectKind.DEPOSIT, -1.0, Likeness(11.0, 1.9), Likeness(1.6, 1.5), Likeness(0.12, 1.8)),
)


def probabilities(features: Features, region: Region, radius_mm: float) -> dict[DefectKind, float]:
    """Return the probability of every possible kind, likeliest first (naive Bayes, equal priors).

    ``radius_mm`` is the radius of the pipe.
    """
    if region.all_round:
        return {DefectKind.WELD if region.sign < 0 else DefectKind.GOUGE: 1.0}
    blunt = features.elongation * _EDGE_MM / features.slim_mm
    logs = {
        p.kind: p.slim_mm.in_pipe(radius_mm).log_likelihood(features.slim_mm, _EDGE_MM)
        + p.elongation.log_likelihood(features.elongation, blunt)
        + p.roughness.log_likelihood(features.roughness, features.roughness_sigma)
        for p in _PORTRAITS
        if p.sign == region.sign
    }
    top = max(logs.values())
    total = sum(np.exp(v - top) for v in logs.values())
    ranked = sorted(logs, key=lambda k: -logs[k])
    return {k: float(np.exp(logs[k] - top) / total) for k in ranked}
