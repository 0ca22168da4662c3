"""Whether ring samples that were moved back behind dirt on the window were displaced by dirt.

Dirt displaces the line at one azimuth of the image in all rings. A groove or seam along the pipe does the
same unless the probe rolls: then the wall behind the dirt changes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import label

from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.machine.scratch import Scratch
from pipeline.machine.stage import Context
from stages.accumulate.grid import MapGrid
from stages.accumulate.survey import RingsOnWall, some_at_a_time


def told_by_roll(rings: RingSamples, roll_rad: Float, context: Context) -> RingSamples:
    """Return the rings without samples that were moved back where the roll (F,) does not bear that out.

    They were moved by the median of what their rings depart by. What is on the wall, and as wide as the
    stretch of azimuths that was moved, is seen there while the probe rolls by that width: it makes the median
    only if half of the rings have rolls within as much.
    """
    if rings.moved_px is None:
        return rings
    moved = (rings.moved_px != 0) & rings.valid
    width = _widths(moved.any(0)) * 2 * np.pi / moved.shape[1]
    unsure = [a for a in np.flatnonzero(width) if _half_within(roll_rad[moved[:, a]]) <= width[a]]
    if not unsure:
        return rings
    lost = np.zeros_like(moved)
    lost[:, unsure] = moved[:, unsure]
    context.report("ring samples behind dirt left out: the probe does not roll", int(lost.sum()), "samples")
    context.warn(
        f"behind dirt on the window, over {360 * len(unsure) / moved.shape[1]:.0f}° of the picture, the line "
        "lies aside alike in all rings. The probe does not roll enough to tell this from a groove or ridge "
        "along the pipe, so nothing is measured there. What to do: clean the window, or record once more "
        "with the probe rolled by 30° or more"
    )
    return replace(rings, validity=np.where(lost, np.uint8(RingValidity.OUT_OF_VIEW), rings.validity))


def _widths(moved: Bool) -> Int:
    """Return of azimuths (A,) around the circle how many are in the same stretch of those moved, else 0."""
    start = int(np.argmin(moved))
    stretch = label(np.roll(moved, -start))[0]
    count = np.bincount(stretch)
    count[0] = 0
    return np.asarray(np.roll(count[stretch], start))


def _half_within(angle: Float) -> float:
    """Return the width, rad, of the shortest arc in which at least half of the angles (n,) lie."""
    ordered = np.sort(angle % (2 * np.pi))
    further = -(-len(ordered) // 2) - 1
    ends = np.concatenate([ordered, ordered + 2 * np.pi])[further : further + len(ordered)]
    return float((ends - ordered).min())


def shared_on_wall(rings: RingsOnWall, grid: MapGrid, gap_mm: float, scratch: Scratch) -> Float32 | None:
    """Return by how much the wall (S, A) was moved, mm without sign; None where nothing was.

    All rings err by it alike, so it counts to the σ of the map whole. A cell takes the largest of the samples
    within a column and ``gap_mm`` along the pipe, because the map bridges as much.
    """
    moved_px = rings.rings.moved_px
    if moved_px is None:
        return None
    shared = scratch.zeros((len(grid.distance_mm), len(grid.azimuth_rad)), np.float32)
    for rows in some_at_a_time(np.flatnonzero(moved_px.any(1))):
        samples = rings.samples(rows)
        of = samples.valid & (moved_px[rows] != 0)
        per_px = samples.sigma_mm[of] / rings.rings.sigma_px[rows][of]
        size = np.abs(moved_px[rows][of]) * per_px
        _draw(shared, samples.distance_mm[of], samples.azimuth_rad[of], size, grid, gap_mm)
    return shared


def _draw(
    shared: Float32, distance_mm: Float, azimuth_rad: Float, size_mm: Float, grid: MapGrid, gap_mm: float
) -> None:
    """Raise cells of ``shared`` (S, A) about each sample (n,) to its size."""
    first, step = grid.distance_mm[0], grid.distance_mm[1] - grid.distance_mm[0]
    row = np.rint((distance_mm - first) / step).astype(np.int64)
    column = np.rint((azimuth_rad + np.pi) / (2 * np.pi) * shared.shape[1]).astype(np.int64)
    reach = int(np.ceil(gap_mm / step))
    for along in range(-reach, reach + 1):
        for around in (-1, 0, 1):
            on = (row + along >= 0) & (row + along < len(shared))
            cell = row[on] + along, (column[on] + around) % shared.shape[1]
            np.maximum.at(shared, cell, size_mm[on].astype(np.float32))
