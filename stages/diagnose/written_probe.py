"""Whether the probe file gets the gauge run's correction: where an inspection does not speak against it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import logit

from pipeline.instrument.probe import Probe
from stages.diagnose.correct import Correction
from stages.diagnose.effects.library import LIBRARY, OF_READINGS
from stages.diagnose.field.evidence import FieldEvidence
from stages.diagnose.field.system import ENCODER_SCALE
from stages.diagnose.inference import INSTRUMENT, eliminated, stated_belief
from stages.diagnose.result import Diagnosis

# Probability of a correction without a name: as likely right as wrong before the inspection is asked. The
# least probability has finite odds.
_NAMELESS, _LEAST = 0.5, 1e-12
# Odds of less than 3.2 to one are "not worth more than a bare mention" (H. Jeffreys, Theory of Probability,
# 1961, app. B): held-out measurements then decide.
_BARE = float(np.log(10) / 2)
_BY_FIELD = (
    "The probe file is written as it was stated: rings and texture of the inspection are {:.2g} times as "
    "likely with the corrected probe as with the stated one, and the least certain effect of the correction "
    "has a probability of {:.2g}; together, this speaks against it. Unknown poses and wall, and errors that "
    "neighbours share, are taken into account."
)
_ALTHOUGH = (
    "The probe file is corrected although held-out measurements lie {:.3g} {} from their expected values "
    "with it, and {:.3g} without: both contain errors of the poses, which many frames share. With poses and "
    "wall unknown, rings and texture of the inspection are {:.2g} times as likely with the corrected probe."
)
_LACKS = (
    "The probe file cannot express {}: what is measured with it still contains the error that this makes."
)
_BY_GAUGE = (
    "The probe file is written as it was stated: held-out measurements would lie {:.3g} {} from their "
    "expected values with the likeliest explanation of the gauge run, and lie {:.3g} without. This alone "
    "refutes no effect: both contain the poses' errors, which neighbouring frames share, and the σ of the "
    "difference is not known."
)


@dataclass(frozen=True)
class Decision:
    """Whether the correction is written, and sentences on why, where that is not plain."""

    written: bool
    notes: tuple[str, ...] = ()


def decided(found: Diagnosis, field: FieldEvidence | None, correction: Correction, probe: Probe) -> Decision:
    """Return whether the probe is corrected.

    An inspection decides by the odds of both probes, beginning with the probability of what the gauge run
    found. Without one, and where these odds are nearly even, held-out measurements must not fit worse.
    """
    ratio = log_ratio(field, correction, probe) if field is not None else None
    lacks = (_LACKS.format(correction.beyond_probe),) if correction.inexpressible else ()
    fit = found.fit
    worse = fit is not None and fit.heldout_after > fit.heldout_before
    chance = _chance(found, correction)
    odds = ratio + logit(chance) if ratio is not None else 0.0
    if ratio is None or abs(odds) < _BARE:
        worse_by = (fit.heldout_after, fit.unit, fit.heldout_before) if fit is not None else ()
        return Decision(not worse, (_BY_GAUGE.format(*worse_by),) if worse else lacks)
    likelier = float(np.exp(np.clip(ratio, -50, 50)))
    if odds < 0:
        return Decision(False, (_BY_FIELD.format(likelier, chance),))
    if fit is None or not worse:
        return Decision(True, lacks)
    although = _ALTHOUGH.format(fit.heldout_after, fit.unit, fit.heldout_before, likelier)
    return Decision(True, (although, *lacks))


def log_ratio(field: FieldEvidence, correction: Correction, probe: Probe) -> float | None:
    """Return ln of the likelihood of an inspection with the corrected probe, over that with the stated one.

    Scores have the expected value 0 with the stated one, and information times correction with the other, and
    with both the same covariance, with correlated errors of neighbours. Poses, wall, matching errors, and the
    encoder's scale, clock and play are unknown: a clock that is late seems an error of the probe. None where
    the inspection shows nothing of what changes.
    """
    try:
        whole = field.about([(LIBRARY[name], ()) for name in OF_READINGS])
    except np.linalg.LinAlgError:
        return None
    if whole is None:
        return None
    moved = dict(zip(probe.parameter_names, correction.probe.parameters - probe.parameters, strict=True))
    changed = [k for k, c in enumerate(whole.columns) if c.effect == INSTRUMENT and c.amplitude in moved]
    free = [k for k, c in enumerate(whole.columns) if c == ENCODER_SCALE or c.effect in OF_READINGS]
    if not changed:
        return None
    at = np.array(changed)
    own, right, _ = eliminated(whole, stated_belief(probe), at, np.array(free, np.int64))
    before = np.maximum(np.diag(whole.information)[at], 1e-300)
    inflation = np.sqrt(np.diag(whole.score_covariance)[at] / before)
    step = np.array([moved[whole.columns[k].amplitude] for k in changed])
    expected, spread = step @ own @ step, step @ (own * np.outer(inflation, inflation)) @ step
    if not spread > 0:
        return None
    return float((step @ right - expected / 2) * expected / spread)


def _chance(found: Diagnosis, correction: Correction) -> float:
    """Return the probability of the least certain effect that the probe file would contain."""
    names = set(correction.applied)
    told = [e for e in found.effects if e.name in names]
    all_told = names and names == {e.name for e in told}
    least = min([e.probability for e in told] + [_NAMELESS] * (not all_told))
    return float(np.clip(least, _LEAST, 1 - _LEAST))
