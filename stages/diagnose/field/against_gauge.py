"""Compare an inspection with a gauge run of the same probe: refute causes, confirm or contradict effects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.catalogue import EFFECTS
from pipeline.physics.effect import CourseKind
from stages.diagnose.agreement import same, sized
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.effects.courses import of_own_clock
from stages.diagnose.effects.library import LIBRARY, OF_READINGS
from stages.diagnose.field.evidence import FieldEvidence
from stages.diagnose.gauge.confirm import partial_of
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.gauge.fit import evidence
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.scan import Scored
from stages.diagnose.inference import Around, Score, Stated, places_of, places_of_all
from stages.diagnose.result import Confirmation

# Inspection and gauge run confirm or refute each other only where the 1 σ of one is below this share of the
# other's size, which is then three σ from zero. Debt: data/debts.md.
TELLING = 0.33
# The same where the time of a step was searched: six σ from zero.
_SEARCHED = 0.5 * TELLING
_PARTS_OF_THE_PROBE = ("laser", "camera", "window")
# The medium belongs to the pipe or the gauge, not to the probe.
_OF_THE_MEDIUM = ("outside_index",)


def not_refuted(shown: Sequence[Scored], gauge: Examined, stated: Stated) -> tuple[Scored, ...]:
    """Return the causes that remain possible after a gauge run in which nothing was found.

    What is fixed to the probe and never changes acts in both recordings; the gauge run's estimate of it must
    agree with that of the inspection. Effects of a pipe, a medium or a time may be in one recording only.
    """
    asked = [s for s in shown if _in_every_recording(s)]
    if not asked:
        return tuple(shown)
    searched = gauge.searched
    about = evidence(searched.run, searched.nothing, [(s.model, s.shape) for s in asked])[0]
    around, out = Around.of(about, stated), []
    for s in shown:
        own = around.score(places_of(about, s.model, s.shape)) if s in asked else None
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


def met_in_field(
    examined: Examined, found: FieldEvidence, stated: Stated
) -> tuple[Confirmation | None, ...]:  # fmt: skip
    """Return, for each effect of the gauge run's likeliest hypothesis, whether the inspection agrees."""
    best = examined.best
    if best is None:
        return ()
    out = []
    for term in best.fit.terms:
        own = partial_of("all", best.evidence, best, term, stated)
        known = own is not None and np.isfinite(own.covariance).all()
        covariance = own.covariance if own is not None and known else np.zeros((len(term.amplitude),) * 2)
        try:
            out.append(_met(term, covariance, found, stated))
        except np.linalg.LinAlgError:
            out.append(None)
    return tuple(out)


def is_asked(model: EffectModel) -> bool:
    """Return whether an inspection is asked about an effect of the gauge run.

    It is not where the effect comes at times of the gauge run alone; only a step is sought at other times.
    """
    return not of_own_clock(model) or model.kind is CourseKind.STEP


def _met(term: Term, covariance: Float, found: FieldEvidence, stated: Stated) -> Confirmation | None:
    """Return whether the inspection alone agrees with the gauge run on an effect; None if too uncertain.

    The inspection's estimate uses nothing of the gauge run except the encoder's scale, where that is named:
    poses come from texture, in a pipe of unknown size, with the stated instrument within its uncertainty and
    an encoder of unknown clock and play. A step is sought at all times of the inspection; it need not happen
    there, so that nothing contradicts it.
    ``covariance`` (Q, Q) is that of the term's amplitudes.
    """
    seen = _own_score(term, found, stated) if is_asked(term.model) else None
    if seen is None:
        return None
    (shape, own), is_step = seen, term.model.kind is CourseKind.STEP
    size = float(np.linalg.norm(term.amplitude))
    agrees = same(term.amplitude, own.amplitude, own.covariance + covariance, size)
    telling = np.sqrt(np.trace(own.covariance)) <= (_SEARCHED if is_step else TELLING) * size
    if not telling or (is_step and not agrees):
        return None
    alone = f"inspection alone, at {shape[0]:.1f} s" if is_step else "inspection alone"
    return Confirmation(
        f"in the inspection, by the gauge run: {sized(term.model, term.shape, term.amplitude, covariance)}",
        f"{alone}: {sized(term.model, shape, own.amplitude, own.covariance)}",
        agrees,
    )


def _own_score(term: Term, found: FieldEvidence, stated: Stated) -> tuple[Shape, Score] | None:
    """Return the inspection's own score of an effect and its shape there: of a step at the best time."""
    if found.run is None:
        return None
    shapes: tuple[Shape, ...] = (term.shape,)
    if term.model.kind is CourseKind.STEP:
        duration = float(np.ptp(found.run.measured.time_s))
        shapes = term.model.shapes(duration, found.run.recording.frame_rate)
    readings = [(LIBRARY[name], ()) for name in OF_READINGS if name != term.model.name]
    whole = found.about([*((term.model, shape) for shape in shapes), *readings])
    if whole is None:
        return None
    around = Around.of(whole, stated, places_of_all(whole, readings))
    each = ((shape, around.score(places_of(whole, term.model, shape))) for shape in shapes)
    seen = [(shape, own) for shape, own in each if own is not None]
    return max(seen, key=lambda pair: pair[1].statistic, default=None)
