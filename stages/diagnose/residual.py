"""Where rings lie against where other measurements have them: one recording under one instrument."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Bool, Float, Int

AZIMUTHS = 72
WALL_STEP_MM = 2.0


@dataclass(frozen=True)
class RingResidual:
    """By how much ring bins lie farther out than texture, poses and the pipe have them.

    Attributes
    ----------
    source : str
        ``field`` or ``gauge``.
    frame : (M,) int
        Frame numbers.
    azimuth_c_rad, azimuth_p_rad, distance_mm : (M,)
        Azimuth in C; azimuth and distance of the wall point in P.
    uv : (M, 2)
    residual_mm, residual_px : (M,)
        As radius, and as outward shift in the image.
    usable : (M,) bool
        False where the adjustment found an outlier.
    """

    source: str
    frame: Int
    azimuth_c_rad: Float
    azimuth_p_rad: Float
    distance_mm: Float
    uv: Float
    residual_mm: Float
    residual_px: Float
    usable: Bool

    @property
    def rms_px(self) -> float:
        """R.m.s. of what is usable, px."""
        return float(np.sqrt(np.mean(self.residual_px[self.usable] ** 2)))

    def over_frames(self, frames: Int) -> Float:
        """Return the mean residual, mm, over (F, `AZIMUTHS`) frames and azimuth in C; NaN where none is."""
        inside = self.usable & np.isin(self.frame, frames)
        row = np.searchsorted(frames, self.frame[inside])
        column = _column(self.azimuth_c_rad[inside])
        return _mean(row, column, self.residual_mm[inside], len(frames))

    def over_wall(self, distance_mm: Float) -> Float:
        """Return the mean residual, mm, over (S, `AZIMUTHS`) distance and azimuth in P; NaN where none is."""
        row = np.round((self.distance_mm - distance_mm[0]) / WALL_STEP_MM).astype(np.int64)
        inside = self.usable & (row >= 0) & (row < len(distance_mm))
        column = _column(self.azimuth_p_rad[inside])
        return _mean(row[inside], column, self.residual_mm[inside], len(distance_mm))


def azimuths_rad() -> Float:
    """Return the middles (`AZIMUTHS`,) of the columns."""
    return np.asarray((np.arange(AZIMUTHS) + 0.5) / AZIMUTHS * 2 * np.pi - np.pi)


def wall_distances_mm(residual: RingResidual) -> Float:
    """Return the rows' distances (S,)."""
    low, high = float(residual.distance_mm.min()), float(residual.distance_mm.max())
    return np.arange(np.floor(low), high + WALL_STEP_MM, WALL_STEP_MM)


def _column(azimuth_rad: Float) -> Int:
    return np.asarray(np.floor((azimuth_rad + np.pi) / (2 * np.pi) * AZIMUTHS).astype(np.int64) % AZIMUTHS)


def _mean(row: Int, column: Int, values: Float, rows: int) -> Float:
    total, count = np.zeros((rows, AZIMUTHS)), np.zeros((rows, AZIMUTHS))
    np.add.at(total, (row, column), values)
    np.add.at(count, (row, column), 1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
