"""Find differences that stay at one place of the image: dirt on the window, dust, a droplet.

The ratio of recorded to re-rendered brightness of a block, its median over frames, divided by its broad
surroundings, is 1 up to noise. Its spread is estimated robustly from the blocks at the same distance from the
image's middle: that includes whatever makes them vary, also similar neighbours and a photo that is poor far
ahead. Where a block varies more from frame to frame than that explains, as steep or glossy wall does, its own
standard error is used. The limit is the one that the largest of as many normal numbers exceeds with the
stated probability.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.stats import norm

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Bool, Float32
from pipeline.artefacts.twin import Mismatch
from stages.twin.compare import BLOCK_PX
from stages.twin.discs import Disc, meet

_FEWEST_OF_RING, _HALF_WIDTHS = 100, (0.5, 1.0, 2.0, 4.0)
"""Half the width of rings, blocks: the narrowest one with enough blocks is used, so that a speck is a small
part of it. Where the lamps' light ends, beyond 90°, light that no twin contains, for example from wall to
wall, makes one ring brighter by a third and leaves the next as it is: wide rings would hide that. Chosen."""
FALSE_ALARM = 0.01
"""Probability that a recording without dirt shows dirt at any place. Chosen."""
_BROAD_BLOCKS, _FEWEST_FRAMES, _FEWEST_BLOCKS = 25, 3, 2
"""What is broader than 25 blocks is light, not dirt. A place must be seen in three frames and cover two
blocks."""
LEAST_CHANGE = 0.03
"""Smallest relative change that counts as dirt: what the photo leaves on clean recordings is smaller."""


LEAST_CONTRAST = 0.25
"""Smallest relative change of texture that counts: errors of poses and radii blur it by a tenth or two."""
_APART_PX = 2.0 * BLOCK_PX
"""Places nearer to each other than two blocks are one."""
LEAST_ASIDE_PX, _OF_PX = 0.3, 0.1
"""Smallest displacement of texture that counts, px: a map of the wall and a lens err by a tenth or two;
chosen. Relative change that stands for a displacement of one pixel."""


@dataclass(frozen=True)
class ImagePlace:
    """A place of the image that is darker or brighter than predicted.

    Attributes
    ----------
    u_px, v_px, radius_px : float
        Middle, and radius of a circle of the same area.
    change, sd : float
        Largest relative change of brightness, negative where darker, and its 1 σ.
    probability : float
        Probability that chance makes as large a change anywhere.
    """

    u_px: float
    v_px: float
    radius_px: float
    change: float
    sd: float
    probability: float

    @property
    def disc(self) -> Disc:
        """Where it lies."""
        return Disc(self.u_px, self.v_px, self.radius_px)

    def most_of(self, aside: Float32 | None) -> float:
        """Return the largest displacement of texture here, px, from a map (2, H, W) of displacements."""
        if aside is None:
            return 0.0
        v, u = np.mgrid[0 : aside.shape[1], 0 : aside.shape[2]]
        near = np.hypot(u - self.u_px, v - self.v_px) < self.radius_px
        return float(np.hypot(*aside[:, near]).max(initial=0.0))


def places_in_image(
    ratios: list[Float32], least: float = LEAST_CHANGE
) -> tuple[tuple[ImagePlace, ...], Float32 | None]:
    """Return the places, and the gain (rows, columns) of the blocks, 1 elsewhere; None without any.

    ``least`` is the smallest relative change that counts.
    """
    if len(ratios) < _FEWEST_FRAMES:
        return (), None
    change, spread, known = _stays(np.stack(ratios))
    if not known.any():
        return (), None
    spread = np.maximum(spread, _error_of_median(np.stack(ratios), known))
    bound = np.maximum(float(norm.isf(FALSE_ALARM / (2 * known.sum()))) * spread, least)
    gain = np.ones_like(change)
    # The photo was made through dirt, too: beside dark dirt it is too dark, which is another place.
    found = [*_joined(change < -bound), *_joined(change > bound)]
    for inside in found:
        grown = cv2.dilate(inside.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        gain[grown & known] = 1 + change[grown & known]
    return tuple(_place(k, change, spread, int(known.sum())) for k in found), gain if found else None


def places_displaced(shifts: list[Float32]) -> tuple[tuple[ImagePlace, ...], Float32 | None]:
    """Return where texture is displaced in all frames, from shifts (2, rows, columns), px, of each frame.

    Second, return a map of these displacements of the same shape, 0 elsewhere; None without any.
    """
    if len(shifts) < _FEWEST_FRAMES:
        return (), None
    ways = [_stays(1 + np.float32(_OF_PX) * np.stack([s[k] for s in shifts])) for k in (0, 1)]
    known = ways[0][2] & ways[1][2]
    if not known.any():
        return (), None
    strength = np.hypot(*(change / np.maximum(spread, 1e-9) for change, spread, _ in ways))
    size = np.hypot(ways[0][0], ways[1][0]).astype(np.float32)
    # The chance that both components together are as large: for two normal numbers exp(−s²/2).
    far = (
        known & (strength > np.sqrt(2 * np.log(known.sum() / FALSE_ALARM))) & (size > _OF_PX * LEAST_ASIDE_PX)
    )
    # Inside a drop nothing seems displaced: close its rim.
    whole = cv2.morphologyEx(far.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8)) > 0
    spread = np.where(strength > 0, size / np.maximum(strength, 1e-9), 1).astype(np.float32)
    found = _joined(whole)
    grown = cv2.dilate(np.any(found, axis=0).astype(np.uint8), np.ones((3, 3), np.uint8)) if found else 0
    aside = np.stack([change for change, _, _ in ways]) * (grown * known) / _OF_PX
    places = tuple(_place(k, size, spread, int(known.sum())) for k in found)
    return places, aside.astype(np.float32) if found else None


def _stays(stack: Float32) -> tuple[Float32, Float32, Bool]:
    """Return relative differences of blocks (rows, columns) from their surroundings, 1 σ, and which count."""
    known = np.isfinite(stack).sum(0) >= _FEWEST_FRAMES
    middle = np.ones(known.shape, np.float32)
    if not known.any():
        return middle, middle, known
    middle[known] = np.nanmedian(stack[:, known], axis=0)
    change = np.where(known, middle / _broad(middle, known) - 1, 0).astype(np.float32)
    return change, _spread_of_rings(change, known), known


def _error_of_median(stack: Float32, known: Bool) -> Float32:
    """Return the standard error (rows, columns) of medians over frames (F, rows, columns), if normal."""
    error, values = np.zeros(known.shape, np.float32), stack[:, known]
    error[known] = np.sqrt(np.pi / 2 * np.nanvar(values, axis=0, ddof=1) / np.isfinite(values).sum(0))
    return error


def _joined(beyond: Bool) -> list[Bool]:
    """Return the connected groups of blocks, without those of too few blocks."""
    count, label = cv2.connectedComponents(beyond.astype(np.uint8))
    return [label == k for k in range(1, count) if (label == k).sum() >= _FEWEST_BLOCKS]


def beside(places: tuple[ImagePlace, ...], others: tuple[ImagePlace, ...]) -> tuple[ImagePlace, ...]:
    """Return the places that do not touch any of ``others``."""
    return tuple(p for p in places if not any(p.disc.touches(o.disc, _APART_PX) for o in others))


def without_duplicates(found: list[Mismatch]) -> tuple[Mismatch, ...]:
    """Return what is on the window, without mismatches that name the same spot again with a worse fit."""
    kept: list[Mismatch] = []
    for one in sorted(found, key=lambda m: m.chi2_after - m.chi2_before):
        if not any(m.name == one.name and meet(m, one, _APART_PX) for m in kept):
            kept.append(one)
    return tuple(kept)


def _spread_of_rings(change: Float32, known: Bool) -> Float32:
    """Return the robust spread (rows, columns) about 0 of the blocks as far from the image's middle."""
    row, column = (np.arange(n) - (n - 1) / 2 for n in change.shape)
    away, least = np.hypot(row[:, None], column), spread_about_median(change[known])
    ring = away.round().astype(int)
    of_ring = np.full(ring.max() + 1, least)
    for k in np.unique(ring[known]):
        near = [change[known & (np.abs(away - k) <= w)] for w in _HALF_WIDTHS]
        enough = next((n for n in near if len(n) >= _FEWEST_OF_RING), near[-1])
        of_ring[k] = max(least, spread_about_median(np.concatenate([enough, -enough])))
    return np.asarray(maximum_filter1d(of_ring, 3)[ring], np.float32)


def _broad(values: Float32, known: Bool) -> Float32:
    """Return the local level about every block, with dirt excluded by a median of medians."""
    filled = np.where(known, values, np.float32(1))
    scaled = np.clip((filled - 0.5) * 255, 0, 255).astype(np.uint8)
    coarse = cv2.medianBlur(scaled, _BROAD_BLOCKS).astype(np.float32) / 255 + 0.5
    weight = cv2.GaussianBlur(known.astype(np.float32), (0, 0), _BROAD_BLOCKS / 4)
    # Blocks that differ from their surroundings by 5 % (chosen) may be dirt and are excluded from the local
    # level.
    near = np.abs(filled - coarse) < 0.05
    use = (known & near).astype(np.float32)
    total = cv2.GaussianBlur(filled * use, (0, 0), _BROAD_BLOCKS / 4)
    share = cv2.GaussianBlur(use, (0, 0), _BROAD_BLOCKS / 4)
    # Where less than a twentieth (chosen) of the blocks is left, the median is the level.
    return np.where((share > 0.05 * weight) & (share > 1e-6), total / np.maximum(share, 1e-6), coarse)


def _place(inside: Bool, change: Float32, spread: Float32, blocks: int) -> ImagePlace:
    most = np.unravel_index(np.argmax(np.where(inside, np.abs(change), 0)), change.shape)
    strongest, sd = float(change[most]), max(float(spread[most]), 1e-9)
    chance = min(1.0, 2 * blocks * float(norm.sf(abs(strongest) / sd)))
    v, u = (np.argwhere(inside).mean(0) + 0.5) * BLOCK_PX - 0.5
    radius = BLOCK_PX * float(np.sqrt(inside.sum() / np.pi))
    return ImagePlace(float(u), float(v), radius, strongest, sd, chance)


def full_size(values: Float32, shape: tuple[int, ...], beyond: float = 1.0) -> Float32:
    """Return the values of blocks at all pixels (H, W); ``beyond`` is the value outside whole blocks."""
    out = np.full(shape, beyond, np.float32)
    big = cv2.resize(values, None, fx=BLOCK_PX, fy=BLOCK_PX, interpolation=cv2.INTER_LINEAR)
    out[: big.shape[0], : big.shape[1]] = big
    return out
