"""The designer's questions: what dominates, which tolerance is needed, which baseline is best."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.robust import root_mean_square
from pipeline.arrays import Float
from pipeline.errors import InputError
from pipeline.instrument.budget import Budget, Row, error_budget
from pipeline.instrument.budget.scan import Pose, RingScan, at_baseline
from pipeline.instrument.budget.sources import Kind

# 2, 3 and 4 inch.
_DIAMETERS_MM = (2 * 25.4, 3 * 25.4, 4 * 25.4)
_BASELINES_MM = range(10, 101, 3)


@dataclass(frozen=True)
class Tolerance:
    """How large one systematic source may be for a required accuracy of the radius at the worst azimuth.

    Attributes
    ----------
    name, unit : str
    now : float
        1 σ in the budget.
    alone : float
        1 σ at which the source alone reaches the accuracy.
    shared : float
        1 σ when all systematic sources of the budget get an equal part of the variance.
    """

    name: str
    unit: str
    now: float
    alone: float
    shared: float


@dataclass(frozen=True)
class BaselineStudy:
    """1 σ of the radius over baselines.

    Attributes
    ----------
    baseline_mm : (B,)
    diameter_mm : (D,)
    sigma_mm : (B, D)
        Root mean square over azimuth of everything; NaN where the camera cannot see the ring.
    best_mm : (D,)
        For each diameter.
    best_overall_mm : float
        Where the worst diameter's σ is smallest.
    good_from_mm : float
        The shortest baseline whose worst σ is within 10 % of that.
    """

    baseline_mm: Float
    diameter_mm: Float
    sigma_mm: Float
    best_mm: Float
    best_overall_mm: float
    good_from_mm: float


def dominant_rows(budget: Budget) -> tuple[tuple[Row, float], ...]:
    """Return the rows by falling share of the summed variance, averaged over azimuth, with the share."""
    variance = [row.level(Pose.KNOWN) ** 2 for row in budget.rows]
    whole = max(math.fsum(variance), 1e-300)
    order = np.argsort(variance)[::-1]
    return tuple((budget.rows[i], variance[i] / whole) for i in order)


def tolerances(budget: Budget, accuracy_mm: float) -> tuple[Tolerance, ...]:
    """Return the tolerance of every systematic source of the budget for an accuracy (1 σ, worst azimuth).

    Raises
    ------
    InputError
        If the accuracy is not positive.
    """
    if not (math.isfinite(accuracy_mm) and accuracy_mm > 0):
        raise InputError("error budget", f"{accuracy_mm} is out of range", place="accuracy_mm",
                         expected="an accuracy above 0 mm")  # fmt: skip
    felt = [r for r in budget.rows if r.source.kind is Kind.SYSTEMATIC and r.worst(Pose.KNOWN) > 1e-9]
    share = 1 / math.sqrt(max(len(felt), 1))
    return tuple(
        Tolerance(r.source.name, r.source.unit, r.sigma, alone, alone * share)
        for r in felt
        for alone in [r.sigma * accuracy_mm / r.worst(Pose.KNOWN)]
    )


def baseline_study(
    scan: RingScan, given: Mapping[str, float] | None = None, baselines_mm: Iterable[float] = _BASELINES_MM
) -> BaselineStudy:
    """Return the total σ of the radius over baselines, in pipes of 2 to 4 inch, for the stated instrument.

    Parameters
    ----------
    scan
        The scan; its diameter and baseline are varied.
    given
        σ by source name: see `error_budget`.
    baselines_mm : (B,)
    """
    at = np.array(list(baselines_mm), float)
    sigma = np.array([[_level(scan, b, d, given) for d in _DIAMETERS_MM] for b in at])
    seen = np.where(np.isnan(sigma), np.inf, sigma)
    worst = seen.max(1)
    # The shortest baseline within 10 % of the best: a longer probe gains less than it loses in bends
    # (chosen).
    good = at[np.flatnonzero(worst <= 1.1 * worst.min())[0]]
    best = at[seen.argmin(0)]
    return BaselineStudy(at, np.array(_DIAMETERS_MM), sigma, best, float(at[worst.argmin()]), float(good))


def _level(
    scan: RingScan, baseline_mm: float, diameter_mm: float, given: Mapping[str, float] | None
) -> float:
    try:
        moved = replace(at_baseline(scan, baseline_mm), diameter_mm=diameter_mm, azimuths=24)
    except InputError:
        return math.nan
    total = error_budget(moved, given).total_mm(None, Pose.KNOWN)
    return root_mean_square(total)
