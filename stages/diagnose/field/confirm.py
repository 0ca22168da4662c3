"""Whether a field recording confirms an effect that the gauge names."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from stages.diagnose.agreement import same, sized
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.effects.courses import OWN_CLOCK, Coursed
from stages.diagnose.field.evidence import FieldEvidence
from stages.diagnose.gauge.confirm import partial_of
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.inference import Evidence, Score, Stated, places_of, score
from stages.diagnose.result import Confirmation

# The field confirms or contradicts only when its 1 σ is below this share of the effect's size.
# Debt: data/debts.md.
_TELLING = 0.33


def confirm_in_field(
    model: EffectModel,
    shape: Shape,
    amplitude: Float,
    covariance: Float,
    found: FieldEvidence,
    stated: Stated,
) -> Confirmation | None:
    """Return whether the field by itself says the same of an effect as the gauge; None when it cannot tell.

    The field's estimate owes nothing to the gauge: poses from texture, a pipe of unknown size, the stated
    instrument within its uncertainty. ``amplitude`` (Q,) and ``covariance`` (Q, Q) are the gauge's.
    """
    if found.run is None:
        return None
    own = _own_score(model, shape, found, stated)
    size = float(np.linalg.norm(amplitude))
    if own is None or np.sqrt(np.trace(own.covariance)) > _TELLING * size:
        return None
    return Confirmation(
        f"in the field, from the gauge: {sized(model, shape, amplitude, covariance)}",
        f"field alone: {sized(model, shape, own.amplitude, own.covariance)}",
        same(amplitude, own.amplitude, own.covariance + covariance, size),
    )


def met_in_field(
    examined: Examined, found: FieldEvidence, stated: Stated
) -> tuple[Confirmation | None, ...]:  # fmt: skip
    """Return, for each effect of the gauge's likeliest hypothesis, whether the field says the same."""
    best = examined.best
    if best is None:
        return ()
    out: list[Confirmation | None] = []
    for term in best.fit.terms:
        if isinstance(term.model, Coursed) and term.model.kind in OWN_CLOCK:
            # What happens at a time of the gauge run need not happen in another recording.
            out.append(None)
            continue
        own = partial_of("all", best.evidence, best, term, stated)
        known = own is not None and np.isfinite(own.covariance).all()
        covariance = own.covariance if own is not None and known else np.zeros((len(term.amplitude),) * 2)
        try:
            out.append(confirm_in_field(term.model, term.shape, term.amplitude, covariance, found, stated))
        except np.linalg.LinAlgError:
            out.append(None)
    return tuple(out)


def _own_score(model: EffectModel, shape: Shape, found: FieldEvidence, stated: Stated) -> Score | None:
    whole: Evidence | None = found.whole
    assert whole is not None
    place = places_of(whole, model, shape)
    if not len(place):
        whole = found.about([(model, shape)])
        if whole is None:
            return None
        place = places_of(whole, model, shape)
    return score(whole, stated, place)
