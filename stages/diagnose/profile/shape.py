"""Whether the line is skewed: by the sheet itself, or by light that returns from within the wall."""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.robust import robust_spreads
from pipeline.arrays import Float
from pipeline.instrument.probe import Probe
from stages.diagnose.profile.cells import Cells
from stages.diagnose.profile.finding import Curve, Finding, Size, finding, untestable
from stages.diagnose.profile.geometry import LineGeometry
from stages.diagnose.profile.regression import Tested, regress, tested
from stages.diagnose.profile.skewed import cell_skewness, skew_table
from stages.diagnose.profile.width import scale_law

# Half a grey level of compression on one flank of a line 100 levels high, over its whole width.
HERMITE_FLOOR = 1e-3
# Change of (line σ / stated)² that image formation may cause across the image's scales. Debt: data/debts.md.
WIDTH_FLOOR = 0.05
_SMALLEST_BLUR_PX2 = 1 / 12
_CLEARLY = 3.0


def skew_findings(cells: Cells, geometry: LineGeometry, probe: Probe) -> tuple[Finding, Finding]:
    """Return the findings of `line_skew` and `subsurface`.

    Both are a line with an exponential tail of constant length in mm. The sheet's own skewness leaves its
    stated 1 σ as it is; light from within the wall adds its length's square to it.
    """
    coefficient = cell_skewness(cells)
    mean = regress(np.ones((len(coefficient), 1)), coefficient, cells.block)
    if not np.isfinite(mean.sigma[0]):
        why = "The line's middle clips or is not seen: its skewness cannot be told."
        return untestable("line_skew", why), untestable("subsurface", why)
    hermite = float(mean.coefficient[0])
    test = tested(hermite, float(mean.sigma[0]), HERMITE_FLOOR, mean.groups)
    tail = _Tail(cells, geometry, probe, hermite, test.sigma)
    return _judged(tail, test, _curve(cells, coefficient), geometry)


class _Tail:
    """The exponential tail that gives the mean skewness, and what the widths leave for it."""

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
        """Of a sheet of the stated 1 σ; forward positive, which is inward in the image."""
        value = 2 * (self.tau_mm / self.stated_mm) ** 3
        sigma = 3 * value * self.tau_sigma / max(self.tau_mm, 1e-9)
        return Size("skewness", "", -self.sign * value, sigma)

    @property
    def transport(self) -> Size:
        """Mean way within the wall."""
        return Size("transport_mm", "mm", self.tau_mm, self.tau_sigma)

    @property
    def fits_sheet(self) -> bool:
        """Whether the widths allow a sheet of the stated 1 σ."""
        return self._allows(1.0)

    @property
    def fits_wall(self) -> bool:
        """Whether the widths allow the stated sheet and the tail on top of it."""
        return self._allows(1 + (self.tau_mm / self.stated_mm) ** 2)

    def _allows(self, scale: float) -> bool:
        variance = max(float(self.covariance[0, 0]), 1e-300)
        off = abs(self.scale - scale) / np.hypot(np.sqrt(variance), WIDTH_FLOOR * max(scale, 1.0))
        rate = float(self.covariance[0, 1]) / variance
        left = self.blur_px2 + rate * (scale - self.scale)
        spread = np.sqrt(max(float(self.covariance[1, 1]) - rate**2 * variance, 0.0))
        return bool(off < _CLEARLY and left > _SMALLEST_BLUR_PX2 - _CLEARLY * max(spread, 0.05))


def _judged(tail: _Tail, test: Tested, curve: Curve, geometry: LineGeometry) -> tuple[Finding, Finding]:
    """Return both findings; one that the widths rule out keeps p = 1."""
    z, p = test.z, test.p_value
    side = "outside" if tail.sign > 0 else "inside"
    seen = f"The line has a longer tail on its {side}, {z:.1f} σ beyond compression."
    width = tail.scale
    sheet_only, wall_only = tail.fits_sheet and not tail.fits_wall, tail.fits_wall and not tail.fits_sheet
    sheet = finding(
        "line_skew", z, 1.0 if wall_only else p, (tail.skewness,),
        f"{seen} Skewness {tail.skewness.value:+.2f} of the sheet; variance {width:.2f} of the stated.",
        curve, _shift(tail, geometry, mean_kept=True), alike=() if sheet_only else ("subsurface",),
    )  # fmt: skip
    wall = finding(
        "subsurface", z, 1.0 if sheet_only else p, (tail.transport,),
        f"{seen} A tail {tail.tau_mm:.3f} mm long adds to it; variance {width:.2f} of the stated.",
        curve, _shift(tail, geometry, mean_kept=False), alike=() if wall_only else ("line_skew",),
    )  # fmt: skip
    return sheet, wall


def _shift(tail: _Tail, geometry: LineGeometry, *, mean_kept: bool) -> Float:
    """Return (F, S) by how much a Gaussian fit finds the line farther out than the sheet's own middle."""
    table = skew_table()
    centre = float(np.interp(tail.ratio, table.ratio, table.centre)) - (tail.ratio if mean_kept else 0.0)
    return np.asarray(tail.sign * centre / max(tail.ratio, 1e-9) * tail.tau_mm * geometry.px_per_mm)


def _curve(cells: Cells, coefficient: Float) -> Curve:
    """Return what Gaussian fits leave, mean over all cells, against the third Hermite function."""
    x = np.linspace(-4, 4, 33)
    w = cells.whole
    place = (cells.offset_px - cells.centre_px[w, None]) / cells.width_px[w, None]
    rest = np.array([np.interp(x, p, r) for p, r in zip(place, cells.rest[w], strict=True)])
    mean = np.median(rest, axis=0)
    sigma = robust_spreads(rest - mean, axis=0) / np.sqrt(max(len(rest), 1))
    predicted = np.nanmedian(coefficient) * (x**3 - 3 * x) * np.exp(-0.5 * x * x)
    return Curve(
        "What a Gaussian leaves of the line", "distance from the line, line widths", "share of the height",
        x, mean, sigma, predicted,
    )  # fmt: skip
