"""Aligns rings of a probe that rolls fast, so that neighbours are also compared at one place of the wall.

Rings are compared by azimuth in the picture. A roll between two rings by more than the width of a pit puts it
elsewhere in the next ring, and it would be alone in each. What the rings show of the wall moves alike from
ring to ring. What moves in a few rings only, or at random, is no roll.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.fft import irfft, rfft
from numpy.typing import NDArray

from pipeline.arrays import Bool, Float, Float32, Int
from stages.rings.kernels import slow_around

Number = TypeVar("Number", bound=np.generic)
# Fastest roll from ring to ring that is looked for, as a part of the circle. Half of it is twice that of a
# probe which turns once in 70 frames.
_FASTEST = 1 / 18
# Two rings show the same wall turned if their fine structures correlate by so much more than unturned. Those
# of noise alone do by up to .2 at some of the shifts, rings of a pit with noise by .86; rings of good
# recordings share up to .16.
_ALIKE = 0.3
# A roll is steady if three of five steps agree within 1 % of the circle: two glints in a row agree with a
# third step by chance in one case of 30, three in one of a thousand.
_STEPS, _AGREE, _WITHIN = 2, 3, 0.01
# Slower rolls need no alignment: a run is confirmed by a neighbour up to two sectors beside it.
_SLOW = 2


def turns(radius_px: Float32) -> Int:
    """Return by how many sectors (F,) the wall is turned in each ring; zeros where it turns little.

    ``radius_px`` (F, A) is NaN where there is no valid sample.
    """
    rings, sectors = radius_px.shape
    if rings <= _AGREE:
        return np.zeros(rings, np.int64)
    step, alike = _steps(np.stack([_fine(r) for r in radius_px.astype(float)]))
    known = np.flatnonzero(_steady(step, alike, sectors))
    if not known.size or np.abs(step[known]).max() <= _SLOW:
        return np.zeros(rings, np.int64)
    nearest = known[np.abs(np.arange(rings - 1)[:, None] - known).argmin(1)]
    return np.concatenate([[0], np.cumsum(step[nearest])])


def turned(values: NDArray[Number], by: Int) -> NDArray[Number]:
    """Return rows (F, A) turned by so many sectors (F,) each; the same array if none is turned."""
    if not by.any():
        return values
    columns = np.arange(values.shape[1]) - by[:, None]
    return np.asarray(np.take_along_axis(values, columns % values.shape[1], axis=1))


def _fine(radius: Float) -> Float:
    """Return a ring (A,) without its slow variation; 0 where unknown."""
    return np.asarray(np.nan_to_num(radius - slow_around(radius)))


def _steps(fine: Float) -> tuple[Int, Float]:
    """Return the shift (F - 1,) in sectors at which each ring is most like the one before, and how much more.

    That is by how much their correlation exceeds that without a shift: rows of an interlaced picture make
    rings alike at many shifts.
    """
    sectors = fine.shape[1]
    reach = int(sectors * _FASTEST)
    shifts = np.arange(-reach, reach + 1)
    spectrum = rfft(fine, axis=1)
    product = irfft(np.conj(spectrum[:-1]) * spectrum[1:], sectors, axis=1)[:, shifts]
    size = np.linalg.norm(fine, axis=1)
    alike = product / np.maximum(size[:-1] * size[1:], 1e-12)[:, None]
    return shifts[alike.argmax(1)], alike.max(1) - alike[:, reach]


def _steady(step: Int, alike: Float, sectors: int) -> Bool:
    """Return which steps (F - 1,) at least two of those around agree with."""
    pairs = np.arange(len(step))
    near = np.abs(pairs[:, None] - pairs) <= _STEPS
    agree = near & (np.abs(step[:, None] - step) <= _WITHIN * sectors) & (alike > _ALIKE)
    return np.asarray((alike > _ALIKE) & (agree.sum(1) >= _AGREE))
