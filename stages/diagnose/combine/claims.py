"""Effects claimed by motion and by the line's profile of each recording, each once, with confirmations."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.physics.catalogue import effect
from pipeline.physics.effect import Channel, FixedTo
from stages.diagnose.agreement import Agreement, agreements, chance_of_name
from stages.diagnose.channels import Seen
from stages.diagnose.combine.late_pictures import Exposure, how_late, own_size, whole_size
from stages.diagnose.gauge.answer import rocking_excluded
from stages.diagnose.inference import SURE
from stages.diagnose.profile.evidence import ProfileEvidence
from stages.diagnose.profile.finding import Finding
from stages.diagnose.result import CourseFound, EffectFound, Location, Value
from stages.diagnose.travel.events import is_found
from stages.diagnose.travel.evidence import TravelEstimate, TravelEvidence
from stages.diagnose.travel.lines import Line
from stages.diagnose.travel.steps import StepFound

# Number of simulated cases per channel in which a name was given, always rightly: gauge runs at ring level,
# simulated lines. After n of them the next is right with probability (n + 1) / (n + 2), and no higher
# probability is stated.
_DRILLED = {Channel.MOTION: 44, Channel.PROFILE: 9}
# What each effect's pattern depends on: distance along the pipe, reversals, or speed.
_GOES_WITH = {
    "encoder_scale": (FixedTo.PIPE, "static"),
    "encoder_backlash": (FixedTo.TIME, "reversal"),
    "time_offset": (FixedTo.TIME, "speed"),
    "motion_blur": (FixedTo.CAMERA, "speed"),
}
# A ring takes this share of a sideways swing for a rotation of the camera.
_TURNED = 0.01


@dataclass(frozen=True)
class Claim:
    """An effect that a channel other than rings and fiducials shows.

    Attributes
    ----------
    alike : tuple of str
        Effects that would look the same and that nothing excludes.
    where : str
        The recording.
    location : Location
        As far as it was measured.
    agreements : tuple of Agreement
        Sufficiently precise second measurements of the same effect.
    fits_p : float
        Probability that noise makes the residual that the effect leaves.
    other_courses : float
        Likelihood of unnamed causes with other courses, relative to this effect.
    unknown : frozenset of str
        Effects that are treated as unknown.
    counted : bool
        Whether the rate of right names was counted on pictures like these; if not, past cases do not support
        the name.
    beside : int
        Number of further, unnamed deviations in the same readings. Each may share its cause with this effect,
        at even odds, which limits the name's probability.
    whole : tuple of (str, Value)
        Sizes before the part that another effect makes was subtracted: recordings are compared by these.
    """

    name: str
    parameters: dict[str, Value]
    statement: str
    p_value: float
    alike: tuple[str, ...]
    where: str
    location: Location
    agreements: tuple[Agreement, ...] = ()
    counted: bool = True
    beside: int = 0
    fits_p: float = 1.0
    other_courses: float = 0.0
    unknown: frozenset[str] = frozenset()
    whole: tuple[tuple[str, Value], ...] = ()

    @property
    def rivals(self) -> tuple[str, ...]:
        """Other possible causes; where its parts disagree, also all that the catalogue lists as similar."""
        disagree = any(not a.confirmation.agrees for a in self.agreements)
        like_it = effect(self.name).alike if disagree else ()
        return (*self.alike, *(n for n in like_it if n not in self.unknown))

    @property
    def sure(self) -> bool:
        """Whether the name is certain."""
        return self._chance > SURE

    @property
    def may_have_other_course(self) -> bool:
        """Whether residual or other courses add more doubt than the rivals do."""
        clear = replace(self, alike=(), beside=0)
        return not clear.sure and replace(clear, fits_p=1.0, other_courses=0.0).sure

    @property
    def _chance(self) -> float:
        doubts = len(self.rivals) + (not self.counted) + self.beside
        return chance_of_name(self.p_value, doubts, self.agreements, self.fits_p, self.other_courses)

    @property
    def compared(self) -> dict[str, Value]:
        """The quantities by which recordings are compared: ``whole`` sizes where another effect adds."""
        return self.parameters | dict(self.whole)

    def not_knowing(self, names: Collection[str]) -> Claim:
        """Return the claim with some effects treated as unknown."""
        return replace(self, alike=tuple(n for n in self.alike if n not in names), unknown=frozenset(names))

    @property
    def of_gauge_alone(self) -> bool:
        """Whether it is an event of the gauge run, which the inspection does not share."""
        return "time_s" in self.parameters and self.where == "gauge"

    @property
    def found(self) -> EffectFound:
        """The effect with the probability that its name is right."""
        drilled = _DRILLED[Channel(self.location.channel)]
        return EffectFound(
            self.name, min(self._chance, (drilled + 1) / (drilled + 2)),
            self.parameters, self.statement, effect(self.name).law,
            tuple(a.confirmation for a in self.agreements),
            course=CourseFound("constant", {}), recording="gauge" if self.of_gauge_alone else "",
            location=self.location,
        )  # fmt: skip


def claims_of(field: Seen | None, gauge: Seen | None, stated_exposure_s: float) -> list[Claim]:
    """Return the effects that motion and profile show; of two recordings the clearer with the other."""
    recordings = field, gauge
    of_probe = Exposure.of(stated_exposure_s, (field, gauge)), Exposure.of(stated_exposure_s, (gauge, field))
    field, gauge = of_probe[0].taken_off(field), of_probe[1].taken_off(gauge)
    of_field, of_gauge = _of_recording(field, of_probe[0]), _of_recording(gauge, of_probe[1])
    out = []
    for name in dict.fromkeys((*of_gauge, *of_field)):
        each = [c for c in (of_gauge.get(name), of_field.get(name)) if c is not None]
        if len(each) == 2:
            out.append(_borne_out(*sorted(each, key=lambda c: (c.of_gauge_alone, c.p_value))))
        else:
            out.append(_against(each[0], field if name in of_gauge else gauge))
    own_delay = any(c.name == "time_offset" and c.sure for c in out)
    out = [_of_exposure(c, recordings, own_delay) for c in out]
    return sorted((c for c in out if not _excluded(c, out)), key=lambda c: c.p_value)


def _of_exposure(claim: Claim, recordings: Sequence[Seen | None], own_delay: bool) -> Claim:
    """Return the claim of a longer exposure with the delay that it causes; any other unchanged."""
    size, words = how_late(claim.parameters, recordings, own_delay)
    return replace(claim, parameters=size, statement=claim.statement + words)


def _excluded(claim: Claim, claims: Sequence[Claim]) -> bool:
    """Return whether a recording that can distinguish a claim's rivals has decided for one of them."""
    return any(c.name in claim.alike and claim.name not in c.alike for c in claims)


def _of_recording(seen: Seen | None, exposure: Exposure) -> dict[str, Claim]:
    """Return the claims of a recording by name; of several events the clearest."""
    if seen is None:
        return {}
    return {c.name: c for c in sorted(_every(seen, exposure), key=lambda c: -c.p_value)}


def _every(seen: Seen, exposure: Exposure) -> Iterable[Claim]:
    if seen.travel is not None:
        travel = seen.travel
        yield from (_of_estimate(e, travel, exposure) for e in travel.estimates if is_found(e.p_value))
        yield from (_of_slip(s, travel) for s in travel.slips if is_found(s.p_value))
        yield from (_of_swing(line, seen, travel) for line in travel.lines if _is_swing(line))
    if seen.profile is not None:
        for f in seen.profile.found:
            claim = _of_finding(f, seen.profile, seen.name)
            too_long = exposure.too_long(seen, f)
            if too_long:
                words = claim.statement.rstrip(".") + too_long
                claim = replace(claim, beside=claim.beside + 1, statement=words)
            yield claim


def _of_estimate(e: TravelEstimate, travel: TravelEvidence, exposure: Exposure) -> Claim:
    alike = (*(n for n, _ in e.alike), *exposure.alike(e, travel))
    goes_with = [_GOES_WITH[n] for n in (e.effect, *alike) if n in _GOES_WITH]
    places, times = {place for place, _ in goes_with}, {time for _, time in goes_with}
    fixed_to, time = places.pop() if len(places) == 1 else None, times.pop() if len(times) == 1 else None
    # Where a step is in doubt, stray pictures are as likely as a slip.
    beside = bool(travel.unsettled) + (travel.unexplained is not None)
    beside += exposure.leaves_open(e)
    return Claim(
        e.effect, {e.quantity: own_size(e)}, e.statement, e.p_value, alike, travel.source,
        stretch(travel, e.where, fixed_to, time), e.agreements,
        beside=beside, fits_p=travel.fits_p, other_courses=e.other_courses,
        whole=((e.quantity, whole_size(e)),) if e.taken_off else (),
    )  # fmt: skip


def _of_slip(step: StepFound, travel: TravelEvidence) -> Claim:
    size = {
        "slip_mm": Value(step.gain_mm, step.sigma_mm), "time_s": Value(step.time_s, step.time_sigma_s),
        "duration_s": Value(step.lasting_s, step.time_sigma_s),
    }  # fmt: skip
    words = (
        f"The encoder's wheel slips at {step.time_s:.2f} s for about {step.lasting_s:.2f} s, and its reading "
        f"{'gains' if step.gain_mm > 0 else 'loses'} {abs(step.gain_mm):.2f} mm."
    )
    where = (step.place - 1, step.place)
    location = stretch(travel, where, FixedTo.TIME, "event")
    # A slip visible in the readings alone does not depend on what pictures leave in doubt elsewhere.
    alone = bool(step.agreements) and all(a.confirmation.agrees for a in step.agreements)
    beside = (bool(travel.unsettled) and not alone) + (travel.unexplained is not None)
    return Claim(
        "encoder_slip", size, words, step.p_value, (), travel.source, location, step.agreements,
        beside=beside, fits_p=travel.fits_p,
    )  # fmt: skip


def _is_swing(line: Line) -> bool:
    return is_found(line.p_value) and "probe_vibration" in line.explained_by


def _of_swing(line: Line, seen: Seen, travel: TravelEvidence) -> Claim:
    turn = float(np.degrees(line.sigma_mm / line.amplitude_mm))
    size = {
        "amplitude_mm": Value(line.amplitude_mm, float(np.hypot(line.sigma_mm, _TURNED * line.amplitude_mm))),
        "frequency_hz": Value(line.frequency_hz, line.frequency_sigma_hz),
        "direction_deg": Value(line.direction_deg, turn),
    }
    at_rest = rocking_excluded(seen.geometry, line.amplitude_mm)
    excluded = ("probe_vibration", "laser_rocking") if at_rest else ("probe_vibration",)
    others = tuple(n for n in line.explained_by if n not in excluded)
    words = (
        f"The camera swings across the pipe by {line.amplitude_mm:.3f} mm at {line.frequency_hz:.2f} Hz "
        "or an alias of it."
    )
    location = stretch(travel, None, FixedTo.TIME, "periodic")
    return Claim(
        "probe_vibration", size, words, line.p_value, others, travel.source, location, line.agreements
    )


def _of_finding(f: Finding, profile: ProfileEvidence, where: str) -> Claim:
    size = {s.name: Value(float(s.value), float(s.sigma)) for s in f.sizes}
    frames = (int(profile.frame[0]), int(profile.frame[-1])) if len(profile.frame) else None
    azimuth = None
    if {"azimuth_deg", "width_deg"} <= size.keys():
        middle, width = size["azimuth_deg"].value, size["width_deg"].value
        azimuth = (middle - width, middle + width)
    fixed_to = str(f.fixed_to) if f.fixed_to is not None else None
    location = Location(str(Channel.PROFILE), fixed_to, f.time, frames=frames, azimuth_deg=azimuth)
    counted = not profile.uncovered
    return Claim(f.effect, size, f.statement, f.p_value, f.alike, where, location, f.agreements, counted)


def stretch(
    travel: TravelEvidence, places: tuple[int, int] | None, fixed_to: FixedTo | None, time: str | None
) -> Location:
    """Return where motion shows it: in the frames between two places of the sight, or in all frames."""
    sight = travel.fit.sight if travel.fit is not None else None
    frames, stretch = None, None
    if sight is not None and len(sight.frame):
        here = slice(None) if places is None else slice(places[0], places[1] + 1)
        frame, distance = sight.frame[here], sight.distance_mm[here]
        frames = (int(frame[0]), int(frame[-1]))
        stretch = (float(distance.min()), float(distance.max()))
    fixed = str(fixed_to) if fixed_to is not None else None
    return Location(str(Channel.MOTION), fixed, time, frames=frames, distance_mm=stretch)


def _borne_out(claim: Claim, other: Claim) -> Claim:
    """Return the claim with the other recording's evidence; a rival remains only where both leave it."""
    alike = tuple(n for n in claim.alike if n in other.alike)
    return replace(_compared(claim, other.where, other.compared), alike=alike)


def _against(claim: Claim, other: Seen | None) -> Claim:
    """Return the claim compared with the other recording's estimate, even if that is no claim itself."""
    travel = other.travel if other is not None else None
    estimate = travel.estimate(claim.name) if travel is not None else None
    if travel is None or estimate is None or not np.isfinite(estimate.sigma) or estimate.alike:
        return claim
    return _compared(claim, travel.source, {estimate.quantity: whole_size(estimate)})


def _compared(claim: Claim, where: str, sizes: Mapping[str, Value]) -> Claim:
    both = agreements(claim.where, claim.compared, where, sizes, "whole " if claim.whole else "")
    return replace(claim, agreements=(*claim.agreements, *both))
