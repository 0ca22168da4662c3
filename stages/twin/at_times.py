"""What some frames show that stays neither in the picture nor on the wall: dark spots that move, a dim line.

Laws of `stages.twin.causes` act in all frames or from one frame on; a spot that crawls over the window, or a
laser that is shaded now and then, follows none of them. Both are located without a name.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Bool, Float
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.cells import SECTORS, Cells, fitted, sector_azimuth_rad
from stages.twin.reference import SHOWN_PX, BlockSamples
from stages.twin.scene import Ring

_FEWEST, _FEWEST_BLOCKS, _FEWEST_SECTORS = 3, 4, 2
_SIGMA, _LEAST_DARK, _LEAST_DIM, _MOSTLY = 8.0, 0.15, 0.25, 0.5
"""Fewest frames; fewest joined blocks and sectors. Times the usual scatter, and least loss of light, of a
block and of the line. A sound recording of another renderer had one block of 24,000 beyond 8, of .05. Share
of squares from which other blocks predict a spot, of blocks that lie at the same place in several frames, and
of the frames from which a sector is dim. Chosen."""


_WHERE = {
    "wall": "mostly where other frames show it on the same wall, but not in all that see it: wall that "
    "shines at some angles, as wet or polished wall does, beside a photo that was made where it shone, or "
    "something that moves slowly.",
    "image": "mostly at the same place of the picture, but not in all frames: something on the window that "
    "shows in front of some wall only, or comes and goes.",
    "": "each time at another place of picture and wall: something moves on the window or in front of the "
    "wall.",
}
"""What is said of spots that recur on the wall, in the image, or nowhere."""


def dark_spots(samples: BlockSamples | None, found: Sequence[Mismatch] = ()) -> tuple[Mismatch, ...]:
    """Return spots of lit wall that are dark in several frames and stay neither in the image nor on the wall.

    Blocks at places of the image where something else was ``found`` do not count: texture that a drop
    displaces leaves dark fragments, each frame others.
    """
    if samples is None:
        return ()
    samples = samples.clear_of(found)
    dark = (samples.strength < -_SIGMA) & (samples.change < -_LEAST_DARK)
    use = np.zeros(len(dark), bool)
    for k in np.unique(samples.frame[dark]):
        use |= _joined(samples, dark & (samples.frame == k))
    frames, count = np.unique(samples.frame[use]), len(samples.number)
    if len(frames) < _FEWEST or _stays(samples, use):
        return ()
    lost = np.array([-samples.change[use & (samples.frame == k)].min() for k in frames])
    size = NamedFigure("darker", float(np.median(lost)), float(lost.std() / np.sqrt(len(lost))), "share")
    first, last = (float(samples.number[frames[k]]) for k in (0, -1))
    place = (NamedFigure("frame_from", first, 0.0), NamedFigure("frame_to", last, 0.0))
    again, nan = _recurs(samples, use), float("nan")
    said = (
        f"In {len(frames)} of {count} lit frames, a spot is up to {100 * lost.max():.0f} % darker than "
        f"re-rendered, {_WHERE[again]}"
    )
    fixed_to = {"wall": "image or wall", "image": "image", "": "time"}[again]
    look = samples.look(use, SHOWN_PX)
    return (Mismatch("", "intensity", fixed_to, place, (size,), nan, nan, nan, said, look),)


def _recurs(samples: BlockSamples, use: Bool) -> str:
    """Return on what most of the blocks (N,) recur: "wall", "image", or neither.

    On wall that is among them in another frame as well; or in the image in most of their frames, since a spot
    that crawls covers its last place in part.
    """
    count = {}
    for order in ("wall", "image"):
        cell = samples.orders[order][use]
        once = np.unique(np.stack([cell, samples.frame[use]]), axis=1)[0]
        count[order] = np.bincount(once)[cell]
    if np.mean(count["wall"] > 1) > _MOSTLY:
        return "wall"
    frames = len(np.unique(samples.frame[use]))
    return "image" if np.mean(count["image"] > _MOSTLY * frames) > _MOSTLY else ""


def _stays(samples: BlockSamples, use: Bool) -> bool:
    """Return whether other blocks at their places of image or wall predict most of the blocks (N,)."""
    most = _MOSTLY * float((samples.change[use] ** 2).sum())
    return any(float(samples.explained(order, use).sum()) > most for order in ("image", "wall"))


def _joined(samples: BlockSamples, use: Bool) -> Bool:
    """Return the blocks (N,) of one frame that are in groups of enough blocks."""
    picture = np.zeros((int(samples.row.max()) + 1, int(samples.column.max()) + 1), np.uint8)
    picture[samples.row[use], samples.column[use]] = 1
    _, label, stats, _ = cv2.connectedComponentsWithStats(picture)
    large = stats[:, cv2.CC_STAT_AREA] >= _FEWEST_BLOCKS
    large[0] = False
    return np.asarray(use & large[label[samples.row, samples.column]])


def dim_at_times(cells: Cells, base: Float, ring: Ring) -> tuple[Mismatch, ...]:
    """Return where the line is dim in several frames and not in most, beyond base columns (K, F, S)."""
    rest = cells.log_ratio - fitted(cells, base, np.ones(len(cells.frame), bool))
    rest = np.where(cells.usable, rest - np.median(rest[cells.usable]), 0.0)
    usual = max(spread_about_median(rest[cells.usable]), 1e-3)
    dim = (rest < -_SIGMA * usual) & (rest < np.log(1 - _LEAST_DIM))
    pairs = dim & np.roll(dim, -1, 1)
    sector = int(pairs.sum(0).argmax())
    frames = np.flatnonzero(pairs[:, sector])
    if not _FEWEST <= len(frames) <= len(rest) / 2:
        return ()
    wide = dim[frames].mean(0) >= _MOSTLY
    turn = np.exp(1j * sector_azimuth_rad())[wide].sum()
    azimuth, width = float(np.degrees(np.angle(turn))), 360 / SECTORS * float(wide.sum())
    lost = 1 - np.exp(rest[frames, sector])
    around = (
        NamedFigure("azimuth_deg", azimuth, 180 / SECTORS, "deg"),
        NamedFigure("width_deg", width, 360 / SECTORS, "deg"),
    )
    place = (
        *(() if wide.all() else around),
        NamedFigure("frame_from", float(cells.frame[frames[0]]), 0.0),
        NamedFigure("frame_to", float(cells.frame[frames[-1]]), 0.0),
    )
    sd = float(lost.std() / np.sqrt(len(lost)))
    size = NamedFigure("lost", float(lost.mean()), sd, "share of the light")
    part = f"the line about image azimuth {azimuth:.0f}°, {width:.0f}° wide,"
    said = (
        f"In {len(frames)} of {len(rest)} laser frames, {'the whole line' if wide.all() else part} is about "
        f"{100 * size.value:.0f} % darker than in the others: something shades the laser or the window at "
        "times, the laser is weaker in them, or the wall is darker there."
    )
    look = ring.whole(int(cells.frame[frames[0]]))
    if not wide.all():
        look = ring.at(int(cells.frame[frames[0]]), float(np.radians(azimuth)))
    nan = float("nan")
    return (Mismatch("", "line", "time", place, (size,), nan, nan, nan, said, look),)
