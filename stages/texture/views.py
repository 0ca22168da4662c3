"""Lit frames with their poses, and the choice of the best ones for each tile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.axis import frames_at, to_pipe
from pipeline.geometry.rigid import inverse
from pipeline.instrument.laser import LaserSheet
from pipeline.recording.base import Illumination, Recording
from stages.texture.grid import FlatGrid
from stages.texture.surface import WallSurface

# Shares whose sum is a whole number must not stay below it by rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class LitViews:
    """Lit frames that have a pose.

    Attributes
    ----------
    frame : (V,) int
    laser_on : (V,) bool
    T_cp : (V, 4, 4)
        Pipe to camera.
    distance_mm : (V,)
        Distance of the camera along the axis.
    lean : (V,)
        Sine of the angle between optical axis and pipe axis.
    """

    frame: Int
    laser_on: Bool
    T_cp: Float
    distance_mm: Float
    lean: Float


@dataclass(frozen=True)
class TileViews:
    """Views (indices into `LitViews`) to blend into one tile, seen up to ``reach_mm`` from the sheet."""

    views: Int
    reach_mm: float


def lit_views(recording: Recording, trajectory: Trajectory) -> LitViews:
    """Return the lit frames for which the trajectory holds a pose."""
    lit = recording.frames.of(Illumination.LED, Illumination.BOTH)
    frame, pose, _ = np.intersect1d(trajectory.frame, lit, return_indices=True)
    laser_on = np.isin(frame, recording.frames.of(Illumination.BOTH))
    T_pc = trajectory.T_pc[pose]
    distance, _, _ = to_pipe(trajectory.axis, T_pc[:, :3, 3])
    tangent = frames_at(trajectory.axis, distance)[1][:, :, 2]
    lean = np.linalg.norm(np.cross(T_pc[:, :3, 2], tangent), axis=-1)
    return LitViews(frame, laser_on, inverse(T_pc), distance, lean)


def sheet_distance_mm(laser: LaserSheet, xyz_c: Float) -> Float:
    """Return the distance (...), mm, of points (..., 3) in C from the laser sheet along the optical axis."""
    psi = np.arctan2(xyz_c[..., 1], xyz_c[..., 0])
    rho = np.hypot(xyz_c[..., 0], xyz_c[..., 1])
    return np.asarray(xyz_c[..., 2] - laser.height(psi) - rho * laser.slope(psi))


def seen_by(
    grid: FlatGrid, surface: WallSurface, views: LitViews, laser: LaserSheet, reach_mm: float
) -> list[TileViews]:
    """Return the views of each tile: those in which it lies near the laser sheet.

    Near the sheet a picture point and the wall point that the ring measured coincide, whatever the errors of
    camera and motion. If views are rare, the reach is widened until three of them show every row. If the
    probe passes a tile several times, the pass with the most views is used, so that the tile need not be
    stored until the probe returns.
    """
    half_tile, lean_mm = grid.tile_rows * grid.mm_per_px / 2, views.lean * surface.mean_radius_mm
    row = _InOrder(views.distance_mm)
    return [
        _tile_views(row, grid.centre_mm(tile) - laser.baseline_mm, half_tile, lean_mm, reach_mm)
        for tile in grid.tiles()
    ]


def thinned(plan: Sequence[TileViews], most: int) -> list[TileViews]:
    """Return the plan with at most ``most`` views a tile, spread evenly."""
    return [replace(t, views=_evenly(t.views, most)) for t in plan]


def shared(plan: Sequence[TileViews], most: int) -> list[TileViews]:
    """Return the plan with at most ``most`` views a tile; neighbouring tiles keep the same views.

    Frames that no tile keeps need not be read. But the views of a tile are spread less evenly than by
    `thinned`: if the pictures' noise requires all available views, the photo would be displaced more
    (open-3-field: 0.155 instead of 0.085 mm in the worst of twenty patches).
    """
    rate = np.zeros(1 + max((int(t.views[-1]) for t in plan if len(t.views)), default=0))
    for tile in plan:
        rate[tile.views] = np.maximum(rate[tile.views], min(most / max(len(tile.views), 1), 1.0))
    kept = np.diff(np.floor(np.cumsum(rate) + _ROUNDING), prepend=0.0) > 0
    return thinned([replace(t, views=t.views[kept[t.views]]) for t in plan], most)


class _InOrder:
    """Views in the order of distance, so that those near a place are found without a search of all."""

    def __init__(self, distance_mm: Float) -> None:
        self._order = np.argsort(distance_mm, kind="stable")
        self._sorted = distance_mm[self._order]
        self.distance_mm = distance_mm

    def third_nearest_mm(self, place_mm: float) -> float | None:
        """Return the distance of the third nearest view, or the farthest of fewer; None without any."""
        at = int(np.searchsorted(self._sorted, place_mm))
        near = np.sort(np.abs(self._sorted[max(at - 3, 0) : at + 3] - place_mm))[:3]
        return float(near[-1]) if len(near) else None

    def within(self, place_mm: float, reach_mm: float) -> Int:
        """Return the views within ``reach_mm`` of a place, in the order of frames.

        One view beyond the reach may be among them.
        """
        ends = np.searchsorted(self._sorted, [place_mm - reach_mm, place_mm + reach_mm])
        return np.sort(self._order[ends[0] : ends[1] + 1])


def _tile_views(
    row: _InOrder, place_mm: float, half_tile: float, lean_mm: Float, reach_mm: float
) -> TileViews:
    nearest = row.third_nearest_mm(place_mm)
    reach = max(reach_mm, nearest + half_tile) if nearest is not None else reach_mm
    near = row.within(place_mm, reach + half_tile + float(lean_mm.max(initial=0.0)))
    candidates = near[np.abs(place_mm - row.distance_mm[near]) < reach + half_tile + lean_mm[near]]
    return TileViews(_longest_pass(candidates), reach)


def _evenly(views: Int, most: int) -> Int:
    """Return at most ``most`` views (n,), spread evenly."""
    places = np.round(np.linspace(0, len(views) - 1, min(most, len(views)))).astype(int)
    return np.asarray(views[np.unique(places)])


def _longest_pass(candidates: Int) -> Int:
    """Return the longest stretch of consecutive views."""
    passes = np.split(candidates, np.flatnonzero(np.diff(candidates) > 1) + 1)
    return max(passes, key=len)
