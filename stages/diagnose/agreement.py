"""Whether two measurements of the same physics, each on data of its own, agree in sign and size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import stats

from pipeline.arrays import Float
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.inference import DEGREES, UNKNOWN
from stages.diagnose.result import Confirmation, Value

# They agree when their difference is no rarer than this.
AGREE = 1e-3
# Predictions are good to this part of an effect's size.
_LAW = 0.05
# A measurement tells something only when it is known to this part of the effect.
TELLING = 0.25
_DRAWS = 400


@dataclass(frozen=True)
class Part:
    """What one part of the measurements says of an effect: a name of the part, words, and numbers (Q,)."""

    where: str
    words: str
    value: Float


@dataclass(frozen=True)
class Agreement:
    """A second prediction, and by how much it favours the named cause.

    Attributes
    ----------
    confirmation : Confirmation
    ratio : float
        Likelihood of the second measurement if the first one's cause made both, over that if it were of a
        like size but owed nothing to the first, sign included.
    """

    confirmation: Confirmation
    ratio: float


def agreement(first: Part, second: Part, own: tuple[Float, Float], gap: Float) -> Agreement | None:
    """Return whether two parts agree; None when either tells too little.

    Parameters
    ----------
    own : two of (Q, Q)
        Each part's covariance.
    gap : (Q, Q)
        Covariance of their difference: less than the sum where they share unknowns.
    """
    square = max(float(first.value @ first.value), float(second.value @ second.value))
    telling = all(np.all(np.isfinite(c)) and np.trace(c) <= TELLING**2 * square for c in own)
    if not telling or not np.all(np.isfinite(gap)):
        return None
    count, size = len(first.value), float(np.sqrt(square))
    agrees = same(first.value, second.value, gap, size)
    unrelated = own[1] + square / count * np.eye(count)
    like = stats.multivariate_normal(np.zeros(count), _spread(gap, size)).logpdf(second.value - first.value)
    unlike = stats.multivariate_normal(np.zeros(count), unrelated).logpdf(second.value)
    told = Confirmation(f"{first.where}: {first.words}", f"{second.where}: {second.words}", agrees)
    return Agreement(told, float(np.exp(np.clip(like - unlike, -50, 50))))


def same(first: Float, second: Float, gap: Float, size: float, rarest: float = AGREE) -> bool:
    """Return whether two estimates (Q,) agree: in sign, and as closely as noise and laws let expect.

    Parameters
    ----------
    gap : (Q, Q)
        Covariance of their difference.
    size
        Of the effect, in their unit: predictions are good to a part of it.
    rarest
        Chance below which a difference is none of noise's (F distribution).
    """
    apart, count = second - first, len(first)
    statistic = float(apart @ np.linalg.solve(_spread(gap, size), apart))
    rare = float(stats.f.sf(statistic / count, count, DEGREES))
    return rare > rarest and float(first @ second) > 0


def _spread(gap: Float, size: float) -> Float:
    return np.asarray(gap + (_LAW * size) ** 2 * np.eye(len(gap)))


def chance_of_name(
    p_value: float, doubts: int, agreements: Sequence[Agreement], fits_p: float = 1.0, otherwise: float = 0.0
) -> float:
    """Return the probability that the named cause made it, and not chance, a rival, or something unknown.

    Chance weighs −e p ln p, the most that a p-value can say for it (T. Sellke, M. J. Bayarri and J. O.
    Berger, "Calibration of p values for testing precise null hypotheses", Am. Stat., 2001). Rivals that were
    not told apart, and all else that speaks against the name, weigh as much as it. What is unknown loses by
    the likelihood ratio of the best second prediction, or wins by that of one that fails; those of one
    recording share its pictures and count once. It also wins where what the name leaves is no noise: by as
    much as the chance of that, ``fits_p``, can say; and by how likely it is with a course of its own in the
    name's place, ``otherwise``.
    """
    nothing = _at_most(p_value)
    ratios = [a.ratio for a in agreements]
    failed = [a.ratio for a in agreements if not a.confirmation.agrees]
    ratio = min(failed) if failed else max(ratios, default=1.0)
    unknown = UNKNOWN * (1 / (ratio * _at_most(fits_p)) + otherwise)
    return float(1 / (1 + nothing + doubts + unknown))


def _at_most(p_value: float) -> float:
    """Return how likely chance may be at most, beside something else, when it gives such a p-value."""
    p = float(np.clip(p_value, 1e-300, 1 / np.e))
    return float(-np.e * p * np.log(p))


def sized(model: EffectModel, shape: Shape, amplitude: Float, covariance: Float) -> str:
    """Return an effect's quantities, each with its own 1 σ, of amplitudes (Q,)."""
    told = drawn(partial(model.quantities, shape), amplitude, covariance)
    words = {name: f" ± {v.sd:.2g}" if v.sd > 0 else "" for name, v in told.items()}
    return ", ".join(f"{name} {v.value:.4g}{words[name]}" for name, v in told.items() if np.isfinite(v.value))


def drawn(
    numbers: Callable[[Float], dict[str, float]], amplitude: Float, covariance: Float
) -> dict[str, Value]:
    """Return numbers of amplitudes (Q,) with 1 σ, by draws; NaN where a covariance is not known."""
    middle, random = numbers(amplitude), np.random.default_rng(0)
    if not np.isfinite(covariance).all():
        return {name: Value(value, float("nan")) for name, value in middle.items()}
    draws = random.multivariate_normal(amplitude, covariance, _DRAWS, check_valid="ignore")
    each, out = [numbers(a) for a in draws], {}
    for name, value in middle.items():
        apart = np.array([d[name] for d in each]) - value
        if name in ("direction_deg", "phase_deg"):
            # A direction may pass from 180 to -180 degrees in between.
            apart = (apart + 180) % 360 - 180
        out[name] = Value(value, float(np.sqrt(np.mean(apart**2))))
    return out
