"""Blocks of frames that the run has measured, beside those of their twins."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from pipeline.arrays import Bool, Float32
from stages.twin.compare import BLOCK_PX, block_ratios, of_blocks
from stages.twin.render import Region, Renderer, TwinFrame
from stages.twin.scene import Scene
from stages.twin.state import PhotometricState, Sampled

_LEAST_TEXTURE = 4.0
"""Variance of fine texture, grey levels squared, above which its contrast is measurable in 576 noisy
pixels."""
_LEAST_SLOPES = 0.2
"""Geometric mean of a block's squared slopes in two directions, as a share of their sum, from which on its
displacement is known both ways: 0.5 where both are alike, 0 along a stripe. Chosen."""


def blocks_of(
    scene: Scene, state: PhotometricState, sampled: list[Sampled]
) -> tuple[list[Float32], list[tuple[Float32, Float32]]]:
    """Return, for blocks of the sampled lit frames, recorded over predicted brightness, and texture."""
    noise, renderer = state.noise, Renderer(replace(scene, outside=state.outside), state)
    lit = [s for s in sampled if s.light in state.shows_wall]
    twins = [renderer.frame(s.frame, s.light).drawn_aside(state.aside) for s in lit]
    made = [(noise.above_black(s.image), t, noise.full_scale) for s, t in zip(lit, twins, strict=True)]
    return [block_ratios(*m) for m in made], [block_textures(*m) for m in made]


def block_textures(
    above_black: Float32, twin: TwinFrame, white_above_black: float
) -> tuple[Float32, Float32]:
    """Return the contrast of each block's fine texture over that of its twin, and the texture's displacement.

    The displacement (2, rows, columns), px to the right and down from the twin's, solves recorded − twin =
    −∇twin · displacement by least squares over three by three blocks (B. Lucas, T. Kanade, 1981). Both are
    NaN without lit wall and texture around.
    """
    use = (twin.region == Region.WALL) & (above_black < white_above_black)

    def about(values: Float32 | Bool) -> Float32:
        return np.asarray(cv2.blur(of_blocks(values), (3, 3)), np.float32)

    seen, made = (
        np.where(use, a - cv2.GaussianBlur(a, (0, 0), BLOCK_PX), np.float32(0))
        for a in (above_black, np.asarray(twin.level))
    )
    right, down = (
        np.asarray(cv2.Sobel(made, cv2.CV_32F, *way, ksize=1, scale=0.5), np.float32)
        for way in ((1, 0), (0, 1))
    )
    cross, own = about(seen * made), about(made**2)
    rr, rd, dd = about(right**2), about(right * down), about(down**2)
    to_right, to_down = (-about(slope * (seen - made)) for slope in (right, down))
    whole = rr * dd - rd**2
    # At the border of the view light and texture end: blocks within two of it are not measured.
    inside = cv2.erode((about(use) > 0.99).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    known = inside & (own > _LEAST_TEXTURE)
    nan, contrast = np.float32(np.nan), cross / np.maximum(own, _LEAST_TEXTURE)
    place = np.stack([dd * to_right - rd * to_down, rr * to_down - rd * to_right]) / np.maximum(whole, 1e-6)
    sloped = known & (whole > (_LEAST_SLOPES * (rr + dd)) ** 2)
    return np.where(known, contrast, nan), np.where(sloped, place, nan).astype(np.float32)
