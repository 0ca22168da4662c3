"""What was found in a gauge run's rings and fiducials, as effects, class, candidates and quality of fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.diagnose.gauge.confirm import Sized, course_of, quantities
from stages.diagnose.gauge.elimination import RING
from stages.diagnose.gauge.examine import ADEQUATE, Examined
from stages.diagnose.gauge.judge import Verdicts
from stages.diagnose.gauge.run import Term
from stages.diagnose.result import Candidate, Confirmation, EffectFound, Picture, Verdict

# Likelihoods do not contain the small errors of laws and of image formation, so that odds of 1000 to 1 are
# asked for instead of 30 to 1: a drawn focal length was once called a cone at 0.99. Debt: data/debts.md.
CONFIDENT = 0.999
_IN_CLASS = 0.01


def effects_found(examined: Examined) -> tuple[EffectFound, ...]:
    """Return the effects of the likeliest hypothesis with sizes and chances."""
    best, verdicts = examined.best, examined.verdicts
    if best is None or verdicts is None or not best.named:
        return ()
    each = zip(best.fit.terms, examined.sizes, examined.confirmed, strict=True)
    return tuple(_found(verdicts, term, sized, confirmed) for term, sized, confirmed in each)


def _found(verdicts: Verdicts, term: Term, sized: Sized, confirmed: tuple[Confirmation, ...]) -> EffectFound:
    model, shape = term.model, term.shape if sized.time_s is None else (sized.time_s.value,)
    return EffectFound(
        model.law, verdicts.chance_of(model.law), quantities(sized),
        model.statement(shape, term.amplitude), model.equation(shape, term.amplitude),
        confirmed, replace(course_of(sized), probability=verdicts.chance_of_course(model)),
    )  # fmt: skip


def candidates(examined: Examined) -> tuple[Candidate, ...]:
    """Return every explanation tried with what it gains."""
    if examined.verdicts is None:
        return ()
    judged = examined.verdicts.judged
    nothing = next(j for j in judged if not j.fit.terms)
    return tuple(
        Candidate(
            j.names, float(p), nothing.surprise - j.surprise, nothing.heldout - j.heldout,
            " ".join(t.model.statement(t.shape, t.amplitude) for t in j.fit.terms) or "Nothing was left out.",
        )
        for p, j in zip(examined.verdicts.probability, judged, strict=True)
    )  # fmt: skip


def members(examined: Examined) -> tuple[str, ...]:
    """Return the names that cannot be ruled out, by these measurements or by what they could tell."""
    if examined.verdicts is None:
        return ()
    pairs = zip(examined.verdicts.probability, examined.verdicts.judged, strict=True)
    names = [n for p, j in pairs if p > _IN_CLASS and j.named for n in j.laws]
    return tuple(dict.fromkeys([*names, *examined.unsplit]))


def formula(examined: Examined) -> str:
    """Return the empirical formula for what nothing of the library explains."""
    if examined.verdicts is None:
        return ""
    terms = examined.verdicts.formula.fit.terms
    return "; ".join(t.model.equation(t.shape, t.amplitude) for t in terms)


def ring_picture(examined: Examined, azimuths: int = 180) -> Picture:
    """Return the rings' residuals over azimuth and frame, mm, before and after."""
    searched, best = examined.searched, examined.best
    after = best.fit if best is not None else searched.found
    rings = searched.run.rings
    azimuth = np.arctan2(rings.outward[:, 1], rings.outward[:, 0])
    column = np.floor((azimuth + np.pi) / (2 * np.pi) * azimuths).astype(int) % azimuths
    frame, row = np.unique(rings.frame, return_inverse=True)
    pictures = []
    for found in (searched.nothing, after):
        equations = found.linearised.equations
        residual = equations.residual[equations.kind == RING]
        total, count = (np.zeros((len(frame), azimuths)) for _ in range(2))
        np.add.at(total, (row, column), residual)
        np.add.at(count, (row, column), 1)
        pictures.append(np.where(count > 0, total / np.maximum(count, 1), np.nan))
    middle = (np.arange(azimuths) + 0.5) / azimuths * 2 * np.pi - np.pi
    return Picture(frame, middle, *pictures)


def verdict_of(examined: Examined) -> Verdict:
    """Return what rings and fiducials alone come to."""
    best, verdicts = examined.best, examined.verdicts
    if best is None or verdicts is None:
        return Verdict.CONSISTENT
    if not best.named or verdicts.adequacy < ADEQUATE:
        return Verdict.UNEXPLAINED
    contradicted = [any(not c.agrees for c in each) for each in examined.confirmed]
    if contradicted and all(contradicted):
        return Verdict.UNEXPLAINED
    sure = all(verdicts.chance_of(law) > CONFIDENT for law in best.laws)
    confirmed = all(each for each in examined.confirmed)
    # An effect that is contradicted by the field is withdrawn; the others stay.
    doubted = any(contradicted) or bool(examined.unsplit)
    return Verdict.NAMED if sure and confirmed and not doubted else Verdict.CLASS
