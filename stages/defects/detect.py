"""Matched filters over scales and directions, with a threshold from a wished number of false alarms."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from stages.defects.relief import Relief

Float = NDArray[np.float64]
Mask = NDArray[np.bool_]

_ROUND_MM = (0.7, 1.4, 2.8, 5.6, 11.2)
_LONG_MM = ((4.0, 0.6), (8.0, 0.8))
_DIRECTIONS = 8


@dataclass(frozen=True)
class Template:
    """A Gaussian bump: 1 σ ``long_mm`` along ``direction_rad`` from the pipe's axis, ``short_mm`` across."""

    long_mm: float
    short_mm: float
    direction_rad: float = 0.0

    def kernel(self, cell_mm: tuple[float, float]) -> Float:
        """Return the template on the grid (odd, odd), peak 1."""
        reach = [int(np.ceil(2.5 * max(self.long_mm, 0.5 * c) / c)) for c in cell_mm]
        s, q = np.meshgrid(
            *(c * np.arange(-n, n + 1) for c, n in zip(cell_mm, reach, strict=True)), indexing="ij"
        )
        c, d = np.cos(self.direction_rad), np.sin(self.direction_rad)
        along, across = c * s + d * q, -d * s + c * q
        return np.asarray(np.exp(-0.5 * ((along / self.long_mm) ** 2 + (across / self.short_mm) ** 2)))


@dataclass(frozen=True)
class Detection:
    """Where something is there.

    Attributes
    ----------
    into, inward : (S, A) bool
        Cells that some template finds above the threshold, into the wall and inward.
    threshold : float
        In σ.
    small_sigma_mm : float
        Typical 1 σ of the height of a bump of 3 mm × 3 mm.
    """

    into: Mask
    inward: Mask
    threshold: float
    small_sigma_mm: float


def templates() -> tuple[Template, ...]:
    """Return round bumps over scales and thin ones over directions."""
    turns = [np.pi * k / _DIRECTIONS for k in range(_DIRECTIONS)]
    return (
        *(Template(m, m) for m in _ROUND_MM),
        *(Template(long, short, t) for long, short in _LONG_MM for t in turns),
    )


def detect(relief: Relief, false_alarms: float) -> Detection:
    """Find cells that stand out of noise and roughness."""
    bank = templates()
    threshold = _threshold(relief, bank, false_alarms)
    into = np.zeros(relief.local_mm.shape, bool)
    inward = into.copy()
    small = np.nan
    for template in bank:
        score, scale = _standardised(relief, template)
        into |= score > threshold
        inward |= score < -threshold
        if template == Template(_ROUND_MM[1], _ROUND_MM[1]):
            small = scale
    return Detection(into, inward, threshold, small)


def _threshold(relief: Relief, bank: tuple[Template, ...], false_alarms: float) -> float:
    """Return the level that Gaussian fields exceed ``false_alarms`` times in all.

    Expected Euler characteristic of the excursion set of a smooth Gaussian field (Adler & Taylor, Random
    Fields and Geometry, 2007, § 11.7); a field filtered with a Gaussian of 1 σ b has gradient variance
    1 / (2 b²).
    """
    area = float(relief.seen.sum()) * relief.cell_mm[0] * relief.cell_mm[1]
    density = sum(0.5 / (t.long_mm * t.short_mm) for t in bank)

    def excess(u: float) -> float:
        expected: float = 2 * area * density * u * math.exp(-0.5 * u * u) / (2 * math.pi) ** 1.5
        return expected - false_alarms

    return float(brentq(excess, 1.0, 40.0)) if excess(1.0) > 0 else 1.0


def _standardised(relief: Relief, template: Template) -> tuple[Float, float]:
    """Return the filter's response (S, A) in σ, and the typical 1 σ of the height it measures, mm.

    The response to white noise is known; noise and roughness are correlated, so that the field's own robust
    scatter sets the unit.
    """
    kernel = template.kernel(relief.cell_mm)
    weight = np.where(relief.seen, 1 / relief.sigma_mm**2, 0.0)
    signal = _filtered(weight * np.nan_to_num(relief.local_mm), kernel)
    power = _filtered(weight, kernel**2)
    enough = power > 0.4 * float(np.median(power[relief.seen])) if relief.seen.any() else power > 0
    response = np.where(enough, signal / np.sqrt(np.maximum(power, 1e-30)), 0.0)
    size = np.abs(response[enough])
    scale = max(1.4826 * float(np.median(size)), float(np.quantile(size, 0.9)) / 1.645, 1e-9)
    return response / scale, scale / float(np.sqrt(np.median(power[enough])))


def _filtered(image: Float, kernel: Float) -> Float:
    """Return the correlation with ``kernel``, periodic in azimuth, zero beyond the ends."""
    rows, columns = kernel.shape[0] // 2, kernel.shape[1] // 2
    turns = -(-columns // image.shape[1])
    wide = np.concatenate([image] * (2 * turns + 1), 1)
    first = turns * image.shape[1] - columns
    wide = wide[:, first : first + image.shape[1] + 2 * columns]
    padded = np.pad(wide, ((rows, rows), (0, 0)))
    out = cv2.filter2D(padded, cv2.CV_64F, kernel, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(out[rows : rows + image.shape[0], columns : columns + image.shape[1]])
