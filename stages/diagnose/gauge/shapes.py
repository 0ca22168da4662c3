"""Frequencies and time constants set free: off the grid that was searched, and with their own 1 σ."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.arrays import Float
from stages.diagnose.effects.base import Amplitude, EffectModel, ImagePoints, Shape, Travel
from stages.diagnose.gauge.fit import Fit, fit
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.gauge.scan import span


@dataclass(frozen=True)
class FreeShape(EffectModel):
    """An effect whose shape, a continuous number, is one more amplitude: its way off ``middle``."""

    model: EffectModel
    middle: Shape
    step: float
    bounds: tuple[float, float]
    name: str = field(init=False)
    amplitudes: tuple[Amplitude, ...] = field(init=False)
    law_sigma: float = field(init=False)

    def __post_init__(self) -> None:
        off = Amplitude("shape off the middle", "", self.step)
        object.__setattr__(self, "name", self.model.name)
        object.__setattr__(self, "amplitudes", (*self.model.amplitudes, off))
        object.__setattr__(self, "law_sigma", self.model.law_sigma)

    def at(self, amplitude: Float) -> tuple[Shape, Float]:
        """Return the effect's own shape, within bounds, and its amplitudes."""
        low, high = self.bounds
        shape = min(max(self.middle[0] + float(amplitude[-1]), low), high)
        return (shape, *self.middle[1:]), amplitude[:-1]

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the effect's."""
        return self.model.image_shift_px(points, *self.at(amplitude))

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the effect's."""
        return self.model.sheet_shift_mm(points, *self.at(amplitude))

    def line_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the effect's."""
        return self.model.line_shift_px(points, *self.at(amplitude))

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the effect's."""
        return self.model.wall_shift_mm(points, *self.at(amplitude))

    def reading_shift_mm(self, travel: Travel, shape: Shape, amplitude: Float) -> Float:
        """Return the effect's."""
        return self.model.reading_shift_mm(travel, *self.at(amplitude))

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the effect's."""
        return self.model.quantities(*self.at(amplitude))

    def statement(self, shape: Shape, amplitude: Float) -> str:
        """Return the effect's."""
        return self.model.statement(*self.at(amplitude))


def freed(run: GaugeRun, found: Fit) -> Fit:
    """Return the fit as it is, with continuous shapes as amplitudes, within what was searched.

    A drift quicker than all that were searched is none: it is what it comes to.
    """
    return replace(found, terms=tuple(_freed(run, t) for t in found.terms))


def refined(run: GaugeRun, found: Fit) -> Fit:
    """Return the fit with continuous shapes at their best, unless it then fits worse."""
    free = freed(run, found)
    if free.terms == found.terms:
        return found
    better = fit(run, found.state, free.terms)
    bound = fit(run, better.state, tuple(_bound(t) for t in better.terms), 1)
    return bound if bound.cost < found.cost else found


def _freed(run: GaugeRun, term: Term) -> Term:
    step = term.model.shape_step(term.shape)
    if step is None or isinstance(term.model, FreeShape):
        return term
    searched = [shape[0] for shape in term.model.shapes(*span(run))]
    bounds = min(searched), max(searched)
    return Term(FreeShape(term.model, term.shape, step, bounds), (), np.append(term.amplitude, 0.0))


def _bound(term: Term) -> Term:
    if not isinstance(term.model, FreeShape):
        return term
    return Term(term.model.model, *term.model.at(term.amplitude))
