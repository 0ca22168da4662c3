"""Estimates and tests from evidence: small dense algebra over amplitudes and the stated instrument."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from pipeline.adjustment.marginal import covariance_of, log_determinant, marginalised
from pipeline.arrays import Float, Int
from pipeline.instrument.probe import Probe
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.evidence import INSTRUMENT, Column, Evidence

# Scores are sums over so many independent cells that χ² has heavier tails: those of F.
DEGREES = 60.0
_TIED = 1e-6
_SEEN, _SEEN_BESIDE = 1e-8, 1e-6
# An amplitude's 1 σ beforehand, in plausible sizes.
PRIOR_PLAUSIBLE = 5.0


@dataclass(frozen=True)
class Stated:
    """What is believed of the instrument beforehand, as information on its columns."""

    names: tuple[str, ...]
    information: Float

    def over(self, columns: Sequence[Column]) -> Float:
        """Return (K, K) the information on columns; nothing on effects."""
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
    """Return (P, P) information on the stated parameters; those without uncertainty are held fast."""
    sigma = np.sqrt(np.diag(probe.covariance))
    scale = np.where(sigma > 0, sigma, 1e-6)
    scaled = probe.covariance / np.outer(scale, scale) + np.diag(np.where(sigma > 0, 0.0, 1.0))
    # Parameters stated as one number (both focal lengths) differ by next to nothing.
    return np.asarray(covariance_of(scaled, _TIED) / np.outer(scale, scale))


@dataclass(frozen=True)
class Score:
    """What the data say of one effect when nothing else is added.

    Attributes
    ----------
    amplitude, covariance : (Q,), (Q, Q)
        Estimate and its true covariance, the stated instrument's uncertainty included.
    statistic : float
        χ² with Q degrees of freedom when nothing is hidden.
    p_value : float
    gain : float
        Drop of χ² that the effect promises.
    """

    amplitude: Float
    covariance: Float
    statistic: float
    p_value: float
    gain: float


def score(evidence: Evidence, stated: Stated, block: Int, given: Int | None = None) -> Score | None:
    """Return the score of columns ``block``, the instrument and columns ``given`` being free.

    None when the columns cannot be seen. What is seen of an effect only beside another, nearly the same one
    that is free, rests on laws being exact, and does not count.
    """
    a = evidence.information
    free = instrument_places(evidence) if given is None else np.union1d(instrument_places(evidence), given)
    own, right, from_stated = eliminated(evidence, stated, block, free)
    size = np.sqrt(np.maximum(np.diag(a)[block], 1e-300))
    value = np.linalg.eigvalsh(own / np.outer(size, size))
    if not np.all(value > (_SEEN if given is None or not len(given) else _SEEN_BESIDE)):
        return None
    # Neighbours that err alike widen what the data say, not what was stated beforehand.
    inflation = np.sqrt(np.diag(evidence.score_covariance)[block] / np.diag(a)[block])
    spread = (own - from_stated) * np.outer(inflation, inflation) + from_stated
    inverse = np.linalg.inv(own)
    amplitude, covariance = inverse @ right, np.asarray(inverse @ spread @ inverse, np.float64)
    statistic = float(right @ np.linalg.solve(spread, right))
    p_value = float(stats.f.sf(statistic / len(block), len(block), DEGREES))
    return Score(np.asarray(amplitude, np.float64), covariance, statistic, p_value, float(right @ amplitude))


def eliminated(evidence: Evidence, stated: Stated, block: Int, free: Int) -> tuple[Float, Float, Float]:
    """Return information (Q, Q) and right side (Q,) of columns ``block``, columns ``free`` eliminated.

    The third, (Q, Q), is what of the information comes from the stated instrument's uncertainty.
    """
    a, b = evidence.information, evidence.right
    free = free[np.diag(a)[free] > 0]
    prior = stated.over(evidence.columns)[np.ix_(free, free)]
    both, out = np.concatenate([free, block]), np.arange(len(free))
    information = a[np.ix_(both, both)]
    information[: len(free), : len(free)] += prior
    left = marginalised(information, b[both], out, rcond=1e-13)
    response = left.follow[out]
    return left.information, left.right, response.T @ prior @ response


def instrument_places(evidence: Evidence) -> Int:
    """Return the places of the instrument's columns."""
    return np.array([k for k, c in enumerate(evidence.columns) if c.effect == INSTRUMENT], np.int64)


def places_of(evidence: Evidence, model: EffectModel, shape: Shape) -> Int:
    """Return the places of an effect's columns."""
    wanted = {(model.name, a.name, shape): k for k, a in enumerate(model.amplitudes)}
    here = [
        (wanted[key], k)
        for k, c in enumerate(evidence.columns)
        if (key := (c.effect, c.amplitude, c.shape)) in wanted
    ]
    return np.array([k for _, k in sorted(here)], np.int64)


@dataclass(frozen=True)
class Estimate:
    """Posterior of the columns: ``value`` (K,), ``covariance`` (K, K), and minus twice the log evidence."""

    value: Float
    covariance: Float
    surprise: float


def estimate(evidence: Evidence, stated: Stated, prior_sigma: Float) -> Estimate:
    """Return the posterior under the stated instrument and Gaussian priors (K,) 1 σ on amplitudes.

    ``prior_sigma`` is infinite for the instrument's columns, whose prior is the stated one. ``surprise`` is
    −2 ln of the marginal likelihood up to a constant common to all hypotheses on the same measurements.
    """
    prior = stated.over(evidence.columns) + np.diag(np.where(np.isinf(prior_sigma), 0.0, prior_sigma**-2.0))
    total = evidence.information + prior
    covariance = covariance_of(total)
    best = covariance @ evidence.right
    occam = log_determinant(total) - log_determinant(prior)
    return Estimate(best, covariance, evidence.misfit - float(evidence.right @ best) + occam)
