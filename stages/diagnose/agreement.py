"""Test whether two measurements of the same effect, each from its own data, agree in sign and size."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import stats

from pipeline.arrays import Float
from pipeline.physics.catalogue import EFFECTS
from pipeline.physics.effect import CourseKind
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.effects.nameless import Nameless
from stages.diagnose.inference import DEGREES, UNKNOWN
from stages.diagnose.result import Confirmation, Value

# They agree unless chance makes such a difference less often than this.
AGREE = 1e-3
# Predictions are accurate to this fraction of an effect's size.
_LAW = 0.05
# A measurement is used only if its 1 σ is at most this fraction of the effect.
TELLING = 0.25
_DRAWS = 400
# Another recording has its own events and aliases, and its frame P has another roll.
_OF_ONE_RECORDING = frozenset({"time_s", "duration_s", "slip_mm", "frequency_hz", "direction_deg"})


@dataclass(frozen=True)
class Part:
    """An effect as measured in one part of the data.

    Attributes
    ----------
    where, words : str
        Name of the part, and the numbers in words.
    value, covariance : (Q,), (Q, Q)
    """

    where: str
    words: str
    value: Float
    covariance: Float

    @classmethod
    def of(cls, where: str, words: str, value: float, sigma: float) -> Part:
        """Return a part that measures one number with this 1 σ."""
        return cls(where, words, np.array([value]), np.array([[sigma**2]]))


@dataclass(frozen=True)
class Agreement:
    """The comparison of a second measurement with the first, and how strongly it favours the named cause.

    Attributes
    ----------
    ratio : float
        Likelihood of the second measurement if the cause of the first one made both, over its likelihood if
        it had a similar size but, including its sign, nothing to do with the first.
    """

    confirmation: Confirmation
    ratio: float


def agreement(
    first: Part, second: Part, gap: Float | None = None, size: float | None = None, rarest: float = AGREE
) -> Agreement | None:
    """Return whether two parts agree; None when either is too uncertain.

    Parameters
    ----------
    gap : (Q, Q), optional
        Covariance of their difference where that is less than the sum, because they share unknowns.
    size, optional
        Of the effect, in their unit; else the larger of both.
    rarest
        Probability below which a difference is not attributed to noise.
    """
    own = first.covariance, second.covariance
    gap = own[0] + own[1] if gap is None else gap
    size = max(float(np.linalg.norm(p.value)) for p in (first, second)) if size is None else size
    telling = all(np.all(np.isfinite(c)) and np.trace(c) <= (TELLING * size) ** 2 for c in own)
    if not telling or not np.all(np.isfinite(gap)):
        return None
    count = len(first.value)
    agrees = same(first.value, second.value, gap, size, rarest)
    unrelated = own[1] + size**2 / count * np.eye(count)
    like = stats.multivariate_normal(np.zeros(count), _spread(gap, size)).logpdf(second.value - first.value)
    unlike = stats.multivariate_normal(np.zeros(count), unrelated).logpdf(second.value)
    confirmation = Confirmation(f"{first.where}: {first.words}", f"{second.where}: {second.words}", agrees)
    return Agreement(confirmation, float(np.exp(np.clip(like - unlike, -50, 50))))


def same(first: Float, second: Float, gap: Float, size: float, rarest: float = AGREE) -> bool:
    """Return whether two estimates (Q,) agree, in sign and within noise and the accuracy of predictions.

    Parameters
    ----------
    gap : (Q, Q)
        Covariance of their difference.
    size
        Size of the effect, in their unit: predictions are accurate to a fraction of it.
    rarest
        Probability below which a difference is not attributed to noise (F distribution).
    """
    apart, count = second - first, len(first)
    statistic = float(apart @ np.linalg.solve(_spread(gap, size), apart))
    rare = float(stats.f.sf(statistic / count, count, DEGREES))
    return rare > rarest and float(first @ second) > 0


def _spread(gap: Float, size: float) -> Float:
    return np.asarray(gap + (_LAW * size) ** 2 * np.eye(len(gap)))


def agreements(
    where: str, sizes: Mapping[str, Value], elsewhere: str, others: Mapping[str, Value], of: str = ""
) -> Iterable[Agreement]:
    """Return whether two recordings agree on each quantity that they share; ``of`` names its owner."""
    for name, value in sizes.items():
        if name not in others or name in _OF_ONE_RECORDING:
            continue
        found = agreement(_part(where, name, value, of), _part(elsewhere, name, others[name], of))
        if found is not None:
            yield found


def _part(where: str, name: str, value: Value, of: str) -> Part:
    """Return a quantity as measured in a recording; an azimuth is given as a unit vector."""
    words = f"{of}{name} {value.value:.4g} (± {value.sd:.2g})"
    if not name.endswith("azimuth_deg"):
        return Part.of(where, words, value.value, value.sd)
    angle = np.radians(value.value)
    return Part(where, words, np.array([np.cos(angle), np.sin(angle)]), np.radians(value.sd) ** 2 * np.eye(2))


def chance_of_name(
    p_value: float, doubts: int, agreements: Sequence[Agreement], fits_p: float = 1.0,
    other_courses: float = 0.0,
) -> float:  # fmt: skip
    """Return the probability that the named cause is right, and not chance, a rival, or something unknown.

    Chance has the weight −e p ln p, the most that a p-value can say for it (T. Sellke, M. J. Bayarri and J.
    O. Berger, "Calibration of p values for testing precise null hypotheses", Am. Stat., 2001). Each
    undistinguished rival, and each other doubt about the name, has the same weight as the name. An unknown
    cause loses weight by the likelihood ratio of the best second measurement, or gains by that of one that
    disagrees. Only the best counts, in whatever recording: an unknown cause that passes one comparison
    because it stays the same passes the next one too, also in another recording of that probe. It also gains
    weight if the residual beside the named cause is not noise (``fits_p``, the chance that noise makes it),
    and by its likelihood with a course of its own, relative to the name (``other_courses``).
    """
    nothing = _at_most(p_value)
    failed = [a.ratio for a in agreements if not a.confirmation.agrees]
    ratio = min(failed) if failed else max((a.ratio for a in agreements), default=1.0)
    unknown = UNKNOWN * (1 / (ratio * _at_most(fits_p)) + other_courses)
    return float(1 / (1 + nothing + doubts + unknown))


def _at_most(p_value: float) -> float:
    """Return the largest weight of chance, relative to an alternative, at such a p-value."""
    p = float(np.clip(p_value, 1e-300, 1 / np.e))
    return float(-np.e * p * np.log(p))


def sized(model: EffectModel, shape: Shape, amplitude: Float, covariance: Float) -> str:
    """Return an effect's quantities, each with its 1 σ, as text, from amplitudes (Q,)."""
    sizes = drawn(partial(model.quantities, shape), amplitude, covariance, turn_deg(model, shape, amplitude))
    words = {name: f" ± {v.sd:.2g}" if v.sd > 0 else "" for name, v in sizes.items()}
    return ", ".join(
        f"{name} {v.value:.4g}{words[name]}" for name, v in sizes.items() if np.isfinite(v.value)
    )


def turn_deg(model: EffectModel, shape: Shape, amplitude: Float) -> float:
    """Return the angle after which a direction means the same again: a swing has two, m waves have m."""
    if model.kind is CourseKind.SINUSOID:
        return 180.0
    known = model if isinstance(model, Nameless) else EFFECTS[model.law]
    return 360.0 / max(model.quantities(shape, amplitude).get("order", known.harmonic or 1), 1)


def drawn(
    numbers: Callable[[Float], dict[str, float]], amplitude: Float, covariance: Float, turn: float = 360.0
) -> dict[str, Value]:
    """Return numbers computed from amplitudes (Q,), with 1 σ by random draws; NaN if it is unknown.

    Directions and phases are the same again after ``turn``, degrees.
    """
    middle, random = numbers(amplitude), np.random.default_rng(0)
    if not np.isfinite(covariance).all():
        return {name: Value(value, float("nan")) for name, value in middle.items()}
    draws = random.multivariate_normal(amplitude, covariance, _DRAWS, check_valid="ignore")
    each, out = [numbers(a) for a in draws], {}
    for name, value in middle.items():
        apart = np.array([d[name] for d in each]) - value
        if name in ("direction_deg", "phase_deg"):
            # A direction may wrap from half a turn to minus half a turn between draws.
            apart = (apart + turn / 2) % turn - turn / 2
        out[name] = Value(value, float(np.sqrt(np.mean(apart**2))))
    return out
