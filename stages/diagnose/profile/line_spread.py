"""The actual shape of the line, and the named shapes that fit it.

First the line is estimated freely: its mean profile at each of a few distances to the wall, of any shape.
Then the shapes known to physics are fitted to it, each together with ordinary image formation: a Gaussian
line and a symmetric skirt. Each is judged by the share of the misfit that it leaves: a shape that leaves much
is no explanation, however clearly it improves the fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.optimize import least_squares
from scipy.special import erfcx

from pipeline.arrays import Bool, Float
from stages.diagnose.profile.cells import Cells, fit_gaussians

# Each contains a third of the blocks: near, middle and far wall.
_DISTANCES = 3
_REACH_PX, _STEP_PX = 24.0, 0.5
# What codec and lens leave in the mean profile of a line without any effect, relative to its height; the
# skirt is fitted and not included. Debt: data/debts.md.
SHAPE_FLOOR = 1e-3
# A shape that leaves more than this share of the misfit does not fit. Debt: data/debts.md.
MOST_LEFT = 0.05
# Two shapes are not distinguished if their misfits differ by less than this, in units of what the better one
# leaves per value: a likelihood ratio of e¹⁰.
_TOLD_APART = 20.0
_STARTS_MM = (0.3, 0.8, 1.6, 3.0)


class Shape(StrEnum):
    """Shapes of a line that is not a Gaussian."""

    TAIL = "exponential tail"
    COPY = "second line as sharp as the first"
    HALO = "second line that is washed out"


@dataclass(frozen=True)
class LineSpread:
    """The line's mean profile at D distances to the wall, estimated freely.

    Attributes
    ----------
    offset_px : (B,)
        From the line, outward positive.
    px_per_mm : (D,)
        Outward shift of the image for 1 mm back along the axis.
    profile, sigma : (D, B)
        Light relative to the line's height, and its 1 σ from leaving out parts of the ring.
    """

    offset_px: Float
    px_per_mm: Float
    profile: Float
    sigma: Float


@dataclass(frozen=True)
class Fitted:
    """A shape fitted to the line's profile.

    Attributes
    ----------
    relative : float
        Height of the second line relative to the first; for a tail, its share of the light, 1.
    way_mm : float
        Distance of the second line, or mean length of the tail; forward positive.
    spread_mm : float
        1 σ by which the second line is wider than the first.
    left : float
        Share of the misfit of an ordinary line that remains.
    core : float
        Variance of the line without what the shape adds, over that of a Gaussian fitted to all of it.
    width_mm : float
        1 σ of the line without what the shape adds, with the blur of the image, as a length of the wall.
    """

    shape: Shape
    relative: float
    way_mm: float
    spread_mm: float
    way_sigma_mm: float
    left: float
    core: float
    width_mm: float

    @property
    def added_mm2(self) -> float:
        """Return the variance, mm², that the shape adds to the line's."""
        if self.shape is Shape.TAIL:
            return self.way_mm**2
        light = self.relative * np.hypot(self.width_mm, self.spread_mm) / self.width_mm
        share = light / (1 + light)
        return float(share * self.spread_mm**2 + share * (1 - share) * self.way_mm**2)


def line_spread(cells: Cells) -> LineSpread:
    """Return the free estimate from the cells whose middle is unclipped."""
    offset = np.arange(-_REACH_PX, _REACH_PX + _STEP_PX / 2, _STEP_PX)
    rows = [r for r in _by_distance(cells) if len(np.unique(cells.part[r])) > 2]
    each = [_mean_profile(cells, r, offset) for r in rows]
    return LineSpread(
        offset, np.array([np.median(cells.px_per_mm[r]) for r in rows]),
        np.array([e[0] for e in each]).reshape(-1, len(offset)),
        np.array([e[1] for e in each]).reshape(-1, len(offset)),
    )  # fmt: skip


def without_mean_shape(cells: Cells) -> Cells:
    """Return the cells minus the mean residual of a Gaussian at each distance."""
    mean = np.zeros_like(cells.rest)
    for rows in _by_distance(cells):
        mean[rows] = np.median(cells.rest[rows], axis=0) if rows.any() else 0.0
    return cells.less(mean[cells.whole])


def _by_distance(cells: Cells) -> list[Bool]:
    """Return the whole cells (N,) of the blocks with the farthest, the middle, and the nearest wall."""
    scale = np.array([np.median(cells.px_per_mm[cells.block == b]) for b in range(len(cells.frames))])
    third = np.argsort(np.argsort(scale)) * _DISTANCES // max(len(scale), 1)
    return [cells.whole & (third[cells.block] == k) for k in range(_DISTANCES)]


def _mean_profile(cells: Cells, rows: Bool, offset: Float) -> tuple[Float, Float]:
    """Return the mean profile (B,) about the line's middle, and its 1 σ from parts of the ring."""
    place = cells.offset_px - cells.centre_px[rows, None]
    value = np.array([np.interp(offset, p, v) for p, v in zip(place, cells.profile[rows], strict=True)])
    part = cells.part[rows]
    means = np.array([value[part == p].mean(0) for p in np.unique(part)])
    spread = means.std(0, ddof=1) / np.sqrt(len(means))
    return means.mean(0), np.hypot(spread, SHAPE_FLOOR)


def explanations(spread: LineSpread) -> tuple[Fitted, ...]:
    """Return the shapes that fit and cannot be distinguished, the best first; none where no shape fits.

    A blurred second line includes the sharp one as a special case, and resembles the tail: it counts only
    where both of them fit clearly worse.
    """
    plain = _Fit(spread, None, np.zeros(0))
    tried = sorted((_best(spread, shape) for shape in Shape), key=lambda f: f.misfit)
    noise = float(spread.profile.size)
    unit = max(tried[0].misfit / noise, 1.0)
    near = [t for t in tried if t.misfit - tried[0].misfit < _TOLD_APART * unit]
    simple = [t for t in near if t.shape is not Shape.HALO] or near
    removable = max(plain.misfit - noise, 1e-9)
    fitted = [t.fitted(max(t.misfit - noise, 0.0) / removable) for t in simple]
    return tuple(f for f in fitted if f.left < MOST_LEFT)


def _best(spread: LineSpread, shape: Shape) -> _Fit:
    return min((_Fit(spread, shape, start) for start in _starts(shape)), key=lambda f: f.misfit)


def _starts(shape: Shape) -> list[Float]:
    ways = [s * w for w in _STARTS_MM for s in (-1, 1)]
    match shape:
        case Shape.TAIL:
            return [np.array([w]) for w in ways[:4]]
        case Shape.COPY:
            return [np.array([0.1, w]) for w in ways]
        case Shape.HALO:
            return [np.array([0.1, w, 0.3]) for w in ways]


class _Fit:
    """Least squares of one shape: height, place, ln width by distance; the skirt; the shape's parameters."""

    def __init__(self, spread: LineSpread, shape: Shape | None, start: Float) -> None:
        self.spread, self.shape, self.count = spread, shape, len(spread.px_per_mm)
        own = np.tile([1.0, 0.0, np.log(1.2)], self.count)
        first = np.concatenate([own, [0.005, np.log(4.0)], start])
        done = least_squares(self._residual, first, x_scale="jac", max_nfev=60)
        self.parameters, self.misfit = done.x, 2 * float(done.cost)
        unit = max(self.misfit / spread.profile.size, 1.0)
        jacobian: Float = np.asarray(done.jac)
        self.covariance = unit * np.linalg.pinv(jacobian.T @ jacobian)

    def _residual(self, parameters: Float) -> Float:
        return np.asarray(((self.model(parameters) - self.spread.profile) / self.spread.sigma).ravel())

    def model(self, parameters: Float) -> Float:
        """Return the profile (D, B)."""
        height, place, log_width = parameters[: 3 * self.count].reshape(-1, 3).T[..., None]
        skirt, log_skirt = parameters[3 * self.count : 3 * self.count + 2]
        x, width = self.spread.offset_px - place, np.exp(np.clip(log_width, -1.5, 2.0))
        line = self._line(x, width, parameters[3 * self.count + 2 :])
        return np.asarray(
            height * (line + skirt * np.exp(-0.5 * (x / np.exp(np.clip(log_skirt, 0.5, 3))) ** 2))
        )

    def _line(self, x: Float, width: Float, numbers: Float) -> Float:
        if self.shape is None:
            return np.asarray(np.exp(-0.5 * (x / width) ** 2))
        scale = self.spread.px_per_mm[:, None]
        if self.shape is Shape.TAIL:
            # Forward along the axis is inward in the image.
            way = float(numbers[0])
            return exponential_gaussian(-np.sign(way) * x, width, abs(way) * scale)
        relative, way, *more = numbers
        wide = np.sqrt(width**2 + ((more[0] if more else 0.0) * scale) ** 2)
        return np.asarray(
            np.exp(-0.5 * (x / width) ** 2) + relative * np.exp(-0.5 * ((x + way * scale) / wide) ** 2)
        )

    def fitted(self, left: float) -> Fitted:
        """Return the fitted shape."""
        assert self.shape is not None
        numbers = self.parameters[3 * self.count + 2 :]
        relative, way = (1.0, numbers[0]) if self.shape is Shape.TAIL else numbers[:2]
        wider = abs(float(numbers[2])) if self.shape is Shape.HALO else 0.0
        at = 3 * self.count + (2 if self.shape is Shape.TAIL else 3)
        log_width = self.parameters[2 : 3 * self.count : 3]
        _, width, _ = fit_gaussians(self.spread.profile, self.spread.offset_px)
        core = float(np.median(np.exp(2 * log_width) / width**2))
        width_mm = float(np.median(np.exp(log_width) / self.spread.px_per_mm))
        sigma = float(np.sqrt(self.covariance[at, at]))
        return Fitted(self.shape, float(relative), float(way), wider, sigma, left, core, width_mm)


def exponential_gaussian(t: Float, sigma: Float, tau: Float) -> Float:
    """Return the density (...) of a normal variable (0 ± ``sigma``) plus an exponential one (``tau``)."""
    normal = np.exp(-0.5 * (t / sigma) ** 2)
    tau = np.maximum(tau, 1e-3 * sigma)
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = normal * erfcx((sigma / tau - t / sigma) / np.sqrt(2))
        tail = 2 * np.exp(0.5 * (sigma / tau) ** 2 - t / tau)
    return np.asarray(np.where(np.isfinite(scaled), scaled, tail) / (2 * tau))
