"""Fits circles to rings of points that mostly lie on a round wall."""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.robust import robust_spreads, row_median
from pipeline.arrays import Bool, Float, Float32

LEAST_COVERED = 0.3
"""Share of the circle that a ring must show to have a centre. Not measured."""
_AT_ONCE = 256
_ROUNDS = 5
"""Number of fits of a circle, each weighted by the residuals of the one before. Chosen: not measured on any
set of rings."""
_OUTLYING = 3.0
"""Spreads at which a sample has half its weight in the fit of a circle. Not measured."""
_FARTHEST_SAMPLE = 2.0
"""Median distances from the camera's axis up to which a sample may lie on a ring's circle: of a camera 0.6
radii off the pipe's axis the farthest lies at 1.65. Lines mirrored far away lie a hundred times as far."""
_ARCS, _ARC = 8, 3
"""Arcs, each a third of the circle, whose circles are tried: standing water mirrors up to half of a ring, and
two of the eight lie in the other half."""
_ENOUGH = 180
"""Number of samples of a ring that are enough to choose the arc."""
_FEWEST = 9
"""Fewest samples of an arc for an estimate of its spread, well above the three fitted terms."""
_AMONG = 10.0
"""Spreads of the arc within which samples all around are on its circle. A choice: it leaves room for an oval
pipe, and a mirrored line passes it within some degrees of the water."""
_CLEARLY = 0.5
"""Largest median error of the arc's circle, as a part of that of the circle through all samples. A choice:
with a fifth of the samples elsewhere, Cauchy's weights find the circle by themselves."""


def circles_through(xy: Float32) -> tuple[Float, Float]:
    """Return centre (F, 2) and radius (F,) of rings (F, A, 2); NaN where one covers too little of its circle.

    The fit is algebraic (Kåsa 1976) and reweighted, as a wall is round to some 0.1 mm.
    """
    parts = [_circles(xy[a : a + _AT_ONCE].astype(float)) for a in range(0, len(xy), _AT_ONCE)]
    centre, radius = (np.concatenate(p) for p in zip(*parts, strict=True))
    return centre, radius


def _circles(xy: Float) -> tuple[Float, Float]:
    seen = np.asarray(np.isfinite(xy).all(-1))
    usable = seen.mean(1) > LEAST_COVERED
    out = np.full((len(xy), 3), np.nan)
    if usable.any():
        distance = np.where(seen, np.linalg.norm(xy, axis=-1), np.nan)[usable]
        near = distance < _FARTHEST_SAMPLE * row_median(distance)[:, None]
        out[usable] = _robust_circles(np.where(seen[..., None], xy, 0.0)[usable], near)
    centre = out[:, :2] / 2
    return centre, np.sqrt(out[:, 2] + np.sum(centre**2, 1))


def _robust_circles(xy: Float, near: Bool) -> Float:
    """Return Kåsa's three terms (F, 3) of circles through the ``near`` samples (F, A) of rings (F, A, 2)."""
    every = max(near.shape[1] // _ENOUGH, 1)
    found, most = _start(xy[:, ::every], near[:, ::every])
    error = _off(xy, found, near)
    near = np.abs(error) < most[:, None]
    error = np.where(near, error, np.nan)
    for _ in range(_ROUNDS - 1):
        scale = np.maximum(robust_spreads(error, axis=1), 1e-6)[:, None]
        found = _fitted(xy, near / (1 + (np.nan_to_num(error) / (_OUTLYING * scale)) ** 2))
        error = _off(xy, found, near)
    return found


def _start(xy: Float, near: Bool) -> tuple[Float, Float]:
    """Return circles through all samples, or through an arc if its circle clearly fits more samples.

    Also return the largest deviation, mm², of samples that are used: the many mirrored ones share another
    circle.
    """
    found, azimuths = _fitted(xy, near), near.shape[1]
    most = np.full(len(xy), np.inf)
    least = _CLEARLY * row_median(np.abs(_off(xy, found, near)))
    for first in range(0, azimuths, max(azimuths // _ARCS, 1)):
        arc = np.zeros(azimuths, bool)
        arc[np.arange(first, first + azimuths // _ARC) % azimuths] = True
        enough = (near & arc).sum(1) > max(azimuths // _ARC / 2, _FEWEST)
        other = _fitted(xy, np.where(enough[:, None], near & arc, near))
        off = _off(xy, other, near)
        size = row_median(np.abs(off))
        better = enough & (size < least)
        found[better], least[better] = other[better], size[better]
        most[better] = _AMONG * robust_spreads(off[better][:, arc], axis=1)
    return found, most


def _fitted(xy: Float, weight: Float | Bool) -> Float:
    """Return Kåsa's terms (F, 3) of weighted circles."""
    design = np.concatenate([xy, np.ones_like(xy[..., :1])], -1)
    weighted = np.swapaxes(design * weight[..., None], 1, 2)
    right = weighted @ np.sum(xy * xy, -1)[..., None]
    return np.asarray(np.linalg.solve(weighted @ design, right)[..., 0])


def _off(xy: Float, found: Float, near: Bool) -> Float:
    """Return the algebraic distance (F, A), mm², of ``near`` samples from their circles; NaN for others."""
    on_circle = np.einsum("fai,fi->fa", xy, found[:, :2]) + found[:, 2:]
    return np.where(near, np.sum(xy * xy, -1) - on_circle, np.nan)
