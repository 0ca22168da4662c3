"""Uncertainty of the wall from errors that rings share, and warnings of samples behind dirt on the window."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter

from pipeline.arrays import Float32, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.machine.scratch import Scratch
from pipeline.machine.stage import Context
from stages.accumulate.grid import MapGrid
from stages.accumulate.survey import RingsOnWall, some_at_a_time

# A bound on memory alone.
_ROWS_AT_ONCE = 512


def warn_of_left_out(rings: RingSamples, kept: RingSamples, context: Context) -> None:
    """Warn of samples of ``rings`` that are not among those ``kept`` thanks to the probe's roll."""
    lost = rings.valid & ~kept.valid
    if not lost.any():
        return
    context.report("ring samples behind dirt left out: the probe does not roll", int(lost.sum()), "samples")
    context.warn(
        f"behind dirt on the window, over {360 * lost.any(0).mean():.0f}° of the picture, the line "
        "is displaced equally in all rings. The probe does not roll enough to distinguish this from a groove "
        "or ridge along the pipe, so that nothing is measured there. What to do: clean the window, or record "
        "again with the probe rolled by 30° or more"
    )


def shared_on_wall(rings: RingsOnWall, grid: MapGrid, gap_mm: float, scratch: Scratch) -> Float32 | None:
    """Return the error (S, A), mm without sign, that all rings share; None if they share none.

    It is by how much the wall was moved behind dirt, or what is left of a line drawn to rows or columns, and
    is added to the map's σ without averaging. A cell takes the largest of the samples within a column and
    ``gap_mm`` along the pipe, because the map bridges as much.
    """
    if rings.rings.moved_px is None and rings.rings.shared_px is None:
        return None
    step = grid.distance_mm[1] - grid.distance_mm[0]
    shared = scratch.zeros((len(grid.distance_mm), len(grid.azimuth_rad)), np.float32)
    for rows in some_at_a_time(np.arange(len(rings.rings.sigma_px))):
        if not (shared_px := _shared_px(rings.rings, rows)).any():
            continue
        samples = rings.samples(rows)
        of = samples.valid & (shared_px != 0)
        per_px = samples.sigma_mm[of] / rings.rings.sigma_px[rows][of]
        size = shared_px[of] * per_px
        row = np.rint((samples.distance_mm[of] - grid.distance_mm[0]) / step).astype(np.int64)
        column = np.rint((samples.azimuth_rad[of] + np.pi) / (2 * np.pi) * shared.shape[1]).astype(np.int64)
        on_map = (row >= 0) & (row < len(shared))
        cell = row[on_map], column[on_map] % shared.shape[1]
        np.maximum.at(shared, cell, size[on_map].astype(np.float32))
    return _widened(shared, int(np.ceil(gap_mm / step)), scratch)


def _shared_px(rings: RingSamples, rows: Int) -> Float32:
    """Return the error (n, A), px without sign, that some rings share with all others."""
    shared = np.zeros(rings.sigma_px[rows].shape, np.float32)
    for part in (None if rings.moved_px is None else rings.moved_px[rows], rings.shared_px):
        if part is not None:
            shared = np.hypot(shared, part)
    return shared


def _widened(size_mm: Float32, rows: int, scratch: Scratch) -> Float32:
    """Return the largest sizes (S, A) within so many rows and one column, some rows at a time."""
    out = scratch.zeros(size_mm.shape, np.float32)
    for first in range(0, len(size_mm), _ROWS_AT_ONCE):
        above = min(rows, first)
        near = size_mm[first - above : first + _ROWS_AT_ONCE + rows]
        wide = maximum_filter(near, (2 * rows + 1, 3), mode=("constant", "wrap"))
        out[first : first + _ROWS_AT_ONCE] = wide[above : above + _ROWS_AT_ONCE]
    return out
