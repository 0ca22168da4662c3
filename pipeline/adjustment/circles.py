"""Fits circles to rings of points that mostly lie on a round wall."""

from __future__ import annotations

from dataclasses import dataclass, replace

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


@dataclass(frozen=True)
class _Rings:
    """Coordinates of the samples (F, A) of rings, their squared distance from the origin, and which count."""

    x: Float
    y: Float
    square: Float
    near: Bool

    @staticmethod
    def of(xy: Float, near: Bool) -> _Rings:
        x, y = xy[..., 0], xy[..., 1]
        return _Rings(x, y, x * x + y * y, near)

    def every(self, step: int) -> _Rings:
        """Return every so many samples."""
        some = slice(None, None, step)
        return _Rings(self.x[:, some], self.y[:, some], self.square[:, some], self.near[:, some])

    def fitted(self, weight: Float) -> Float:
        """Return Kåsa's terms (F, 3) of circles through samples of some weight (F, A)."""
        terms = (self.x, self.y, np.ones_like(weight))
        weighted = [weight * t for t in terms]
        normal = [[np.einsum("fa,fa->f", w, t) for t in terms] for w in weighted]
        right = [np.einsum("fa,fa->f", w, self.square) for w in weighted]
        return np.linalg.solve(np.moveaxis(np.array(normal), -1, 0), np.array(right).T[..., None])[..., 0]

    def off(self, found: Float) -> Float:
        """Return the algebraic distance (F, A), mm², of samples from their circles; NaN where none counts."""
        a, b, c = found.T[..., None]
        return np.where(self.near, self.square - (a * self.x + b * self.y + c), np.nan)


def _circles(xy: Float) -> tuple[Float, Float]:
    seen = np.asarray(np.isfinite(xy).all(-1))
    usable = seen.mean(1) > LEAST_COVERED
    out = np.full((len(xy), 3), np.nan)
    if usable.any():
        distance = np.where(seen, np.hypot(xy[..., 0], xy[..., 1]), np.nan)[usable]
        near = distance < _FARTHEST_SAMPLE * row_median(distance)[:, None]
        out[usable] = _robust_circles(_Rings.of(np.where(seen[..., None], xy, 0.0)[usable], near))
    centre = out[:, :2] / 2
    return centre, np.sqrt(out[:, 2] + np.sum(centre**2, 1))


def _robust_circles(rings: _Rings) -> Float:
    """Return Kåsa's three terms (F, 3) of circles through rings."""
    found, most = _start(rings.every(max(rings.near.shape[1] // _ENOUGH, 1)))
    error = rings.off(found)
    rings = replace(rings, near=np.abs(error) < most[:, None])
    error = np.where(rings.near, error, np.nan)
    for _ in range(_ROUNDS - 1):
        scale = np.maximum(robust_spreads(error, axis=1), 1e-6)[:, None]
        found = rings.fitted(rings.near / (1 + (np.nan_to_num(error) / (_OUTLYING * scale)) ** 2))
        error = rings.off(found)
    return found


def _start(rings: _Rings) -> tuple[Float, Float]:
    """Return circles through all samples, or through an arc if its circle clearly fits more samples.

    Also return the largest deviation, mm², of samples that are used: the many mirrored ones share another
    circle.
    """
    near, azimuths = rings.near, rings.near.shape[1]
    found, most = rings.fitted(near.astype(float)), np.full(len(near), np.inf)
    least = _CLEARLY * row_median(np.abs(rings.off(found)))
    for first in range(0, azimuths, max(azimuths // _ARCS, 1)):
        arc = np.zeros(azimuths, bool)
        arc[np.arange(first, first + azimuths // _ARC) % azimuths] = True
        enough = (near & arc).sum(1) > max(azimuths // _ARC / 2, _FEWEST)
        other = rings.fitted(np.where(enough[:, None], near & arc, near).astype(float))
        off = rings.off(other)
        size = row_median(np.abs(off))
        better = enough & (size < least)
        found[better], least[better] = other[better], size[better]
        most[better] = _AMONG * robust_spreads(off[better][:, arc], axis=1)
    return found, most
