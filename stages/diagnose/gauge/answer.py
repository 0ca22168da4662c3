"""The result from a gauge run's rings and fiducials: effects, class, candidates and quality of fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.physics.catalogue import effect
from pipeline.physics.effect import CourseKind, FixedTo
from stages.diagnose.agreement import TELLING
from stages.diagnose.effects.courses import Coursed, Drifting
from stages.diagnose.effects.library import LIBRARY, ring_shift_px
from stages.diagnose.gauge.confirm import Sized, course_of, quantities
from stages.diagnose.gauge.doubts import chances, fits, sure
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.gauge.formula import ADEQUATE
from stages.diagnose.gauge.judge import Verdicts
from stages.diagnose.gauge.run import Term, pattern_of
from stages.diagnose.gauge.search import ring_shift_alone_px, shift_px
from stages.diagnose.gauge.unknown_laws import Unknown
from stages.diagnose.inference import SURE
from stages.diagnose.result import Candidate, Confirmation, EffectFound, Location, Value, Verdict

# Explanations that were weighed but not fitted are listed above this probability: all others together change
# no answer.
_LISTED = 1e-3
# Nothing predicts how far a second line pulls the first. Least squares with one line follow a second one of
# height h at a distance d, both of width σ, by h d exp(−d² / 4σ²), which is largest, √(2/e) h σ, at d = √2 σ.
_SECOND_LINES, _MOST_PULL = ("ghost_ring", "tube_ghost"), float(np.sqrt(2 / np.e))
# Rings exclude a rocking sheet only if all sets of effects with one are less likely than this together.
_ROCKING_P = 0.01
_REPEATS = (
    "Rings and fiducials of the gauge run lie {:.2f} px from where its other parts predict them; noise makes "
    "{:.2f} px. The rest is the same at one place of the image on other wall, and no effect or simple "
    "pattern explains it."
)


def effects_found(examined: Examined) -> tuple[EffectFound, ...]:
    """Return the effects of the likeliest hypothesis with sizes and probabilities."""
    best, verdicts = examined.best, examined.verdicts
    if best is None or verdicts is None:
        return ()
    duration_s = float(np.ptp(examined.searched.run.time_s))
    each = zip(best.library_terms, examined.sizes, examined.confirmed, chances(examined), strict=False)
    return tuple(_found(verdicts, duration_s, *one) for one in each)


def unknown_rivals(examined: Examined) -> tuple[str, ...]:
    """Return the causeless patterns that make a name of the likeliest uncertain, likeliest first.

    One may do so alone, or all together where no other names are likelier in its place.
    """
    best, verdicts = examined.best, examined.verdicts
    if best is None or verdicts is None:
        return ()
    doubted = dict[str, float]()
    for term in best.library_terms:
        instead = verdicts.instead_of(term)
        least = 0.0 if instead.nameless > max(1 - SURE, instead.named) else 1 - SURE
        for formula, p in instead.patterns.items():
            if p > least:
                doubted[formula] = max(p, doubted.get(formula, 0.0))
    return tuple(sorted(doubted, key=lambda formula: -doubted[formula]))


def unknown_law_descriptions(examined: Examined) -> tuple[str, ...]:
    """Return, for each name that an unknown law makes uncertain, a description of that law."""
    best = examined.best
    each = zip(best.library_terms, examined.unknown_laws, strict=True) if best is not None else ()
    unsure = [(t.model.law, beyond) for t, beyond in each if beyond.odds > 1 - SURE]
    return tuple(dict.fromkeys(f"one like {law} {_otherwise(beyond)}" for law, beyond in unsure))


def _otherwise(beyond: Unknown) -> str:
    grows = beyond.growth > beyond.course
    return "with another dependence on the radius" if grows else "with another course in time"


def beyond_line(examined: Examined) -> tuple[bool, ...]:
    """Return, for each effect, whether it shifts the line by more than its width: no light can."""
    best = examined.best
    width_px = float(np.median(examined.searched.run.width_px))
    return tuple(shift_px(best.fit, t) > width_px for t in best.library_terms) if best is not None else ()


def may_be_light(examined: Examined, name: str, size: Value | None) -> bool:
    """Return whether all that rings show may be the line's own light, whose effect ``name`` has this size.

    It moves no fiducials, and the line by no more than its own law says for what is unknown of the size. An
    effect without a size, or whose influence is not predicted, explains nothing.
    """
    best, quality = examined.best, examined.quality
    most_px = _unknown_shift_px(examined, name, size) if size is not None else 0.0
    if best is not None:
        return all(ring_shift_alone_px(best.fit, t) < most_px for t in best.fit.terms)
    return quality is not None and quality.heldout_after**2 - quality.noise_floor**2 < most_px**2


def _unknown_shift_px(examined: Examined, name: str, size: Value) -> float:
    """Return the RMS shift, px, of rings by what is unknown of a light: its σ, or a second line's whole pull.

    A size that is worse known than 100 % moves no more than it does itself.
    """
    searched = examined.searched
    if name in _SECOND_LINES:
        return float(_MOST_PULL * abs(size.value) * np.median(searched.run.width_px))
    if name not in LIBRARY:
        return 0.0
    unknown = np.array([min(size.sd, abs(size.value))])
    model, rings = LIBRARY[name], searched.nothing.linearised.rings
    each = (ring_shift_px(model, rings, shape, unknown) for shape in model.shapes(0.0, 1.0))
    return max(float(np.sqrt(np.nanmean(shift**2))) for shift in each)


def rocking_excluded(examined: Examined | None, amplitude_mm: float) -> bool:
    """Return whether a sheet that makes the ring oscillate so much would be visible, but rings show none.

    If the sheet is assumed to be at rest, a tilt φ of it moves the ring like a camera that is r² φ / l off
    the axis. But only a sheet moves rings relative to fiducials, the more the wider the bore.
    """
    if examined is None:
        return False
    rings, verdicts = examined.searched.nothing.linearised.rings, examined.verdicts
    about = [f for f in examined.feasibility if f.name == "laser_rocking"]
    sets = verdicts.sets if verdicts is not None else ()
    suspected = sum(p for p, terms in sets if any(t.model.law == "laser_rocking" for t in terms))
    if not about or suspected > _ROCKING_P:
        return False
    needed_mrad = 1e3 * amplitude_mm * rings.probe.laser.baseline_mm / float(np.max(rings.radius_mm)) ** 2
    return bool(needed_mrad > about[0].detectable)


def _found(
    verdicts: Verdicts, duration_s: float, term: Term, sized: Sized,
    confirmed: tuple[Confirmation, ...], chance: float,
) -> EffectFound:  # fmt: skip
    model, shape = term.model, term.shape if sized.time_s is None else (sized.time_s.value,)
    return EffectFound(
        model.law, chance, quantities(sized),
        model.statement(shape, term.amplitude) + _in_the_end(sized, duration_s),
        model.equation(shape, term.amplitude),
        confirmed, replace(course_of(sized), probability=verdicts.chance_of_course(term)),
    )  # fmt: skip


def _in_the_end(sized: Sized, duration_s: float) -> str:
    """Return a sentence on the final value of a drift; empty where the run only extrapolates to it."""
    model, size = sized.term.model, next(iter(quantities(sized).values()), Value(0.0, 0.0))
    if not isinstance(model, Drifting | Coursed) or model.kind is not CourseKind.EXPONENTIAL:
        return ""
    shape, amplitude = sized.term.at(sized.term.amplitude)
    if shape[0] > duration_s or not size.sd < TELLING * abs(size.value):
        return ""
    own = model.own if isinstance(model, Coursed) else ()
    words = model.static.statement(own, amplitude).rstrip(".")
    known = effect(model.law).quantities[0]
    scale, unit = (100.0, "%") if known.name == "relative" else (1.0, f" {known.unit}".rstrip())
    return f" In the end, {words[0].lower()}{words[1:]}, ± {scale * size.sd:.1g}{unit}."


def candidates(examined: Examined) -> tuple[Candidate, ...]:
    """Return every explanation that was fitted, and the likeliest of the others, with what each gains."""
    verdicts = examined.verdicts
    if verdicts is None:
        return ()
    nothing = next(j for j in verdicts.judged if not j.fit.terms)
    before = nothing.deviance + nothing.prior_deviance
    fitted = [
        Candidate(
            j.names, float(p), nothing.deviance - j.deviance, nothing.heldout - j.heldout,
            " ".join(t.model.statement(t.shape, t.amplitude) for t in j.fit.terms) or "Nothing was left out.",
        )
        for p, j in zip(verdicts.probability, verdicts.judged, strict=True)
    ]  # fmt: skip
    weighed = [
        Candidate(
            tuple(sorted(m.model.name for m in u.members)), u.probability, before - u.deviance, np.nan,
            u.statement or "Nothing was left out.",
        )
        for u in verdicts.unfitted
        if u.probability > _LISTED
    ]  # fmt: skip
    return tuple(sorted((*fitted, *weighed), key=lambda c: -c.probability))


def members(examined: Examined) -> tuple[str, ...]:
    """Return the names that cannot be excluded."""
    verdicts, best = examined.verdicts, examined.best
    if verdicts is None or best is None:
        return ()
    certain = {t.model.law for t, is_sure in zip(best.library_terms, sure(examined), strict=False) if is_sure}
    return tuple(n for n in verdicts.likely_laws(SURE) if n not in certain)


def formula(examined: Examined) -> str:
    """Return the empirical formula for what no effect of the library explains."""
    if examined.verdicts is None:
        quality = examined.quality if examined.repeats else None
        return _REPEATS.format(quality.heldout_after, quality.noise_floor) if quality is not None else ""
    best = examined.best
    patterns = best.fit.terms[len(best.library_terms) :] if best is not None and best.library_terms else ()
    terms = patterns or examined.verdicts.formula.fit.terms
    return "; ".join(t.model.equation(t.shape, t.amplitude) for t in terms)


def places(examined: Examined, verdict: Verdict) -> tuple[str, ...]:
    """Return what the mismatch may be fixed to, likeliest first, where rings and fiducials found one.

    What has no name is described by known effects and by the formula. Neither is accepted, so that both
    count. A drift without a cause tells no place.
    """
    best, verdicts, measured = examined.best, examined.verdicts, examined.location
    if measured is None or measured.fixed_to is None:
        return ()
    if verdict is not Verdict.UNEXPLAINED or best is None or verdicts is None:
        return (measured.fixed_to,)
    fits = (best.fit, verdicts.formula.fit)
    each = [measured.fixed_to, *(pattern_of(fit.terms[0])[0] for fit in fits if fit.terms)]
    return tuple(p for p in dict.fromkeys(each) if p != FixedTo.TIME) or (measured.fixed_to,)


def location(examined: Examined, verdict: Verdict) -> Location | None:
    """Return where rings and fiducials show the mismatch, and what it is fixed to where that can be told.

    Place, order and growth are measured under one law: of a class, those are told that all members share.
    """
    known = examined.location
    if known is None or verdict is Verdict.CLASS:
        return _shared(known, members(examined)) if known is not None else None
    if len(places(examined, verdict)) < 2:
        return known
    return replace(known, fixed_to=None, harmonic=None, radial_exponent=None)


def _shared(measured: Location, names: Sequence[str]) -> Location:
    """Return a location without what effects differ in."""
    each = [effect(name) for name in names]
    places, orders, growths = (
        {getattr(e, what) for e in each} for what in ("fixed_to", "harmonic", "radial_exponent")
    )
    return replace(
        measured,
        fixed_to=measured.fixed_to if len(places) < 2 else None,
        harmonic=measured.harmonic if len(orders) < 2 else None,
        radial_exponent=measured.radial_exponent if len(growths) < 2 else None,
    )


def explains(examined: Examined) -> bool:
    """Return whether the likeliest effects explain the run, though an unknown cause may do so, too.

    If held-out measurements are not predicted, something unknown was left out.
    """
    best, verdicts = examined.best, examined.verdicts
    if best is None or verdicts is None or not best.library_terms:
        return False
    contradicted = all(any(not c.agrees for c in each) for each in examined.confirmed)
    return verdicts.adequacy >= ADEQUATE and fits(examined) and not contradicted


def known_explanation(examined: Examined) -> str:
    """Return, in words, known effects that explain a run as well as an unknown cause; empty for none."""
    best = examined.best
    if best is None or not best.named or not explains(examined):
        return ""
    if verdict_of(examined) is not Verdict.UNEXPLAINED:
        return ""
    return " ".join(e.statement for e in effects_found(examined))


def verdict_of(examined: Examined) -> Verdict:
    """Return the verdict from rings and fiducials alone."""
    best, verdicts = examined.best, examined.verdicts
    if best is None or verdicts is None:
        return Verdict.UNEXPLAINED if examined.repeats else Verdict.CONSISTENT
    if not explains(examined):
        return Verdict.UNEXPLAINED
    if all(sure(examined)):
        return Verdict.NAMED if best.named else Verdict.PARTLY
    if any(sure(examined)):
        return Verdict.PARTLY
    # A class of effects would not include the unknown cause.
    known = not unknown_rivals(examined)
    known &= all(beyond.odds < 1 for beyond in examined.unknown_laws)
    return Verdict.CLASS if best.named and known else Verdict.UNEXPLAINED
