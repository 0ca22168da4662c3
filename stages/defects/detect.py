"""Detect with matched filters of several sizes, at a threshold set by the number of false alarms."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Float32
from pipeline.machine.scratch import Scratch
from pipeline.machine.stage import Progress
from pipeline.system.parallel import in_threads
from stages.defects.along import stretches, widened
from stages.defects.relief import WallRelief
from stages.defects.weight import Weighed, weighed

# 1 σ of round templates, for defects 3 to 48 mm wide: an octave apart, the next one loses at most 6 % of the
# signal over noise, 1 − 2 w t / (w² + t²) at t = √2 w.
ROUND_MM = (0.7, 1.4, 2.8, 5.6, 11.2)
# Quantiles that describe scores on a wall, taken from every seventh cell to save time.
_QUANTILES, _EVERY = (np.arange(20) + 0.5) / 20, 7
_LONG_MM = ((4.0, 0.6), (8.0, 0.8))
_DIRECTIONS = 8
_THREADS = 2
# The filters search where they see at least this part of what they usually see: a little less than at the
# pipe's ends.
_LEAST_SEEN = 0.4


@dataclass(frozen=True)
class Template:
    """A Gaussian bump: 1 σ ``long_mm`` along ``direction_rad`` from the pipe's axis, ``short_mm`` across."""

    long_mm: float
    short_mm: float
    direction_rad: float = 0.0

    def kernel(self, cell_mm: tuple[float, float]) -> Float:
        """Return the template on the map's grid (odd, odd), 1 at its peak."""
        reach = [int(np.ceil(2.5 * max(self.long_mm, 0.5 * c) / c)) for c in cell_mm]
        s, q = np.meshgrid(
            *(c * np.arange(-n, n + 1) for c, n in zip(cell_mm, reach, strict=True)), indexing="ij"
        )
        c, d = np.cos(self.direction_rad), np.sin(self.direction_rad)
        along, across = c * s + d * q, -d * s + c * q
        return np.asarray(np.exp(-0.5 * ((along / self.long_mm) ** 2 + (across / self.short_mm) ** 2)))


@dataclass(frozen=True)
class Filter:
    """A template scaled to a wall's noise.

    Attributes
    ----------
    kernel : (odd, odd)
    scale : float
        1 σ of its response to this wall's noise and roughness; it would be 1 for white noise.
    least_seen : float
        Where less was seen (the sum of squared kernel), the score is 0.
    height_sigma_mm : float
        Typical 1 σ of the height that it measures.
    noise, gain : (Q,)
        Quantiles of the score on this wall, in σ, and of how much more than usual a defect adds to it.
    """

    kernel: Float
    scale: float
    least_seen: float
    height_sigma_mm: float
    noise: Float
    gain: Float

    def standardised(self, wall: Weighed) -> Float:
        """Return the response (S, A) in σ."""
        response, _, seen = _response(wall, self.kernel)
        return self.score(response, seen)

    def score(self, response: Float, seen: Float) -> Float:
        """Return a response (S, A) in σ; 0 where too little of the wall was ``seen`` (S, A)."""
        return np.where(seen > self.least_seen, response / self.scale, 0.0)


@dataclass(frozen=True)
class Detection:
    """Cells in which the matched filters exceed the threshold.

    Attributes
    ----------
    into, inward : (S, A) bool
        Cells that some template finds above the threshold, into the wall and inward.
    threshold : float
        In σ.
    score : (S, A)
        Largest absolute response of all templates, σ.
    filters : tuple of Filter
    """

    into: Bool
    inward: Bool
    threshold: float
    score: Float32
    filters: tuple[Filter, ...]

    def height_sigma_mm(self, width_mm: float) -> float:
        """Return 1 σ of the height that the best filter measures of a round bump, 1 σ ``width_mm`` wide.

        A Gaussian template of width t measures 2 w² / (w² + t²) of the height of a bump of width w.
        """
        shares = (2 * width_mm**2 / (width_mm**2 + t**2) for t in ROUND_MM)
        sigmas = (f.height_sigma_mm for f in self.filters[: len(ROUND_MM)])
        return min(sigma / share for share, sigma in zip(shares, sigmas, strict=True))


def templates() -> tuple[Template, ...]:
    """Return round bumps of several sizes and elongated ones in several directions."""
    turns = [np.pi * k / _DIRECTIONS for k in range(_DIRECTIONS)]
    return (
        *(Template(m, m) for m in ROUND_MM),
        *(Template(long, short, t) for long, short in _LONG_MM for t in turns),
    )


def detect(relief: WallRelief, false_alarms: float, scratch: Scratch, progress: Progress) -> Detection:
    """Find cells that exceed noise and roughness; ``false_alarms`` are expected on the whole wall."""
    bank = templates()
    threshold = _threshold(seen_mm2(relief), bank, false_alarms)
    into, inward = (scratch.zeros(relief.shape, bool) for _ in range(2))
    best = scratch.zeros(relief.shape, np.float32)

    def note(rows: slice, score: Float) -> None:
        into[rows] |= score > threshold
        inward[rows] |= score < -threshold
        best[rows] = np.maximum(best[rows], np.abs(score))

    kernels, filters = [template.kernel(relief.cell_mm) for template in bank], []
    overlap = max(map(len, kernels)) // 2
    parts = stretches(relief.shape[0], overlap)
    fitted_to_all = [part.own for part in parts] == list(relief.sampled)
    for used, score in _fitted(relief, kernels, overlap, threshold):
        filters.append(used)
        if fitted_to_all:
            note(parts[0].own, score)
    for done, part in enumerate(parts, 1):
        if not fitted_to_all:
            near = weighed(relief.rows(part.wide), overlap)
            for score in scores(filters, near):
                note(part.own, score[part.inner])
        progress(done, 2 * len(parts))
    return Detection(into, inward, threshold, best, tuple(filters))


def scores(filters: Sequence[Filter], wall: Weighed) -> Iterator[Float]:
    """Yield the response (S, A) of every filter, in σ."""
    return in_threads(lambda used: used.standardised(wall), filters, _THREADS)


def seen_mm2(relief: WallRelief) -> float:
    """Return the measured area of the wall, mm²."""
    cells = sum(int(relief.rows(s.own).seen.sum()) for s in stretches(relief.shape[0]))
    return cells * relief.cell_mm[0] * relief.cell_mm[1]


def _threshold(area_mm2: float, bank: tuple[Template, ...], false_alarms: float) -> float:
    """Return the level, σ, that Gaussian noise exceeds ``false_alarms`` times on the whole wall.

    Expected Euler characteristic of the excursion set of a smooth Gaussian field (Adler & Taylor, Random
    Fields and Geometry, 2007, § 11.7); a field filtered with a Gaussian of 1 σ b has gradient variance 1 / (2
    b²).
    """
    density = sum(0.5 / (t.long_mm * t.short_mm) for t in bank)

    def excess(u: float) -> float:
        expected: float = 2 * area_mm2 * density * u * math.exp(-0.5 * u * u) / (2 * math.pi) ** 1.5
        return expected - false_alarms

    return float(brentq(excess, 1.0, 40.0)) if excess(1.0) > 0 else 1.0


def _fitted(
    relief: WallRelief, kernels: list[Float], overlap: int, threshold: float
) -> Iterator[tuple[Filter, Float]]:
    """Yield the filters for this wall, each with its response to the sampled rows, σ.

    A filter's response to white noise is known. This wall's noise and roughness are correlated, so that the
    robust scatter of the response itself is its unit. What exceeds the ``threshold`` by that unit is no noise
    but what is searched: standing water on a fifth of the wall hid all defects elsewhere.
    """
    parts = [widened(rows, relief.shape[0], overlap) for rows in relief.sampled]
    walls = [weighed(relief.rows(part.wide), overlap) for part in parts]
    measured = np.concatenate([w.seen[part.inner] for w, part in zip(walls, parts, strict=True)])

    def fitted(kernel: Float) -> tuple[Filter, Float]:
        found = [[f[part.inner] for f in _response(w, kernel)] for w, part in zip(walls, parts, strict=True)]
        response, power, seen = (np.concatenate(f) for f in zip(*found, strict=True))
        least = _LEAST_SEEN * float(np.median(seen[measured]))
        enough = seen > least
        size = np.abs(response)
        middle = robust_spread(size[enough])
        enough &= size <= threshold * middle
        scale = max(middle, float(np.quantile(size[enough], 0.9)) / 1.645, 1e-9)
        usual = float(np.median(power[enough]))
        noise = np.quantile(np.outer([-1, 1], response[enough][::_EVERY] / scale), _QUANTILES)
        gain = np.quantile(np.sqrt(power[enough][::_EVERY] / usual), _QUANTILES)
        used = Filter(kernel, scale, least, scale / float(np.sqrt(usual)), noise, gain)
        return used, used.score(response, seen)

    return in_threads(fitted, kernels, _THREADS)


def _response(wall: Weighed, kernel: Float) -> tuple[Float, Float, Float]:
    """Return the response (S, A), of unit variance in white noise, its power, and how much was seen.

    What was seen counts by area, not by its weight: where noise is larger, as in a dent of glossy steel, only
    what stands out of that noise is found, but it is searched.
    """
    power, seen = wall.filtered(kernel**2, wall.weight_spectrum, wall.seen_spectrum)
    (response,) = wall.filtered(kernel, wall.signal_spectrum)
    return response / np.sqrt(np.maximum(power, 1e-30)), power, seen
