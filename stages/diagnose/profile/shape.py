"""Whether the line is skewed, by the sheet or by light from within the wall, and by how much.

The skewed line is modelled as the sum of a normal variable of 1 σ s and an exponential one of mean τ (the
simplest one-sided line: light that travels on in the sheet or in the wall). The result of a Gaussian fit to
it depends on τ/s only.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.probe import Probe
from stages.diagnose.profile.cells import CORE_REACH, Cells, LineGeometry, fit_gaussians
from stages.diagnose.profile.finding import Finding, Size, Tested, finding, regress, tested, untestable
from stages.diagnose.profile.line_spread import exponential_gaussian
from stages.diagnose.profile.width import scale_law

# Half a grey level of compression on one flank of a line 100 levels high, over its whole width.
HERMITE_FLOOR = 1e-3
# Change of (line σ / stated)² that image formation may cause across the scales of the image. Debt:
# data/debts.md.
WIDTH_FLOOR = 0.05
_SMALLEST_BLUR_PX2 = 1 / 12
_CLEARLY = 3.0
_RATIOS = np.linspace(0.0, 3.0, 61)
_SIGMA_PX, _REACH_PX, _STEP_PX = 1.2, 12.0, 0.05


def third_hermite(rest: Float, offset_px: Float, centre_px: Float, width_px: Float) -> Float:
    """Return the coefficient (N,) of He₃(x) exp(−x²/2) in the residual (N, B) of a unit Gaussian fit.

    A small third cumulant κ₃ gives κ₃ / 6w³. What the fit would absorb is removed from the template.
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
    """Return `third_hermite` (N,) of the cells, outward positive; NaN where the middle is not seen."""
    out = np.full(len(cells.whole), np.nan)
    w = cells.whole
    out[w] = third_hermite(cells.rest[w], cells.offset_px, cells.centre_px[w], cells.width_px[w])
    return out


@dataclass(frozen=True)
class SkewTable:
    """Results of a Gaussian fit to the skewed line with τ/s = ``ratio``, all (K,) and in units of s.

    ``hermite``: third coefficient; ``width``: fitted 1 σ.
    """

    ratio: Float
    hermite: Float
    width: Float


@cache
def skew_table() -> SkewTable:
    """Return the table; it is computed once."""
    t, sigma = np.arange(-_REACH_PX, _REACH_PX, _STEP_PX), np.array(_SIGMA_PX)
    profile = np.array([exponential_gaussian(t, sigma, k * sigma) for k in _RATIOS])
    profile /= profile.max(axis=1, keepdims=True)
    moved = np.array([t[int(np.argmax(p))] for p in profile])
    placed = np.array([np.interp(t + m, t, p) for p, m in zip(profile, moved, strict=True)])
    centre, width, peak = fit_gaussians(placed, t)
    rest = placed / peak[:, None] - np.exp(-0.5 * ((t - centre[:, None]) / width[:, None]) ** 2)
    hermite = third_hermite(rest, t, centre, width)
    return SkewTable(_RATIOS, hermite, width / _SIGMA_PX)


def skew_findings(cells: Cells, geometry: LineGeometry, probe: Probe) -> tuple[Finding, Finding]:
    """Return the findings of `line_skew` and `subsurface`.

    Both are a line with an exponential tail of constant length in mm. The sheet's own skewness leaves its
    stated 1 σ unchanged; light from within the wall adds the square of its length to the variance.
    """
    coefficient = cell_skewness(cells)
    mean = regress(np.ones((len(coefficient), 1)), coefficient, cells.block)
    if not np.isfinite(mean.sigma[0]):
        why = "The line's middle is clipped or not seen: its skewness cannot be measured."
        return untestable("line_skew", why), untestable("subsurface", why)
    hermite = float(mean.coefficient[0])
    test = tested(hermite, float(mean.sigma[0]), HERMITE_FLOOR, mean.groups)
    tail = _Tail(cells, geometry, probe, hermite, test.sigma)
    return _judged(tail, test)


class _Tail:
    """The exponential tail that explains the mean skewness, and whether the widths allow it."""

    def __init__(
        self, cells: Cells, geometry: LineGeometry, probe: Probe, hermite: float, hermite_sigma: float
    ) -> None:
        table, w = skew_table(), cells.whole
        self.sign = float(np.sign(hermite))
        self.ratio = self._ratio(abs(hermite))
        step = self._ratio(abs(hermite) + hermite_sigma) - self._ratio(max(abs(hermite) - hermite_sigma, 0.0))
        normal_px = cells.width_px[w] / np.interp(self.ratio, table.ratio, table.width)
        self.tau_mm = float(np.median(self.ratio * normal_px / cells.px_per_mm[w]))
        self.tau_sigma = float(step / 2 / max(self.ratio, 1e-6) * self.tau_mm)
        self.stated_mm = probe.laser.line_sigma_mm
        law = scale_law(cells, geometry, probe)
        whole = (1 + self.ratio**2) / float(np.interp(self.ratio, table.ratio, table.width)) ** 2
        self.scale, self.blur_px2 = whole * law.coefficient[:2]
        self.covariance = whole**2 * law.covariance[:2, :2]

    @staticmethod
    def _ratio(hermite: float) -> float:
        table = skew_table()
        return float(np.interp(hermite, table.hermite, table.ratio))

    @property
    def skewness(self) -> Size:
        """Skewness of a sheet of the stated 1 σ; forward positive, which is inward in the image."""
        value = 2 * (self.tau_mm / self.stated_mm) ** 3
        sigma = 3 * value * self.tau_sigma / max(self.tau_mm, 1e-9)
        return Size("skewness", "", -self.sign * value, sigma)

    @property
    def transport(self) -> Size:
        """Mean path within the wall."""
        return Size("transport_mm", "mm", self.tau_mm, self.tau_sigma)

    @property
    def fits_sheet(self) -> bool:
        """Whether the widths allow a sheet of the stated 1 σ."""
        return self._allows(1.0)

    @property
    def fits_wall(self) -> bool:
        """Whether the widths allow the stated sheet with the tail in addition."""
        return self._allows(1 + (self.tau_mm / self.stated_mm) ** 2)

    def _allows(self, scale: float) -> bool:
        variance = max(float(self.covariance[0, 0]), 1e-300)
        off = abs(self.scale - scale) / np.hypot(np.sqrt(variance), WIDTH_FLOOR * max(scale, 1.0))
        rate = float(self.covariance[0, 1]) / variance
        left = self.blur_px2 + rate * (scale - self.scale)
        spread = np.sqrt(max(float(self.covariance[1, 1]) - rate**2 * variance, 0.0))
        # 0.05 px² at least (chosen): a pixel's own variance, 1/12 px², is known no better.
        return bool(off < _CLEARLY and left > _SMALLEST_BLUR_PX2 - _CLEARLY * max(spread, 0.05))


def _judged(tail: _Tail, test: Tested) -> tuple[Finding, Finding]:
    """Return both findings; one that the widths exclude keeps p = 1."""
    z, p = test.z, test.p_value
    side = "outside" if tail.sign > 0 else "inside"
    seen = f"The line has a longer tail on its {side}, {z:.1f} σ beyond what compression leaves."
    width = tail.scale
    sheet_only, wall_only = tail.fits_sheet and not tail.fits_wall, tail.fits_wall and not tail.fits_sheet
    sheet = finding(
        "line_skew", z, 1.0 if wall_only else p, (tail.skewness,),
        f"{seen} The sheet's skewness would be {tail.skewness.value:+.2f}; the line's variance is "
        f"{width:.2f} of the stated one.",
        alike=() if sheet_only else ("subsurface",),
    )  # fmt: skip
    wall = finding(
        "subsurface", z, 1.0 if sheet_only else p, (tail.transport,),
        f"{seen} It is {tail.tau_mm:.3f} mm long; the line's variance is {width:.2f} of the stated one.",
        alike=() if wall_only else ("line_skew",),
    )  # fmt: skip
    return sheet, wall
