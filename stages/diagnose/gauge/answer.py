"""What was found in a gauge run's rings and fiducials, as effects, class, candidates and quality of fit."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import chain

import numpy as np

from stages.diagnose.gauge.confirm import Sized, course_of, quantities
from stages.diagnose.gauge.elimination import RING
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.gauge.formula import ADEQUATE, pattern_of
from stages.diagnose.gauge.judge import Judged, Verdicts
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.search import shift_px
from stages.diagnose.inference import SURE, UNKNOWN
from stages.diagnose.result import Candidate, Confirmation, EffectFound, Picture, Verdict

# What was held out is predicted to the noise where its r.m.s. is below so many noise floors. Under right
# names, and where nothing is hidden, 25 runs at ring level come to 1.03–1.16 (mean 1.11, s.d. 0.04: samples
# of one fiducial err alike, which the floor does not have), four rendered ones to 1.00–1.17; this is 5 s.d.
# beyond. A wrong explanation of four effects came to 1.36 (`bench_diagnosis --mode several`, case 1).
_MOST_OF_FLOOR = 1.3


def effects_found(examined: Examined) -> tuple[EffectFound, ...]:
    """Return the effects of the likeliest hypothesis with sizes and chances."""
    best, verdicts = examined.best, examined.verdicts
    if best is None or verdicts is None:
        return ()
    each = zip(best.library_terms, examined.sizes, examined.confirmed, _doubts(examined), strict=False)
    return tuple(_found(verdicts, *one) for one in each)


def _doubts(examined: Examined) -> tuple[float, ...]:
    """Return for each effect of the likeliest the odds against its name beyond those of fitted hypotheses.

    What is not expected to be told from it is as likely as it, and so is, with `UNKNOWN`, a cause that nobody
    knows, where no second prediction agrees.
    """
    return tuple(
        len(alike) + UNKNOWN * (not (confirmed and all(c.agrees for c in confirmed)))
        for alike, confirmed in zip(examined.unsplit, examined.confirmed, strict=True)
    )


def sure(examined: Examined) -> tuple[bool, ...]:
    """Return for each effect of the likeliest hypothesis whether its name is sure, whatever else is left.

    It must be as likely as a name has to be, told from all that is like it and from every pattern without a
    cause, and confirmed; what was held out must fit to about the noise. Beside patterns for what is left it
    must move rings or fiducials by more than they do, else it may make up for their error; no other names, as
    many or fewer, may predict what was held out better; and nothing else
    that was found may have its harmonic and its course, else the two may make up for one law that the library
    does not have.
    """
    best, verdicts = examined.best, examined.verdicts
    if best is None or verdicts is None or verdicts.adequacy < ADEQUATE:
        return ()
    if not _fits(examined):
        return (False,) * len(best.library_terms)
    patterns = best.fit.terms[len(best.library_terms) :]
    left = [shift_px(best.fit, t) for t in patterns]
    like = Counter(pattern_of(t)[1:] for t in best.fit.terms)
    each = zip(best.library_terms, examined.unsplit, examined.confirmed, strict=False)
    return tuple(
        verdicts.chance_of(term.model.law) > SURE
        and not alike
        and bool(confirmed)
        and all(c.agrees for c in confirmed)
        and (not left or shift_px(best.fit, term) > max(left))
        and like[pattern_of(term)[1:]] == 1
        and all(term.model.law in j.laws for j in better_held_out(verdicts))
        for term, alike, confirmed in each
    )


def better_held_out(verdicts: Verdicts) -> tuple[Judged, ...]:
    """Return hypotheses of as many names as the likeliest, or fewer, that predict better what was held out.

    A drift of the focal length was once called one of the distortion, at 99 to 1.
    """
    best, *others = verdicts.judged
    as_few = (j for j in others if j.named and len(j.library_terms) <= len(best.library_terms))
    return tuple(j for j in as_few if j.heldout < best.heldout)


def _fits(examined: Examined) -> bool:
    """Return whether what had no say in the fit is predicted to about the noise, where that was tried."""
    quality = examined.quality
    return quality is None or not quality.heldout_after > _MOST_OF_FLOOR * quality.noise_floor


def unknown_rivals(examined: Examined) -> tuple[str, ...]:
    """Return the patterns without a cause that leave a name of the likeliest unsure, the likeliest first."""
    each = chain(*examined.verdicts.unknown) if examined.verdicts is not None else ()
    doubted = sorted((r for r in each if r.odds > 1 - SURE), key=lambda r: -r.odds)
    return tuple(dict.fromkeys(r.formula for r in doubted))


def beyond_line(examined: Examined) -> tuple[bool, ...]:
    """Return for each effect whether it moves the line by more than its width, as no light beside it can."""
    best = examined.best
    width_px = float(np.median(examined.searched.run.width_px))
    return tuple(shift_px(best.fit, t) > width_px for t in best.library_terms) if best is not None else ()


def _found(
    verdicts: Verdicts, term: Term, sized: Sized, confirmed: tuple[Confirmation, ...], doubt: float
) -> EffectFound:
    model, shape = term.model, term.shape if sized.time_s is None else (sized.time_s.value,)
    return EffectFound(
        model.law, verdicts.chance_of(model.law) / (1 + doubt), quantities(sized),
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
    verdicts, best = examined.verdicts, examined.best
    if verdicts is None or best is None:
        return ()
    certain = {t.model.law for t, is_sure in zip(best.library_terms, sure(examined), strict=False) if is_sure}
    before = np.cumsum(verdicts.probability) - verdicts.probability
    likely = [j for j, sum_before in zip(verdicts.judged, before, strict=True) if sum_before < SURE]
    names = (t.model.law for j in (*likely, *better_held_out(verdicts)) for t in j.library_terms)
    return tuple(n for n in dict.fromkeys((*names, *chain(*examined.unsplit))) if n not in certain)


def formula(examined: Examined) -> str:
    """Return the empirical formula for what nothing of the library explains."""
    if examined.verdicts is None:
        return ""
    best = examined.best
    patterns = best.fit.terms[len(best.library_terms) :] if best is not None and best.library_terms else ()
    terms = patterns or examined.verdicts.formula.fit.terms
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
    contradicted = [any(not c.agrees for c in each) for each in examined.confirmed]
    if not best.library_terms or verdicts.adequacy < ADEQUATE or all(contradicted):
        return Verdict.UNEXPLAINED
    if all(sure(examined)):
        return Verdict.NAMED if best.named else Verdict.PARTLY
    if any(sure(examined)):
        return Verdict.PARTLY
    # A class of effects would leave out what nobody knows.
    known = any(examined.unsplit) or not unknown_rivals(examined)
    return Verdict.CLASS if best.named and known else Verdict.UNEXPLAINED
