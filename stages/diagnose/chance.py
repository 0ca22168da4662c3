"""How likely the name of a claim is right, from what was measured for and against it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.diagnose.agreement import Agreement

# Beforehand, beside a named cause: one that the library does not know and that shows just so.
_UNKNOWN = 0.1


def chance_of_name(p_value: float, rivals: int, agreements: Sequence[Agreement], drilled: int) -> float:
    """Return the probability that the named cause made it, and not chance, a rival, or something unknown.

    Chance weighs −e p ln p, the most that a p-value can say for it (T. Sellke, M. J. Bayarri and J. O.
    Berger, "Calibration of p values for testing precise null hypotheses", Am. Stat., 2001). Rivals that were
    not told apart weigh as much as the name. What is unknown loses by the likelihood ratio of the best second
    prediction, or wins by that of one that fails; those of one recording share its pictures and count once.
    No more is claimed than ``drilled`` cases bear, all of which were right: (n + 1) / (n + 2).
    """
    p = float(np.clip(p_value, 1e-300, 1 / np.e))
    nothing = -np.e * p * np.log(p)
    ratios = [a.ratio for a in agreements]
    failed = [a.ratio for a in agreements if not a.confirmation.agrees]
    ratio = min(failed) if failed else max(ratios, default=1.0)
    weight = 1 / (1 + nothing + rivals + _UNKNOWN / ratio)
    return min(float(weight), (drilled + 1) / (drilled + 2))
