"""Finds departures that stay at one place of the image while the wall moves: on the window or the probe.

A droplet, a scratch, a reflection or a wave of the laser sheet moves the line at one azimuth of the image,
whatever wall is there. Ring by ring it looks like a groove or a ridge along the pipe. Therefore every ring's
departure from its smooth shape is followed in the image over a length of pipe that is longer than a defect.
If the probe rolls, a feature of the wall moves in the image and one of the probe does not. If it does not
roll, a true groove cannot be distinguished, and the warning says so.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label, maximum_filter1d

from pipeline.adjustment.robust import robust_spread, row_median
from pipeline.arrays import Float, Int
from pipeline.artefacts.wall_map import FixedPlace, FixedToProbe
from pipeline.machine.scratch import Scratch
from stages.accumulate.grid import MapGrid
from stages.accumulate.survey import RingSurvey

# A departure must stay over this length: the pipe's diameter, in a short pass half of the pass, but no less
# than half of the diameter: the longest of the defects of the open recordings, 30 mm in a pipe of 101 mm, is
# shorter. In a still shorter pass, all of it: a defect of that length looks like a droplet, as the text says.
_LONGEST, _SHORTEST = 1.0, 0.5
# Blocks of rings in that length, of two rings at least. Their medians leave out what is shorter than half of
# the length.
_BLOCKS = 8
_FEWEST_RINGS = 2 * _BLOCKS
# Of the length itself, so much must be covered: a block at either end may be missed.
_COVERED = 0.8
# A place is found from 8 robust σ of all sectors' departures over such a length on, and extends to 3 σ. In
# the three open recordings nothing reached 5 σ; a droplet on the window of one of them made 54.
_FOUND, _REACHED = 8.0, 3.0
# A block shows a place if its own departure is at least half of that of the blocks around it.
_SHOWN = 0.5
# 1 σ of the share of a departure that a ring's smooth fit takes for shape, per radian of its width; the
# stated departure is also the largest of its place. Of 294 drawn bumps of 6 to 120° and .08 to 1.5 mm in
# noise of .02 to .1 mm the error of the height was .7 σ r.m.s. with this share included, 1.0 σ at widths
# about 1 rad; without, 1.8 and 2.9 σ.
_TAKEN_FOR_SHAPE = 0.2
# Share of the circle that a ring must show.
_LEAST_SEEN = 0.3
# A place is on the probe or on the wall if it scatters so many times less there.
_CLEARLY = 2.0
_EIGHT = np.ones((3, 3), int)


@dataclass(frozen=True)
class _Blocks:
    """Medians of rings over short distances: rows are blocks (B,), columns sectors of the image (K,)."""

    rings: tuple[Int, ...]
    first_mm: Float
    last_mm: Float
    roll_rad: Float
    departure_mm: Float

    def length_mm(self, which: Int) -> float:
        """Return the length of wall that some blocks pass over."""
        return float(self.last_mm[which].max(initial=-np.inf) - self.first_mm[which].min(initial=np.inf))


def fixed_to_probe(
    survey: RingSurvey, frame: Int, radius_mm: float, grid: MapGrid, scratch: Scratch
) -> FixedToProbe | None:
    """Return departures that stay in the image; None without any, or with too few rings.

    ``frame`` (F,) are the frames of the rings, ``radius_mm`` is that of the pipe.
    """
    rings = np.flatnonzero(survey.seen > _LEAST_SEEN)
    if not len(rings):
        return None
    passed = float(np.ptp(survey.middle_mm[rings]))
    length = float(np.clip(passed / 2, 2 * radius_mm * _SHORTEST, 2 * radius_mm * _LONGEST))
    length = min(length, passed)
    if len(rings) < _FEWEST_RINGS or length == 0:
        return None
    blocks = _blocks_of(survey, rings, length / _BLOCKS)
    steady = _running_median(blocks.departure_mm)
    places, departure = [], scratch.zeros((len(grid.distance_mm), len(grid.azimuth_rad)), np.float32)
    spread = robust_spread(steady[np.isfinite(steady)])
    for place in _places(steady, spread):
        row, sector = _where_it_shows(*place, steady, blocks)
        on_probe = _is_on_probe(row, sector, steady, blocks)
        if on_probe is False or blocks.length_mm(np.unique(row)) < _COVERED * length:
            continue
        _draw(departure, row, sector, steady, blocks, grid)
        places.append(_described(row, sector, steady, spread, blocks, frame, on_probe is True))
    return FixedToProbe(departure, tuple(places)) if places else None


def _blocks_of(survey: RingSurvey, rings: Int, length_mm: float) -> _Blocks:
    """Return the rings in blocks over each of which the probe moves by a length; it may stand meanwhile."""
    middle = survey.middle_mm[rings]
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(middle)))])
    cuts = np.flatnonzero(np.diff((way / length_mm).astype(np.int64))) + 1
    parts = tuple(np.split(rings, cuts))
    return _Blocks(
        parts,
        np.array([survey.middle_mm[p].min() for p in parts]),
        np.array([survey.middle_mm[p].max() for p in parts]),
        np.array([np.angle(np.exp(1j * survey.roll_rad[p]).sum()) for p in parts]),
        np.stack([_median(survey.departure_mm[p]) for p in parts]),
    )


def _median(rows: Float) -> Float:
    """Return the medians (K,) of the known values in rows (n, K); NaN where less than half are known."""
    known = np.isfinite(rows).sum(0)
    middle = row_median(np.where(known > 0, rows, 0.0).T)
    return np.where(2 * known > len(rows), middle, np.nan)


def _running_median(departure_mm: Float) -> Float:
    """Return the medians (B, K) over the length around each block; at the ends over the last whole length."""
    last = max(len(departure_mm) - _BLOCKS - 1, 0)
    starts = np.clip(np.arange(len(departure_mm)) - _BLOCKS // 2, 0, last)
    return np.stack([_median(departure_mm[k : k + _BLOCKS + 1]) for k in starts])


def _places(steady: Float, spread: float) -> Iterator[tuple[Int, Int]]:
    """Yield blocks and sectors (n,) of every place, around the circle, that departs to one side."""
    start = int(np.argmin((np.abs(np.nan_to_num(steady)) > _REACHED * spread).sum(0)))
    turned = np.nan_to_num(np.roll(steady, -start, axis=1))
    for side in (-1.0, 1.0):
        found, count = label(side * turned > _REACHED * spread, _EIGHT)
        for number in range(1, count + 1):
            row, sector = np.nonzero(found == number)
            if np.abs(turned[row, sector]).max() > _FOUND * spread:
                yield row, (sector + start) % steady.shape[1]


def _where_it_shows(row: Int, sector: Int, steady: Float, blocks: _Blocks) -> tuple[Int, Int]:
    """Return the blocks and sectors of a place without blocks that do not show half of it themselves."""
    _, index = np.unique(row, return_inverse=True)
    size = np.bincount(index, np.abs(steady[row, sector]))
    own = np.nan_to_num(blocks.departure_mm[row, sector]) * np.sign(steady[row, sector])
    shows = (np.bincount(index, own) > _SHOWN * size)[index]
    return row[shows], sector[shows]


def _is_on_probe(row: Int, sector: Int, steady: Float, blocks: _Blocks) -> bool | None:
    """Return whether a place stays in the image while the probe rolls; None if this is unknown.

    In a pass no longer than the medians' length, these are at one place whatever rolls: only if the blocks'
    own departures stay in the image as well, the place is on the probe.
    """
    each, index = np.unique(row, return_inverse=True)
    weight = np.zeros((len(each), steady.shape[1]))
    weight[index, sector] = np.abs(steady[row, sector])
    roll = blocks.roll_rad[each]
    stays = _stays_in_image(weight, roll)
    if not stays:
        return stays
    own = np.nan_to_num(blocks.departure_mm[each] * np.sign(steady[row[0], sector[0]]))
    reach = int(np.ceil(np.ptp(np.unwrap(roll)) / (2 * np.pi) * steady.shape[1]))
    near = maximum_filter1d((weight > 0).any(0), 2 * reach + 1, mode="wrap")
    own = np.where(near & (own > _SHOWN * weight.max()), own, 0.0)
    return True if _stays_in_image(own[own.any(1)], roll[own.any(1)]) else None


def _stays_in_image(weight: Float, roll_rad: Float) -> bool | None:
    """Return whether the middle of weights (n, K) around the image stays there as the probe rolls (n,)."""
    step = 2 * np.pi / weight.shape[1]
    middle = np.angle(weight @ np.exp(1j * step * np.arange(weight.shape[1])))
    in_image = np.hypot(_circular_spread(middle), step / 4)
    on_wall = np.hypot(_circular_spread(middle + roll_rad), step / 4)
    if on_wall > _CLEARLY * in_image:
        return True
    return False if in_image > _CLEARLY * on_wall else None


def _circular_spread(angle: Float) -> float:
    if not angle.size:
        return 0.0
    mean = np.angle(np.exp(1j * angle).mean())
    return float(np.std(np.angle(np.exp(1j * (angle - mean)))))


def _draw(departure: Float, row: Int, sector: Int, steady: Float, blocks: _Blocks, grid: MapGrid) -> None:
    """Write a place's departure, mm without sign, to the wall (S, A) that was seen through it."""
    sectors = steady.shape[1]
    for block in np.unique(row):
        here = np.zeros(sectors)
        here[sector[row == block]] = np.abs(steady[block, sector[row == block]])
        in_image = (grid.azimuth_rad - blocks.roll_rad[block] + np.pi) / (2 * np.pi)
        column = np.floor(in_image * sectors).astype(np.int64) % sectors
        near = (grid.distance_mm >= blocks.first_mm[block] - _gap(blocks)) & (
            grid.distance_mm <= blocks.last_mm[block] + _gap(blocks)
        )
        departure[near] = np.maximum(departure[near], here[column].astype(np.float32))


def _gap(blocks: _Blocks) -> float:
    """Return the usual length of a block, mm, over which a block's departure is assumed to hold."""
    return float(np.median(blocks.last_mm - blocks.first_mm)) / 2


def _described(
    row: Int, sector: Int, steady: Float, spread: float, blocks: _Blocks, frame: Int, on_probe: bool
) -> FixedPlace:
    step = 2 * np.pi / steady.shape[1]
    deepest = int(np.argmax(np.abs(steady[row, sector])))
    rings = np.concatenate([blocks.rings[b] for b in np.unique(row)])
    width = len(np.unique(sector)) * step
    departure = float(steady[row, sector][deepest])
    sd = float(np.hypot(spread, _TAKEN_FOR_SHAPE * width * departure))
    return FixedPlace(
        (sector[deepest] + 0.5) * step - np.pi, width, departure, sd,
        blocks.length_mm(np.unique(row)), int(frame[rings.min()]), int(frame[rings.max()]), on_probe,
    )  # fmt: skip
