"""What an inspection shows alone, which is a class of effects and never one name, and with the gauge run."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.instrument.probe import Probe
from pipeline.physics.catalogue import EFFECTS
from stages.diagnose.agreement import same
from stages.diagnose.channels import Seen
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.field.against_gauge import is_asked, met_in_field, not_refuted
from stages.diagnose.field.evidence import FieldEvidence, travels
from stages.diagnose.field.extended_answer import each_once, with_class, with_statement, with_unexplained
from stages.diagnose.field.unexplained import why_unexplained
from stages.diagnose.gauge.scan import Scored
from stages.diagnose.inference import DETECTED, INSTRUMENT, Around, Evidence, Stated, places_of, stated_belief
from stages.diagnose.record_next import AGAIN, record_next
from stages.diagnose.result import Confirmation, Diagnosis, EffectFound, Location, Value, Verdict, classes_of

# Effects that explain almost as much as the best one are in its class: laws err by a few per cent, and the
# recording's own unknowns absorb nearly the same part of each. Debt: data/debts.md.
_ALMOST, _APART = 0.1, 20.0
_OTHER_ENCODER = (
    "Encoder and pictures of the inspection do not differ by so much: the encoder counted differently in the "
    "gauge run, or the inspection cannot show it."
)
_TOO_LITTLE = "The inspection alone shows too little of {} to confirm or to contradict it."
_UNASKED = (
    "The size of {} changes at times that belong to the gauge run: the inspection can neither confirm nor "
    "contradict it."
)
_SHOWN = 4
_SCALE = "encoder_scale"
_BY_FIELD = "The inspection alone shows: "
_NOT_IN_GAUGE = (
    "The gauge run shows none of it: it came or went between the recordings, or does not act in a gauge."
)
_ONE_PIPE = "In one pipe of unknown size several causes look alike: it gives a class, not a name."
_LOOKS_LIKE = (
    "The inspection alone shows something that looks like this: {}. But the gauge run, by the same probe, "
    "shows none of it: the probe changed between the recordings, or the library does not have the cause"
)


@dataclass(frozen=True)
class FieldAnswer:
    """What an inspection shows alone.

    Attributes
    ----------
    global_p : float
        Probability of such measurements when nothing is hidden.
    shown : tuple of Scored
        Effects that explain it about as well as the best, the best first; empty when nothing shows.
    """

    global_p: float
    shown: tuple[Scored, ...]

    @property
    def members(self) -> tuple[str, ...]:
        """The class: what explains it, and what no single kind of recording distinguishes from that."""
        return classes_of([s.model.name for s in self.shown])

    @property
    def identifiable(self) -> str:
        """Return what is determined: the size that each single cause would have."""
        return "; or ".join(s.statement.rstrip(".") for s in self.shown[:_SHOWN])

    @property
    def next(self) -> str:
        """Return what to record: a gauge run, and what distinguishes the members."""
        more = record_next([s.model.name for s in self.shown]) if self.shown else ""
        return (
            f"A gauge run with this probe, off the axis of known bores, rolled, to and fro. {more}".rstrip()
        )


def field_answer(found: FieldEvidence, library: Mapping[str, EffectModel], stated: Stated) -> FieldAnswer:
    """Return what rings and texture of an inspection show beyond the stated instrument's uncertainty."""
    scores = scores_of(found.whole, library, stated)
    p_value = min((s.p_value for s in scores), default=1.0) * max(len(scores), 1)
    if p_value > DETECTED:
        return FieldAnswer(min(p_value, 1.0), ())
    return FieldAnswer(p_value, _about_as_good(scores))


def scores_of(
    whole: Evidence, library: Mapping[str, EffectModel], stated: Stated
) -> list[Scored]:  # fmt: skip
    """Return every effect's score at its best shape, the most significant first."""
    best: dict[str, Scored] = {}
    tried: dict[str, int] = {}
    around = Around.of(whole, stated)
    for name, shape in sorted({(c.effect, c.shape) for c in whole.columns if c.effect != INSTRUMENT}):
        if name not in library:
            continue
        result = around.score(places_of(whole, library[name], shape))
        if result is None or not library[name].possible(shape, result.amplitude):
            continue
        tried[name] = tried.get(name, 0) + 1
        if name not in best or result.statistic > best[name].score.statistic:
            best[name] = Scored(library[name], shape, result, 1)
    counted = [replace(s, tried=tried[name]) for name, s in best.items()]
    return sorted(counted, key=lambda s: -s.score.statistic)


def location_in_field(found: FieldEvidence, shown: Sequence[Scored]) -> Location | None:
    """Return where and when the inspection shows it; one diameter determines no radial exponent."""
    if not shown or found.run is None:
        return None
    first = EFFECTS[shown[0].model.name]
    same_order = all(EFFECTS[s.model.name].harmonic == first.harmonic for s in shown)
    trajectory = found.run.trajectory
    distance = trajectory.T_pc[:, 2, 3]
    return Location(
        str(first.channel), str(first.fixed_to), first.time, first.harmonic if same_order else None,
        frames=(int(trajectory.frame[0]), int(trajectory.frame[-1])),
        distance_mm=(float(distance.min()), float(distance.max())),
        azimuth_deg=(-180.0, 180.0),
    )  # fmt: skip


def _about_as_good(scores: Sequence[Scored]) -> tuple[Scored, ...]:
    top = scores[0].score.statistic
    return tuple(s for s in scores if s.score.statistic > top - max(_APART, _ALMOST * top))


def field_confirmations(
    found: Diagnosis, field: Seen | None, gauge: Seen | None, probe: Probe
) -> tuple[Confirmation | None, ...]:
    """Return, for each effect of the gauge run's likeliest hypothesis, whether the inspection agrees.

    The encoder's scale is the one that the gauge run's markers show: estimated from the inspection's own
    motion, it would make the inspection agree with any place of the sheet.
    """
    examined = gauge.geometry if gauge is not None else None
    if gauge is None or examined is None or field is None or field.field is None or field.field.run is None:
        return ()
    of_gauge = gauge.travel.estimate(_SCALE) if gauge.travel is not None else None
    scale = (
        Value(of_gauge.value, of_gauge.size_sigma) if of_gauge is not None and _scale_named(found) else None
    )
    return met_in_field(examined, *_knowing_encoder(field, scale, stated_belief(probe)))


def borne_out(gauge: Seen | None, met: Sequence[Confirmation | None]) -> Seen | None:
    """Return the gauge run's evidence with confirmations ``met`` as from `field_confirmations`."""
    if gauge is None or gauge.geometry is None or not met:
        return gauge
    each = zip(gauge.geometry.confirmed, met, strict=False)
    confirmed = tuple((*own, other) if other is not None and other.agrees else own for own, other in each)
    return replace(gauge, geometry=replace(gauge.geometry, confirmed=confirmed))


def with_field(
    found: Diagnosis, field: Seen | None, gauge: Seen | None, met: Sequence[Confirmation | None],
    probe: Probe, library: Mapping[str, EffectModel],
) -> Diagnosis:  # fmt: skip
    """Return the answer with the evidence of rings and texture; ``met`` as from `field_confirmations`."""
    if field is None or field.field is None or field.field.run is None:
        return found
    stated = stated_belief(probe)
    scale = _scale_named(found)
    seen, stated = _knowing_encoder(field, scale, stated)
    if scale is not None and seen is field.field and field.travel is not None:
        found = replace(found, notes=(*found.notes, _OTHER_ENCODER))
    alone = field_answer(seen, library, stated)
    examined = gauge.geometry if gauge is not None else None
    found = replace(found, global_p=_both(found.global_p, alone.global_p))
    if examined is not None and examined.best is not None and examined.best.fit.terms:
        terms = examined.best.fit.terms
        unasked = [t.model.law for t in terms if not is_asked(t.model)]
        return _met(found, dict(zip([t.model.law for t in terms], met, strict=True)), unasked)
    if alone.shown:
        repeats = examined is not None and examined.repeats
        asked = examined if not repeats else None
        possible = alone.shown if asked is None else not_refuted(alone.shown, asked, stated)
        doubt = why_unexplained(seen, possible[0]) if possible else ""
        if repeats:
            return with_statement(found, doubt or _BY_FIELD + alone.identifiable)
        left = replace(alone, shown=() if doubt else possible)
        return _alone(found, alone, left, seen, examined is not None, doubt)
    if found.verdict is Verdict.NOT_IDENTIFIABLE and gauge is None and travels(field.field.run):
        return replace(found, verdict=Verdict.CONSISTENT)
    return found


def _scale_named(found: Diagnosis) -> Value | None:
    """Return the relative error by which the encoder is known to read too much, where that is named."""
    certain = found.effects if found.verdict in (Verdict.NAMED, Verdict.PARTLY) else ()
    return next((e.parameters["relative"] for e in certain if e.name == _SCALE), None)


def encoder_share(found: Diagnosis, field: Seen | None, probe: Probe) -> float:
    """Return by what share of its reading the encoder surely reads too much in the inspection; else 0."""
    if field is None or field.field is None:
        return 0.0
    return _knowing_encoder(field, _scale_named(found), stated_belief(probe))[0].encoder_scale


def _knowing_encoder(field: Seen, scale: Value | None, stated: Stated) -> tuple[FieldEvidence, Stated]:
    """Return the inspection's evidence, and the stated beliefs, for a known error of the encoder's scale.

    If taken as right, an encoder that counts short makes the wall seem nearer than it is. An error that the
    inspection's own motion contradicts belongs to another recording.
    """
    assert field.field is not None
    own = field.travel.estimate(_SCALE) if field.travel is not None else None
    if scale is None or own is None or not np.isfinite([scale.sd, own.size_sigma]).all():
        return field.field, stated
    gap = np.array([[scale.sd**2 + own.size_sigma**2]])
    if not same(np.array([scale.value]), np.array([own.value]), gap, abs(scale.value)):
        return field.field, stated
    information, at = stated.information.copy(), stated.names.index(_SCALE)
    information[at, at] = scale.sd**-2.0
    return field.field.with_encoder(scale.value), replace(stated, information=information)


def _met(
    found: Diagnosis, met: Mapping[str, Confirmation | None], unasked: Collection[str] = ()
) -> Diagnosis:
    """Return the answer with the inspection's confirmations, or less certain where it contradicts them.

    A contradiction speaks against a name at even odds, like any prediction that fails. The inspection was not
    asked about the effects in ``unasked``.
    """
    effects = tuple(_confirmed(e, met.get(e.name)) for e in found.effects)
    silent = [name for name, each in met.items() if each is None and name in EFFECTS]
    missing = tuple((_UNASKED if name in unasked else _TOO_LITTLE).format(name) for name in silent)
    found = replace(found, effects=effects, shortcomings=(*found.shortcomings, *missing))
    against = {name for name, each in met.items() if each is not None and not each.agrees}
    withdrawn = [e for e in effects if e.name in against]
    if found.verdict not in (Verdict.NAMED, Verdict.PARTLY) or not withdrawn:
        return found
    note = "The inspection contradicts what the gauge run names: see the predictions of each effect for it."
    found = replace(found, identifiable="; ".join(e.statement for e in withdrawn), notes=(*found.notes, note))
    kept = tuple(e for e in effects if e.name not in against)
    doubtful = tuple(replace(e, probability=e.probability / (1 + e.probability)) for e in withdrawn)
    return with_class(replace(found, effects=kept or doubtful), kept, classes_of([e.name for e in withdrawn]))


def _confirmed(effect: EffectFound, met: Confirmation | None) -> EffectFound:
    if met is None or met in effect.confirmed_by:
        return effect
    return replace(effect, confirmed_by=(*effect.confirmed_by, met))


def _alone(
    found: Diagnosis, alone: FieldAnswer, possible: FieldAnswer, field: FieldEvidence, with_gauge: bool,
    doubt: str = "",
) -> Diagnosis:  # fmt: skip
    """Return the class that the inspection alone shows, beside whatever other channels show.

    Where none of it is ``possible``, what the inspection shows is unexplained: ``doubt`` says why, or else
    the gauge run refutes every member.
    """
    refuted = doubt or _LOOKS_LIKE.format(alone.identifiable)
    addition = _BY_FIELD + possible.identifiable if possible.shown else refuted
    notes = (_NOT_IN_GAUGE if with_gauge else _ONE_PIPE,) if possible.shown else ()
    said = [text for text in (found.identifiable, addition) if text]
    certain = found.effects if found.verdict in (Verdict.NAMED, Verdict.PARTLY) else ()
    names = () if certain else classes_of([e.name for e in found.effects])
    where = location_in_field(field, alone.shown)
    if where is not None and not possible.shown:
        # What the refuted causes would be fixed to was not measured.
        where = replace(where, fixed_to=None, time=None)
    found = (
        with_class(found, certain, each_once(possible.members, names))
        if possible.shown
        else with_unexplained(found)
    )
    following = possible.next if possible.shown or not with_gauge else AGAIN
    found = replace(found, identifiable="; ".join(said), record_next=following, notes=(*found.notes, *notes))
    if found.remainder is None:
        return replace(found, location=where)
    return replace(found, remainder=replace(found.remainder, location=where))


def _both(first: float, second: float) -> float:
    return min(2 * min(first, second), 1.0)
