"""Whether the wall moves: where it stands, no comparison of steps tells anything."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Bool, Float

# A wall that moves by less than this part of what its fast steps make stands: what is left are errors of
# matching, up to a tenth of a step, and one noise over another tells nothing. Chosen.
_MOVES = 0.25
# The fast steps are told by this quantile: a probe may stand for nine tenths of a run, and the longest tenth
# holds whatever leaps.
_FAST = 0.9


def wall_moves(speed: Float, of_run: Float) -> Bool:
    """Return where the wall moves (K,) at a ``speed`` (K,), by all the speeds ``of_run`` (N,)."""
    fast = float(np.quantile(np.abs(of_run), _FAST)) if len(of_run) else 0.0
    return np.asarray(np.abs(speed) > _MOVES * fast)
