"""What all channels of both recordings show together, before a verdict."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from pipeline.physics.effect import Channel, FixedTo
from stages.diagnose.channels import Seen
from stages.diagnose.combine.claims import Claim, claims_of, stretch
from stages.diagnose.gauge import answer as of_gauge
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.result import Location, Verdict

_BY_LIGHT = (
    "The uncertain size of {} can explain all deviations of the rings of the gauge run: whether anything "
    "else, such as {}, moves them was not decided."
)
_PLACES = (
    "Whether the mismatch in the gauge run is fixed to the {} was not decided: the known effects that fit it "
    "best and the simplest pattern without a cause do not agree. What the laser does moves no fiducials: "
    "more of them near the line's place in the image help to tell."
)


@dataclass(frozen=True)
class UnexplainedTravel:
    """An unnamed difference between motion and encoder, and whether a slip may have made it."""

    sentence: str
    location: Location
    by_slip: bool


@dataclass(frozen=True)
class Shown:
    """What both recordings show, before a verdict.

    Attributes
    ----------
    examined : Examined or None
        Rings and fiducials of the gauge run.
    rings : Verdict
        Of rings and fiducials, given what other channels of the gauge run claim.
    every, known : list of Claim
        Claims of all channels, and those that the library may name.
    of_profile : tuple of str
        Sentences on the line's profile that no named shape fits.
    misdrawn : bool
        Whether a bore that is not as drawn explains the gauge run as well.
    """

    examined: Examined | None
    rings: Verdict
    every: list[Claim]
    known: list[Claim]
    of_profile: tuple[str, ...]
    of_travel: list[UnexplainedTravel]
    shortcomings: tuple[str, ...]
    misdrawn: bool

    @property
    def unnamed(self) -> bool:
        """Whether a channel other than rings and fiducials shows something that has no name."""
        return len(self.known) < len(self.every) or any(not u.by_slip for u in self.of_travel)

    @property
    def nameless(self) -> bool:
        """Whether anything was seen that no effect of the library explains."""
        return self.unnamed or bool(self.of_profile) or _is_nameless(self.examined, self.rings)


def shown_by(field: Seen | None, gauge: Seen | None, exposure_s: float, without: Collection[str]) -> Shown:
    """Return what both recordings show; effects in ``without`` have no name."""
    every = claims_of(field, gauge, exposure_s)
    known = [c.not_knowing(without) for c in every if c.name not in without]
    own = [c for c in claims_of(None, gauge, exposure_s) if c.name not in without]
    examined = gauge.geometry if gauge is not None else None
    rings = verdict_of_rings(examined, own)
    certain = {c.name for c in known if c.sure}
    of_light = _by_light(examined, rings, [c for c in own if c.name in certain])
    missing = [s for seen in (field, gauge) if seen is not None for s in seen.shortcomings]
    return Shown(
        examined, Verdict.CONSISTENT if of_light else rings, every, known,
        _unexplained_profile(field, gauge), _unexplained_travel(field, gauge),
        (*missing, *of_light, *undecided_place(examined, rings)),
        gauge is not None and gauge.misdrawn,
    )  # fmt: skip


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


def undecided_place(examined: Examined | None, rings: Verdict) -> tuple[str, ...]:
    """Return in words between which places it was not decided what the mismatch is fixed to."""
    places = of_gauge.places(examined, rings) if examined is not None else ()
    return (_PLACES.format(" or the ".join(places)),) if len(places) > 1 else ()


def _lights(examined: Examined, claims: Sequence[Claim]) -> list[str]:
    """Return the effects on the line's light that may have made all that rings show."""
    lights = (c for c in claims if c.location.channel == Channel.PROFILE)
    each = ((c.name, next(iter(c.parameters.values()), None)) for c in lights)
    return [name for name, size in each if of_gauge.may_be_light(examined, name, size)]


def _unexplained_profile(*recordings: Seen | None) -> tuple[str, ...]:
    """Return sentences on features of the lines' profiles that no named shape fits."""
    profiles = [(s.name, s.profile) for s in recordings if s is not None and s.profile is not None]
    return tuple(f"{name}: {p.unexplained.statement}" for name, p in profiles if p.unexplained is not None)


def _unexplained_travel(*recordings: Seen | None) -> list[UnexplainedTravel]:
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
            out.append(UnexplainedTravel(f"{name}: {step.doubt}", where, by_slip))
        if left is not None:
            where = stretch(travel, left.where, None, None)
            out.append(UnexplainedTravel(f"{name}: {left.statement}", where, left.by_slip))
    return out
