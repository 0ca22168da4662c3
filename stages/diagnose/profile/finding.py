"""The result of one test of the line's light, and the robust regression that most tests use."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float, Int
from pipeline.physics.effect import FixedTo
from stages.diagnose.agreement import Agreement

# An effect is found if p is below one in ten million by the estimate's own σ, and if it exceeds the errors of
# image formation by this many σ. Debt: data/debts.md.
FOUND_P, FOUND_Z = 1e-7, 6.0
# Effects that are tested at fixed pixels or azimuths of the image while the pipe moves past.
_OF_THE_SENSOR = frozenset({"fixed_pattern", "pixel_locking", "dust", "vignetting", "saturation"})
_TUNING = 4.685
_STEPS = 8


@dataclass(frozen=True)
class Regression:
    """Coefficients (K,), their covariance (K, K) by leaving out groups, and the number of groups."""

    coefficient: Float
    covariance: Float
    groups: int

    @property
    def sigma(self) -> Float:
        """(K,) 1 σ."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance)))

    def test(self, place: int, floor: float, stated: float = 0.0) -> Tested | None:
        """Test a coefficient against its ``stated`` value; None where it is not determined."""
        sigma = float(self.sigma[place])
        off = float(self.coefficient[place]) - stated
        return tested(off, sigma, floor, self.groups) if np.isfinite(sigma) else None

    def test_wave(self, floor: float) -> Tested | None:
        """Test the amplitude of the first two coefficients, of a cosine and a sine, against zero."""
        size = float(np.hypot(*self.coefficient[:2]))
        sigma = float(np.sqrt(np.trace(self.covariance[:2, :2]) / 2))
        return tested(size, sigma, floor, self.groups) if np.isfinite(sigma) else None


def regress(design: Float, value: Float, group: Int) -> Regression:
    """Fit ``value`` (...) by ``design`` (..., K) with biweights; σ by the jackknife over ``group`` (...).

    Groups must be far enough apart for independent errors; a ``group`` with fewer axes than ``value`` applies
    to all of its remaining ones. Values that are not finite, or of a negative group, are left out.
    """
    group = np.broadcast_to(
        group.reshape(*group.shape, *[1] * (value.ndim - group.ndim)), value.shape
    ).ravel()
    design, value = design.reshape(-1, design.shape[-1]), value.ravel()
    known = (group >= 0) & np.isfinite(value) & np.isfinite(design).all(1)
    x, y, g = design[known], value[known], group[known]
    names = np.unique(g)
    width = x.shape[1]
    if len(names) < 3 or len(y) <= 2 * width:
        return Regression(np.full(width, np.nan), np.full((width, width), np.nan), len(names))
    weight = _biweights(x, y)
    parts = [
        (x[s].T @ (weight[s, None] * x[s]), x[s].T @ (weight[s] * y[s])) for s in (g == n for n in names)
    ]
    normal, right = sum(p[0] for p in parts), sum(p[1] for p in parts)
    best = _solve(normal, right)
    left = np.array([_solve(normal - a, right - b) for a, b in parts]) - best
    return Regression(best, (len(names) - 1) / len(names) * left.T @ left, len(names))


@dataclass(frozen=True)
class Tested:
    """An estimate tested against zero: its σ, its ratio to σ, and the two-sided p-value."""

    sigma: float
    z: float
    p_value: float


def tested(estimate: float, random: float, floor: float, groups: int) -> Tested:
    """Test an estimate whose 1 σ ``random`` was estimated from ``groups`` groups; its ``floor`` is known.

    Student's t with Welch and Satterthwaite's degrees of freedom; the known floor has infinitely many.
    """
    variance = random**2 + floor**2
    sigma = float(np.sqrt(variance))
    freedom = max(groups - 1, 1) * (variance / max(random**2, 1e-12 * variance)) ** 2
    z = float(estimate / sigma)
    return Tested(sigma, z, float(2 * student.sf(abs(z), freedom)))


def _biweights(x: Float, y: Float) -> Float:
    weight = np.ones(len(y))
    for _ in range(_STEPS):
        rest = y - x @ _solve(x.T @ (weight[:, None] * x), x.T @ (weight * y))
        scale = max(robust_spread(rest), 1e-12)
        weight = np.maximum(1 - (rest / (_TUNING * scale)) ** 2, 0.0) ** 2
    return weight


def _solve(normal: Float, right: Float) -> Float:
    """Solve with columns scaled alike, so that units do not decide what is singular."""
    scale = np.sqrt(np.maximum(np.diagonal(normal), 1e-300))
    return np.asarray(np.linalg.lstsq(normal / np.outer(scale, scale), right / scale, rcond=1e-10)[0] / scale)


@dataclass(frozen=True)
class Size:
    """One measured quantity, true minus stated, with its 1 σ (random, and from image formation)."""

    name: str
    unit: str
    value: float
    sigma: float


@dataclass(frozen=True)
class Finding:
    """The test of one effect.

    Attributes
    ----------
    effect : str
        Name in the catalogue.
    z : float
        Estimate over its σ, which includes the errors of image formation.
    p_value : float
        Two-sided, with the degrees of freedom of σ; 1 when it could not be tested.
    sizes : tuple of Size
        Quantities of the catalogue; empty when the test gives none.
    fixed_to : FixedTo or None
        As far as this test itself measures it.
    time : str or None
        Likewise.
    statement : str
        What was seen, with numbers.
    confirms : tuple of Size
        Sizes of other effects that this measurement gives independently, named ``effect.quantity``.
    alike : tuple of str
        Effects that would look the same here.
    agreements : tuple of Agreement
        Whether the two halves of the frames agree.
    """

    effect: str
    z: float
    p_value: float
    sizes: tuple[Size, ...]
    fixed_to: FixedTo | None
    time: str | None
    statement: str
    confirms: tuple[Size, ...] = ()
    alike: tuple[str, ...] = ()
    agreements: tuple[Agreement, ...] = ()

    @property
    def found(self) -> bool:
        """Whether it exceeds image formation and chance."""
        return self.p_value < FOUND_P and abs(self.z) > FOUND_Z


def finding(
    name: str, z: float, p_value: float, sizes: tuple[Size, ...], statement: str,
    confirms: tuple[Size, ...] = (), alike: tuple[str, ...] = (),
) -> Finding:  # fmt: skip
    """Return the finding of an effect; what it is fixed to is stated only where the test shows it."""
    fixed_to = FixedTo.CAMERA if name in _OF_THE_SENSOR else None
    time = "speed" if name == "motion_blur" else None
    return Finding(name, z, p_value, sizes, fixed_to, time, statement, confirms, alike)


def untestable(name: str, why: str) -> Finding:
    """Return the finding of an effect that these frames cannot show."""
    return finding(name, 0.0, 1.0, (), why)


def withdrawn(found: Finding) -> Finding:
    """Return a finding that something else explains better: measured, but not found."""
    return replace(found, p_value=1.0, confirms=(), alike=())
