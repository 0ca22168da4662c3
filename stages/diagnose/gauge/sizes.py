"""How large the effects found are, with all that makes their sizes uncertain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float
from stages.diagnose.gauge.confirm import partial_of
from stages.diagnose.gauge.fit import evidence
from stages.diagnose.gauge.judge import Judged
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.gauge.shapes import freed
from stages.diagnose.inference import Stated
from stages.diagnose.result import Value

_DRAWS = 400


@dataclass(frozen=True)
class Sized:
    """A term, its continuous shape free, with the covariance (Q, Q) of its amplitudes."""

    term: Term
    covariance: Float


def sizes_of(run: GaugeRun, judged: Judged, stated: Stated) -> tuple[Sized, ...]:
    """Return the terms of a hypothesis with covariances: by the data, shapes, and laws."""
    free = freed(run, judged.fit)
    whole = judged.evidence if free.terms == judged.fit.terms else evidence(run, free, ())[0]
    about = replace(judged, fit=free, evidence=whole)
    return tuple(_sized(about, term, stated) for term in free.terms)


def _sized(judged: Judged, term: Term, stated: Stated) -> Sized:
    part = partial_of("all", judged.evidence, judged, term, stated)
    covariance = part.covariance if part is not None else np.zeros((len(term.amplitude),) * 2)
    by_law = term.model.law_sigma**2 * np.outer(term.amplitude, term.amplitude)
    return Sized(term, covariance + by_law)


def quantities(sized: Sized) -> dict[str, Value]:
    """Return the catalogue's quantities with 1 σ, by draws of the amplitudes."""
    term, random = sized.term, np.random.default_rng(0)
    draws = random.multivariate_normal(term.amplitude, sized.covariance, _DRAWS, check_valid="ignore")
    middle = term.model.quantities(term.shape, term.amplitude)
    drawn = [term.model.quantities(term.shape, a) for a in draws]
    out = {}
    for name, value in middle.items():
        apart = np.array([d[name] for d in drawn]) - value
        if name.endswith("_deg") and name.startswith("direction"):
            apart = (apart + 180) % 360 - 180
        out[name] = Value(value, float(np.sqrt(np.mean(apart**2))))
    return out
