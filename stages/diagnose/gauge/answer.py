"""What was found in a gauge run's rings and fiducials, as effects, class, candidates and quality of fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stages.diagnose.classes import alike as of_one_class
from stages.diagnose.gauge.confirm import partial_of
from stages.diagnose.gauge.elimination import RING
from stages.diagnose.gauge.examine import ADEQUATE, Examined
from stages.diagnose.gauge.judge import Judged
from stages.diagnose.gauge.run import Term
from stages.diagnose.inference import Stated
from stages.diagnose.result import (
    Candidate,
    Confirmation,
    EffectFound,
    Picture,
    Value,
    Verdict,
)

Float = NDArray[np.float64]
CONFIDENT = 0.97
_IN_CLASS = 0.01
_DRAWS = 400


def effects_found(examined: Examined, stated: Stated) -> tuple[EffectFound, ...]:
    """Return the effects of the likeliest hypothesis with sizes and chances."""
    best, verdicts = examined.best, examined.verdicts
    if best is None or verdicts is None or not best.named:
        return ()
    out = []
    for term, confirmed in zip(best.fit.terms, examined.confirmed, strict=True):
        chance = verdicts.chance_of(term.model.name)
        out.append(_found(term, best, chance, confirmed, stated))
    return tuple(out)


def _found(
    term: Term, best: Judged, chance: float, confirmed: tuple[Confirmation, ...], stated: Stated
) -> EffectFound:
    part = partial_of("all", best.evidence, best, term, stated)
    covariance = part.covariance if part is not None else np.zeros((len(term.amplitude),) * 2)
    return EffectFound(
        term.model.name, chance, quantities(term, covariance),
        term.model.statement(term.shape, term.amplitude), term.model.equation(term.shape, term.amplitude),
        confirmed,
    )  # fmt: skip


def quantities(term: Term, covariance: Float) -> dict[str, Value]:
    """Return the catalogue's quantities with 1 σ, by draws of the amplitudes."""
    random = np.random.default_rng(0)
    draws = random.multivariate_normal(term.amplitude, covariance, _DRAWS, check_valid="ignore")
    middle = term.model.quantities(term.shape, term.amplitude)
    drawn = [term.model.quantities(term.shape, a) for a in draws]
    out = {}
    for name, value in middle.items():
        apart = np.array([d[name] for d in drawn]) - value
        if name.endswith("_deg") and name.startswith("direction"):
            apart = (apart + 180) % 360 - 180
        out[name] = Value(value, float(np.sqrt(np.mean(apart**2))))
    return out


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
    names = [n for p, j in pairs if p > _IN_CLASS and j.named for n in j.names]
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
    if any(not c.agrees for each in examined.confirmed for c in each):
        return Verdict.UNEXPLAINED
    sure = all(verdicts.chance_of(n) > CONFIDENT for n in best.names)
    confirmed = all(each for each in examined.confirmed)
    return Verdict.NAMED if sure and confirmed and not examined.unsplit else Verdict.CLASS


def same_class(names: tuple[str, ...]) -> bool:
    """Return whether all names are alike."""
    return all(of_one_class(names[0], other) for other in names[1:])
