"""An empirical formula by sparse regression, and tests of what remains without further effects.

Orthogonal matching pursuit (Y. Pati et al., 1993) over patterns in (r, ψ, t, s, speed, row), on the evidence
from which poses and the stated instrument are eliminated.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import stats

from pipeline.arrays import Float, Int
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.effects.nameless import Nameless
from stages.diagnose.effects.vocabulary import SWINGS, VOCABULARY
from stages.diagnose.gauge.fit import Fit, evidence, fit
from stages.diagnose.gauge.linearise import asking, linearise
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.gauge.scan import Scored, freed, refined, scan
from stages.diagnose.gauge.sets import SAME
from stages.diagnose.inference import (
    DEGREES,
    DETECTED,
    Around,
    Evidence,
    Score,
    Stated,
    eliminated,
    instrument_places,
    places_of,
    places_of_all,
)

_MOST_TERMS = 4
# A fit is adequate unless noise alone gives its residual with less than this probability. Debt:
# data/debts.md.
ADEQUATE = 1e-5
# Directions with less information than this share of the best one are excluded from the test of adequacy.
# Debt: data/debts.md.
_WEAK = 1e-3


def empirical(run: GaugeRun, before: Fit, stated: Stated, swung: Sequence[Scored]) -> Fit:
    """Return a fit extended by the few patterns that explain most of its residual.

    ``swung`` are the `swings` about that fit.
    """
    swinging = [s for s in swung if s.p_value * len(SWINGS) < DETECTED]
    words = [*VOCABULARY, *((s.model, s.shape) for s in swinging)]
    has_patterns = any(isinstance(t.model, Nameless) for t in before.terms)
    about = evidence(run, before, words)[0] if swinging or has_patterns else before.of_patterns
    own = [(t.model, t.shape) for t in before.terms]
    chosen: list[tuple[EffectModel, Shape, Score]] = []
    for _ in range(_MOST_TERMS):
        given = places_of_all(about, [*own, *((m, s) for m, s, _ in chosen)])
        left = [w for w in words if w not in [(m, s) for m, s, _ in chosen]]
        best = _next(about, stated, given, left)
        if best is None:
            break
        chosen.append(best)
    terms = [Term(model, shape, np.zeros(len(model.amplitudes))) for model, shape, _ in chosen]
    return refined(run, fit(run, before.state, (*before.terms, *terms)))


def may_need_pattern(left: float, swung: Sequence[Scored]) -> bool:
    """Return whether a pattern or swing may be needed: noise makes the rest with probability ``left``."""
    return left < 2 * DETECTED or any(s.p_value * len(SWINGS) < DETECTED for s in swung)


def swings(run: GaugeRun, found: Fit, stated: Stated) -> list[Scored]:
    """Return what each swing without a cause explains at its best frequency."""
    return scan(run, found, {model.name: model for model in SWINGS}, stated)


def patterns_by_chance(nothing: Fit, stated: Stated, swung: Sequence[Scored]) -> float:
    """Return the expected number of equally good patterns and swings when nothing is hidden."""
    swinging = min((s.p_value for s in swung), default=1.0) * len(SWINGS)
    return 2 * min(_by_chance(nothing.of_patterns, nothing.terms, stated), swinging)


def describes_effects(run: GaugeRun, formula: Fit, named: Fit, scores: Sequence[Scored] = ()) -> bool:
    """Return whether a formula's pattern equals, within the laws' accuracy, one that named effects make.

    Such a pattern describes those effects and is not a rival, even if it also fits some of the noise. Nor is
    a formula each of whose patterns equals one of these effects, or one with a score: under their names they
    are another hypothesis.
    """
    known = [(s.model, s.shape) for s in scores]
    terms = freed(run, named).terms
    patterns = [(t.model, t.shape) for t in formula.terms]
    equations = asking(run, named.state, linearise(run, named.state, terms), [*patterns, *known])
    size = [len(t.amplitude) for t in (*terms, *formula.terms)] + [len(m.amplitudes) for m, _ in known]
    weighted = np.sqrt(equations.weight)[:, None] * equations.by_global[:, -sum(size) :]
    columns = np.split(weighted, np.cumsum(size)[:-1], axis=1)
    effects, rest = columns[: len(terms)], columns[len(terms) :]
    each = [c @ t.amplitude for c, t in zip(rest, formula.terms, strict=False)]
    if effects and _is_made_by(np.sum(each, axis=0), np.concatenate(effects, axis=1)):
        return True
    single = (*effects, *rest[len(each) :])
    return all(any(_is_made_by(pattern, effect) for effect in single) for pattern in each)


def _is_made_by(pattern: Float, effects: Float) -> bool:
    """Return whether columns (M, Q) of effects make a pattern (M,) within the laws' accuracy."""
    scale = np.maximum(np.linalg.norm(effects, axis=0), 1e-300)
    left = pattern - effects @ (np.linalg.lstsq(effects / scale, pattern, rcond=1e-10)[0] / scale)
    return bool(np.linalg.norm(left) < SAME * np.linalg.norm(pattern))


def adequacy(about: Evidence, terms: Sequence[Term], stated: Stated) -> float:
    """Return the probability that terms leave only noise: by the worst pattern and by all together.

    ``about`` is the evidence over the terms and `VOCABULARY`.
    """
    return min(_by_chance(about, terms, stated), 1.0)


def _by_chance(about: Evidence, terms: Sequence[Term], stated: Stated) -> float:
    given = places_of_all(about, [(t.model, t.shape) for t in terms])
    each = _scores(about, stated, given, VOCABULARY)
    single = min((s.p_value for s in each if s is not None), default=1.0) * len(VOCABULARY)
    return float(2 * min(single, joint_p(about, stated, given)))


def joint_p(about: Evidence, stated: Stated, given: Int) -> float:
    """Return the probability of the scores of all patterns together when only noise is left.

    Scores are taken along the principal directions of their information, each over its true scatter.
    """
    block = places_of_all(about, VOCABULARY)
    free = np.union1d(instrument_places(about), given).astype(np.int64)
    own, right, _ = eliminated(about, stated, block, free)
    a = about.information
    size = np.sqrt(np.maximum(np.diag(a)[block], 1e-300))
    value, vector = np.linalg.eigh(own / np.outer(size, size))
    seen = value > _WEAK * value[-1]
    inflation = np.diag(about.score_covariance)[block] / np.maximum(np.diag(a)[block], 1e-300)
    along = vector[:, seen].T @ (right / size)
    spread = value[seen] * (vector[:, seen].T ** 2 @ inflation)
    statistic = float(np.sum(along**2 / spread))
    return float(stats.f.sf(statistic / seen.sum(), seen.sum(), DEGREES))


def _next(
    about: Evidence, stated: Stated, given: Int, words: Sequence[tuple[EffectModel, Shape]]
) -> tuple[EffectModel, Shape, Score] | None:
    each = zip(words, _scores(about, stated, given, words), strict=True)
    scored = [(model, shape, result) for (model, shape), result in each if result is not None]
    best = max(scored, key=lambda s: s[2].statistic / len(s[2].amplitude), default=None)
    needed = best is not None and best[2].p_value * len(VOCABULARY) < DETECTED
    return best if needed else None


def _scores(
    about: Evidence, stated: Stated, given: Int, words: Sequence[tuple[EffectModel, Shape]]
) -> list[Score | None]:
    """Return the score of each pattern that is not among the columns ``given``."""
    around = Around.of(about, stated, given)
    places = [places_of(about, model, shape) for model, shape in words]
    return [around.score(block) if not np.isin(block, given).any() else None for block in places]
