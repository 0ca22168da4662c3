"""How a field recording changes the answer: it confirms the gauge, contradicts it, or stands alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from pipeline.instrument.probe import Probe
from pipeline.physics.catalogue import EFFECTS
from stages.diagnose.channels import Seen
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.field.answer import FieldAnswer, field_answer, location_in_field
from stages.diagnose.field.confirm import InField, met_in_field
from stages.diagnose.field.evidence import FieldEvidence
from stages.diagnose.field.shortcomings import travels
from stages.diagnose.inference import stated_belief
from stages.diagnose.result import Diagnosis, EffectFound, Verdict, classes_of, record_next

_BY_FIELD = "The field, by itself, shows: "


def with_field(
    found: Diagnosis, field: Seen | None, gauge: Seen | None, probe: Probe, library: Mapping[str, EffectModel]
) -> Diagnosis:
    """Return the answer with what the field's rings and texture say put in."""
    if field is None or field.field is None or field.field.run is None:
        return found
    stated = stated_belief(probe)
    alone = field_answer(field.field, library, stated)
    examined = gauge.geometry if gauge is not None else None
    found = replace(found, global_p=_both(found.global_p, alone.global_p))
    if examined is not None and examined.best is not None and examined.best.fit.terms:
        met = met_in_field(examined, field.field, stated)
        names = [t.model.name for t in examined.best.fit.terms]
        return _met(found, dict(zip(names, met, strict=True)))
    if alone.shown:
        return _alone(found, alone, field.field, gauge is not None)
    if found.verdict is Verdict.NOT_IDENTIFIABLE and gauge is None and travels(field.field.run):
        return replace(found, verdict=Verdict.CONSISTENT)
    return found


def _met(found: Diagnosis, met: Mapping[str, InField | None]) -> Diagnosis:
    """Return the answer with the field's confirmations, or less sure where the field contradicts it."""
    effects = tuple(_confirmed(e, met.get(e.name)) for e in found.effects)
    silent = [name for name, each in met.items() if each is None and name in EFFECTS]
    missing = tuple(f"The field by itself tells too little of {name} to bear it out." for name in silent)
    known = [each for each in met.values() if each is not None]
    found = replace(found, effects=effects, shortcomings=(*found.shortcomings, *missing))
    if found.verdict is not Verdict.NAMED or all(each.confirmation.agrees for each in known):
        return found
    names = [e.name for e in effects]
    note = "The field contradicts what the gauge run names: see the confirmations."
    return replace(
        found, verdict=Verdict.CLASS, members=classes_of(names), record_next=record_next(names),
        identifiable="; ".join(e.statement for e in effects), notes=(*found.notes, note),
    )  # fmt: skip


def _confirmed(effect: EffectFound, met: InField | None) -> EffectFound:
    if met is None:
        return effect
    return replace(effect, confirmed_by=(*effect.confirmed_by, met.confirmation))


def _alone(found: Diagnosis, alone: FieldAnswer, field: FieldEvidence, with_gauge: bool) -> Diagnosis:
    """Return the class that the field alone shows, beside whatever other channels say."""
    names = [e.name for e in found.effects]
    note = (
        "The gauge run shows nothing of it: it came or went in between, or does not act there."
        if with_gauge
        else "One pipe of unknown size gives a class of causes, not a name."
    )
    said = [text for text in (found.identifiable, _BY_FIELD + alone.identifiable) if text]
    return replace(
        found, verdict=Verdict.CLASS, members=_union(alone.members, classes_of(names)),
        identifiable="; ".join(said), record_next=alone.next, notes=(*found.notes, note),
        location=location_in_field(field, alone.shown),
    )  # fmt: skip


def _union(first: Sequence[str], second: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys((*first, *second)))


def _both(first: float, second: float) -> float:
    return min(2 * min(first, second), 1.0)
