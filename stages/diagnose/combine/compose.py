"""Combine what the channels of all recordings show into one answer."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from pipeline.instrument.probe import Probe
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import Channel
from stages.diagnose.causes import NONE, Causes
from stages.diagnose.channels import Seen
from stages.diagnose.combine.claims import Claim
from stages.diagnose.combine.shown import Shown, shown_by
from stages.diagnose.combine.weighed import weighed
from stages.diagnose.gauge import answer as of_gauge
from stages.diagnose.gauge.doubts import sure
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.inference import SURE
from stages.diagnose.record_next import AGAIN, record_next
from stages.diagnose.result import Diagnosis, EffectFound, Location, Remainder, Verdict, classes_of
from stages.diagnose.travel.events import SLIP

_SAME_FREQUENCY_HZ = 0.15
_WITH_NAMES = (Verdict.CLASS, Verdict.PARTLY, Verdict.NAMED)
_IN_PROFILE = Location(str(Channel.PROFILE), None, None)
_UNKNOWN = "a cause that the library does not have, such as {}"
_BORE_FIRST = "Measure the gauge's bores and correct recording.yaml; then run the diagnosis again."
_BY_KNOWN = "With a probability of {:.0f} %, known effects alone are the cause, likeliest these: {}"
_OF_ENCODER = "an error of the encoder that depends on distance or speed in another way"


def composed(
    field: Seen | None, gauge: Seen | None, probe: Probe, without: Collection[str] = ()
) -> Diagnosis:
    """Return the answer from the channels of both recordings together.

    Effects in ``without``, which the library must do without, may be seen but not named.
    """
    shown = shown_by(field, gauge, probe.shutter.exposure_s, without)
    said = _said(shown)
    asked = said.members if said.members else [e.name for e in said.effects]
    causes = weighed(shown.examined if shown.rings in _WITH_NAMES else None, shown.known)
    causes = causes if said.members else NONE
    identifiable = _identifiable(said, shown)
    partly = said.verdict is Verdict.PARTLY
    found = Diagnosis(
        recording=field.name if field is not None else "",
        gauge=gauge.name if gauge is not None else "",
        verdict=said.verdict,
        global_p=_global_p(field, gauge),
        location=_location(shown, asked),
        effects=said.effects,
        members=() if partly else said.members,
        identifiable=identifiable,
        fit=shown.examined.quality if shown.examined is not None else None,
        record_next=_BORE_FIRST if shown.misdrawn else _next(said, asked, causes),
        causes=causes,
        feasibility=shown.examined.feasibility if shown.examined is not None else (),
        candidates=of_gauge.candidates(shown.examined) if shown.examined is not None else (),
        shortcomings=shown.shortcomings,
        remainder=_remainder(said, shown, identifiable) if partly else None,
        unexamined=tuple(w for seen in (field, gauge) if seen is not None for w in unexamined(seen)),
    )
    return found.not_knowing(without)


def _global_p(field: Seen | None, gauge: Seen | None) -> float:
    """Return the smallest p-value of all channels, times the number of channels that show anything.

    The p-values of the line's profile leave out errors of image formation, so that only those count which
    exceed these, too.
    """
    each = []
    for seen in (field, gauge):
        if seen is None:
            continue
        if seen.geometry is not None:
            each.append(seen.geometry.global_p)
        if seen.travel is not None:
            each.append(seen.travel.least_p)
        if seen.profile is not None:
            each.append(min((f.p_value for f in seen.profile.findings if f.found), default=1.0))
    showing = [p for p in each if p < 1]
    return float(min(min(showing) * len(showing), 1.0)) if showing else 1.0


def unexamined(seen: Seen) -> tuple[str, ...]:
    """Return in words what of a recording is not known: the line's profile, a gauge run's rings."""
    rings = seen.field is not None or seen.geometry is not None or seen.misdrawn
    each = ("the line's profile", seen.profile is not None), ("rings and fiducials", rings)
    return tuple(f"{what} of {seen.name}" for what, known in each if not known)


@dataclass(frozen=True)
class _Said:
    """The verdict, the certain effects, the remaining class, and those of its members that have a size."""

    verdict: Verdict
    effects: tuple[EffectFound, ...]
    members: tuple[str, ...]
    unsure: tuple[EffectFound, ...] = ()


def _said(shown: Shown) -> _Said:
    """Return the verdict of rings and fiducials, and then of the claims beyond them.

    What is certain is named, whatever is left beside it; what is left is a class, or unexplained. A bore that
    is not as drawn, or an effect that fits as well, remains beside any name.
    """
    of_rings = of_gauge.effects_found(shown.examined) if shown.examined is not None else ()
    claims = _beyond(shown.known, of_rings)
    every = (*of_rings, *(c.found for c in claims))
    of_profile = bool(shown.of_profile)
    certain = (
        *_sure_of_rings(shown.examined, shown.rings, of_profile), *(c.found for c in claims if c.sure)
    )  # fmt: skip
    doubted = _doubted(shown, claims, [e.name for e in of_rings if e not in certain])
    if certain and not doubted and not shown.nameless:
        return _Said(Verdict.PARTLY if shown.misdrawn else Verdict.NAMED, certain, ())
    if certain and shown.nameless:
        return _Said(Verdict.PARTLY, certain, ())
    if certain:
        left = classes_of(doubted, {e.name for e in certain})
        return _Said(Verdict.PARTLY, certain, left, tuple(e for e in every if e not in certain))
    if doubted and shown.rings is not Verdict.UNEXPLAINED:
        return _Said(Verdict.CLASS, every, classes_of(doubted), every)
    if shown.nameless:
        return _Said(Verdict.UNEXPLAINED, tuple(c.found for c in claims), ())
    return _Said(shown.rings, (), ())


def _doubted(shown: Shown, claims: Sequence[Claim], unsure: Sequence[str]) -> list[str]:
    """Return names that may be no effect at all: ``unsure`` ones of the rings, claims, and their rivals."""
    out = [n for c in claims if not c.sure for n in (*c.rivals, c.name)]
    out += [SLIP] * any(u.by_slip for u in shown.of_travel)
    if shown.rings not in _WITH_NAMES:
        return out
    members = of_gauge.members(shown.examined) if unsure and shown.examined is not None else ()
    return [*out, *members, *unsure]


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


def _remainder(said: _Said, shown: Shown, formula: str) -> Remainder:
    """Return what is left beside the certain effects."""
    verdict = Verdict.CLASS if said.members else Verdict.UNEXPLAINED
    return Remainder(verdict, _of_rest(shown.examined, shown.rings), said.members, formula)


def _of_rest(examined: Examined | None, rings: Verdict) -> Location | None:
    """Return where rings show something unexplained although nothing was found in them."""
    repeats = rings is Verdict.UNEXPLAINED and examined is not None and examined.best is None
    return examined.location if repeats and examined is not None else None


def _next(said: _Said, asked: Sequence[str], causes: Causes) -> str:
    """Return what to record so that the answer becomes a name."""
    if said.verdict is Verdict.UNEXPLAINED or (said.verdict is Verdict.PARTLY and not said.members):
        return AGAIN
    return record_next(asked, causes) if said.verdict in (Verdict.CLASS, Verdict.PARTLY) and asked else ""


def _identifiable(said: _Said, shown: Shown) -> str:
    """Return in sentences what is determined in any case, by rings, fiducials, line and encoder."""
    of_travel = (u.sentence for u in shown.of_travel)
    each = (_causes_or_formula(said, shown), *shown.of_profile, *of_travel)
    return " ".join(words for words in each if words)


def _causes_or_formula(said: _Said, shown: Shown) -> str:
    """Return a size for each uncertain cause, or the empirical formula of what has no cause."""
    examined = shown.examined
    if said.verdict is Verdict.CLASS or said.unsure:
        other_course = any(c.may_have_other_course for c in shown.known)
        unknown = (*_unknown(examined), *(_OF_ENCODER,) * other_course)
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


def _location(shown: Shown, asked: Sequence[str]) -> Location | None:
    """Return where the mismatch was seen; where no name has a place, that of what has no name."""
    if shown.of_profile:
        nameless: Location | None = _IN_PROFILE
    else:
        nameless = shown.of_travel[0].location if shown.of_travel else None
    of_rings = of_gauge.location(shown.examined, shown.rings) if shown.examined is not None else None
    return _location_of(of_rings, shown.every, asked) or nameless


def _location_of(of_rings: Location | None, claims: Sequence[Claim], asked: Sequence[str]) -> Location | None:
    """Return the location as far as it was measured, and otherwise what all candidate causes share."""
    of_claims = bool(asked) and set(asked) <= {c.name for c in claims}
    if of_rings is not None and not of_claims:
        return of_rings
    if not claims:
        return None
    measured, known = claims[0].location, [effect(name) for name in asked]
    fixed_to, time = {str(e.fixed_to) for e in known}, {e.time for e in known}
    return replace(
        measured,
        fixed_to=measured.fixed_to or (fixed_to.pop() if len(fixed_to) == 1 else None),
        time=measured.time or (time.pop() if len(time) == 1 else None),
    )
