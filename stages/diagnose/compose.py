"""Combine what the channels of all recordings show into one answer."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from pipeline.instrument.probe import Probe
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import Channel, FixedTo
from stages.diagnose.both_recordings import global_p
from stages.diagnose.causes import NONE, Causes
from stages.diagnose.channels import Seen
from stages.diagnose.claims import Claim, claims_of, stretch
from stages.diagnose.gauge import answer as of_gauge
from stages.diagnose.gauge.doubts import sure
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.inference import SURE
from stages.diagnose.record_next import AGAIN, record_next
from stages.diagnose.result import (
    Diagnosis,
    EffectFound,
    Location,
    Remainder,
    Verdict,
    classes_of,
)
from stages.diagnose.travel.events import SLIP
from stages.diagnose.weighed import weighed

_SAME_FREQUENCY_HZ = 0.15
_WITH_NAMES = (Verdict.CLASS, Verdict.PARTLY, Verdict.NAMED)
_IN_PROFILE = Location(str(Channel.PROFILE), None, None)
_UNKNOWN = "a cause that the library does not have, such as {}"
_BY_LIGHT = (
    "The uncertain size of {} can explain all deviations of the rings of the gauge run: whether anything "
    "else, such as {}, moves them was not decided."
)
_BORE_FIRST = "Measure the gauge's bores and correct recording.yaml; then run the diagnosis again."
_BY_KNOWN = "With a probability of {:.0f} %, known effects alone are the cause, likeliest these: {}"
_OF_ENCODER = "an error of the encoder that depends on distance or speed in another way"


def composed(
    field: Seen | None, gauge: Seen | None, probe: Probe, without: Collection[str] = ()
) -> Diagnosis:
    """Return the answer from the channels of both recordings together.

    Effects in ``without``, which the library must do without, may be seen but not named.
    """
    examined = gauge.geometry if gauge is not None else None
    every = claims_of(field, gauge, probe.shutter.exposure_s)
    known = [c.not_knowing(without) for c in every if c.name not in without]
    of_profile, of_travel = _unexplained_profile(field, gauge), _unexplained_travel(field, gauge)
    unnamed = len(known) < len(every) or any(not u.by_slip for u in of_travel)
    doubtful = (SLIP,) if any(u.by_slip for u in of_travel) else ()
    own = [c for c in claims_of(None, gauge, probe.shutter.exposure_s) if c.name not in without]
    rings = verdict_of_rings(examined, own)
    certain = {c.name for c in known if c.sure}
    of_light = _by_light(examined, rings, [c for c in own if c.name in certain])
    rings = Verdict.CONSISTENT if of_light else rings
    said = _said(examined, rings, known, unnamed, bool(of_profile), doubtful)
    misdrawn = gauge is not None and gauge.misdrawn
    if misdrawn and said.verdict is Verdict.NAMED:
        said = replace(said, verdict=Verdict.PARTLY)  # the bore, or an effect that fits as well, remains
    asked = said.members if said.members else [e.name for e in said.effects]
    nameless = _IN_PROFILE if of_profile else of_travel[0].location if of_travel else None
    location = _location(examined, every, asked) or nameless
    causes = weighed(examined if rings in _WITH_NAMES else None, known) if said.members else NONE
    words = _identifiable(said, examined, any(c.may_have_other_course for c in known))
    identifiable = " ".join(s for s in (words, *of_profile, *(u.sentence for u in of_travel)) if s)
    partly = said.verdict is Verdict.PARTLY
    rest = Verdict.CLASS if said.members else Verdict.UNEXPLAINED
    found = Diagnosis(
        recording=field.name if field is not None else "",
        gauge=gauge.name if gauge is not None else "",
        verdict=said.verdict,
        global_p=global_p(field, gauge),
        location=location,
        effects=said.effects,
        members=() if partly else said.members,
        identifiable=identifiable,
        fit=examined.quality if examined is not None else None,
        record_next=_BORE_FIRST if misdrawn else _next(said, asked, causes),
        causes=causes,
        feasibility=examined.feasibility if examined is not None else (),
        candidates=of_gauge.candidates(examined) if examined is not None else (),
        shortcomings=(
            *(s for seen in (field, gauge) if seen is not None for s in seen.shortcomings),
            *of_light,
        ),
        remainder=Remainder(rest, _of_rest(examined, rings), said.members, identifiable) if partly else None,
    )
    return found.not_knowing(without)


@dataclass(frozen=True)
class _Said:
    """The verdict, the certain effects, the remaining class, and those of its members that have a size."""

    verdict: Verdict
    effects: tuple[EffectFound, ...]
    members: tuple[str, ...]
    unsure: tuple[EffectFound, ...] = ()


def _said(
    examined: Examined | None, rings: Verdict, known: Sequence[Claim], unnamed: bool, unexplained: bool,
    doubtful: Sequence[str],
) -> _Said:  # fmt: skip
    """Return the verdict of ``rings`` and fiducials, and then of the claims beyond them.

    What is certain is named, whatever is left beside it; what is left is a class, or unexplained. Names in
    ``doubtful`` may be no effect at all.
    """
    of_rings = of_gauge.effects_found(examined) if examined is not None else ()
    claims = _beyond(known, of_rings)
    every = (*of_rings, *(c.found for c in claims))
    certain = (*_sure_of_rings(examined, rings, unexplained), *(c.found for c in claims if c.sure))
    doubted = [*(n for c in claims if not c.sure for n in (*c.rivals, c.name)), *doubtful]
    if rings in _WITH_NAMES:
        unsure = [e.name for e in of_rings if e not in certain]
        doubted += [*(of_gauge.members(examined) if unsure and examined is not None else ()), *unsure]
    nameless = unexplained or unnamed or _is_nameless(examined, rings)
    if certain and not doubted and not nameless:
        return _Said(Verdict.NAMED, certain, ())
    if certain and nameless:
        return _Said(Verdict.PARTLY, certain, ())
    if certain:
        left = classes_of(doubted, {e.name for e in certain})
        return _Said(Verdict.PARTLY, certain, left, tuple(e for e in every if e not in certain))
    if doubted and rings is not Verdict.UNEXPLAINED:
        return _Said(Verdict.CLASS, every, classes_of(doubted), every)
    if nameless:
        return _Said(Verdict.UNEXPLAINED, tuple(c.found for c in claims), ())
    return _Said(rings, (), ())


def _sure_of_rings(examined: Examined | None, rings: Verdict, unexplained: bool) -> tuple[EffectFound, ...]:
    """Return the effects that rings and fiducials name with certainty.

    Where the line's profile shows something unexplained, its light may have displaced the line within its
    width.
    """
    if examined is None or rings not in (Verdict.NAMED, Verdict.PARTLY):
        return ()
    each = zip(of_gauge.effects_found(examined), sure(examined), strict=True)
    certain = [e for e, is_sure in each if is_sure]
    if not unexplained:
        return tuple(certain)
    beyond = zip(of_gauge.effects_found(examined), of_gauge.beyond_line(examined), strict=True)
    moved = {e.name for e, is_beyond in beyond if is_beyond}
    return tuple(e for e in certain if e.name in moved)


def _is_nameless(examined: Examined | None, rings: Verdict) -> bool:
    """Return whether rings show something that no effect of the library explains."""
    best = examined.best if examined is not None else None
    return rings is Verdict.UNEXPLAINED or (rings is Verdict.PARTLY and best is not None and not best.named)


def verdict_of_rings(examined: Examined | None, own: Sequence[Claim]) -> Verdict:
    """Return the verdict of rings and fiducials of a gauge run, given what its ``own`` other channels claim.

    Where rings deviate but "no effect" is still the likeliest explanation, the claimed effect is taken to be
    the cause: play or a slip disturbs the poses, too. What repeats at one place of the image on other wall is
    no error of poses: only the line's light may be its cause, if the light can move the line so far.
    """
    if examined is None:
        return Verdict.NOT_IDENTIFIABLE
    verdict = of_gauge.verdict_of(examined)
    if verdict is not Verdict.UNEXPLAINED:
        return verdict
    if examined.best is None:
        explained = bool(_lights(examined, [c for c in own if c.sure]))
    else:
        explained = bool(own) and not examined.best.names
    return Verdict.CONSISTENT if explained else verdict


def _by_light(examined: Examined | None, rings: Verdict, certain: Sequence[Claim]) -> tuple[str, ...]:
    """Return in words which light of the gauge run's line may have made the class that rings show."""
    if examined is None or rings is not Verdict.CLASS:
        return ()
    names = ", ".join(of_gauge.members(examined))
    return tuple(_BY_LIGHT.format(light, names) for light in _lights(examined, certain))[:1]


def _lights(examined: Examined, claims: Sequence[Claim]) -> list[str]:
    """Return the effects on the line's light that may have made all that rings show."""
    lights = (c for c in claims if c.location.channel == Channel.PROFILE)
    each = ((c.name, next(iter(c.parameters.values()), None)) for c in lights)
    return [name for name, size in each if of_gauge.may_be_light(examined, name, size)]


def _of_rest(examined: Examined | None, rings: Verdict) -> Location | None:
    """Return where rings show something unexplained although nothing was found in them."""
    repeats = rings is Verdict.UNEXPLAINED and examined is not None and examined.best is None
    return examined.location if repeats and examined is not None else None


def _next(said: _Said, asked: Sequence[str], causes: Causes) -> str:
    """Return what to record so that the answer becomes a name."""
    if said.verdict is Verdict.UNEXPLAINED or (said.verdict is Verdict.PARTLY and not said.members):
        return AGAIN
    return record_next(asked, causes) if said.verdict in (Verdict.CLASS, Verdict.PARTLY) and asked else ""


def _identifiable(said: _Said, examined: Examined | None, other_encoder_course: bool) -> str:
    """Return what is determined in any case: a size for each uncertain cause, or an empirical formula.

    With ``other_encoder_course``, the effect on the encoder may have another course than the named one.
    """
    if said.verdict is Verdict.CLASS or said.unsure:
        unknown = (*_unknown(examined), *(_OF_ENCODER,) * other_encoder_course)
        causes = [*(e.statement for e in said.unsure), *(_UNKNOWN.format(f) for f in unknown)]
        return "; or ".join(dict.fromkeys(w.rstrip(".") for w in causes)) + "." * bool(causes)
    nameless = said.verdict in (Verdict.UNEXPLAINED, Verdict.PARTLY) and not said.members
    if not nameless or examined is None:
        return ""
    return ". ".join(s for s in (of_gauge.formula(examined), _by_known(examined)) if s)


def _by_known(examined: Examined) -> str:
    """Return a sentence on the known effects that explain what has no name; empty if they surely do not."""
    known, share = of_gauge.known_explanation(examined), 1 - weighed(examined, ()).outside
    return _BY_KNOWN.format(100 * share, known) if known and share > 1 - SURE else ""


def _unknown(examined: Examined | None) -> tuple[str, ...]:
    """Return, in words, the likeliest causes that are not in the library but would look like this."""
    if examined is None:
        return ()
    return (*of_gauge.unknown_rivals(examined), *of_gauge.unknown_law_descriptions(examined))[:1]


def _beyond(claims: Sequence[Claim], effects: Sequence[EffectFound]) -> list[Claim]:
    """Return the claims that are not already covered by effects found in rings and fiducials."""
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
    """Return the location as far as it was measured, and otherwise what all candidate causes share."""
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
    """Return sentences on features of the lines' profiles that no named shape fits."""
    profiles = [(s.name, s.profile) for s in recordings if s is not None and s.profile is not None]
    return tuple(f"{name}: {p.unexplained.statement}" for name, p in profiles if p.unexplained is not None)


@dataclass(frozen=True)
class _UnexplainedTravel:
    """An unnamed difference between motion and encoder, and whether a slip may have made it."""

    sentence: str
    location: Location
    by_slip: bool


def _unexplained_travel(*recordings: Seen | None) -> list[_UnexplainedTravel]:
    """Return differences between motion and encoder that may be a slip or stray pictures, or are unexplained.

    Several doubtful steps in one recording may have one unknown cause, and so may a step beside something
    that no slip explains.
    """
    out = []
    for name, travel in ((s.name, s.travel) for s in recordings if s is not None and s.travel is not None):
        left = travel.unexplained
        by_slip = len(travel.unsettled) == 1 and (left is None or left.by_slip)
        for step in travel.unsettled:
            where = stretch(travel, (step.place - 1, step.place), FixedTo.TIME, "event")
            out.append(_UnexplainedTravel(f"{name}: {step.doubt}", where, by_slip))
        if left is not None:
            where = stretch(travel, left.where, None, None)
            out.append(_UnexplainedTravel(f"{name}: {left.statement}", where, left.by_slip))
    return out
