"""A Gaussian with a one-sided exponential tail, as a Gaussian fit sees it.

The skewed line is a normal of 1 σ s and an exponential of mean τ added (the simplest one-sided line: light
that travels on in the sheet's profile or in the wall). All that a fit makes of it depends on τ/s alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import erfcx

from pipeline.arrays import Float
from stages.diagnose.profile.cells import CORE_REACH, Cells, fit_gaussians

_RATIOS = np.linspace(0.0, 3.0, 61)
_SIGMA_PX, _REACH_PX, _STEP_PX = 1.2, 12.0, 0.05


def third_hermite(rest: Float, offset_px: Float, centre_px: Float, width_px: Float) -> Float:
    """Return (N,) the coefficient of He₃(x) exp(−x²/2) in what a Gaussian fit of unit height leaves (N, B).

    A small third cumulant κ₃ gives κ₃ / 6w³. What the fit would absorb is taken out of the template.
    """
    x = (offset_px - centre_px[:, None]) / width_px[:, None]
    e = np.exp(-0.5 * x * x) * (np.abs(x) < CORE_REACH)
    tangent = np.stack([e, x * e, x * x * e], axis=-1)
    template = (x**3 - 3 * x) * e
    gram = np.einsum("nbi,nbj->nij", tangent, tangent)
    taken = np.linalg.solve(gram, np.einsum("nbi,nb->ni", tangent, template)[..., None])
    template = template - (tangent @ taken)[..., 0]
    return np.asarray(np.sum(template * np.where(e > 0, rest, 0.0), axis=1) / np.sum(template**2, axis=1))


def cell_skewness(cells: Cells) -> Float:
    """Return (N,) `third_hermite` of the cells, outward positive; NaN where the middle is not seen."""
    out = np.full(len(cells.whole), np.nan)
    w = cells.whole
    out[w] = third_hermite(cells.rest[w], cells.offset_px, cells.centre_px[w], cells.width_px[w])
    return out


@dataclass(frozen=True)
class SkewTable:
    """What a Gaussian fit makes of the skewed line with τ/s = ``ratio``, all (K,) and in units of s.

    ``hermite``: third coefficient; ``width``: fitted 1 σ; ``centre``: fitted centre from the normal's.
    """

    ratio: Float
    hermite: Float
    width: Float
    centre: Float


@cache
def skew_table() -> SkewTable:
    """Return the table; it is computed once."""
    t = np.arange(-_REACH_PX, _REACH_PX, _STEP_PX)
    profile = np.array([exponential_gaussian(t, _SIGMA_PX, k * _SIGMA_PX) for k in _RATIOS])
    profile /= profile.max(axis=1, keepdims=True)
    moved = np.array([t[int(np.argmax(p))] for p in profile])
    placed = np.array([np.interp(t + m, t, p) for p, m in zip(profile, moved, strict=True)])
    centre, width, peak = fit_gaussians(placed, t)
    rest = placed / peak[:, None] - np.exp(-0.5 * ((t - centre[:, None]) / width[:, None]) ** 2)
    hermite = third_hermite(rest, t, centre, width)
    return SkewTable(_RATIOS, hermite, width / _SIGMA_PX, (centre + moved) / _SIGMA_PX)


def exponential_gaussian(t: Float, sigma: float, tau: float) -> Float:
    """Return the density (...) of a normal of 1 σ ``sigma`` at 0 plus an exponential of mean ``tau``."""
    normal = np.exp(-0.5 * (t / sigma) ** 2)
    if tau < 1e-3 * sigma:
        return np.asarray(normal / (sigma * np.sqrt(2 * np.pi)))
    argument = (sigma / tau - t / sigma) / np.sqrt(2)
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = normal * erfcx(argument)
        tail = 2 * np.exp(0.5 * (sigma / tau) ** 2 - t / tau)
    return np.asarray(np.where(np.isfinite(scaled), scaled, tail) / (2 * tau))
