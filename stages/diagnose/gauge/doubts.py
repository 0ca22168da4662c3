"""What makes the names of a gauge run's likeliest hypothesis doubtful, and how likely each name is."""

from __future__ import annotations

import numpy as np

from stages.diagnose.gauge.examine import Examined
from stages.diagnose.gauge.formula import ADEQUATE
from stages.diagnose.gauge.search import shift_px
from stages.diagnose.inference import SURE, UNKNOWN

# Held-out measurements are predicted to within the noise if their RMS is below this many noise floors. Under
# right names, and without hidden effects, 10 runs at ring level give 0.93–0.99 and five rendered ones
# 1.00–1.02 (mean of all 0.974, s.d. 0.030); this limit is 5 s.d. above. A wrong explanation of four effects
# gave 1.17 (`bench_diagnosis --mode several`, case 1, with an older floor and the ratio of both floors).
_MOST_OF_FLOOR = 1.12


def chances(examined: Examined) -> tuple[float, ...]:
    """Return, for each effect of the likeliest hypothesis, the probability that its name is right.

    The odds against it are those of the hypotheses without it, and its `doubts`.
    """
    best, verdicts = examined.best, examined.verdicts
    if best is None or verdicts is None:
        return ()
    each = zip(best.library_terms, doubts(examined), strict=False)
    return tuple((chance := verdicts.chance_of(t)) / (1 + chance * odds) for t, odds in each)


def doubts(examined: Examined) -> tuple[float, ...]:
    """Return the odds of what is beyond the weighed hypotheses, relative to each name of the likeliest.

    These are unknown laws and courses, and `UNKNOWN` more where no second prediction agrees; and at even odds
    each sign that the hypothesis is wrong: a prediction that fails, a remainder that is not noise or that
    moves rings or fiducials by more than the effect, and poorly predicted held-out measurements.
    """
    best, verdicts = examined.best, examined.verdicts
    if best is None or verdicts is None:
        return ()
    everywhere = (verdicts.adequacy < ADEQUATE) + (not fits(examined))
    patterns = best.fit.terms[len(best.library_terms) :]
    left = max((shift_px(best.fit, t) for t in patterns), default=0.0)
    each = zip(best.library_terms, examined.confirmed, examined.unknown_laws, strict=False)
    out = []
    for term, confirmed, beyond in each:
        signs = everywhere + sum(not c.agrees for c in confirmed) + (left > shift_px(best.fit, term))
        out.append(signs + beyond.odds + UNKNOWN * (not any(c.agrees for c in confirmed)))
    return tuple(out)


def sure(examined: Examined) -> tuple[bool, ...]:
    """Return, for each effect of the likeliest hypothesis, whether its name is certain."""
    return tuple(chance > SURE for chance in chances(examined))


def fits(examined: Examined) -> bool:
    """Return whether held-out measurements are predicted to about the noise, where that was tested.

    False where the noise is unknown.
    """
    quality = examined.quality
    if quality is None or np.isnan(quality.heldout_after):
        return True
    return bool(quality.heldout_after <= _MOST_OF_FLOOR * quality.noise_floor)
