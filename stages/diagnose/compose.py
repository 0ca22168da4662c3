"""From what each channel of each recording says to one answer."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from pipeline.instrument.probe import Probe
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import Channel
from stages.diagnose.channels import Seen
from stages.diagnose.claims import Claim, claims_of
from stages.diagnose.gauge import answer as of_gauge
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.result import Diagnosis, EffectFound, Location, Verdict, classes_of, record_next

_SAME_FREQUENCY_HZ = 0.15
_IN_PROFILE = Location(str(Channel.PROFILE), None, None)
_AGAIN = (
    "To see what the pattern goes with, record the gauge again: rolled by 90° (probe or gauge), at another "
    "speed (time), after warming up (drift)."
)


def composed(
    field: Seen | None, gauge: Seen | None, probe: Probe, without: Collection[str] = ()
) -> Diagnosis:
    """Return the answer to which the channels of both recordings come together.

    Effects ``without`` which the library has to do may be seen, but not named.
    """
    examined = gauge.geometry if gauge is not None else None
    every = claims_of(field, gauge)
    unexplained = _unexplained_profile(field, gauge)
    said = _said(examined, every, without, bool(unexplained))
    asked = said.members if said.verdict is Verdict.CLASS else [e.name for e in said.effects]
    return Diagnosis(
        recording=field.name if field is not None else "",
        gauge=gauge.name if gauge is not None else "",
        verdict=said.verdict,
        global_p=_global_p(field, gauge),
        location=_location(examined, every, asked) or (_IN_PROFILE if unexplained else None),
        effects=said.effects,
        members=said.members,
        identifiable=" ".join(s for s in (_identifiable(said, examined), *unexplained) if s),
        fit=examined.quality if examined is not None else None,
        record_next=_next(said.verdict, asked),
        feasibility=examined.feasibility if examined is not None else (),
        inseparable=examined.inseparable if examined is not None else (),
        candidates=of_gauge.candidates(examined) if examined is not None else (),
        shortcomings=tuple(s for seen in (field, gauge) if seen is not None for s in seen.shortcomings),
        ring_picture=of_gauge.ring_picture(examined) if examined is not None else None,
    )


@dataclass(frozen=True)
class _Said:
    """The verdict, the effects it rests on, and the members of its class."""

    verdict: Verdict
    effects: tuple[EffectFound, ...]
    members: tuple[str, ...]


def _said(
    examined: Examined | None, every: Sequence[Claim], without: Collection[str], unexplained: bool
) -> _Said:
    """Return what rings and fiducials, and then the claims beyond them, come to.

    Where the line's profile shows what nothing explains, ``unexplained``, no name stands alone.
    """
    known = [c for c in every if c.name not in without]
    nameless = unexplained or len(known) < len(every)
    verdict = verdict_of_rings(examined, bool(known))
    of_rings = of_gauge.effects_found(examined) if examined is not None else ()
    claims = _beyond(known, of_rings)
    named = (*of_rings, *(c.found for c in claims))
    if verdict is Verdict.CLASS and examined is not None:
        return _Said(verdict, named, classes_of(of_gauge.members(examined)))
    if nameless and not claims and verdict in (Verdict.CONSISTENT, Verdict.NOT_IDENTIFIABLE):
        verdict = Verdict.UNEXPLAINED
    if verdict is Verdict.UNEXPLAINED:
        return _Said(verdict, tuple(c.found for c in claims), ())
    if not named:
        return _Said(verdict, (), ())
    names, doubted = [e.name for e in named], tuple(n for c in claims for n in _rivals(c))
    if doubted or nameless or not all(map(_confirmed, named)):
        return _Said(Verdict.CLASS, named, classes_of([*doubted, *names]))
    return _Said(Verdict.NAMED, named, ())


def verdict_of_rings(examined: Examined | None, claimed: bool) -> Verdict:
    """Return what rings and fiducials of a gauge run come to beside what other channels claim, if anything.

    Where something touches them for which nothing is still the likeliest pattern, it is the claim's doing:
    play or a slip pulls at the poses too.
    """
    if examined is None:
        return Verdict.NOT_IDENTIFIABLE
    verdict = of_gauge.verdict_of(examined)
    patternless = examined.best is not None and not examined.best.names
    return Verdict.CONSISTENT if claimed and patternless and verdict is Verdict.UNEXPLAINED else verdict


def _rivals(claim: Claim) -> tuple[str, ...]:
    """Return what else may have made a claim; where its parts disagree, all that is known to be like it."""
    disagree = any(not a.confirmation.agrees for a in claim.agreements)
    return (*claim.alike, *(effect(claim.name).alike if disagree else ()))


def _confirmed(found: EffectFound) -> bool:
    """Return whether a second prediction of the same physics agrees, and none disagrees."""
    return bool(found.confirmed_by) and all(c.agrees for c in found.confirmed_by)


def _next(verdict: Verdict, asked: Sequence[str]) -> str:
    """Return what to record so that the answer becomes a name."""
    if verdict is Verdict.UNEXPLAINED:
        return _AGAIN
    return record_next(asked) if verdict is Verdict.CLASS and asked else ""


def _identifiable(said: _Said, examined: Examined | None) -> str:
    """Return what is determined all the same: the size each cause would have, or an empirical formula."""
    if said.verdict is Verdict.CLASS:
        return "; or ".join(e.statement for e in said.effects)
    if said.verdict is Verdict.UNEXPLAINED and examined is not None:
        return of_gauge.formula(examined)
    return ""


def _beyond(claims: Sequence[Claim], effects: Sequence[EffectFound]) -> list[Claim]:
    """Return the claims that the effects found in rings and fiducials do not already make."""
    names = {e.name for e in effects}
    rocking = [e.parameters["frequency_hz"].value for e in effects if e.name == "laser_rocking"]
    out = []
    for claim in claims:
        frequency = claim.parameters.get("frequency_hz")
        echoed = frequency is not None and any(abs(frequency.value - f) < _SAME_FREQUENCY_HZ for f in rocking)
        if claim.name not in names and not echoed:
            out.append(claim)
    return out


def _location(examined: Examined | None, claims: Sequence[Claim], asked: Sequence[str]) -> Location | None:
    """Return the place as far as it was measured, and for the rest what all causes in question share."""
    of_claims = bool(asked) and set(asked) <= {c.name for c in claims}
    if examined is not None and examined.location is not None and not of_claims:
        return examined.location
    if not claims:
        return None
    measured, known = claims[0].location, [effect(name) for name in asked]
    fixed_to, time = {str(e.fixed_to) for e in known}, {e.time for e in known}
    return replace(
        measured,
        fixed_to=measured.fixed_to or (fixed_to.pop() if len(fixed_to) == 1 else None),
        time=measured.time or (time.pop() if len(time) == 1 else None),
    )


def _unexplained_profile(*recordings: Seen | None) -> tuple[str, ...]:
    """Return sentences on what the lines' profiles show and no shape with a name fits."""
    profiles = [(s.name, s.profile) for s in recordings if s is not None and s.profile is not None]
    return tuple(f"{name}: {p.unexplained.statement}" for name, p in profiles if p.unexplained is not None)


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
