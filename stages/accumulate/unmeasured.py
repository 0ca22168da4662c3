"""Finds places inside the wall that the probe passed and no ring measured: a defect there is not found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_opening, find_objects, label

from pipeline.arrays import Float, Float32
from pipeline.artefacts.findings import clock_of_azimuth
from pipeline.artefacts.measured import RadiusMap
from pipeline.machine.stage import Context
from pipeline.pages import notation

# Number of places that are listed one by one, the largest first.
_NAMED = 4
# Rows that are examined together; a place that reaches from one part into the next counts as two.
_ROWS = 4096
# Rings are oblique and hidden sectors end anywhere: the inside begins where nine in ten columns have begun
# and ends before the last tenth has ended.
_BEGUN = 0.9
# Smallest share of the circle that a place between two rings covers: most of it (chosen), so that an adjacent
# hidden sector changes nothing.
_ALL_ROUND = 0.9
# Number of holes between rings, nearer to each other than the bridged length, from which rings are sparse: an
# object that hides a place leaves one, or two with an edge between (chosen).
_IN_A_ROW = 3
# Length that `configs/long.yaml` bridges, mm.
LONG_GAP_MM = 12.0


@dataclass(frozen=True)
class Unmeasured:
    """A place without radius: its middle on the wall, its extent along and around, mm, and its area, mm²."""

    distance_mm: float
    azimuth_rad: float
    length_mm: float
    width_mm: float
    area_mm2: float


@dataclass(frozen=True)
class SparseRings:
    """Stretches in which rings are farther apart than is bridged: their ends (N, 2), and the spacing, mm."""

    ends_mm: Float
    spacing_mm: float

    def lost(self, place: Unmeasured, pipe_radius_mm: float) -> bool:
        """Return whether a place lies there and reaches round the wall, like all wall between rings."""
        first, last = self.ends_mm.T
        beyond = np.maximum(first - place.distance_mm, place.distance_mm - last)
        all_round = place.width_mm > _ALL_ROUND * 2 * np.pi * pipe_radius_mm
        return bool(all_round and np.any(beyond < place.length_mm / 2))


def warn_of_unmeasured(
    radius_map: RadiusMap, pipe_radius_mm: float, gap_mm: float, ring_at_mm: Float, context: Context
) -> None:
    """Warn of unmeasured places inside the wall that are larger than the bridged gaps.

    If several rings (F,) in a row lie farther apart than that, the warning names this instead of the places.
    """
    places = unmeasured_places(radius_map, pipe_radius_mm, gap_mm)
    context.report("places inside the wall that are not measured", len(places), "")
    sparse = sparse_rings(ring_at_mm, gap_mm)
    between = [p for p in places if sparse.lost(p, pipe_radius_mm)]
    others = [p for p in places if not sparse.lost(p, pipe_radius_mm)]
    if between:
        _warn_of_sparse_rings(sparse, between, pipe_radius_mm, gap_mm, context)
    if others:
        _warn_of_places(others, context)


def sparse_rings(ring_at_mm: Float, gap_mm: float) -> SparseRings:
    """Return where several steps in a row from ring to ring (F,) along the wall are longer than ``gap_mm``.

    The rings' order in time does not matter: the probe may pass twice, or rest. NaN means that no ring was
    found.
    """
    at = np.sort(ring_at_mm[np.isfinite(ring_at_mm)])
    wide = np.diff(at) > gap_mm
    holes = np.stack([at[:-1][wide], at[1:][wide]], 1)
    apart = np.flatnonzero(holes[1:, 0] - holes[:-1, 1] > gap_mm) + 1
    rows = [row for row in np.split(holes, apart) if len(row) >= _IN_A_ROW]
    if not rows:
        return SparseRings(np.zeros((0, 2)), 0.0)
    ends = np.array([(row[0, 0], row[-1, 1]) for row in rows])
    return SparseRings(ends, float(np.median(np.diff(np.concatenate(rows), axis=1))))


def _warn_of_places(places: list[Unmeasured], context: Context) -> None:
    largest = sorted(places, key=lambda p: -p.area_mm2)[:_NAMED]
    where = ", ".join(
        f"at {p.distance_mm:.0f} mm, {notation.clock(float(clock_of_azimuth(p.azimuth_rad)))} "
        f"({p.length_mm:.0f} mm along, {p.width_mm:.0f} mm around)"
        for p in largest
    )
    area_mm2 = sum(p.area_mm2 for p in places)
    many = f"{len(places)} place{'s' * (len(places) > 1)} inside the wall, {area_mm2:.0f} mm² in all"
    context.warn(
        f"{many}, could not be measured{', the largest' * (len(places) > _NAMED)}: {where}. Defects there "
        "are not found. What to do: look at these places in the lit pictures; clean window and wall, drain "
        "the pipe, shade reflections, and record again"
    )


def _warn_of_sparse_rings(
    sparse: SparseRings, lost: list[Unmeasured], pipe_radius_mm: float, gap_mm: float, context: Context
) -> None:
    length_mm = float(np.diff(sparse.ends_mm, axis=1).sum())
    share = min(sum(p.area_mm2 for p in lost) / (2 * np.pi * pipe_radius_mm * length_mm), 1.0)
    coarser = (
        f", or run it again with --config long, which bridges {LONG_GAP_MM:g} mm and makes coarser maps"
        if sparse.spacing_mm <= LONG_GAP_MM
        else ""
    )
    context.warn(
        f"along {length_mm:.0f} mm of the pipe the rings lie {sparse.spacing_mm:.1f} mm apart, but at most "
        f"{gap_mm:g} mm are bridged: {100 * share:.0f} % of the wall there was passed and not "
        f"measured. Even large defects are missed there. What to do: pull the probe more slowly "
        f"there{coarser}"
    )


def unmeasured_places(radius_map: RadiusMap, pipe_radius_mm: float, gap_mm: float) -> list[Unmeasured]:
    """Return the places inside the wall without radius that hold a square of half of ``gap_mm``."""
    radius, s, azimuth = radius_map.radius_mm, radius_map.distance_mm, radius_map.azimuth_rad
    along, around = float(np.median(np.diff(s))), 2 * np.pi * pipe_radius_mm / len(azimuth)
    square = np.ones([max(round(gap_mm / 2 / cell), 1) for cell in (along, around)], bool)
    first, last, turn = _ends_of(radius)
    found = []
    for start in range(first, last, _ROWS):
        # Cut open at the column that is known best, so that no place is cut in two.
        hole = np.roll(~np.isfinite(radius[start : min(start + _ROWS, last)]), -turn, axis=1)
        numbers, _ = label(binary_opening(hole, square))
        for number, (rows, columns) in enumerate(find_objects(numbers), 1):
            middle = (turn + (columns.start + columns.stop) // 2) % len(azimuth)
            found.append(
                Unmeasured(
                    float(s[start + (rows.start + rows.stop) // 2]), float(azimuth[middle]),
                    (rows.stop - rows.start) * along, (columns.stop - columns.start) * around,
                    int(np.sum(numbers[rows, columns] == number)) * along * around,
                )
            )  # fmt: skip
    return found


def _ends_of(radius: Float32) -> tuple[int, int, int]:
    """Return the first and last row with wall all round, and the column that is known best."""
    rows, columns = radius.shape
    known = np.zeros(columns, np.int64)
    begun, ended = np.full(columns, rows), np.zeros(columns, np.int64)
    for start in range(0, rows, _ROWS):
        there = np.isfinite(radius[start : start + _ROWS])
        some = there.any(0)
        known += there.sum(0)
        begun = np.where(some, np.minimum(begun, start + there.argmax(0)), begun)
        ended = np.where(some, start + len(there) - there[::-1].argmax(0), ended)
    seen = known > 0
    if not seen.any():
        return 0, 0, 0
    first, last = np.quantile(begun[seen], _BEGUN), np.quantile(ended[seen], 1 - _BEGUN)
    return int(np.ceil(first)), int(last), int(np.argmax(known))
