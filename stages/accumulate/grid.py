"""Interpolates rings to the regular radius map: bins in azimuth, local linear regression in distance.

J. Fan, I. Gijbels, "Local polynomial modelling and its applications", 1996: a local line has no bias from the
rings' uneven spacing, and its variance follows from its weights.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial

import numba
import numpy as np

from pipeline.adjustment.local_spread import local_spread, running_median
from pipeline.adjustment.robust import robust_spread
from pipeline.adjustment.shared_light import HeldOver
from pipeline.arrays import Float, Float32, Int
from pipeline.system.parallel import in_threads
from stages.accumulate.survey import RingSurvey, WallSamples

# Columns that a thread processes at a time, and threads: see `pipeline.system.parallel`.
_BLOCK, _THREADS = 64, 2
# Least 1 σ of the kernel in ring spacings: narrower ones leave rows between rings with one ring. Debt:
# data/debts.md.
WIDTH_IN_RINGS = 0.4
# Share of a ring from which its distance belongs to the map: half and twice as much change nothing on open-1
# and open-3, whose rings end within a cell.
_SEEN_SHARE = 0.1
_SOME_COLUMNS = 4  # for the scatter of distant rings: every fourth column, 2° apart, errs by 1 % of it


@dataclass(frozen=True)
class MapGrid:
    """Rows ``distance_mm`` (S,) and columns ``azimuth_rad`` (A,) of the radius map."""

    distance_mm: Float
    azimuth_rad: Float

    def rows(self, first: int, last: int) -> MapGrid:
        """Return some of its rows."""
        return MapGrid(self.distance_mm[first:last], self.azimuth_rad)


@dataclass(frozen=True)
class RingColumns:
    """Rings averaged in the map's azimuth columns, sorted by distance within each column.

    Attributes
    ----------
    distance_mm, radius_mm, variance, misalignment_mm : (A, F)
        Means of each ring in each column; distance is NaN where the ring was not seen.
    count : (A, F) int
        Number of averaged samples.
    """

    distance_mm: Float
    radius_mm: Float
    variance: Float
    misalignment_mm: Float
    count: Int

    def every_other(self, first: int) -> RingColumns:
        """Return every second ring of each column."""
        part = (slice(None), slice(first, None, 2))
        return RingColumns(
            self.distance_mm[part].copy(), self.radius_mm[part].copy(), self.variance[part].copy(),
            self.misalignment_mm[part].copy(), self.count[part].copy(),
        )  # fmt: skip


def map_grid(survey: RingSurvey, step_mm: float, azimuths: int) -> MapGrid:
    """Return the grid that covers the distances at which at least a tenth of a ring was seen."""
    some = survey.seen > _SEEN_SHARE
    if not some.any():
        some = survey.count > 0
    middle = survey.middle_mm[some]
    first, last = np.ceil(middle.min() / step_mm), np.floor(middle.max() / step_mm)
    distance = step_mm * np.arange(first, max(last, first + 1) + 1, dtype=float)
    azimuth = 2 * np.pi / azimuths * np.arange(azimuths) - np.pi
    return MapGrid(distance.astype(np.float64), azimuth.astype(np.float64))


def rings_on_columns(parts: Iterable[WallSamples], rings: int, grid: MapGrid) -> RingColumns:
    """Average each ring's samples in every column's bin, with weights from their noise.

    ``parts`` are the samples of ``rings`` rings, some at a time.
    """
    columns = len(grid.azimuth_rad)
    sums = np.zeros((4, columns, rings))
    count = np.zeros((columns, rings), np.int64)
    done = 0
    for samples in parts:
        mine = slice(done, done + len(samples.valid))
        turn = np.nan_to_num(samples.azimuth_rad + np.pi) / (2 * np.pi)
        bin_of = np.rint(turn * columns).astype(np.int64) % columns
        valid, shape = samples.valid, (columns, len(samples.valid))
        cell = (bin_of * shape[1] + np.arange(shape[1])[:, None])[valid]
        weight = 1 / (samples.sigma_mm[valid] ** 2 + 1e-12)
        measured = (np.ones(valid.shape), samples.distance_mm, samples.radius_mm, samples.misalignment_mm)
        for out, value in zip(sums, measured, strict=True):
            out[:, mine] = np.bincount(cell, weight * value[valid], columns * shape[1]).reshape(shape)
        count[:, mine] = np.bincount(cell, minlength=columns * shape[1]).reshape(shape)
        done = mine.stop
    weight = np.where(count > 0, sums[0], np.nan)
    distance, radius, misalignment = (part / weight for part in sums[1:])
    order = np.argsort(distance, axis=1, kind="stable")
    sort = partial(np.take_along_axis, indices=order, axis=1)
    return RingColumns(sort(distance), sort(radius), sort(1 / weight), sort(misalignment), sort(count))


def kernel_mm(columns: RingColumns, smoothing_mm: float) -> float:
    """Return 1 σ of the kernel along the pipe, mm: as asked, or wider where rings are sparse."""
    return max(smoothing_mm, WIDTH_IN_RINGS * _usual_spacing(columns))


def gridded(
    columns: RingColumns, grid: MapGrid, width: float, largest_gap_mm: float, held: HeldOver
) -> tuple[Float32, Float32, Int, Float32]:
    """Return radius, its random 1 σ, sample count and misalignment error, each (S, A); NaN where unseen.

    The kernel has 1 σ ``width``, mm. The noise of single samples is not the whole error: speckle is
    correlated between neighbouring azimuths, and each ring has a pose error. The scatter of rings is
    therefore measured from two maps of every other ring. If a codec carried light over from ring to ring
    (``held``), it is measured from rings that share none.
    """
    radius, sigma, count, misalignment = _map_of(columns, grid, width, largest_gap_mm)
    halves = [
        _map_of(columns.every_other(first), grid, 2 * width, 2 * largest_gap_mm)[:2] for first in (0, 1)
    ]
    sigma = sigma * _excess(halves, grid)
    rough = sigma * _roughness(radius, sigma, grid)
    shared = _shared(columns, held, width / max(_usual_spacing(columns), 1e-9))
    return radius, _with_shared(rough, sigma, shared), count, misalignment


def _map_of(
    columns: RingColumns, grid: MapGrid, width: float, gap: float
) -> tuple[Float32, Float32, Int, Float32]:
    shape = (len(grid.distance_mm), len(grid.azimuth_rad))
    radius, sigma, misalignment = (np.full(shape, np.nan, np.float32) for _ in range(3))
    count = np.zeros(shape, np.int64)

    def fill(part: slice) -> None:
        _regress(
            columns.distance_mm[part], columns.radius_mm[part], columns.variance[part],
            columns.misalignment_mm[part], columns.count[part], grid.distance_mm, width, gap,
            radius[:, part], sigma[:, part], count[:, part], misalignment[:, part],
        )  # fmt: skip

    blocks = (slice(a, min(a + _BLOCK, shape[1])) for a in range(0, shape[1], _BLOCK))
    for _ in in_threads(fill, blocks, _THREADS):
        pass
    return radius, sigma, count, misalignment


def _excess(halves: list[tuple[Float32, Float32]], grid: MapGrid) -> Float32:
    """Return the ratio (S, A) of the difference of two independent maps to its stated σ; at least 1."""
    (a, sigma_a), (b, sigma_b) = halves
    return _spread_by_place(np.abs(a - b) / np.hypot(sigma_a, sigma_b), grid)


def _with_shared(rough: Float32, sigma: Float32, shared: float) -> Float32:
    """Return σ (S, A) with the error that rings share, everywhere the same: flanks scatter anyway."""
    if shared <= 1.0 or not (known := np.isfinite(sigma)).any():
        return rough
    lacking = (shared * float(np.median(sigma[known]))) ** 2 - float(np.median(rough[known])) ** 2
    return np.asarray(np.sqrt(rough**2 + max(lacking, 0.0)), np.float32)


def _shared(columns: RingColumns, held: HeldOver, width: float) -> float:
    """Return the true σ over that from neighbouring rings, for a mean of ``width`` rings; at least 1.

    Rings are compared at a distance at which no light is carried over; the wall's own shape over that length,
    too, counts as error. What rings share at any distance, fixed to the image, follows from their likeness.
    """
    if not held.alike or columns.distance_mm.shape[1] < 2 * held.rings + 1:
        return 1.0
    near, far = (max(_scatter(columns, apart), 1.0) for apart in (1, held.rings))
    return max(far / near, 1.0) * held.unseen * held.gain_in_mean(width)


def _scatter(columns: RingColumns, apart: int) -> float:
    """Return the robust spread of rings around the line through those ``apart`` on both sides, over its σ."""
    some = slice(None, None, _SOME_COLUMNS)
    at, radius, variance = (v[some] for v in (columns.distance_mm, columns.radius_mm, columns.variance))
    before, middle, after = slice(None, -2 * apart), slice(apart, -apart), slice(2 * apart, None)
    share = (at[:, middle] - at[:, before]) / np.maximum(at[:, after] - at[:, before], 1e-9)
    error = radius[:, middle] - (1 - share) * radius[:, before] - share * radius[:, after]
    usual = variance[:, middle] + (1 - share) ** 2 * variance[:, before] + share**2 * variance[:, after]
    ratio = error / np.sqrt(usual)
    return robust_spread(ratio[np.isfinite(ratio)]) if np.isfinite(ratio).any() else 1.0


def _roughness(radius: Float32, sigma: Float32, grid: MapGrid) -> Float32:
    """Return the ratio (S, A) of the map's roughness from cell to cell to its stated σ; at least 1.

    Reflectance under the line displaces neighbouring rings equally, so that comparing rings does not show it.
    Relief finer than a few cells cannot be distinguished from it and counts as noise.
    """
    filled = np.where(np.isfinite(radius), radius, np.nanmedian(radius))
    fine = radius - running_median(filled)
    return _spread_by_place(np.abs(fine) / sigma, grid)


def _spread_by_place(ratio: Float | Float32, grid: MapGrid) -> Float32:
    """Return the robust spread (S, A) of ratios around each cell, at least 1.

    Grease on a part of the window, or a codec's blocks, make the line worse at some azimuths and for some
    time: with one spread for the whole wall, σ would be too small there, and noise would become findings.
    """
    spread = local_spread(lambda rows: ratio[rows], grid.distance_mm, ratio.shape[1])
    return np.maximum(spread.at(grid.distance_mm), 1.0).astype(np.float32)


def _usual_spacing(columns: RingColumns) -> float:
    """Return the median distance between neighbouring rings, mm."""
    step = np.diff(columns.distance_mm[:: max(len(columns.distance_mm) // 16, 1)], axis=1)
    step = step[np.isfinite(step)]
    return float(np.median(step)) if step.size else 0.0


@numba.njit(cache=True, nogil=True)
def _regress(  # type: ignore[no-untyped-def]
    distance, radius, variance, misalignment, count, rows, width, gap,
    out_radius, out_sigma, out_count, out_misalignment,
):  # fmt: skip
    reach = max(3.0 * width, gap)
    d, kernel = np.empty(distance.shape[1]), np.empty(distance.shape[1])
    for a in range(distance.shape[0]):
        known, first, last = 0, 0, 0
        for x in distance[a]:
            known += np.isfinite(x)
        for i in range(len(rows)):
            while first < known and distance[a, first] < rows[i] - reach:
                first += 1
            while last < known and distance[a, last] <= rows[i] + reach:
                last += 1
            total, carried = 0.0, 0.0
            for k in range(first, last):
                d[k] = distance[a, k] - rows[i]
                kernel[k] = np.exp(-0.5 * (d[k] / width) ** 2)
                total += kernel[k] / variance[a, k]
                carried += kernel[k] / variance[a, k] * misalignment[a, k]
            if total <= 0 or not _near_rings(d[first:last], width, gap):
                continue
            out_radius[i, a], out_sigma[i, a] = _line_at(
                d[first:last], kernel[first:last], radius[a, first:last], variance[a, first:last], width
            )
            for k in range(first, last):
                out_count[i, a] += count[a, k] if abs(d[k]) <= 3.0 * width else 0  # beyond, a ring weighs 1 %
            out_misalignment[i, a] = carried / total


@numba.njit(cache=True, nogil=True)
def _near_rings(d, width, gap):  # type: ignore[no-untyped-def]
    """Return whether rings at ascending signed distances ``d`` are near: on both sides, or one very near."""
    before, after = np.inf, np.inf
    for x in d:
        if x <= 0:
            before = -x
        elif after == np.inf:
            after = x
    return before + after <= gap or min(before, after) <= 0.5 * width


@numba.njit(cache=True, nogil=True)
def _line_at(d, kernel, radius, variance, width):  # type: ignore[no-untyped-def]
    """Return value at d = 0 of the weighted line and its 1 σ, from the scatter around it if larger."""
    m0, m1, m2, b0, b1, sum1, sum2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(len(d)):
        w = kernel[k] / variance[k]
        m0, m1, m2 = m0 + w, m1 + w * d[k], m2 + w * d[k] * d[k]
        b0, b1 = b0 + w * radius[k], b1 + w * d[k] * radius[k]
        sum1, sum2 = sum1 + kernel[k], sum2 + kernel[k] * kernel[k]
    determinant = m0 * m2 - m1 * m1
    sloped = determinant > 1e-6 * m0 * m0 * width * width
    value = (m2 * b0 - m1 * b1) / determinant if sloped else b0 / m0
    slope = (m0 * b1 - m1 * b0) / determinant if sloped else 0.0
    misfit, spread = 0.0, 0.0
    for k in range(len(d)):
        w = kernel[k] / variance[k]
        share = w * (m2 - m1 * d[k]) / determinant if sloped else w / m0
        misfit += w * (radius[k] - value - slope * d[k]) ** 2
        spread += share * share * variance[k]
    freedom = sum1 - 2.0 * sum2 / max(sum1, 1e-12)
    excess = misfit / freedom if freedom > 0.2 else 1.0  # a choice: the scatter of fewer is unreliable
    return value, np.sqrt(spread * max(1.0, excess))
