"""Photometry from the overlap of frames: variations with the place in the image are light, not wall.

Model: log I = log ρ(cell) + log E(point, normal) + f(θ) + g(θ, φ) + log gain(frame), with ρ free in every
cell, f and g hat functions over polar angle and image azimuth, all but ρ with weak priors at zero. Least
squares with Huber weights; the cells are eliminated (Schur complement), so that only light and gains are
solved for. A long pipe is photographed stretch by stretch: each has its own light, joined to the next by
shared views.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float, Int
from pipeline.instrument.probe import Probe
from stages.texture.light import LightField
from stages.texture.sampling import LightSamples
from stages.texture.views import TileViews

_THETA_KNOTS = 9
_AZIMUTH_KNOTS = 12
# 1 σ of log brightness: prior of f, of g, of g's steps and of gains; of one sample.
_SIGMA_THETA, _SIGMA_AROUND, _SIGMA_STEP, _SIGMA_GAIN, _SIGMA_SAMPLE = 1.0, 0.05, 0.05, 0.05, 0.05
_ITERATIONS = 4
_FEWEST = 20
_STANDSTILL_CELLS = 1e-3
# Polar angles at which the lights of neighbouring stretches are compared.
_ANGLES = 32


@dataclass(frozen=True)
class Light:
    """Light over the image, exposure of the views, and the residual of the samples.

    Attributes
    ----------
    field : LightField
    gain : (V,)
        Exposure of each view; NaN where a view gave too few samples.
    residual : float
        Robust 1 σ of the samples' relative brightness after the fit.
    """

    field: LightField
    gain: Float
    residual: float


def solve_light(samples: LightSamples, views: int, probe: Probe, reference: float) -> Light:
    """Separate light from wall.

    Parameters
    ----------
    samples
        Samples of wall cells in frames.
    views
        Number of views.
    probe
        Its lighting is the model that is corrected.
    reference
        Irradiance that counts as 1.
    """
    count = np.bincount(samples.view, minlength=views)
    if not len(samples.log_ratio):
        flat = LightField(probe.lighting, 0.0, 1.0, np.zeros((2, 1)), reference)
        return Light(flat, np.full(views, np.nan), float("nan"))
    theta_from = float(samples.theta_rad.min())
    theta_step = max(float(np.ptp(samples.theta_rad)) / (_THETA_KNOTS - 1), 1e-6)
    design = _design(samples, views, theta_from, theta_step)
    _, cell = np.unique(samples.cell, return_inverse=True)
    level = float(np.median(samples.log_ratio))
    along = _along(samples, views)
    solution, residual = _solve_robust(design, cell, samples.log_ratio - level, _prior(views), along)
    f = solution[:_THETA_KNOTS]
    g = solution[_THETA_KNOTS:-views].reshape(_THETA_KNOTS, _AZIMUTH_KNOTS)
    field = LightField(probe.lighting, theta_from, theta_step, f[:, None] + g, reference)
    return Light(field, np.where(count >= _FEWEST, np.exp(solution[-views:]), np.nan), residual)


def _design(samples: LightSamples, views: int, theta_from: float, theta_step: float) -> sparse.csr_array:
    """Return (N, T + T P + views): hats f(θ), hats g(θ, φ), one column per view."""
    row = np.clip((samples.theta_rad - theta_from) / theta_step, 0, _THETA_KNOTS - 1 - 1e-9)
    column = np.mod((samples.azimuth_rad + np.pi) / (2 * np.pi), 1.0) * _AZIMUTH_KNOTS
    i, j = row.astype(int), column.astype(int) % _AZIMUTH_KNOTS
    u, v = row - i, column - np.floor(column)
    j1 = (j + 1) % _AZIMUTH_KNOTS
    first = _THETA_KNOTS + i * _AZIMUTH_KNOTS
    index = [i, i + 1, first + j, first + j1, first + _AZIMUTH_KNOTS + j, first + _AZIMUTH_KNOTS + j1]
    value = [1 - u, u, (1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v]
    index.append(_THETA_KNOTS * (1 + _AZIMUTH_KNOTS) + samples.view)
    value.append(np.ones_like(u))
    shape = (len(u), _THETA_KNOTS * (1 + _AZIMUTH_KNOTS) + views)
    rows = np.tile(np.arange(len(u)), len(index))
    return sparse.csr_array((np.concatenate(value), (rows, np.concatenate(index))), shape=shape)


def _along(samples: LightSamples, views: int) -> Float:
    """Return the distance along the wall of each view (V,), with zero mean; all equal when nothing moved.

    A wall that becomes brighter along the pipe, a light that falls off less and an exposure that decreases
    from frame to frame explain the same pictures: exposure is assumed to have no trend over this distance.
    """
    count = np.bincount(samples.view, minlength=views)
    mean = np.bincount(samples.view, samples.cell, minlength=views) / np.maximum(count, 1)
    centred = np.where(count > 0, mean - mean[count > 0].mean(), 0.0)
    if float(np.linalg.norm(centred)) < _STANDSTILL_CELLS:
        centred = np.ones(views)
    return np.asarray(centred / np.linalg.norm(centred))


def _prior(views: int) -> sparse.csc_array:
    """Return the prior's information matrix."""
    around = np.arange(_THETA_KNOTS * _AZIMUTH_KNOTS).reshape(_THETA_KNOTS, _AZIMUTH_KNOTS)
    pairs = np.concatenate(
        [
            np.stack([around, np.roll(around, -1, 1)], -1).reshape(-1, 2),
            np.stack([around[:-1], around[1:]], -1).reshape(-1, 2),
        ]
    )
    steps = np.zeros((len(pairs), around.size))
    steps[np.arange(len(pairs)), pairs[:, 0]], steps[np.arange(len(pairs)), pairs[:, 1]] = -1, 1
    smooth = steps.T @ steps / _SIGMA_STEP**2 + np.eye(around.size) / _SIGMA_AROUND**2
    theta = np.eye(_THETA_KNOTS) / _SIGMA_THETA**2
    gain = sparse.eye_array(views) / _SIGMA_GAIN**2
    return sparse.csc_array(sparse.block_diag([theta, smooth, gain]))


def _solve_robust(
    design: sparse.csr_array, cell: Int, value: Float, prior: sparse.csc_array, along: Float
) -> tuple[Float, float]:
    """Return the solution of the reduced normal equations with Huber weights, and the robust residual.

    The gains, the last unknowns, are kept orthogonal to ``along`` by a Lagrange multiplier.
    """
    border = sparse.csc_array(np.concatenate([np.zeros(design.shape[1] - len(along)), along])[:, None])
    weight = np.ones(len(value))
    cells = sparse.csr_array((np.ones(len(cell)), (np.arange(len(cell)), cell)))
    for _ in range(_ITERATIONS):
        weighted = cells.T * weight
        total = np.bincount(cell, weight)
        crossed = weighted @ design
        shrunk = crossed.T * (1 / total)
        mean = weighted @ value
        matrix = (design.T * weight) @ design - shrunk @ crossed + prior * _SIGMA_SAMPLE**2
        bordered = sparse.block_array([[matrix, border], [border.T, None]], format="csc")
        solution = spsolve(bordered, np.append(design.T @ (weight * value) - shrunk @ mean, 0.0))[:-1]
        rest = value - design @ solution
        rest -= ((weighted @ rest) / total)[cell]
        residual = robust_spread(rest)
        weight = np.minimum(1, (1.345 * residual + 1e-6) / np.maximum(np.abs(rest), 1e-12))
    return np.asarray(solution), residual


@dataclass(frozen=True)
class TextureStretch:
    """Consecutive tiles, and the views (W,) that they use, ascending."""

    tiles: range
    wanted: Int


def cut_plan(plan: Sequence[TileViews], views_at_once: int) -> list[TextureStretch]:
    """Return stretches of tiles that use about ``views_at_once`` views; a short pipe is one stretch."""
    stretches: list[TextureStretch] = []
    first, wanted = 0, np.zeros(0, np.int64)
    for tile, chosen in enumerate(plan):
        both = np.union1d(wanted, chosen.views)
        if len(both) > views_at_once and tile > first:
            stretches.append(TextureStretch(range(first, tile), wanted))
            first, both = tile, np.unique(chosen.views)
        wanted = both
    return [*stretches, TextureStretch(range(first, len(plan)), wanted)]


class LightChain:
    """The lights of stretches, each as bright as the one before it in the views that both use.

    The first is as bright as recorded where the median view sees the laser ring, at ``ring_polar_rad``.

    Attributes
    ----------
    gain : (V,)
        Exposure of every view, from the last stretch that uses it; NaN without one.
    wanted : (W,) int
        Views of all stretches so far.
    """

    def __init__(self, views: int, probe: Probe, ring_polar_rad: float) -> None:
        self._probe, self._ring_polar_rad = probe, ring_polar_rad
        self._before: Light | None = None
        self._residuals: list[float] = []
        self.gain: Float = np.full(views, np.nan)
        self.wanted: Int = np.zeros(0, np.int64)

    def add(self, samples: LightSamples, wanted: Int, reference: float) -> Light:
        """Return the light of a stretch, with the exposures of all views (V,); NaN beyond the stretch."""
        found = solve_light(samples, len(wanted), self._probe, reference)
        gain = np.full(len(self.gain), np.nan)
        gain[wanted] = found.gain
        light = replace(found, gain=gain)
        if self._before is None:
            light = _one_at(light, self._ring_polar_rad)
        else:
            light = replace(light, gain=gain * _ratio(self._before, light))
        self._before = light
        self._residuals.append(light.residual)
        self.gain[wanted] = light.gain[wanted]
        self.wanted = np.union1d(self.wanted, wanted)
        return light

    @property
    def residual(self) -> float:
        """Robust 1 σ of relative brightness after the fit, median over the stretches."""
        return float(np.median(self._residuals))


def _one_at(light: Light, polar_rad: float) -> Light:
    """Return the light with a brightness of 1 at a polar angle in the median view.

    Wall, light and exposures are known up to common factors, which are chosen so that the wall's photo is as
    bright as the recording.
    """
    if not np.isfinite(light.gain).any():
        return light
    level = float(_course(light.field, np.array([polar_rad]))[0])
    field = replace(light.field, log_correction=light.field.log_correction - level)
    return replace(light, field=field, gain=light.gain / np.nanmedian(light.gain))


def _ratio(before: Light, light: Light) -> float:
    """Return the ratio of the shared views' exposures to those in the light before; 1 if none is shared."""
    shared = np.isfinite(before.gain) & np.isfinite(light.gain)
    if not shared.any():
        return 1.0
    exposure = np.median(np.log(before.gain[shared]) - np.log(light.gain[shared]))
    ends = [(f.theta_from, f.theta_from + f.theta_step * (len(f.log_correction) - 1))
            for f in (before.field, light.field)]  # fmt: skip
    theta = np.linspace(max(e[0] for e in ends), min(e[1] for e in ends), _ANGLES)
    return float(np.exp(exposure + np.mean(_course(before.field, theta) - _course(light.field, theta))))


def _course(field: LightField, theta: Float) -> Float:
    """Return the correction's mean around the image at polar angles."""
    at = field.theta_from + field.theta_step * np.arange(len(field.log_correction))
    return np.asarray(np.interp(theta, at, field.log_correction.mean(1)))
