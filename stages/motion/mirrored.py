"""Recognises pictures that a recorder mirrors or turns: an equally mirrored probe fits them better."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from pipeline.artefacts.measured import Trajectory
from pipeline.instrument.probe import Probe

_WAYS = {"mirrored left to right": "x", "mirrored upside down": "y", "turned by 180°": "xy"}
"""Changes that a recorder may make to pictures, and the axes of the image along which it then mirrors
them."""
_SURE = float(np.log(1000))
"""Least log odds of mirrored pictures against pictures as stated. A choice."""
_FITS, _LEAST_VARIANCE = 5.0, 1e-6
"""A mirrored probe fits if the data move it by at most so many times the usual motion of a right one: more
happens once in 10⁵ recordings. The least variance is in units of the stated variance."""
_WHOLLY = 0.01
"""A mirrored probe is considered if a combination of the stated probe's uncertain directions gives it, up to
this part of the change. A choice."""


def mirrored_way(probe: Probe, trajectory: Trajectory) -> str:
    """Return how the pictures of a run are mirrored; empty if they are not, or if there is no evidence.

    In mirrored pictures the principal point and every asymmetry of lens and laser lie on the other side. The
    run's estimate of the instrument, without its prior, is compared with both.
    """
    if trajectory.instrument is None or trajectory.instrument_covariance is None:
        return ""
    to_sigma = np.linalg.pinv(probe.principal_uncertainties())
    found = to_sigma @ (trajectory.instrument - probe.parameters)
    covariance = to_sigma @ trajectory.instrument_covariance @ to_sigma.T
    odds = {"": _SURE}
    for way, axes in _WAYS.items():
        change = _mirrored(probe, axes) - probe.parameters
        if _can_be(probe, change) and _fits(to_sigma @ change, found, covariance):
            odds[way] = _log_odds(to_sigma @ change, found, covariance)
    return max(odds, key=odds.__getitem__)


def _mirrored(probe: Probe, axes: str) -> Float:
    """Return the parameters (P,) of a probe that sees the world as ``probe`` does in mirrored pictures."""
    names, out = probe.parameter_names, probe.parameters.copy()
    for axis in axes:
        for name in set(_turning_sign(axis)) & set(names):
            out[names.index(name)] *= -1
        k = names.index(f"c{axis}")
        out[k] = probe.camera.image_size["xy".index(axis)] - 1 - out[k]
    return out


def _turning_sign(axis: str) -> tuple[str, ...]:
    """Return the parameters that have the other sign in an image mirrored along ``axis``.

    Azimuth ψ becomes π − ψ along x, and −ψ along y. The tangential distortion is Brown's, with OpenCV's
    names; the affine part of the image is Scaramuzza's.
    """
    waves = tuple(f"wave{m}_{'cos' if axis == 'x' and m % 2 else 'sin'}" for m in (2, 3, 4))
    return (f"tilt_{axis}", f"decentre_{axis}_mm", {"x": "p2", "y": "p1"}[axis], "d", "e", *waves)


def _can_be(probe: Probe, change: Float) -> bool:
    """Return whether a change (P,) of the parameters lies in the directions that are uncertain."""
    unsure = probe.principal_uncertainties()
    made_up = unsure @ np.linalg.lstsq(unsure, change, rcond=None)[0]
    return bool(np.any(change) and np.linalg.norm(made_up - change) < _WHOLLY * np.linalg.norm(change))


def _fits(change: Float, found: Float, covariance: Float) -> bool:
    """Return whether the data move a prior mean at ``change`` (Q,) by no more than usual."""
    usual = np.sqrt(np.maximum(1 - np.diagonal(covariance), _LEAST_VARIANCE))
    return bool((np.abs(found + covariance @ change - change) / usual).max() < _FITS)


def _log_odds(change: Float, found: Float, covariance: Float) -> float:
    """Return the log odds of a prior mean at ``change`` (Q,) against one at 0, both of unit covariance.

    The likelihood is the posterior ``found`` (Q,) with ``covariance`` (Q, Q) divided by the prior N(0, 1);
    with it both evidences are Gaussian integrals (Bishop, "Pattern recognition and machine learning", 2.3).
    """
    return float(change @ found - change @ change / 2 + change @ covariance @ change / 2)
