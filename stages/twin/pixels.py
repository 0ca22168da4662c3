"""Defective pixels of the sensor: bright without light, or dark in any light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.stats import norm

from pipeline.arrays import Bool, Byte, Float, Float32, Int
from pipeline.artefacts.twin import Look, Mismatch, NamedFigure

_LEAST_GREY, _AROUND_PX, _MOST_PIXELS, _FEWEST_FRAMES = 12, 5, 3, 6
"""Grey levels by which a pixel must differ from the median of five by five around it, in every frame: wall
moves and noise changes. Most adjacent pixels of a defect; more are dirt, a scratch or text. Fewest lit
frames. Chosen."""
_BROAD_PX, _SPREAD_PIXELS = 15, 9
"""Side of the surroundings, px, beside which a defect's own pixels are counted: more than a scratch is wide.
Most pixels about a defect that differ by half as much as it does: colour filters and codecs spread one pixel
over three by three."""
_BEYOND = 6.0
"""By how many spreads of the pixels' constant offsets a defective one must stand out: of normal offsets,
which are no defect, one pixel in 10⁹ does."""


@dataclass(frozen=True)
class DefectivePixels:
    """Rows and columns (N, 2) of single pixels, too bright or too dark, of those ``seen`` (H, W)."""

    hot: Int
    dead: Int
    seen: Bool

    def mended(self, image: Float32) -> Float32:
        """Return a picture (H, W) with the medians of their surroundings in place of these pixels.

        A codec or colour filters spread a pixel by one to each side. Without any, the picture itself.
        """
        both, reach = np.concatenate([self.hot, self.dead]), 1 + _AROUND_PX // 2
        made = image.copy() if len(both) else image
        for row, column in both:
            top, left = max(row - reach, 0), max(column - reach, 0)
            near = cv2.medianBlur(image[top : row + reach + 1, left : column + reach + 1], _AROUND_PX)
            first, begin = max(row - 1, 0), max(column - 1, 0)
            made[first : row + 2, begin : column + 2] = near[
                first - top : row + 2 - top, begin - left : column + 2 - left
            ]
        return made

    def mismatches(self) -> tuple[Mismatch, ...]:
        """Return what is reported of them; nothing without any."""
        both, pixels, nan = np.concatenate([self.hot, self.dead]), int(self.seen.sum()), float("nan")
        if not len(both):
            return ()
        size = NamedFigure("share", len(both) / pixels, float(np.sqrt(len(both))) / pixels, "of pixels")
        v, u = (float(a) for a in both[0])
        said = (
            f"{len(self.hot)} single pixels are too bright in all frames, {len(self.dead)} too dark in all "
            "lit ones."
        )
        look = Look(0, u, v, 4.0 * _AROUND_PX)
        return (Mismatch("defective_pixels", "intensity", "image", (), (size,), nan, nan, nan, said, look),)


def defective_pixels(images: Sequence[Byte], lit: Sequence[bool], seen: Bool) -> DefectivePixels:
    """Return pixels among those ``seen`` (H, W) that are bright in all frames, or dark in all lit ones."""
    if sum(lit) < _FEWEST_FRAMES:
        return DefectivePixels(np.zeros((0, 2), int), np.zeros((0, 2), int), seen)
    most = np.iinfo(np.int16).max
    more, less = (np.full(seen.shape, most, np.int16) for _ in range(2))
    total, sums = np.zeros(seen.shape, np.int32), np.zeros((2, *seen.shape), np.int32)
    for image, shows_wall in zip(images, lit, strict=True):
        beyond = image.astype(np.int16) - np.asarray(cv2.medianBlur(image, _AROUND_PX), np.int16)
        total += beyond
        sums += np.stack([image, image * np.uint8(shows_wall)])
        more = np.minimum(more, beyond)
        less = np.minimum(less, -beyond) if shows_wall else less
    kept = _spread(total[seen] / len(images))
    hot, dead = (
        _alone(_single((a >= max(_LEAST_GREY, _BEYOND * kept)) & seen), way * mean)
        for a, way, mean in ((more, 1, sums[0] / len(images)), (less, -1, sums[1] / sum(lit)))
    )
    return DefectivePixels(hot, dead, seen)


def _spread(offset: Float) -> float:
    """Return 1 σ of pixels' constant offsets (N,): 1 σ to either side, or twice that from 2 σ to 2.5 σ.

    Black cuts off the darker pixels: half of them or more, where it is clipped. Then only the tail shows σ,
    and of it only what begins at one pixel in 160: farther out, defective pixels of a bad sensor are more.
    The widest counts.
    """
    if not len(offset):
        return 0.0
    low, high, inner, outer = (float(np.quantile(offset, norm.cdf(z))) for z in (-1.0, 1.0, 2.0, 2.5))
    return max(-low, high, 2 * (outer - inner))


def _single(differs: Bool) -> Int:
    """Return row and column (N, 2) of marked pixels that form groups of a few pixels at most."""
    count, _, stats, centre = cv2.connectedComponentsWithStats(differs.astype(np.uint8))
    small = [k for k in range(1, count) if stats[k, cv2.CC_STAT_AREA] <= _MOST_PIXELS]
    return np.asarray(np.round(centre[small])[:, ::-1], int).reshape(-1, 2)


def _alone(places: Int, mean: Float) -> Int:
    """Return the places (N, 2) about which only a few pixels of a mean picture (H, W) are as bright.

    Parts of a scratch or of a burnt-in line may differ from their narrow surroundings by as much as a pixel.
    """
    level = mean.astype(np.float32)
    reach = _BROAD_PX // 2
    kept = []
    for row, column in places:
        corner = max(row - reach, 0), max(column - reach, 0)
        near = level[corner[0] : row + reach + 1, corner[1] : column + reach + 1]
        own = near[row - corner[0], column - corner[1]] - np.median(near)
        label = cv2.connectedComponents((near - np.median(near) > own / 2).astype(np.uint8))[1]
        group = label == label[row - corner[0], column - corner[1]]
        kept.append(own > 0 and group.sum() <= _SPREAD_PIXELS)
    return np.asarray(places[np.array(kept, bool)])
