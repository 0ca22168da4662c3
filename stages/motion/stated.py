"""Whether the stated probe fits the recording: by how much the adjustment had to move it."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from pipeline.artefacts.measured import Trajectory
from pipeline.instrument.probe import Probe
from pipeline.machine.outcome import WARNING
from pipeline.machine.stage import Context

# A right probe moves further than this along one of its ten or so directions once in 10^5 recordings.
_TOO_FAR = 5.0


def report_instrument(probe: Probe, trajectory: Trajectory, context: Context) -> None:
    """Report how far the probe was moved, in its stated σ, and warn where it cannot have been right."""
    if trajectory.instrument is None:
        return
    change = trajectory.instrument - probe.parameters
    farthest = _farthest(change, probe.principal_uncertainties())
    context.report("instrument moved by the adjustment, at most", farthest, "stated σ")
    if farthest > _TOO_FAR:
        sigma = np.sqrt(np.diagonal(probe.covariance))
        most = int(np.argmax(np.divide(np.abs(change), sigma, out=np.zeros_like(change), where=sigma > 0)))
        context.report(
            WARNING,
            f"the stated probe does not fit this recording: it had to be moved by {farthest:.0f} times its "
            f"stated σ, most of all {probe.parameter_names[most]} by {change[most]:+.3g}; radii "
            "and distances may be wrong by more than their σ. Run boresight diagnose, or "
            "calibrate the probe anew",
        )


def _farthest(change: Float, directions: Float) -> float:
    """Return the longest part of a change (P,) along the principal directions (P, Q), in σ."""
    moved, *_ = np.linalg.lstsq(directions, change, rcond=None)
    return float(np.max(np.abs(moved), initial=0.0))
