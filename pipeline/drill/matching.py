"""Match the names that a diagnosis gives with what is concealed, one to one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.drill.answer import Concealed, NamedEffect
from pipeline.physics.catalogue import EFFECTS

# Distance between different laws: more than the numbers of one law can differ, each by its whole range.
_STRANGERS = 1e3
# The quantity that is an integer.
_WHOLE = "order"


def matched(
    given: Sequence[NamedEffect], concealed: Sequence[Concealed]
) -> list[tuple[NamedEffect, Concealed]]:
    """Return names with the concealed effects they match, one to one; repeated laws by nearest numbers.

    Differences are relative to the range in the catalogue. A wave of another order is another effect.
    """
    apart = np.array([[_apart(e, c) for c in concealed] for e in given]).reshape(len(given), len(concealed))
    pairs = np.stack(linear_sum_assignment(np.minimum(apart, _STRANGERS)), -1).tolist()
    return [(given[e], concealed[c]) for e, c in pairs if apart[e, c] < _STRANGERS]


def _apart(named: NamedEffect, truth: Concealed) -> float:
    if named.name != truth.name:
        return np.inf
    # An effect of pictures only is not in the catalogue.
    each = zip(EFFECTS[truth.name].quantities, truth.values, strict=False) if truth.name in EFFECTS else ()
    known = [(q, named.parameters[q.name].value - v) for q, v in each if q.name in named.parameters]
    if any(q.name == _WHOLE and abs(d) > 0.5 for q, d in known):
        return np.inf
    return float(sum(min(abs(d) / (q.high - q.low), 1.0) for q, d in known if np.isfinite(d)))
