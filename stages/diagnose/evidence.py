"""What one kind of measurement says about all effects at once, its own unknowns eliminated.

Evidence of independent measurements adds: the sum of information matrices and of right sides over shared
columns. The stated instrument's parameters are columns too, because gauge and field share one instrument.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.effect import Channel

INSTRUMENT = "instrument"


@dataclass(frozen=True, order=True)
class Column:
    """One amplitude of an effect at one shape, or one parameter of the stated instrument.

    Attributes
    ----------
    effect : str
        Name of the catalogue, or ``instrument`` for a parameter of `Probe.parameter_names` or
        ``encoder_scale``, whose amplitude is true minus stated in the parameter's own unit.
    amplitude : str
        As the effect's model names it.
    shape : tuple of float
    """

    effect: str
    amplitude: str
    shape: tuple[float, ...] = ()


@dataclass(frozen=True)
class Evidence:
    """Reduced normal equations A x = b of amplitudes x (true − stated), without any prior on x.

    Attributes
    ----------
    columns : tuple of K Column
    information : (K, K)
        A: the recording's own unknowns (poses, wall, landmarks) eliminated with their priors.
    right : (K,)
        b at x = 0: the score.
    score_covariance : (K, K)
        True covariance of b, neighbours that err alike counted once (sandwich over cells); A where that
        is not known.
    misfit : float
        Weighted sum of squares at x = 0 with the own unknowns at their best.
    cells : float
        Number of independent cells of measurements behind it.
    """

    columns: tuple[Column, ...]
    information: Float
    right: Float
    score_covariance: Float
    misfit: float
    cells: float

    def over(self, columns: Sequence[Column]) -> Evidence:
        """Return the evidence over other columns, in their order; it says nothing of those it lacks."""
        place = {c: k for k, c in enumerate(self.columns)}
        here = [k for k, c in enumerate(columns) if c in place]
        own = [place[columns[k]] for k in here]
        size = len(columns)
        information, covariance, right = np.zeros((size, size)), np.zeros((size, size)), np.zeros(size)
        information[np.ix_(here, here)] = self.information[np.ix_(own, own)]
        covariance[np.ix_(here, here)] = self.score_covariance[np.ix_(own, own)]
        right[here] = self.right[own]
        return Evidence(tuple(columns), information, right, covariance, self.misfit, self.cells)

    def deflated(self, alike: float) -> Evidence:
        """Return the evidence when ``alike`` measurements that err alike count as one."""
        return Evidence(
            self.columns, self.information / alike, self.right / alike, self.score_covariance / alike**2,
            self.misfit / alike, self.cells,
        )  # fmt: skip


def total(parts: Sequence[Evidence]) -> Evidence:
    """Return the sum of independent evidence over the union of its columns."""
    columns = tuple(sorted({c for part in parts for c in part.columns}))
    each = [part.over(columns) for part in parts]
    return Evidence(
        columns,
        np.asarray(sum(e.information for e in each)),
        np.asarray(sum(e.right for e in each)),
        np.asarray(sum(e.score_covariance for e in each)),
        float(sum(e.misfit for e in each)),
        float(sum(e.cells for e in each)),
    )


@dataclass(frozen=True)
class Anomaly:
    """Something a channel shows that the stated instrument does not, tested on its own (no column for it).

    Attributes
    ----------
    channel : Channel
    p_value : float
        Calibrated: uniform when nothing is hidden.
    statement : str
    frames : (2,)
        First and last frame in which it shows.
    explained_by : tuple of str
        Effects of the catalogue that would show like this; empty when none is known.
    """

    channel: Channel
    p_value: float
    statement: str
    frames: tuple[int, int]
    explained_by: tuple[str, ...] = ()


@dataclass(frozen=True)
class ChannelEvidence:
    """All that one channel of one recording says.

    Attributes
    ----------
    source : str
        Such as ``gauge``, ``profile of the gauge`` or ``field``.
    channel : Channel
    whole : Evidence
    regimes : tuple of (str, Evidence)
        Disjoint parts whose unknowns were eliminated apart (a bore, a stretch of the motion): for judging
        on held-out regimes. May be empty.
    anomalies : tuple of Anomaly
    shortcomings : tuple of str
        What this recording cannot tell, and why.
    """

    source: str
    channel: Channel
    whole: Evidence
    regimes: tuple[tuple[str, Evidence], ...] = ()
    anomalies: tuple[Anomaly, ...] = ()
    shortcomings: tuple[str, ...] = ()
