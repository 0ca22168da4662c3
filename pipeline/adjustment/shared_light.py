"""How much rings correlate because a codec repeats light, and how much less they tell together.

The class is stored with the wall and read by pages, so that this module does without SciPy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float

# Smaller correlation counts as none: σ from the scatter of such rings is too small by 1 − √(1 − 0.1) = 5 %.
_NOTHING = 0.1
# Likeness of neighbouring rings in open-1, open-2 and open-3: 0.05, 0.05 and 0.16; in 7 copies at crf 30, by
# HEVC and with all spoilings 0.36 to 0.79, of which two had a false finding with probabilities of 0.89 and
# 0.98; behind filters against noise that flattened a pit by a fifth 0.23 to 0.79.
_USUAL = 0.2
# Where what is fixed to the image is taken off: .01 and .10 in open-1 and open-3, .02 to .09 in 7 of 8
# inspections drawn by another renderer, .43 in one by HEVC; .18 to .64 in open-3 at crf 30 and with all
# spoilings. Open-1 and open-2 at crf 30 share .04 and .03, of .18.
_USUALLY_REPEATED = 0.15
# Error of the likeness of rings far apart, by 120 rings of some 400 independent samples.
_LIKENESS_ERRS = 0.01
# Least share of their variance that the scatter of rings is taken to show: σ is at most tripled (chosen).
_LEAST_SCATTER = 1 / 9
# Shares handed on that are tried. A larger one looks like none: over 16 rings it hardly falls.
_SHARES = np.arange(0.02, 0.985, 0.01)
# Two lags leave open whether something is the same in all rings: it is taken to be handed on.
_LAGS_OF_A_PLATEAU = 3


@dataclass(frozen=True)
class HeldOver:
    """How alike rings 0, 1, 2, ... apart are: 1 where nothing is new, 0 where all is.

    Attributes
    ----------
    likeness : (L,)
        By repeated light, and by errors at the same places of the image.
    repeated : (L,), optional
        By repeated light alone; None where the two were not told apart, and all counts as repeated.
    """

    likeness: Float
    repeated: Float | None = None

    @property
    def rings(self) -> int:
        """Lag at which next to no light is repeated, or the largest lag compared where there is none."""
        below = self._light <= _NOTHING
        return int(np.argmax(below)) if below.any() else len(self._light) - 1

    @property
    def unseen(self) -> float:
        """σ over that from the scatter of rings about the line through those `rings` before and after.

        That scatter's variance is σ² (1.5 − 2 ρ_k + ρ_2k / 2).
        """
        at, twice = np.interp([self.rings, 2 * self.rings], np.arange(len(self.likeness)), self.likeness)
        return float(max(1 - (4 * at - twice) / 3, _LEAST_SCATTER) ** -0.5)

    @property
    def alike(self) -> bool:
        """Whether neighbouring rings share so much that their scatter alone does not show their σ."""
        return bool(self.likeness[1:2].max(initial=0.0) > _NOTHING)

    @property
    def more_than_usual(self) -> bool:
        """Whether light is repeated more than in good recordings."""
        return bool(self._light[1:].max(initial=0.0) > self._usual)

    @property
    def _light(self) -> Float:
        return self.likeness if self.repeated is None else self.repeated

    @property
    def _usual(self) -> float:
        return _USUAL if self.repeated is None else _USUALLY_REPEATED

    @property
    def handed_on(self) -> float:
        """Share of a ring that is handed on to the next one, in [0, 1): the largest that the likeness allows.

        What is new in every ring, as noise of another codec, lowers all likeness; what is the same in all, as
        rows of the sensor or speckle, raises it: only how it falls off from ring to ring counts.
        """
        if not self.more_than_usual:
            return 0.0
        falling, misfit = _falling_parts(np.minimum.accumulate(self._light[1:]))
        may_be = (misfit <= np.hypot(misfit.min(), _LIKENESS_ERRS)) & (falling > self._usual)
        return float(np.maximum(_SHARES, falling)[may_be].max(initial=0.0).clip(max=_SHARES[-1]))

    def independent(self, count: int) -> int:
        """Return how many independent rings tell as much as ``count`` rings in a row, rounded.

        The variance of their mean is Σ_ij ρ_(i−j) / n² of that of one ring. Likeness below 0.1 counts as 0.
        Errors fixed to the image are in σ; rings beside each other tell as much of the wall as distant ones.
        """
        apart = np.arange(1, min(len(self._light), count))
        shared = np.where(self._light > _NOTHING, self._light, 0.0)[apart]
        return round(count / (1 + 2 * float(shared @ (1 - apart / count)))) if count > 1 else count

    def gain_in_mean(self, width: float) -> float:
        """Return the factor by which correlation raises the σ of a Gaussian mean over ``width`` rings.

        The variance of Σ w_i x_i is Σ_k ρ_k Σ_i w_i w_(i+k), and a Gaussian's Σ_i w_i w_(i+k) falls off as
        exp(−k² / 4 w²).
        """
        apart = np.arange(1, len(self.likeness))
        shared = np.exp(-((apart / (2 * width)) ** 2))
        return float(np.sqrt(1 + 2 * self.likeness[1:] @ shared))


NOTHING_HELD = HeldOver(np.ones(1))
"""Of rings that share nothing."""


def _falling_parts(likeness: Float) -> tuple[Float, Float]:
    """Return, for each share, the part of the likeness (L,) at lag 1 that falls off, and the RMS misfit.

    A plateau and a geometric fall, neither below zero, are fitted by least squares.
    """
    fall = _SHARES[:, None] ** np.arange(1, len(likeness) + 1)
    alone = (fall @ likeness) / (fall**2).sum(1)
    away = fall - fall.mean(1, keepdims=True)
    size = (away @ likeness) / np.maximum((away**2).sum(1), 1e-12)
    plateau = likeness.mean() - size * fall.mean(1)
    no_plateau = (plateau < 0) | (len(likeness) < _LAGS_OF_A_PLATEAU)
    size = np.maximum(np.where(no_plateau, alone, size), 0.0)
    plateau = np.where(no_plateau, 0.0, np.minimum(plateau, likeness.mean()))
    misfit = likeness - plateau[:, None] - size[:, None] * fall
    return size * _SHARES, np.sqrt(np.mean(misfit**2, axis=1))
