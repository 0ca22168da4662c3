"""Laws that nobody knows and that are like a named one: they grow otherwise with the radius.

A name says how an effect grows from the middle of the picture outward. A law that the library lacks may pass
for it as long as measurements leave that growth open. So each name is held against its own law times a free
polynomial of the radius: a Gaussian process about the law. Its marginal likelihood pays for this freedom only
where measurements could have told it (D. MacKay, "Bayesian interpolation", 1992). Without it, a focal length
that the library lacked was called a shifted dome, and a shifted dome a focal length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import FixedTo
from stages.diagnose.effects.base import Amplitude, EffectModel, ImagePoints, Shape
from stages.diagnose.gauge.fit import evidence
from stages.diagnose.gauge.hypotheses import Judged
from stages.diagnose.gauge.run import GaugeRun, Linearised, Term
from stages.diagnose.gauge.sets import NAMELESS, prior_sigma
from stages.diagnose.inference import Evidence, Stated, estimate, places_of

_POWERS = (1, 2)
# How far such a law may be off the named one, as a part of its size: in even steps of the logarithm, from
# what laws of one part of an instrument differ by to another law altogether. Debt: data/debts.md.
_APART = (0.1, 0.3, 1.0)


@dataclass(frozen=True)
class OtherGrowth(EffectModel):
    """A law at a size, times powers of how far off a reference the radius is, as a part of it.

    Attributes
    ----------
    name : str
    law_of : EffectModel
    own, size
        Its shape and its amplitudes (Q,).
    of_line : bool
        Whether the radius is that of the wall, mm, as for a laser's sheet; else it is the polar angle, rad.
    reference : float
        In that unit.
    """

    name: str
    law_of: EffectModel
    own: Shape
    size: Float = field(compare=False)
    of_line: bool
    reference: float
    amplitudes: tuple[Amplitude, ...] = tuple(Amplitude(f"power {n}", "", 1.0) for n in _POWERS)

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the law's shift, changed."""
        change = self._change(points, amplitude)
        return change[:, None] * self.law_of.image_shift_px(points, self.own, self.size)

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the law's shift, changed."""
        return self._change(points, amplitude) * self.law_of.sheet_shift_mm(points, self.own, self.size)

    def line_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the law's shift, changed."""
        return self._change(points, amplitude) * self.law_of.line_shift_px(points, self.own, self.size)

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the law's shift, changed."""
        return self._change(points, amplitude) * self.law_of.wall_shift_mm(points, self.own, self.size)

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return nothing: it is held against a name and never given."""
        return {}

    def statement(self, shape: Shape, amplitude: Float) -> str:
        """Return what it is."""
        return f"A law like {self.law_of.law} that grows otherwise with the radius."

    def _change(self, points: ImagePoints, amplitude: Float) -> Float:
        """Return (M,) the part of the law's shift that is added."""
        off = _radius(points, self.of_line) / self.reference - 1
        return np.asarray(sum(a * off**n for a, n in zip(amplitude, _POWERS, strict=True)))


def other_growth(term: Term, at: Linearised, of_line: bool) -> OtherGrowth:
    """Return the law like a term's that grows otherwise, its reference in the middle of the rings."""
    middle = float(np.median(_radius(at.rings, of_line)))
    shape, amplitude = term.at(term.amplitude)
    name = f"{term.model.name} {term.shape}, growing otherwise"
    return OtherGrowth(name, term.model, shape, amplitude, of_line, middle)


def excess_exponent(
    run: GaugeRun, best: Judged, term: Term, stated: Stated, believed: float
) -> tuple[float, float]:
    """Return by how much d ln |δr| / d ln r exceeds the law's own in the middle of the rings, with 1 σ."""
    other = other_growth(term, best.fit.linearised, of_line=True)
    about = evidence(run, best.fit, [(other, ())], with_spread=False)[0].deflated(believed)
    both = (*best.fit.terms, Term(other, (), np.zeros(len(_POWERS))))
    found = estimate(about, stated, prior_sigma(about, both))
    at = places_of(about, other, ())[0]
    return float(found.value[at]), float(np.sqrt(found.covariance[at, at]))


def odds_of_other_growth(
    run: GaugeRun, best: Judged, terms: Sequence[Term], stated: Stated, believed: float
) -> tuple[float, ...]:
    """Return for each term the odds, beside its name, of a law that nobody knows and that is like it.

    χ² is divided by ``believed``.
    """
    at = best.fit.linearised
    others = [other_growth(t, at, effect(t.model.law).fixed_to is FixedTo.LASER) for t in terms]
    about = evidence(run, best.fit, [(o, ()) for o in others], with_spread=False)[0].deflated(believed)
    return odds_in(about, best.fit.terms, [o.name for o in others], stated)


def odds_in(
    about: Evidence, terms: Sequence[Term], others: Sequence[str], stated: Stated
) -> tuple[float, ...]:
    """Return the odds of each of the other laws ``others`` beside the terms alone; beforehand `NAMELESS`.

    ``about`` is the evidence over the terms and all the other laws.
    """
    own = about.over([c for c in about.columns if c.effect not in others])
    before = prior_sigma(own, terms)
    alone = estimate(own, stated, before).surprise
    out = []
    for other in others:
        both = about.over([*own.columns, *(c for c in about.columns if c.effect == other)])
        ratio = [np.exp((alone - _surprise(both, before, stated, apart)) / 2) for apart in _APART]
        out.append(NAMELESS * float(np.mean(ratio)))
    return tuple(out)


def _surprise(both: Evidence, before: Float, stated: Stated, apart: float) -> float:
    return estimate(both, stated, np.append(before, np.full(len(_POWERS), apart))).surprise


def _radius(points: ImagePoints, of_line: bool) -> Float:
    return points.radius_mm if of_line else points.theta
