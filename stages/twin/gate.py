"""Decide whether a suspected effect is named: withheld frames rendered again with it must fit better.

Single frames may agree on a law of the whole picture by chance, or because something else resembles it.
Therefore the size from one half of the frames is applied in the frames of the other half; there the sum of
squares of z must fall by more than its scatter from frame to frame. An effect that does not pass is
withdrawn, and reported as one that cannot be distinguished from what resembles it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float, Float32, Int
from pipeline.artefacts.twin import Mismatch
from stages.twin.locate import FALSE_ALARM
from stages.twin.significance import significance_over_frames
from stages.twin.switched import Law, Pair, Shown

_SURE, _MOST, _FEWEST = 3.0, 16, 6
"""σ, from frame to frame, by which z² must fall; most frames that are rendered again; fewest frames for a
decision."""
_MOST_SQUARE = 25.0
"""Largest z² of a pixel: otherwise a glint of thirty σ would outweigh a thousand pixels."""
_LEAST_FALL = 0.05
"""Share of the usual predicted fall: frames that the effect should change by less are not used. Chosen."""
_FEWEST_PIXELS = 200
"""Fewest pixels on which an effect acts in a frame, for the frame to be used."""

Again = Callable[[Int], Iterable[tuple[int, Shown]]]
"""Yields the frames of given numbers, each with its number, for rendering again."""


@dataclass(frozen=True)
class Suspected:
    """An effect on the whole picture whose size single frames agree on.

    Attributes
    ----------
    mismatch : Mismatch
        What is reported if the effect is confirmed.
    law : callable or None
        Returns a frame without and with the effect; None for what has no name, which nothing confirms.
    frame : (F,) int
        Frames in which its size was measured, ascending.
    sizes : (F, K)
        The sizes measured in each frame.
    size_of : callable
        Maps the mean (K,) of the measured sizes to the numbers that the law takes.
    measured : callable, optional
        Measures the size in a frame rendered again; the mean over frames is then reported.
    said : callable, optional
        Returns the sentence about the size so measured.
    least : float
        Lower bound of that size. A smaller one shows that the law has not its true shape: it is not reported.
    otherwise : str
        Names, of which one must hold, under which it is reported if other frames do not confirm the law;
        without any it is then withdrawn.
    """

    mismatch: Mismatch
    law: Law | None
    frame: Int
    sizes: Float
    size_of: Callable[[Float], Float] = np.asarray
    measured: Callable[[Shown, Float], float] | None = None
    said: Callable[[float], str] | None = None
    least: float = -np.inf
    otherwise: str = ""

    def from_other_half(self, frame: int) -> Float:
        """Return the law's numbers from the half of the frames that does not contain this one."""
        half = np.arange(len(self.frame)) % 2
        own = half[int(np.searchsorted(self.frame, frame))]
        return np.asarray(self.size_of(self.sizes[half != own].mean(0)), float)

    @property
    def judges(self) -> Int:
        """Frames that are rendered again, spread over those in which the size was measured."""
        few = np.linspace(0, len(self.frame) - 1, min(_MOST, len(self.frame)))
        return np.asarray(self.frame[np.unique(few.round().astype(int))])


def judged(suspected: Sequence[Suspected], again: Again) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return the effects that frames rendered again confirm, and those that are withdrawn."""
    made = [_judged(one, again) for one in suspected]
    return tuple(m for m, kept in made if kept), tuple(m for m, kept in made if not kept)


def first_confirmed(
    suspected: Sequence[Suspected], again: Again
) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return the first confirmed one of effects that a single cause has; if none is, those withdrawn."""
    kept, withdrawn = judged(suspected, again)
    return kept[:1], () if kept else withdrawn


def _judged(one: Suspected, again: Again) -> tuple[Mismatch, bool]:
    """Return the mismatch with the figures from frames rendered again, and whether its name stays."""
    if one.law is None:
        return one.mismatch, True
    squares, sizes = [np.zeros((0, 4))], []
    for frame, shown in again(one.judges):
        numbers = one.from_other_half(frame)
        squares.append(_squares(shown, one.law(shown, numbers))[None])
        if one.measured is not None:
            sizes.append(one.measured(shown, numbers))
    before, after, predicted, pixels = np.concatenate(squares).T
    seen = pixels >= _FEWEST_PIXELS
    fall = (before - after)[seen]
    sigma, chance = _borne_out(fall, predicted[seen])
    total = max(float(pixels[seen].sum()), 1.0)
    chi2 = [float(squares[seen].sum()) / total for squares in (before, after)]
    found = replace(one.mismatch, chi2_before=chi2[0], chi2_after=chi2[1])
    if len(fall) < _FEWEST or sigma < _SURE or chance > FALSE_ALARM:
        if one.otherwise:
            return replace(one.mismatch, name=one.otherwise), True
        return _withdrawn(found, fall, sigma), False
    if sizes and np.mean(sizes) >= one.least:
        found = _with_size(found, sizes, one.said)
    return replace(found, probability=float(np.nanmax([chance, found.probability]))), True


def _borne_out(fall: Float, predicted: Float) -> tuple[float, float]:
    """Return by how many σ the falls (F,) of z² are above 0, and the chance of that.

    An effect that is ten times as strong in some frames as in others makes falls that are as unequal, which
    looks like chance. Divided by the predicted falls, in frames where it acts, they are alike: the more
    significant of both tests counts, with a chance doubled for two tries.
    """
    each = [significance_over_frames(fall)]
    acts = predicted > _LEAST_FALL * np.median(predicted) if len(predicted) else predicted > 0
    if acts.sum() >= _FEWEST:
        each.append(significance_over_frames(fall[acts] / predicted[acts]))
    sigma, chance = min(each, key=lambda e: e[1])
    return sigma, min(len(each) * chance, 1.0)


def _squares(shown: Shown, pair: Pair) -> Float:
    """Return sums of z² of a frame without and with an effect, and of the effect; and the pixels."""
    above = np.asarray(shown.above[pair.use])
    weight = np.asarray(1 / shown.twin.variance[pair.use], np.float32)
    levels = [
        _taken_up(level[pair.use], above, weight, pair.free_of) for level in (pair.without, pair.with_it)
    ]
    rests = [above - levels[0], above - levels[1], levels[1] - levels[0]]
    made = [float(np.minimum(weight * r**2, _MOST_SQUARE).sum(dtype=float)) for r in rests]
    return np.array([*made, float(len(above))])


def _taken_up(level: Float32, above: Float32, weight: Float32, free_of: str) -> Float32:
    """Return a frame's levels (N,) with the exposure ("scale") or constant ("offset") that fits best."""
    if free_of == "scale":
        own = float((weight * level * level).sum(dtype=float))
        return level * np.float32(float((weight * level * above).sum(dtype=float)) / max(own, 1e-9))
    if free_of == "offset":
        return level + np.float32(np.median(above - level)) if len(level) else level
    return level


def _with_size(found: Mismatch, sizes: list[float], said: Callable[[float], str] | None) -> Mismatch:
    """Return a mismatch with the mean of the sizes measured in frames rendered again."""
    figure, *others = found.parameters
    sd = float(np.std(sizes, ddof=1) / np.sqrt(len(sizes)))
    mean = float(np.mean(sizes))
    figure = replace(figure, value=mean, sd=float(np.hypot(sd, _OF_PROFILE * mean)))
    told = found.statement if said is None else said(mean)
    return replace(found, parameters=(figure, *others), statement=told)


_OF_PROFILE = 0.02
"""Relative 1 σ of a size measured through a profile: half of the variation of a line about its profile."""


def _withdrawn(found: Mismatch, fall: Float, sigma: float) -> Mismatch:
    words = found.name.replace("_", " ") or "an effect without a name"
    why = (
        f"{len(fall)} frames rendered again with it fit no better than by chance ({sigma:+.1f} σ)"
        if len(fall) >= _FEWEST
        else f"only {len(fall)} frames could be rendered again with it"
    )
    said = f"Single frames suggest {words}, but {why}: something else may look alike."
    return replace(found, statement=said)
