"""Which causes that an inspection shows are refuted by a gauge run of the same probe."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.physics.catalogue import EFFECTS
from stages.diagnose.agreement import same
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.gauge.fit import evidence
from stages.diagnose.gauge.scan import Scored
from stages.diagnose.inference import Stated, places_of, score

# Inspection and gauge confirm or refute each other only where the 1 σ of what is asked is below this share of
# the other's size: it is then three such σ away from nothing. Debt: data/debts.md.
TELLING = 0.33
_PARTS_OF_THE_PROBE = ("laser", "camera", "window")
# The medium is that of the pipe or of the gauge, not of the probe.
_OF_THE_MEDIUM = ("outside_index",)


def not_refuted(shown: Sequence[Scored], gauge: Examined, stated: Stated) -> tuple[Scored, ...]:
    """Return the causes that a gauge run, in which nothing was found, leaves possible.

    What is fixed to the probe and never changes acts in both recordings alike; the gauge's own estimate of
    it must then agree with that of the inspection. Whatever acts in a pipe, in a medium or at times may be
    in one recording alone.
    """
    asked = [s for s in shown if _in_every_recording(s)]
    if not asked:
        return tuple(shown)
    searched = gauge.searched
    about = evidence(searched.run, searched.nothing, [(s.model, s.shape) for s in asked])[0]
    out = []
    for s in shown:
        own = score(about, stated, places_of(about, s.model, s.shape)) if s in asked else None
        size = float(np.linalg.norm(s.score.amplitude))
        telling = own is not None and np.sqrt(np.trace(own.covariance)) < TELLING * size
        if own is None or not telling or same(
            s.score.amplitude, own.amplitude, s.score.covariance + own.covariance, size
        ):  # fmt: skip
            out.append(s)
    return tuple(out)


def _in_every_recording(scored: Scored) -> bool:
    known = EFFECTS[scored.model.name]
    return known.family in _PARTS_OF_THE_PROBE and known.time == "static" and known.name not in _OF_THE_MEDIUM
