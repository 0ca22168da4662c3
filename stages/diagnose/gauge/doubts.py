"""What makes the names of a gauge run's likeliest hypothesis doubtful, and how likely each name is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from stages.diagnose.gauge.examine import Examined
from stages.diagnose.gauge.formula import ADEQUATE
from stages.diagnose.gauge.hypotheses import Judged
from stages.diagnose.gauge.judge import Verdicts
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.search import shift_px
from stages.diagnose.inference import SURE, UNKNOWN

# Held-out measurements are predicted to within the noise if their RMS is below this many noise floors. Under
# right names, and without hidden effects, 10 runs at ring level give 0.93–0.99 and five rendered ones
# 1.00–1.02 (mean of all 0.974, s.d. 0.030); this limit is 5 s.d. above. A wrong explanation of four effects
# gave 1.17 (`bench_diagnosis --mode several`, case 1, with an older floor and the ratio of both floors).
_MOST_OF_FLOOR = 1.12


@dataclass(frozen=True)
class Doubt:
    """The odds of what may be in a name's place, relative to the name and beyond the weighed hypotheses.

    Attributes
    ----------
    alike : dict of str to float
        Of each law that predicts held-out measurements better.
    absent : float
        That nothing is in its place.
    outside : float
        Of causes that the library does not have, and of measurements that do not agree.
    """

    alike: dict[str, float]
    absent: float = 0.0
    outside: float = 0.0

    @property
    def odds(self) -> float:
        """The sum of all."""
        return sum(self.alike.values()) + self.absent + self.outside


def chances(examined: Examined) -> tuple[float, ...]:
    """Return, for each effect of the likeliest hypothesis, the probability that its name is right.

    The odds against it are those of the hypotheses without it, and its `doubts`.
    """
    best, verdicts = examined.best, examined.verdicts
    if best is None or verdicts is None:
        return ()
    each = (
        (verdicts.chance_of(t), d.odds) for t, d in zip(best.library_terms, doubts(examined), strict=False)
    )
    return tuple(chance / (1 + chance * odds) for chance, odds in each)


def doubts(examined: Examined) -> tuple[Doubt, ...]:
    """Return what makes each name of the likeliest hypothesis doubtful.

    At least as likely as the name is each other name of a hypothesis of as many names or fewer that predicts
    held-out measurements better; if that has no other name, so is nothing in its place. Outside are unknown
    laws and courses, and `UNKNOWN` more where no second prediction agrees; and at even odds each sign that
    the hypothesis is wrong: a prediction that fails, a remainder that is not noise or that moves rings or
    fiducials by more than the effect, and poorly predicted held-out measurements.
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
        unknown = beyond.odds + UNKNOWN * (not any(c.agrees for c in confirmed))
        better = _better_without(verdicts, term)
        alike = _at_least_as_likely(verdicts, term, tuple(chain(*better)))
        out.append(Doubt(alike, float(() in better), signs + unknown))
    return tuple(out)


def _better_without(verdicts: Verdicts, term: Term) -> list[tuple[str, ...]]:
    """Return the names that hypotheses have in a term's place which predict held-out measurements better."""
    own = {t.model.law for t in verdicts.judged[0].library_terms}
    without = (j.laws for j in better_held_out(verdicts) if term.model.law not in j.laws)
    return [tuple(law for law in laws if law not in own) for laws in without]


def _at_least_as_likely(verdicts: Verdicts, term: Term, names: Sequence[str]) -> dict[str, float]:
    """Return the odds that make each name, which hypotheses have in the term's place, as likely as it."""
    chance, instead = max(verdicts.chance_of(term), 1e-300), verdicts.instead_of(term).laws
    return {name: max(1 - instead.get(name, 0.0) / chance, 0.0) for name in names}


def sure(examined: Examined) -> tuple[bool, ...]:
    """Return, for each effect of the likeliest hypothesis, whether its name is certain."""
    return tuple(chance > SURE for chance in chances(examined))


def better_held_out(verdicts: Verdicts) -> tuple[Judged, ...]:
    """Return hypotheses of no more names than the likeliest that predict held-out measurements better.

    A drift of the focal length was once named a drift of the distortion, at 99 to 1.
    """
    best, *others = verdicts.judged
    as_few = (j for j in others if j.named and len(j.library_terms) <= len(best.library_terms))
    return tuple(j for j in as_few if j.heldout < best.heldout)


def fits(examined: Examined) -> bool:
    """Return whether held-out measurements are predicted to about the noise, where that was tested.

    False where the noise is unknown.
    """
    quality = examined.quality
    if quality is None or np.isnan(quality.heldout_after):
        return True
    return bool(quality.heldout_after <= _MOST_OF_FLOOR * quality.noise_floor)
