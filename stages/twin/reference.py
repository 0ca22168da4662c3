"""Decide to what a difference is fixed: to the image, to the wall, or to rows of single frames.

Blocks of compared lit frames are grouped by place in the image, by place on the wall, and by frame and row.
For each grouping, the mean of a cell over half of its blocks predicts the other half; neighbouring blocks are
in the same half. A difference is fixed to whatever grouping predicts it best. Two groupings between which
frames do not decide are both reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.twin import Look, Mismatch
from stages.twin.cells import centred, sigmas
from stages.twin.compare import BLOCK_PX, block_ratios, of_blocks
from stages.twin.discs import disc_of
from stages.twin.locate import ImagePlace
from stages.twin.render import TwinFrame
from stages.twin.scene import Ring

_SURE, FEWEST_FRAMES = 3.0, 4
"""σ, from frame to frame, by which a grouping must predict better, and fewest frames for that."""
WALL_COLUMNS = 128
"""Cells of the wall around the pipe; they are square: about two blocks at the laser ring."""
_RING_BLOCKS, _LEAST_SPREAD, _NEAR_BLOCKS = 4, 1e-3, 3
"""Width of the rings of blocks that are taken to scatter alike; their least relative spread; distance of
neighbouring blocks."""
SHOWN_PX = 60.0
"""Half the side of the thumbnail of a place, px."""


@dataclass(frozen=True)
class BlockSamples:
    """Blocks of compared frames, (N,) each.

    Attributes
    ----------
    change : float
        Recorded over re-rendered brightness minus 1, minus its median over the frame.
    log_level : float
        Logarithm of the re-rendered brightness, grey levels above black.
    weight : float
        Pixels of a block over their variance.
    frame : int
        Index of the frame, from 0.
    row, column : int
        Of the block in the image.
    along, around : int
        Of its cell on the wall.
    away : float
        Distance from the image's middle, in radii of the line: farther out, wall is seen more obliquely.
    log_light : float
        Logarithm of the irradiance by uniform lamps, as in `LitSight`.
    first_mm, cell_mm : float
        Distance at which the first cell begins, and the side of a cell.
    number : (F,) int
        Frame numbers.
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
    away: Float
    log_light: Float

    @cached_property
    def orders(self) -> dict[str, Int]:
        """Index (N,) of each block's cell, by name of the grouping (what it would be fixed to)."""
        image = self.row * (self.column.max() + 1) + self.column
        wall = self.along * WALL_COLUMNS + self.around
        return {"image": image, "wall": wall, "rows": self.frame * (self.row.max() + 1) + self.row}

    @cached_property
    def log_change(self) -> Float:
        """(N,) logarithm of recorded over re-rendered brightness."""
        return np.log1p(np.maximum(self.change, -0.99))

    @cached_property
    def light_and_brightness(self) -> tuple[Float, Float]:
        """Logarithms (N,) of light and of brightness, minus their means over image, wall and frames.

        What remains of the light is how a place is lit differently from its photo.
        """
        groups = self.orders["image"], self.orders["wall"], self.frame
        return centred(self.log_light, *groups), centred(self.log_change, *groups)

    @cached_property
    def _half(self) -> Int:
        """Half (N,), 0 or 1, of each block: drawn at random for two by two blocks of a frame.

        A regular pattern could be in step with the camera's motion.
        """
        size = (self.frame.max() + 1, self.row.max() // 2 + 1, self.column.max() // 2 + 1)
        drawn = np.random.default_rng(1).integers(0, 2, size)
        return np.asarray(drawn[self.frame, self.row // 2, self.column // 2])

    def explained(self, order: str, use: Bool) -> Float:
        """Return by how much (F,) squares of blocks in ``use`` (N,) fall if other blocks predict them."""
        cell = self.orders[order]
        half = self._half
        count = np.bincount(2 * cell + half, minlength=2 * cell.max() + 2)
        total = np.bincount(2 * cell + half, self.change, len(count))
        other = 2 * cell[use] + 1 - half[use]
        predicted = total[other] / np.maximum(count[other], 1)
        fall = self.change[use] ** 2 - (self.change[use] - predicted) ** 2
        return np.asarray(np.bincount(self.frame[use], fall, self.frame.max() + 1), float)

    def common_in_rows(self) -> Float:
        """Return the variance (F,) of brightness that both halves of the blocks share in rows of a frame."""
        rows, frames = self.row.max() + 1, self.frame.max() + 1
        cell = 2 * self.orders["rows"] + self._half
        count, total = (np.bincount(cell, w, 2 * rows * frames).reshape(-1, 2) for w in (None, self.change))
        known = (count > 0).all(1)
        product, frame = (total[known] / count[known]).prod(1), np.flatnonzero(known) // rows
        each = np.maximum(np.bincount(frame, minlength=frames), 1)
        return np.asarray(np.bincount(frame, product, frames) / each)

    def seen_through(self, gain: Float32 | None) -> BlockSamples:
        """Return the blocks compared with a twin seen through a window of transmission ``gain`` (H, W)."""
        if gain is None:
            return self
        passed = of_blocks(gain)[self.row, self.column].astype(float)
        return replace(self, change=(1 + self.change) / passed - 1, log_level=self.log_level + np.log(passed))

    def clear_of(self, found: Sequence[Mismatch]) -> BlockSamples:
        """Return the blocks outside of what was found at places of the image, rims within 1 σ included."""
        keep = np.ones(len(self.change), bool)
        u, v = ((a + 0.5) * BLOCK_PX for a in (self.column, self.row))
        for place in filter(None, (disc_of(m, sigmas=1.0) for m in found)):
            keep &= np.hypot(u - place.u_px, v - place.v_px) > place.radius_px + 2 * BLOCK_PX
        return self.kept(keep) if keep.any() else self

    def kept(self, keep: Bool) -> BlockSamples:
        """Return the blocks in ``keep`` (N,)."""
        of_blocks = (f.name for f in fields(self) if f.name not in ("first_mm", "cell_mm", "number"))
        return replace(self, **{name: getattr(self, name)[keep] for name in of_blocks})

    @cached_property
    def strength(self) -> Float:
        """(N,) change over the robust spread of the blocks at the same distance from the image's middle."""
        row, column = (a - a.max() / 2 for a in (self.row, self.column))
        ring = (np.hypot(row, column) / _RING_BLOCKS).astype(int)
        spread = np.ones(ring.max() + 1)
        for k in np.unique(ring):
            spread[k] = max(spread_about_median(self.change[ring == k]), _LEAST_SPREAD)
        return np.asarray(self.change / spread[ring])

    def near(self, k: int) -> tuple[Bool, Bool]:
        """Return which blocks (N,) are next to block ``k`` in the image, and which on the wall."""
        image = np.hypot(self.row - self.row[k], self.column - self.column[k]) < _NEAR_BLOCKS
        turn = np.abs(self.around - self.around[k])
        turn = np.minimum(turn, WALL_COLUMNS - turn)
        return image, np.hypot(self.along - self.along[k], turn) < _NEAR_BLOCKS

    def look(self, use: Bool, half_px: float) -> Look:
        """Return the view of the strongest of the blocks in ``use`` (N,)."""
        k = int(np.argmax(np.where(use, np.abs(self.strength), -1.0)))
        u, v = ((float(a[k]) + 0.5) * BLOCK_PX for a in (self.column, self.row))
        return Look(int(self.number[self.frame[k]]), u, v, half_px)

    def fixed_to(self, use: Bool, orders: Sequence[str] = ("image", "wall", "rows")) -> str:
        """Return to which of ``orders`` the blocks in ``use`` (N,) are fixed; empty where none predicts them.

        ``image or wall`` names two groupings that the frames do not separate.
        """
        frames = np.unique(self.frame[use])
        if len(frames) < FEWEST_FRAMES:
            return ""
        found = sorted(((k, self.explained(k, use)[frames]) for k in orders), key=lambda e: -e[1].sum())
        (first, best), (second, next_best) = found[:2]
        if sigmas(best) < _SURE:
            return ""
        return first if sigmas(best - next_best) > _SURE else f"{first} or {second}"


@dataclass
class BlocksOfFrames:
    """Collects the blocks of compared lit frames."""

    ring: Ring
    parts: list[tuple[Float32, ...]] = field(default_factory=list)
    number: list[int] = field(default_factory=list)

    def add(self, frame: int, above: Float32, twin: TwinFrame, white: float) -> None:
        """Add a frame (H, W), grey levels above black, whose twin has its exposure."""
        ratio = block_ratios(above, twin, white)
        middle = (slice(BLOCK_PX // 2, None, BLOCK_PX),) * 2
        rows, columns = ratio.shape
        distance, azimuth = (a[middle][:rows, :columns] for a in (twin.distance_mm, twin.azimuth_rad))
        assert twin.irradiance is not None
        level, variance, light = (of_blocks(a) for a in (twin.level, twin.variance, twin.irradiance))
        self.parts.append((ratio, level, variance, distance, azimuth, light))
        self.number.append(frame)

    def samples(self) -> BlockSamples | None:
        """Return all blocks; None without any."""
        found, cell_mm = [], 2 * np.pi * self.ring.radius_mm / WALL_COLUMNS
        for k, (ratio, level, variance, distance, azimuth, light) in enumerate(self.parts):
            row, column = np.nonzero(np.isfinite(ratio) & np.isfinite(distance))
            if not len(row):
                continue
            change = ratio[row, column] / np.median(ratio[row, column]) - 1
            along = np.floor(distance[row, column] / cell_mm)
            around = np.floor((azimuth[row, column] / (2 * np.pi)) % 1 * WALL_COLUMNS) % WALL_COLUMNS
            bright = np.log(np.maximum(level[row, column], 1))
            weight = BLOCK_PX**2 / variance[row, column]
            aside = [
                (a + 0.5) * BLOCK_PX - c for a, c in zip((column, row), self.ring.centre_px, strict=True)
            ]
            away = np.hypot(*aside) / self.ring.radius_px
            lit = np.log(np.maximum(light[row, column], 1e-6))
            found.append(
                (change, bright, weight, away, lit, np.full(len(row), k), row, column, along, around)
            )
        if not found:
            return None
        change, bright, weight, away, lit, *place = (np.concatenate(c) for c in zip(*found, strict=True))
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
            away,
            lit.astype(float),
        )


def in_image(samples: BlockSamples | None, places: tuple[ImagePlace, ...]) -> tuple[str, ...]:
    """Return what each place of the image is fixed to; "image" where frames are too few to decide.

    Rows of single frames are not tested: their means predict the fragments of texture in a drop, which change
    from frame to frame, no worse than the drop's place does.
    """
    if samples is None or samples.frame.max() + 1 < FEWEST_FRAMES:
        return ("image",) * len(places)
    return tuple(_fixed_in_image(samples, p) for p in places)


def _fixed_in_image(samples: BlockSamples, place: ImagePlace) -> str:
    away = np.hypot(
        (samples.column + 0.5) * BLOCK_PX - place.u_px, (samples.row + 0.5) * BLOCK_PX - place.v_px
    )
    return samples.fixed_to(away < max(place.radius_px, BLOCK_PX), ("image", "wall"))


def map_of(samples: BlockSamples, order: str, shape: tuple[int, int]) -> tuple[Float, Float]:
    """Return the mean over a grouping's cells and its 1 σ, as maps of ``shape``; NaN with few blocks."""
    cell, cells = samples.orders[order], shape[0] * shape[1]
    count = np.bincount(cell, minlength=cells)[:cells]
    mean = np.bincount(cell, samples.change, cells)[:cells] / np.maximum(count, 1)
    scale = np.sqrt(np.maximum(count, 1))
    known = count >= FEWEST_FRAMES
    # The scatter of the means themselves includes whatever makes neighbours and frames alike.
    sd = spread_about_median((mean * scale)[known]) / scale if known.any() else np.full(cells, np.nan)
    return np.where(known, mean, np.nan).reshape(shape), np.reshape(sd, shape)
