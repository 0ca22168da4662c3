"""The sensor's fixed pattern: each pixel's own offset and gain, the same in all frames.

These are DSNU and PRNU of EMVA 1288. The wall moves and noise changes between frames; what remains the same
at a pixel in two frames is its own. Its covariance is D² + G² · level₁ · level₂, with D the spread of the
dark signals and G that of the gains. Lenses, lamps and dirt vary slowly and are removed with the mean over
five by five pixels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from scipy.optimize import nnls

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Float32
from pipeline.artefacts.twin import NamedFigure
from stages.twin.lamp_light import Figure

_AROUND_PX, _EVERY, _BINS, _FEWEST_PIXELS = 5, 2, 8, 5000
"""Side of the local mean, px; every how many pixels one is used; bins of brightness; least number of pixels
that two frames must share."""
_OF_PHOTO = 0.04
"""Relative 1 σ: the wall's photo was made from the same frames, and absorbs the share that each has in it."""
_LARGEST = 6.0
"""Robust σ beyond which a residual is not pattern but a hot pixel or an edge of the photo."""


@dataclass(frozen=True)
class FixedPattern:
    """1 σ of the pixels' dark signals, grey levels, and of their gains, relative to 1."""

    dark: Figure
    gain: Figure


def fixed_pattern(frames: Sequence[tuple[Float32, Float32, Bool]]) -> FixedPattern | None:
    """Return the fixed pattern seen in lit frames; None where too few frames share enough pixels.

    Each frame is given as recorded − predicted, predicted above black, and which pixels count, (H, W) each.
    """
    few = (slice(None, None, _EVERY),) * 2
    fine = [(_detail(rest, use)[few], level[few]) for rest, level, use in frames]
    pairs = [t for (a, x), (b, y) in combinations(fine, 2) if (t := _covariance(a * b, x * y)) is not None]
    if len(pairs) < 3:
        return None
    each = np.array(pairs)
    mean = each.mean(0)
    # A frame is part of several pairs: only as many pairs as frames are independent.
    sd = each.std(0, ddof=1) / np.sqrt(len(frames))
    one = np.sqrt(mean)
    each_sd = np.hypot(sd / (2 * np.sqrt(np.maximum(np.maximum(mean, sd), 1e-12))), _OF_PHOTO * one)
    dark, gain = (Figure(float(v), float(s)) for v, s in zip(one, each_sd, strict=True))
    return FixedPattern(dark, gain)


def pattern_figures(pattern: FixedPattern | None) -> tuple[NamedFigure, ...]:
    """Return the figures of the fixed pattern for twin.json; a lossy codec removes most of the pattern."""
    if pattern is None:
        return ()
    return (
        NamedFigure("dark_pattern_dn", pattern.dark.value, pattern.dark.sd, "grey levels"),
        NamedFigure("gain_pattern", pattern.gain.value, pattern.gain.sd, "relative"),
    )


def _detail(rest: Float32, use: Bool) -> Float32:
    """Return a residual (H, W) minus its local mean; NaN where not all pixels of the mean are in use."""
    size = (_AROUND_PX, _AROUND_PX)
    whole = cv2.erode(use.astype(np.uint8), np.ones(size, np.uint8)) > 0
    filled = np.where(use, np.nan_to_num(rest), np.float32(0))
    fine = filled - cv2.blur(filled, size)
    if whole.any():
        whole &= np.abs(fine) < _LARGEST * robust_spread(fine[whole].astype(float)) + 1e-6
    kept = np.float32(1 / np.sqrt(1 - 1 / _AROUND_PX**2))
    return np.asarray(np.where(whole, kept * fine, np.float32(np.nan)), np.float32)


def _covariance(product: Float32, levels: Float32) -> Float | None:
    """Return D² and G² fitted to products (H, W) of two frames' residuals over products of their levels."""
    known = np.isfinite(product)
    if known.sum() < _FEWEST_PIXELS:
        return None
    p, x = product[known].astype(float), levels[known].astype(float)
    edges = np.quantile(x, np.linspace(0, 1, _BINS + 1)[1:-1])
    cell = np.searchsorted(edges, x)
    count, spread = np.bincount(cell, minlength=_BINS), np.bincount(cell, p**2, _BINS)
    weight = count / np.sqrt(np.maximum(spread, 1e-12))
    mean = np.stack([np.bincount(cell, v, _BINS) / np.maximum(count, 1) for v in (x, p)])
    design = np.stack([np.ones(_BINS), mean[0]], 1) * weight[:, None]
    return np.asarray(nnls(design, mean[1] * weight)[0])
