"""To what a difference is fixed: to the image, to the wall, or to rows of single frames.

Blocks of compared lit frames are sorted by place in the image, by place on the wall, and by frame and row.
In each order the mean of a cell, taken from half of its blocks, predicts the other half; neighbouring blocks
go to the same half. What a difference is fixed to is the order in which it is predicted best. Two orders
between which frames do not decide cannot be told apart.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import cv2
import numpy as np
from scipy.stats import norm, t

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.twin import Look, Mismatch, NamedFigure
from stages.twin.cells import sigmas
from stages.twin.compare import BLOCK_PX, block_ratios, of_blocks
from stages.twin.locate import FALSE_ALARM, ImagePlace
from stages.twin.render import TwinFrame

_SURE, _FEWEST_FRAMES, _FEWEST_CELLS = 3.0, 4, 2
"""σ from frame to frame by which an order must predict better, frames for that, and cells of a region."""
WALL_COLUMNS = 128
"""Cells of the wall around the pipe; they are as long as wide: about two blocks at the laser ring."""
_LEAST_ON_WALL, _LEAST_OF_ROWS = 0.05, 0.01
"""Relative changes that count: at steps of the wall the photo itself errs by a few per cent."""
_RING_BLOCKS, _LEAST_SPREAD, _NEAR_BLOCKS = 4, 1e-3, 3
"""Width of the rings in which blocks are alike, their least relative spread, and what is next to a block."""
SHOWN_PX = 60.0
"""Half the side of the thumbnail of a place."""


@dataclass(frozen=True)
class BlockSamples:
    """Blocks of compared frames, (N,) each.

    Attributes
    ----------
    change : float
        Recorded over re-rendered brightness less 1, the median of the frame taken off.
    log_level : float
        Logarithm of the re-rendered brightness, grey levels above black.
    weight : float
        Pixels of a block over their variance.
    frame : int
        Counted from 0.
    row, column : int
        Of the block in the image.
    along, around : int
        Of its cell on the wall.
    first_mm, cell_mm : float
        Distance at which the first cell begins, and the side of a cell.
    number : (F,) int
        Numbers of the frames.
    """

    change: Float
    log_level: Float
    weight: Float
    frame: Int
    row: Int
    column: Int
    along: Int
    around: Int
    first_mm: float
    cell_mm: float
    number: Int

    @cached_property
    def orders(self) -> dict[str, Int]:
        """Number (N,) of the cell that each block is in, by what is then fixed."""
        image = self.row * (self.column.max() + 1) + self.column
        wall = self.along * WALL_COLUMNS + self.around
        return {"image": image, "wall": wall, "rows": self.frame * (self.row.max() + 1) + self.row}

    @cached_property
    def _half(self) -> Int:
        """Which half (N,) a block belongs to, drawn for two by two blocks of a frame.

        A regular pattern could be in step with the camera's motion.
        """
        size = (self.frame.max() + 1, self.row.max() // 2 + 1, self.column.max() // 2 + 1)
        drawn = np.random.default_rng(1).integers(0, 2, size)
        return np.asarray(drawn[self.frame, self.row // 2, self.column // 2])

    def explained(self, order: str, use: Bool) -> Float:
        """Return by how much (F,) squares of blocks in ``use`` (N,) fall when other blocks predict them."""
        cell = self.orders[order]
        half = self._half
        count = np.bincount(2 * cell + half, minlength=2 * cell.max() + 2)
        total = np.bincount(2 * cell + half, self.change, len(count))
        other = 2 * cell[use] + 1 - half[use]
        predicted = total[other] / np.maximum(count[other], 1)
        fall = self.change[use] ** 2 - (self.change[use] - predicted) ** 2
        return np.asarray(np.bincount(self.frame[use], fall, self.frame.max() + 1), float)

    def seen_through(self, gain: Float32 | None) -> BlockSamples:
        """Return the blocks against a twin that is seen through a window which lets ``gain`` (H, W) pass."""
        if gain is None:
            return self
        passed = of_blocks(gain)[self.row, self.column].astype(float)
        return replace(self, change=(1 + self.change) / passed - 1, log_level=self.log_level + np.log(passed))

    @cached_property
    def strength(self) -> Float:
        """(N,) change over the robust spread of the blocks as far from the image's middle."""
        row, column = (a - a.max() / 2 for a in (self.row, self.column))
        ring = (np.hypot(row, column) / _RING_BLOCKS).astype(int)
        spread = np.ones(ring.max() + 1)
        for k in np.unique(ring):
            spread[k] = max(spread_about_median(self.change[ring == k]), _LEAST_SPREAD)
        return np.asarray(self.change / spread[ring])

    def near(self, k: int) -> tuple[Bool, Bool]:
        """Return which blocks (N,) lie next to one in the image, and which next to it on the wall."""
        image = np.hypot(self.row - self.row[k], self.column - self.column[k]) < _NEAR_BLOCKS
        turn = np.abs(self.around - self.around[k])
        turn = np.minimum(turn, WALL_COLUMNS - turn)
        return image, np.hypot(self.along - self.along[k], turn) < _NEAR_BLOCKS

    def look(self, use: Bool, half_px: float) -> Look:
        """Return where the strongest of blocks (N,) is to be looked at."""
        k = int(np.argmax(np.where(use, np.abs(self.strength), -1.0)))
        u, v = ((float(a[k]) + 0.5) * BLOCK_PX for a in (self.column, self.row))
        return Look(int(self.number[self.frame[k]]), u, v, half_px)

    def fixed_to(self, use: Bool) -> str:
        """Return what the blocks in ``use`` (N,) are fixed to; empty where no order predicts them.

        ``image or wall`` stands for two orders that cannot be told apart.
        """
        frames = np.unique(self.frame[use])
        if len(frames) < _FEWEST_FRAMES:
            return ""
        found = sorted(((k, self.explained(k, use)[frames]) for k in self.orders), key=lambda e: -e[1].sum())
        (first, best), (second, next_best) = found[:2]
        if sigmas(best) < _SURE:
            return ""
        return first if sigmas(best - next_best) > _SURE else f"{first} or {second}"


@dataclass
class BlocksOfFrames:
    """Collects the blocks of compared lit frames."""

    mean_radius_mm: float
    parts: list[tuple[Float32, ...]] = field(default_factory=list)
    number: list[int] = field(default_factory=list)

    def add(self, frame: int, above: Float32, twin: TwinFrame, white: float) -> None:
        """Take a frame whose exposure is its own."""
        ratio = block_ratios(above, twin, white)
        middle = (slice(BLOCK_PX // 2, None, BLOCK_PX),) * 2
        rows, columns = ratio.shape
        distance, azimuth = (a[middle][:rows, :columns] for a in (twin.distance_mm, twin.azimuth_rad))
        level, variance = (of_blocks(a) for a in (twin.level, twin.variance))
        self.parts.append((ratio, level, variance, distance, azimuth))
        self.number.append(frame)

    def samples(self) -> BlockSamples | None:
        """Return all blocks; None where there are none."""
        found, cell_mm = [], 2 * np.pi * self.mean_radius_mm / WALL_COLUMNS
        for k, (ratio, level, variance, distance, azimuth) in enumerate(self.parts):
            row, column = np.nonzero(np.isfinite(ratio) & np.isfinite(distance))
            if not len(row):
                continue
            change = ratio[row, column] / np.median(ratio[row, column]) - 1
            along = np.floor(distance[row, column] / cell_mm)
            around = np.floor((azimuth[row, column] / (2 * np.pi)) % 1 * WALL_COLUMNS) % WALL_COLUMNS
            bright = np.log(np.maximum(level[row, column], 1))
            weight = BLOCK_PX**2 / variance[row, column]
            found.append((change, bright, weight, np.full(len(row), k), row, column, along, around))
        if not found:
            return None
        change, bright, weight, *place = (np.concatenate(c) for c in zip(*found, strict=True))
        frame, row, column, along, around = (p.astype(np.int64) for p in place)
        first = int(along.min())
        return BlockSamples(
            change.astype(float),
            bright.astype(float),
            weight.astype(float),
            frame,
            row,
            column,
            along - first,
            around,
            first * cell_mm,
            cell_mm,
            np.array(self.number),
        )


def in_image(samples: BlockSamples | None, places: tuple[ImagePlace, ...]) -> tuple[str, ...]:
    """Return what each place of the image is fixed to; the image itself where frames are too few to tell."""
    if samples is None or samples.frame.max() + 1 < _FEWEST_FRAMES:
        return ("image",) * len(places)
    return tuple(_fixed_in_image(samples, p) for p in places)


def _fixed_in_image(samples: BlockSamples, place: ImagePlace) -> str:
    away = np.hypot(
        (samples.column + 0.5) * BLOCK_PX - place.u_px, (samples.row + 0.5) * BLOCK_PX - place.v_px
    )
    return samples.fixed_to(away < max(place.radius_px, BLOCK_PX))


def map_of(samples: BlockSamples, order: str, shape: tuple[int, int]) -> tuple[Float, Float]:
    """Return the mean of the cells of an order and its 1 σ, each of a shape; NaN where few blocks are."""
    cell, cells = samples.orders[order], shape[0] * shape[1]
    count = np.bincount(cell, minlength=cells)[:cells]
    mean = np.bincount(cell, samples.change, cells)[:cells] / np.maximum(count, 1)
    scale = np.sqrt(np.maximum(count, 1))
    known = count >= _FEWEST_FRAMES
    # The spread of the means themselves holds whatever makes neighbours and frames alike.
    sd = spread_about_median((mean * scale)[known]) / scale if known.any() else np.full(cells, np.nan)
    return np.where(known, mean, np.nan).reshape(shape), np.reshape(sd, shape)


def unnamed(samples: BlockSamples | None) -> tuple[Mismatch, ...]:
    """Return what is fixed to the wall or to rows."""
    return () if samples is None else (*_regions_of_wall(samples), *_banding(samples))


def _regions_of_wall(samples: BlockSamples) -> tuple[Mismatch, ...]:
    """Return regions of the wall that stay brighter or darker than their photo, if frames bear it out."""
    shape = (int(samples.along.max()) + 1, WALL_COLUMNS)
    mean, sd = map_of(samples, "wall", shape)
    known = np.isfinite(mean)
    bound = np.maximum(float(norm.isf(FALSE_ALARM / (2 * max(known.sum(), 1)))) * sd, _LEAST_ON_WALL)
    beyond = known & (np.abs(np.nan_to_num(mean)) > bound)
    count, label = cv2.connectedComponents(beyond.astype(np.uint8))
    found = []
    for k in range(1, count):
        cells = np.argwhere(label == k)
        use = label[samples.along, samples.around] == k
        if len(cells) < _FEWEST_CELLS or samples.fixed_to(use) != "wall":
            continue
        found.append(_on_wall(cells, mean, sd, int(known.sum()), samples, use))
    return tuple(found)


def _on_wall(cells: Int, mean: Float, sd: Float, known: int, samples: BlockSamples, use: Bool) -> Mismatch:
    cell_mm = samples.cell_mm
    value, spread = (a[tuple(cells.T)] for a in (mean, sd))
    most = int(np.argmax(np.abs(value)))
    chance = min(1.0, 2 * known * float(norm.sf(abs(value[most]) / max(float(spread[most]), 1e-9))))
    distance = samples.first_mm + (cells[:, 0].mean() + 0.5) * cell_mm
    azimuth = (cells[:, 1].mean() + 0.5) * 360 / WALL_COLUMNS
    azimuth -= 360 * (azimuth > 180)
    extent = cell_mm * float(np.sqrt(len(cells)))
    nan, way = float("nan"), "brighter" if value[most] > 0 else "darker"
    place = (
        NamedFigure("distance_mm", distance, cell_mm / 2, "mm"),
        NamedFigure("azimuth_deg", azimuth, 180 / WALL_COLUMNS, "deg"),
        NamedFigure("extent_mm", extent, cell_mm, "mm"),
    )
    size = NamedFigure("change", float(value[most]), float(spread[most]), "relative")
    return Mismatch(
        "", "intensity", "wall", place, (size,), chance, nan, nan,
        f"At {distance:.0f} mm, azimuth {azimuth:.0f}°, the wall is {100 * abs(value[most]):.0f} % {way} "
        "than its photo: it shines differently from each side, or lies elsewhere than the radius map says.",
        samples.look(use, SHOWN_PX),
    )  # fmt: skip


def _banding(samples: BlockSamples) -> tuple[Mismatch, ...]:
    """Return bands along rows that change from frame to frame."""
    everywhere = np.ones(len(samples.change), bool)
    if samples.frame.max() + 1 < _FEWEST_FRAMES or samples.fixed_to(everywhere) != "rows":
        return ()
    mean, _ = map_of(samples, "rows", (int(samples.frame.max()) + 1, int(samples.row.max()) + 1))
    size = float(np.nanstd(mean))
    frames = np.unique(samples.frame)
    chance = float(t.sf(sigmas(samples.explained("rows", everywhere)[frames]), len(frames) - 1))
    sd = float(np.nanstd(np.nanstd(mean, axis=1))) / np.sqrt(len(frames))
    if size < _LEAST_OF_ROWS:
        return ()
    nan = float("nan")
    return (
        Mismatch(
            "banding", "intensity", "rows", (), (NamedFigure("change", size, sd, "relative"),), chance,
            nan, nan,
            f"Rows of single frames are brighter or darker by {100 * size:.1f} % (1 σ): banding, as of lamps "
            "that flicker within a frame of a rolling shutter.",
            samples.look(everywhere, 2 * SHOWN_PX),
        ),
    )  # fmt: skip
