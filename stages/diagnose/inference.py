"""Evidence about effects from one kind of measurement, and the estimates and tests based on it.

Evidence of independent measurements is additive: information matrices and right sides are summed over shared
columns. The stated instrument's parameters are columns, too, because gauge run and inspection share one
instrument.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import fdtrc

from pipeline.adjustment.normal_equations import covariance_of, log_determinant, marginalised
from pipeline.arrays import Float, Int
from pipeline.instrument.probe import Probe
from stages.diagnose.effects.base import EffectModel, Shape

# Scores are sums over at most this many independent cells, so that χ² has heavier tails: those of F.
DEGREES = 60.0
_TIED = 1e-6
_SEEN, _SEEN_BESIDE = 1e-8, 1e-6
# Prior 1 σ of an amplitude, in plausible sizes.
PRIOR_PLAUSIBLE = 5.0
INSTRUMENT = "instrument"
# Prior odds, relative to a named cause, of an unknown cause that looks exactly like it. Debt: data/debts.md.
UNKNOWN = 0.1
# Physics was left out, and a pattern is added, when the probability of chance, corrected for all that was
# tried, is below this. Debt: data/debts.md.
DETECTED = 1e-4
# Costs of an answer, fixed in advance: 50 for a confident wrong name, 1 − 1/n for a class of n names that
# contains the right one, 1 for a missed name. A name is given where its expected cost is below that of a
# class of two; a class contains as many names as make it equally certain.
WRONG = 50.0
SURE = 1 - 1 / (2 * WRONG)


@dataclass(frozen=True, order=True)
class Column:
    """One amplitude of an effect at one shape, or one parameter of the stated instrument.

    Attributes
    ----------
    effect : str
        Name in the catalogue, or ``instrument`` for a parameter of `Probe.parameter_names` or
        ``encoder_scale``, whose amplitude is true minus stated in the parameter's own unit.
    amplitude : str
        As the effect's model names it.
    """

    effect: str
    amplitude: str
    shape: tuple[float, ...] = ()


@dataclass(frozen=True)
class Evidence:
    """Reduced normal equations A x = b of amplitudes x (true − stated), without any prior on x.

    Attributes
    ----------
    information : (K, K)
        A: the recording's own unknowns (poses, wall, landmarks) eliminated with their priors.
    right : (K,)
        b at x = 0: the score.
    score_covariance : (K, K)
        True covariance of b, with correlated errors of neighbours (sandwich over cells); A where unknown.
    misfit : float
        Weighted sum of squares at x = 0 with the own unknowns at their optimum.
    degrees : (K,)
        Degrees of freedom of each score's scatter; infinite where it is not estimated from the data.
    """

    columns: tuple[Column, ...]
    information: Float
    right: Float
    score_covariance: Float
    misfit: float
    degrees: Float

    @cached_property
    def place(self) -> dict[Column, int]:
        """Index of each column."""
        return {c: k for k, c in enumerate(self.columns)}

    def over(self, columns: Sequence[Column]) -> Evidence:
        """Return the evidence over other columns, in their order; it is empty for columns that it lacks."""
        place = self.place
        here = [k for k, c in enumerate(columns) if c in place]
        own = [place[columns[k]] for k in here]
        size = len(columns)
        information, covariance, right = np.zeros((size, size)), np.zeros((size, size)), np.zeros(size)
        degrees = np.full(size, np.inf)
        information[np.ix_(here, here)] = self.information[np.ix_(own, own)]
        covariance[np.ix_(here, here)] = self.score_covariance[np.ix_(own, own)]
        right[here], degrees[here] = self.right[own], self.degrees[own]
        return Evidence(tuple(columns), information, right, covariance, self.misfit, degrees)

    def deflated(self, inflation: float) -> Evidence:
        """Return the evidence when ``inflation`` measurements with correlated errors count as one."""
        return Evidence(
            self.columns, self.information / inflation, self.right / inflation,
            self.score_covariance / inflation**2, self.misfit / inflation, self.degrees,
        )  # fmt: skip


def total(parts: Sequence[Evidence]) -> Evidence:
    """Return the sum of independent evidence over the union of its columns."""
    columns = tuple(sorted({c for part in parts for c in part.columns}))
    each = [part.over(columns) for part in parts]
    return Evidence(
        columns,
        np.asarray(sum(e.information for e in each)),
        np.asarray(sum(e.right for e in each)),
        np.asarray(sum(e.score_covariance for e in each)),
        float(sum(e.misfit for e in each)),
        np.min([e.degrees for e in each], axis=0),
    )


@dataclass(frozen=True)
class Stated:
    """Prior knowledge of the instrument, as information on its columns."""

    names: tuple[str, ...]
    information: Float

    def over(self, columns: Sequence[Column]) -> Float:
        """Return the information (K, K) on columns; zero on effects."""
        place = {name: k for k, name in enumerate(self.names)}
        out = np.zeros((len(columns), len(columns)))
        here = [k for k, c in enumerate(columns) if c.effect == INSTRUMENT and c.amplitude in place]
        own = [place[columns[k].amplitude] for k in here]
        out[np.ix_(here, here)] = self.information[np.ix_(own, own)]
        return out


def stated_belief(probe: Probe) -> Stated:
    """Return the stated probe's and encoder's uncertainty as information."""
    names = (*probe.parameter_names, "encoder_scale")
    information = np.zeros((len(names), len(names)))
    information[:-1, :-1] = instrument_information(probe)
    information[-1, -1] = probe.encoder_scale_sigma**-2
    return Stated(names, information)


def instrument_information(probe: Probe) -> Float:
    """Return the information (P, P) on the stated parameters; those without uncertainty are held fixed."""
    sigma = np.sqrt(np.diag(probe.covariance))
    scale = np.where(sigma > 0, sigma, 1e-6)
    scaled = probe.covariance / np.outer(scale, scale) + np.diag(np.where(sigma > 0, 0.0, 1.0))
    # Parameters stated as one number (both focal lengths) are practically equal.
    return np.asarray(covariance_of(scaled, _TIED) / np.outer(scale, scale))


@dataclass(frozen=True)
class Score:
    """Evidence for one effect when nothing else is added.

    Attributes
    ----------
    amplitude, covariance : (Q,), (Q, Q)
        Estimate and its true covariance, including the stated instrument's uncertainty.
    statistic : float
        χ² with Q degrees of freedom when nothing is hidden.
    gain : float
        Drop of χ² that the effect promises.
    """

    amplitude: Float
    covariance: Float
    statistic: float
    p_value: float
    gain: float


@dataclass(frozen=True)
class Around:
    """Evidence about every effect when the instrument, and effects already included, are free.

    Attributes
    ----------
    information, right : (K, K), (K,)
        The rest of it with the free columns eliminated; zero in those.
    from_stated : (K, K)
        Part of the information that comes from the stated instrument's uncertainty.
    least : float
        Least share of its own information that an effect must keep to be tested.
    """

    evidence: Evidence
    information: Float
    right: Float
    from_stated: Float
    least: float

    @staticmethod
    def of(evidence: Evidence, stated: Stated, given: Int | None = None) -> Around:
        """Return the evidence with the instrument and the columns ``given`` free."""
        beside = given is not None and len(given) > 0
        own = instrument_places(evidence)
        free = np.union1d(own, given) if given is not None else own
        kept = np.setdiff1d(np.arange(len(evidence.columns)), free)
        size, at = len(evidence.columns), np.ix_(kept, kept)
        information, right, from_stated = np.zeros((size, size)), np.zeros(size), np.zeros((size, size))
        information[at], right[kept], from_stated[at] = eliminated(evidence, stated, kept, free)
        return Around(evidence, information, right, from_stated, _SEEN_BESIDE if beside else _SEEN)

    def score(self, block: Int) -> Score | None:
        """Return the score of columns ``block``.

        None when the columns cannot be determined. An effect that is determined only beside a nearly
        identical free one depends on laws being exact, and is not tested.
        """
        at = np.ix_(block, block)
        own, right, from_stated = self.information[at], self.right[block], self.from_stated[at]
        before = np.diag(self.evidence.information)[block]
        size = np.sqrt(np.maximum(before, 1e-300))
        if not np.all(np.linalg.eigvalsh(own / np.outer(size, size)) > self.least):
            return None
        # Correlated errors of neighbours widen what the data say, not the prior of the stated instrument.
        inflation = np.sqrt(np.diag(self.evidence.score_covariance)[block] / before)
        spread = (own - from_stated) * np.outer(inflation, inflation) + from_stated
        inverse = np.linalg.inv(own)
        amplitude, covariance = inverse @ right, np.asarray(inverse @ spread @ inverse, np.float64)
        statistic = float(right @ np.linalg.solve(spread, right))
        # Relative variances are averaged, so that columns of well-known scatter support those with few cells.
        degrees = 1 / max(1 / DEGREES, float(np.mean(1 / self.evidence.degrees[block])))
        p_value = float(fdtrc(len(block), degrees, statistic / len(block)))
        return Score(
            np.asarray(amplitude, np.float64), covariance, statistic, p_value, float(right @ amplitude)
        )


def eliminated(evidence: Evidence, stated: Stated, block: Int, free: Int) -> tuple[Float, Float, Float]:
    """Return information (Q, Q) and right side (Q,) of columns ``block``, with columns ``free`` eliminated.

    The third result, (Q, Q), is the part of the information from the stated instrument's uncertainty.
    """
    a, b = evidence.information, evidence.right
    free = free[np.diag(a)[free] > 0]
    prior = stated.over([evidence.columns[k] for k in free])
    both, out = np.concatenate([free, block]), np.arange(len(free))
    information = a[np.ix_(both, both)]
    information[: len(free), : len(free)] += prior
    left = marginalised(information, b[both], out, rcond=1e-13)
    response = left.follow[out]
    return left.information, left.right, response.T @ prior @ response


def instrument_places(evidence: Evidence) -> Int:
    """Return the indices of the instrument's columns."""
    return np.array([k for k, c in enumerate(evidence.columns) if c.effect == INSTRUMENT], np.int64)


def places_of(evidence: Evidence, model: EffectModel, shape: Shape) -> Int:
    """Return the indices of an effect's columns."""
    columns = (Column(model.name, a.name, shape) for a in model.amplitudes)
    return np.array([evidence.place[c] for c in columns if c in evidence.place], np.int64)


def places_of_all(evidence: Evidence, asked: Sequence[tuple[EffectModel, Shape]]) -> Int:
    """Return the indices of the columns of several effects, one effect after the other."""
    each = [places_of(evidence, model, shape) for model, shape in asked]
    return np.concatenate([np.zeros(0, np.int64), *each])


@dataclass(frozen=True)
class Estimate:
    """Posterior of the columns: ``value`` (K,), ``covariance`` (K, K), and −2 ln of the evidence."""

    value: Float
    covariance: Float
    deviance: float


def estimate(evidence: Evidence, stated: Stated, prior_sigma: Float) -> Estimate:
    """Return the posterior under the stated instrument and Gaussian priors (K,) 1 σ on amplitudes.

    ``prior_sigma`` is infinite for the instrument's columns, whose prior is the stated one. ``deviance`` is
    −2 ln of the marginal likelihood up to a constant common to all hypotheses on the same measurements.
    """
    prior = stated.over(evidence.columns) + np.diag(np.where(np.isinf(prior_sigma), 0.0, prior_sigma**-2.0))
    total = evidence.information + prior
    covariance = covariance_of(total)
    best = covariance @ evidence.right
    occam = log_determinant(total) - log_determinant(prior)
    return Estimate(best, covariance, evidence.misfit - float(evidence.right @ best) + occam)
