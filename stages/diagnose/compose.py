"""From what each channel of each recording says to one answer."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.instrument.probe import Probe
from pipeline.physics.catalogue import effect
from stages.diagnose.classes import classes_of, record_next
from stages.diagnose.gauge import answer as of_gauge
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.profile.finding import Finding
from stages.diagnose.result import Confirmation, Diagnosis, EffectFound, Location, Value, Verdict
from stages.diagnose.seen import Seen
from stages.diagnose.travel.events import StepFound
from stages.diagnose.travel.evidence import TravelEvidence

# Below this chance, motion against encoder shows an effect.
_TRAVEL_FOUND = 1e-6
_SAME_FREQUENCY_HZ = 0.15
_AGAIN = (
    "To see what the pattern goes with, record the gauge again: rolled by 90° (probe or gauge), at another "
    "speed (time), after warming up (drift)."
)


@dataclass(frozen=True)
class Claim:
    """An effect that a channel other than rings and fiducials shows."""

    found: EffectFound
    channel: str
    p_value: float
    alike: tuple[str, ...]
    where: str


def composed(
    field: Seen | None, gauge: Seen | None, probe: Probe, without: Collection[str] = ()
) -> Diagnosis:
    """Return the answer to which the channels of both recordings come together.

    Effects ``without`` which the library has to do may be seen, but not named.
    """
    examined = gauge.geometry if gauge is not None else None
    every = _claims(field, gauge)
    claims = [c for c in every if c.found.name not in without]
    verdict = of_gauge.verdict_of(examined) if examined is not None else Verdict.NOT_IDENTIFIABLE
    effects = of_gauge.effects_found(examined) if examined is not None else ()
    claims = _beyond(claims, effects)
    members: tuple[str, ...] = ()
    if verdict is Verdict.CLASS and examined is not None:
        members = classes_of(of_gauge.members(examined))
    doubted = tuple(n for c in claims for n in c.alike)
    if claims and verdict in (Verdict.CONSISTENT, Verdict.NOT_IDENTIFIABLE, Verdict.NAMED):
        verdict = Verdict.CLASS if doubted else Verdict.NAMED
        every_name = [*doubted, *(c.found.name for c in claims), *(e.name for e in effects)]
        members = classes_of(every_name) if doubted else ()
    p_value = _global_p(field, gauge)
    if len(claims) < len(every) and verdict in (Verdict.CONSISTENT, Verdict.NOT_IDENTIFIABLE):
        verdict = Verdict.UNEXPLAINED
    if verdict is Verdict.UNEXPLAINED:
        effects = ()
    named = (*effects, *(c.found for c in claims))
    if verdict is Verdict.NAMED and (len(claims) < len(every) or not all(map(_confirmed, named))):
        verdict, members = Verdict.CLASS, classes_of([e.name for e in named])
    asked = members if verdict is Verdict.CLASS else [e.name for e in named]
    return Diagnosis(
        recording=field.recording.name if field is not None else "",
        gauge=gauge.recording.name if gauge is not None else "",
        verdict=verdict,
        global_p=p_value,
        location=_location(examined, every),
        effects=named,
        members=members,
        identifiable=_identifiable(verdict, named, examined),
        fit=examined.quality if examined is not None else None,
        record_next=_next(verdict, asked),
        feasibility=examined.feasibility if examined is not None else (),
        inseparable=examined.inseparable if examined is not None else (),
        candidates=of_gauge.candidates(examined) if examined is not None else (),
        shortcomings=tuple(s for seen in (field, gauge) if seen is not None for s in seen.shortcomings),
        ring_picture=of_gauge.ring_picture(examined) if examined is not None else None,
    )


def _confirmed(found: EffectFound) -> bool:
    """Return whether a second prediction of the same physics agrees."""
    return any(c.agrees for c in found.confirmed_by)


def _next(verdict: Verdict, asked: Sequence[str]) -> str:
    """Return what to record so that the answer becomes a name."""
    if verdict is Verdict.UNEXPLAINED:
        return _AGAIN
    return record_next(asked) if verdict is Verdict.CLASS and asked else ""


def _identifiable(verdict: Verdict, named: Sequence[EffectFound], examined: Examined | None) -> str:
    """Return what is determined all the same: the size each cause would have, or an empirical formula."""
    if verdict is Verdict.CLASS:
        return "; or ".join(e.statement for e in named)
    return of_gauge.formula(examined) if verdict is Verdict.UNEXPLAINED and examined is not None else ""


def _claims(field: Seen | None, gauge: Seen | None) -> list[Claim]:
    """Return what travel and profile show; of one effect the clearer, the other recording confirming it."""
    every = [
        claim
        for seen in (gauge, field)
        if seen is not None
        for claim in (*_of_travel(seen.travel), *_of_profile(seen))
    ]
    best: dict[str, Claim] = {}
    for claim in sorted(every, key=lambda c: c.p_value):
        known = best.get(claim.found.name)
        best[claim.found.name] = claim if known is None else _borne_out(known, claim)
    return list(best.values())


def _borne_out(claim: Claim, other: Claim) -> Claim:
    confirmation = Confirmation(
        f"{claim.where}: {claim.found.statement}", f"{other.where}: {other.found.statement}", True
    )
    found = claim.found
    both = (*found.confirmed_by, confirmation)
    return Claim(
        EffectFound(
            found.name, max(found.probability, 0.99), found.parameters, found.statement, found.equation, both
        ),
        claim.channel, claim.p_value, claim.alike, claim.where,
    )  # fmt: skip


def _of_travel(travel: TravelEvidence | None) -> list[Claim]:
    if travel is None:
        return []
    out = []
    for e in travel.estimates:
        if e.p_value < _TRAVEL_FOUND:
            size = {e.quantity: Value(e.value, e.sigma)}
            found = EffectFound(e.effect, 0.98, size, e.statement, effect(e.effect).law)
            out.append(Claim(found, "motion", e.p_value, tuple(n for n, _ in e.alike), travel.source))
    out += [_of_slip(s, travel.source) for s in travel.slips if s.p_value < _TRAVEL_FOUND]
    for line in travel.lines:
        if line.p_value < _TRAVEL_FOUND and "probe_vibration" in line.explained_by:
            turn = float(np.degrees(line.sigma_mm / line.amplitude_mm))
            size = {
                "amplitude_mm": Value(line.amplitude_mm, line.sigma_mm),
                "frequency_hz": Value(line.frequency_hz, 0.05),
                "direction_deg": Value(line.direction_deg, turn),
            }
            others = tuple(n for n in line.explained_by if n != "probe_vibration")
            size_words = f"{line.amplitude_mm:.3f} mm at {line.frequency_hz:.2f} Hz"
            words = f"The camera swings across the pipe by {size_words}."
            found = EffectFound("probe_vibration", 0.98, size, words, effect("probe_vibration").law)
            out.append(Claim(found, "motion", line.p_value, others, travel.source))
    return out


def _of_slip(step: StepFound, source: str) -> Claim:
    size = {"slip_mm": Value(step.gain_mm, step.sigma_mm), "time_s": Value(step.time_s, 0.05)}
    words = f"The encoder's wheel slips at {step.time_s:.2f} s and its reading gains {step.gain_mm:+.2f} mm."
    evenly = Confirmation(
        "a slip moves the reading alone: the pictures go on evenly",
        "no picture is astray and no time is lost there",
        True,
    )
    found = EffectFound("encoder_slip", 0.98, size, words, effect("encoder_slip").law, (evenly,))
    return Claim(found, "motion", step.p_value, (), source)


def _of_profile(seen: Seen) -> list[Claim]:
    if seen.profile is None:
        return []
    return [_profile_claim(f, seen.recording.name) for f in seen.profile.found]


def _profile_claim(f: Finding, where: str) -> Claim:
    size = {s.name: Value(float(s.value), float(s.sigma)) for s in f.sizes}
    known = effect(f.effect)
    found = EffectFound(f.effect, 0.97, size, f.statement, known.law)
    return Claim(found, str(known.channel), f.p_value, f.alike, where)


def _beyond(claims: Sequence[Claim], effects: Sequence[EffectFound]) -> list[Claim]:
    """Return the claims that the effects found in rings and fiducials do not already make."""
    names = {e.name for e in effects}
    rocking = [e.parameters["frequency_hz"].value for e in effects if e.name == "laser_rocking"]
    out = []
    for claim in claims:
        frequency = claim.found.parameters.get("frequency_hz")
        echoed = frequency is not None and any(abs(frequency.value - f) < _SAME_FREQUENCY_HZ for f in rocking)
        if claim.found.name not in names and not echoed:
            out.append(claim)
    return out


def _location(examined: Examined | None, claims: Sequence[Claim]) -> Location | None:
    if examined is not None and examined.location is not None:
        return examined.location
    if not claims:
        return None
    known = effect(claims[0].found.name)
    return Location(str(known.channel), str(known.fixed_to), known.time, known.harmonic)


def _global_p(field: Seen | None, gauge: Seen | None) -> float:
    """Return the least chance of all channels, counted as often as channels were looked at."""
    each = []
    for seen in (field, gauge):
        if seen is None:
            continue
        if seen.geometry is not None:
            each.append(seen.geometry.global_p)
        if seen.travel is not None:
            each.append(min((a.p_value for a in seen.travel.anomalies), default=1.0))
        if seen.profile is not None:
            each.append(min((f.p_value for f in seen.profile.findings), default=1.0))
    return float(min(min(each) * len(each), 1.0)) if each else 1.0
