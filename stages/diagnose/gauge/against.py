"""Rings of a gauge run against where its fiducials alone have them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Int
from stages.calibrate.gauge.state import Unknowns
from stages.diagnose.gauge.elimination import RING
from stages.diagnose.gauge.fit import Fit, fit
from stages.diagnose.gauge.points import ring_points
from stages.diagnose.gauge.run import GaugeRun, Term, ring_mm_per_px
from stages.diagnose.residual import RingResidual

# Factor on the rings' weight: so small that fiducials determine the poses, and large enough for rings to size
# the effects. Debt: data/debts.md.
_RELAXED = 1e-4
_OUTLIER = 0.1
# Poses are carried over so many frames at most.
_NEAR = 2


@dataclass(frozen=True)
class GaugeResiduals:
    """Residuals without and with the effects, and with effects sized on the other bores only."""

    before: RingResidual
    after: RingResidual
    heldout: RingResidual


def rings_against_fiducials(
    run: GaugeRun, start: Unknowns, terms: Sequence[Term], frames: Int
) -> GaugeResiduals:
    """Return the rings' residuals, poses by fiducials and encoder.

    Parameters
    ----------
    frames : (N,) int
        Numbers of all frames.

    Raises
    ------
    numpy.linalg.LinAlgError
        When fiducials do not determine the poses.
    """
    relaxed = replace(run, ring_weight=_RELAXED * run.ring_weight)
    before = _residual(run, fit(relaxed, start, ()), frames)
    if not terms:
        return GaugeResiduals(before, before, before)
    found = fit(relaxed, start, terms)
    after = _residual(run, found, frames)
    heldout = after.residual_mm.copy(), after.residual_px.copy()
    nothing = tuple(replace(t, amplitude=0 * t.amplitude) for t in terms)
    for section in np.unique(run.rings.section):
        here = run.rings.section == section
        others = replace(relaxed, ring_weight=np.where(here, 1e-6, 1.0) * relaxed.ring_weight)
        left = _residual(run, fit(others, start, nothing), frames)
        heldout[0][here], heldout[1][here] = left.residual_mm[here], left.residual_px[here]
    return GaugeResiduals(before, after, replace(after, residual_mm=heldout[0], residual_px=heldout[1]))


def _residual(run: GaugeRun, found: Fit, frames: Int) -> RingResidual:
    equations = found.linearised.equations
    residual = equations.residual[equations.kind == RING]
    points = ring_points(found.state, run.rings, run.time_s, run.width_px)
    assert points.distance_mm is not None
    usable = run.ring_weight > _OUTLIER * np.median(run.ring_weight)
    seen = np.unique(run.edges.frame)
    usable &= np.min(np.abs(run.rings.frame[:, None] - seen), axis=1) <= _NEAR
    return RingResidual(
        "gauge", frames[run.rings.frame], points.azimuth_rad, points.azimuth_p_rad, points.distance_mm,
        run.rings.uv, residual, residual / ring_mm_per_px(points), usable,
    )  # fmt: skip
