"""The wall's 1 mm mean from the points themselves, without what the map's smoothing takes off a peak."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import PointCloud
from stages.defects.relief import Relief

_AROUND_MM = 0.45  # 1 σ of the kernel around the pipe: within a ring, samples lie close
_LEAST = 12


@dataclass(frozen=True)
class DeviationPoints:
    """The cloud's points against the pipe's smooth shape, ordered by cell of the map.

    Attributes
    ----------
    first : (S A + 1,) int
        Index of each cell's first point.
    row, column, deviation_mm : (M,)
        Fractional place in the map, and radius minus the smooth shape of ``Relief.all_mm``.
    spacing_mm : float
        Median distance between neighbouring rings.
    """

    first: Int
    row: Float
    column: Float
    deviation_mm: Float
    spacing_mm: float

    @property
    def kernel_mm(self) -> tuple[float, float]:
        """1 σ of the regression's kernel along and around: as narrow as the rings allow."""
        return max(0.4, 0.55 * self.spacing_mm), _AROUND_MM


def fine_surface(relief: Relief, points: DeviationPoints, wanted: Bool, coarse_mm: Float) -> Float:
    """Return the 1 mm mean (S, A) of ``relief.all_mm`` by local quadratic regression on the points.

    A local quadratic has no bias from a peak's curvature (Fan & Gijbels, Local polynomial modelling and its
    applications, 1996, § 3.2). Where too few points lie near, and where it is not ``wanted`` (S, A), the
    map's own mean ``coarse_mm`` (S, A) stands in.
    """
    out = np.full(relief.local_mm.shape, np.nan)
    place = (points.first, points.row, points.column, points.deviation_mm)
    _regress(*place, *relief.cell_mm, *points.kernel_mm, _LEAST, np.argwhere(wanted & relief.seen), out)
    return np.where(np.isfinite(out), out, coarse_mm)


def deviation_points(relief: Relief, points: PointCloud, spacing_mm: float) -> DeviationPoints:
    """Return points on the rows of a relief against the smooth shape."""
    rows, columns = relief.local_mm.shape
    step = float(relief.azimuth_rad[1] - relief.azimuth_rad[0])
    i = (points.distance_mm.astype(float) - relief.distance_mm[0]) / relief.cell_mm[0]
    j = np.mod((points.azimuth_rad.astype(float) - relief.azimuth_rad[0]) / step, columns)
    i, j, radius = (x[(i > -0.5) & (i < rows - 0.5)] for x in (i, j, points.radius_mm.astype(float)))
    cell = np.rint(i).astype(np.int64) * columns + np.rint(j).astype(np.int64) % columns
    order = np.argsort(cell, kind="stable")
    first = np.searchsorted(cell[order], np.arange(rows * columns + 1))
    deviation = radius - relief.shape_at(i, j)
    return DeviationPoints(first, i[order], j[order], deviation[order], spacing_mm)


@numba.njit(cache=True)
def _regress(first, i, j, deviation, cell_s, cell_a, along, around, least, wanted, out):  # type: ignore[no-untyped-def]
    rows, columns = out.shape
    reach_s = int(np.ceil(2.5 * along / cell_s))
    reach_a = min(int(np.ceil(2.5 * around / cell_a)), columns // 2 - 1)
    normal, right, basis = np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    for row, column in wanted:
        normal[:] = 0.0
        right[:] = 0.0
        count = 0
        before = after = False
        for r in range(max(0, row - reach_s), min(rows, row + reach_s + 1)):
            for c in range(column - reach_a, column + reach_a + 1):
                cell = r * columns + c % columns
                for k in range(first[cell], first[cell + 1]):
                    s = (i[k] - row) * cell_s
                    q = j[k] - column
                    q = (q - columns * np.rint(q / columns)) * cell_a
                    w = np.exp(-0.5 * ((s / along) ** 2 + (q / around) ** 2))
                    basis[0], basis[1], basis[2] = 1.0, s, q
                    basis[3], basis[4], basis[5] = s * s, s * q, q * q
                    for a in range(6):
                        right[a] += w * basis[a] * deviation[k]
                        for b in range(a, 6):
                            normal[a, b] += w * basis[a] * basis[b]
                    count += 1
                    before = before or s <= 0.0
                    after = after or s >= 0.0
        if count < least or not (before and after):
            continue
        weight = normal[0, 0]
        for a in range(6):
            normal[a, a] += 1e-4 * weight
        _solve(normal, right)
        # mean of x² over a millimetre about its middle is 1 / 12
        out[row, column] = right[0] + (right[3] + right[5]) / 12.0


@numba.njit(cache=True)
def _solve(matrix, right):  # type: ignore[no-untyped-def]
    """Solve equations in place by Cholesky's way; of the matrix, positive definite, the upper half counts."""
    n = len(right)
    for a in range(n):
        for k in range(a):
            share = matrix[k, a] / matrix[k, k]
            for b in range(a, n):
                matrix[a, b] -= share * matrix[k, b]
            right[a] -= share * right[k]
    for a in range(n - 1, -1, -1):
        for b in range(a + 1, n):
            right[a] -= matrix[a, b] * right[b]
        right[a] /= matrix[a, a]
