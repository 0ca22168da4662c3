"""What kind a defect is, from a few features that can be named, as a probability."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.artefacts.findings import DefectKind
from stages.defects.depth import Depth
from stages.defects.grow import millimetre_mean
from stages.defects.relief import Relief
from stages.defects.segment import Region

_SMALL_MM2 = 60.0  # below this a quartic surface follows everything
_UNKNOWN_ROUGHNESS = 0.08


@dataclass(frozen=True)
class Features:
    """Shape of a defect.

    Attributes
    ----------
    length_mm, width_mm : float
        Extent along the pipe and around it.
    slim_mm : float
        Smaller axis of the ellipse of the same second moments.
    elongation : float
        Larger axis over smaller.
    roughness : float
        RMS from a smooth (quartic) surface over depth.
    direction_rad : float
        Of the larger axis from the pipe's axis, in [0, π/2].
    """

    length_mm: float
    width_mm: float
    slim_mm: float
    elongation: float
    roughness: float
    direction_rad: float


@dataclass(frozen=True)
class Likeness:
    """Median of a feature for a kind, and by which factor two of three examples stay around it."""

    median: float
    factor: float

    def log_likelihood(self, value: float) -> float:
        """Return that of a lognormal with a floor, so that no single feature rules a kind out."""
        z = np.log(max(value, 1e-3) / self.median) / np.log(self.factor)
        return float(np.log(np.exp(-0.5 * z * z) / np.log(self.factor) + 1e-4))


@dataclass(frozen=True)
class Portrait:
    """What a kind looks like; ``sign`` is +1 for kinds into the wall."""

    kind: DefectKind
    sign: float
    slim_mm: Likeness
    elongation: Likeness
    roughness: Likeness


_PORTRAITS = (
    Portrait(DefectKind.PIT, 1.0, Likeness(5.0, 1.7), Likeness(1.3, 1.4), Likeness(0.08, 2.0)),
    Portrait(DefectKind.CORROSION, 1.0, Likeness(20.0, 1.8), Likeness(1.4, 1.4), Likeness(0.12, 2.0)),
    Portrait(DefectKind.GOUGE, 1.0, Likeness(2.5, 1.5), Likeness(7.0, 1.7), Likeness(0.12, 2.0)),
    Portrait(DefectKind.CRACK, 1.0, Likeness(1.0, 1.4), Likeness(14.0, 1.8), Likeness(0.15, 2.0)),
    Portrait(DefectKind.DENT, -1.0, Likeness(22.0, 1.6), Likeness(1.3, 1.3), Likeness(0.03, 1.7)),
    Portrait(DefectKind.DEPOSIT, -1.0, Likeness(11.0, 1.9), Likeness(1.6, 1.5), Likeness(0.12, 1.8)),
)


def features_of(relief: Relief, region: Region, depth: Depth) -> Features:
    """Measure the shape of a region."""
    cell = relief.cell_mm
    length, width = region.mask.shape[0] * cell[0], region.mask.shape[1] * cell[1]
    i, j = np.nonzero(region.mask)
    place = np.stack([i * cell[0], j * cell[1]], -1)
    spread = np.cov(place.T) + np.diag(np.square(cell) / 12) if len(i) > 1 else np.diag(np.square(cell))
    values, vectors = np.linalg.eigh(spread)
    # what the 1 mm mean adds to a width
    slim = float(np.sqrt(max(16 * values[0] - 1.0, cell[1] ** 2)))
    elongation = float(np.sqrt(values[1] / max(values[0] - 1.0 / 16, values[0] / 4)))
    direction = float(np.arccos(min(1.0, abs(vectors[0, 1]))))
    return Features(length, width, slim, elongation, _roughness(relief, region, depth), direction)


def _roughness(relief: Relief, region: Region, depth: Depth) -> float:
    surface = region.cut(millimetre_mean(relief.local_mm, relief.cell_mm))
    i, j = np.nonzero(region.mask & np.isfinite(surface))
    if len(i) * relief.cell_mm[0] * relief.cell_mm[1] < _SMALL_MM2:
        return _UNKNOWN_ROUGHNESS
    x, y = (2 * (k - k.min()) / max(1, np.ptp(k)) - 1 for k in (i, j))
    basis = np.stack([x**m * y**n for m in range(5) for n in range(5 - m)], -1)
    values = surface[i, j]
    rest = values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0]
    noise = relief.typical.noise_mm / 2
    excess = max(0.0, float(np.mean(rest**2)) - noise**2)
    return float(np.sqrt(excess)) / max(abs(depth.depth_mm), 1e-6)


def probabilities(features: Features, region: Region) -> dict[DefectKind, float]:
    """Return the probability of every kind that is possible, likeliest first (naive Bayes, equal priors)."""
    if region.all_round:
        return {DefectKind.WELD: 1.0}
    logs = {
        p.kind: p.slim_mm.log_likelihood(features.slim_mm)
        + p.elongation.log_likelihood(features.elongation)
        + p.roughness.log_likelihood(features.roughness)
        for p in _PORTRAITS
        if p.sign == region.sign
    }
    top = max(logs.values())
    total = sum(np.exp(v - top) for v in logs.values())
    ranked = sorted(logs, key=lambda k: -logs[k])
    return {k: float(np.exp(logs[k] - top) / total) for k in ranked}
