"""Names what may be wrong with a probe that the pictures contradict, and how wrong it may be.

One stated number is more often wrong than all of them: the picture was cropped, the laser knocked. The
pictures may not tell which; then they fit with several, of which each makes another wall.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from pipeline.arrays import Float
from pipeline.artefacts.measured import Trajectory
from pipeline.instrument.probe import Probe
from stages.motion.stated_probe import moved_by_pictures

_LEAST_SHARE = 0.05
"""Probability below which a cause is left out: what is left out together is about as rare as the error of a
95 % interval."""
_WIDEST = 1e4
"""Factor, at most, by which a stated σ may be too small: .05 px of a centre then are all of the picture."""
_REGULAR = 1e-9
"""Least share of a direction that the pictures must leave, or determine, so that it can be inverted."""


@dataclass(frozen=True)
class WrongParameters:
    """Parameters that may be wrong together.

    Attributes
    ----------
    log_evidence : float
        Logarithm of the marginal likelihood of the pictures, over that with the stated probe.
    covariance : (P, P)
        Covariance of the parameters that makes the pictures likeliest, with these less certain.
    moved : (P,)
        Change of the parameters with it.
    """

    log_evidence: float
    covariance: Float
    moved: Float


def wrong_parameters(trajectory: Trajectory, probe: Probe) -> tuple[WrongParameters, ...]:
    """Return the kinds of parameters that may be wrong in a contradicted probe, the likeliest first.

    There is none if the pictures demand changes of several kinds at once: then the pictures themselves are
    likelier to be wrong, as behind water, and no probe is what they demand.

    The evidence of the pictures is what the adjustment has added to the stated covariance. Of every kind of
    parameter, and of all of them, the stated σ is multiplied by the factor that makes the pictures likeliest
    (type II maximum likelihood: I. J. Good, "The Estimation of Probabilities", 1965).
    """
    evidence = _Evidence.of(trajectory, probe)
    sigma = np.sqrt(np.diagonal(probe.covariance))
    several = evidence.with_wider(np.diag(sigma)[:, sigma > 0])
    found = sorted((evidence.with_wider(w) for w in _kinds(probe)), key=lambda f: -f.log_evidence)
    evidences = np.array([several.log_evidence, *(f.log_evidence for f in found)])
    share = np.exp(evidences - evidences.max())
    share /= share.sum()
    if share[0] > 0.5:
        return ()
    return tuple(f for f, s in zip(found, share[1:], strict=True) if s >= _LEAST_SHARE)


def _kinds(probe: Probe) -> Iterator[Float]:
    """Yield 1 σ (P, K) of the uncertain parameters of each kind."""
    sigma = np.sqrt(np.diagonal(probe.covariance))
    kinds = [_kind(name) for name in probe.parameter_names]
    for kind in dict.fromkeys(kinds):
        of = np.array([k == kind for k in kinds]) & (sigma > 0)
        if of.any():
            yield np.diag(sigma)[:, of]


def _kind(name: str) -> str:
    """Return a parameter's name without direction and order."""
    return name.removesuffix("_mm").removesuffix("_cos").removesuffix("_sin").rstrip("xy_0123456789")


@dataclass(frozen=True)
class _Evidence:
    """What the pictures say about the probe, along its principal uncertainties.

    Attributes
    ----------
    unsure : (P, Q)
        Principal uncertainties.
    information : (Q, Q)
    pull : (Q,)
        Information times the change that the pictures alone demand.
    """

    unsure: Float
    information: Float
    pull: Float

    @staticmethod
    def of(trajectory: Trajectory, probe: Probe) -> _Evidence:
        """Return the evidence in an adjusted probe: its own information less the stated one."""
        moved, left = moved_by_pictures(trajectory, probe)
        share, direction = np.linalg.eigh(left)
        share = np.clip(share, _REGULAR, 1.0)
        posterior = (direction / share) @ direction.T
        unsure = probe.principal_uncertainties()
        return _Evidence(unsure, posterior - np.eye(len(share)), posterior @ moved)

    def with_wider(self, sigma: Float) -> WrongParameters:
        """Return the evidence for parameters of 1 σ (P, K) that are as unsure as the pictures demand."""
        wide = np.linalg.pinv(self.unsure) @ sigma
        own = wide @ wide.T

        def prior(log_factor: float) -> Float:
            return np.asarray(np.eye(len(own)) + np.expm1(2 * log_factor) * own)

        stated = self._likelihood(prior(0.0))
        best = minimize_scalar(
            lambda f: stated - self._likelihood(prior(f)), bounds=(0.0, np.log(_WIDEST)), method="bounded"
        )
        chosen = prior(float(best.x))
        moved = np.linalg.solve(np.linalg.inv(chosen) + self.information, self.pull)
        return WrongParameters(-float(best.fun), self.unsure @ chosen @ self.unsure.T, self.unsure @ moved)

    def _likelihood(self, prior: Float) -> float:
        posterior = np.linalg.inv(prior) + self.information
        volume = np.linalg.slogdet(prior)[1] + np.linalg.slogdet(posterior)[1]
        return float(self.pull @ np.linalg.solve(posterior, self.pull) - volume) / 2
