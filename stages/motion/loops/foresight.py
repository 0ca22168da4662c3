"""Where the wall should lie where it is passed again, as far as the places compared before it tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.arrays import Float, Int
from stages.motion.loops.strip_registration import Comparison, Expected, Verdict

_REACH_SIGMA = 5.0
_LEAST_REACH_PX = 4.0


@dataclass
class Foresight:
    """Where the wall should lie at each place, learning from the places already compared.

    Drift grows with the way between two frames, so the reach hardly grows from one place to the next, and
    hardly anything else can be taken for the wall.

    Attributes
    ----------
    spread : (2 M, 2 M)
        Covariance of the shifts, rows and columns by turns, before any is known.
    known : list of int
        Places learnt.
    shift, variance : list of (2,)
        What was measured there.
    """

    spread: Float
    known: list[int] = field(default_factory=list)
    shift: list[Float] = field(default_factory=list)
    variance: list[Float] = field(default_factory=list)

    def of(self, place: int) -> Expected:
        """Return what is expected of a place."""
        mine, theirs = _both([place]), _both(self.known)
        mean: Float = np.zeros(2)
        spread = self.spread[np.ix_(mine, mine)]
        if self.known:
            own = self.spread[np.ix_(theirs, theirs)] + np.diag(np.concatenate(self.variance))
            with_mine = self.spread[np.ix_(theirs, mine)]
            gain = np.asarray(np.linalg.solve(own, with_mine).T, float)
            mean, spread = gain @ np.concatenate(self.shift), spread - gain @ with_mine
        sigma = np.sqrt(np.maximum(np.diag(spread), 0.0))
        return Expected(mean, np.ceil(_REACH_SIGMA * sigma + _LEAST_REACH_PX))

    def learn(self, place: int, found: Comparison) -> None:
        """Take note of what comparing a place gave."""
        if found.verdict is Verdict.SAME:
            self.known.append(place)
            self.shift.append(found.shift)
            self.variance.append(found.sigma**2)


def _both(places: Sequence[int]) -> Int:
    """Return the rows of both shifts of places."""
    return (2 * np.array(places, np.int64)[:, None] + np.arange(2)).ravel()
