"""Laws like a named one that depend otherwise on the radius, or change otherwise in time."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field

import numpy as np

from pipeline.arrays import Float
from stages.diagnose.effects.base import Amplitude, EffectModel, ImagePoints, Shape, Share, SumOfLaws
from stages.diagnose.gauge.run import Linearised, Term

_POWERS = (1, 2)
# Waves of half a period over the run and more, for a course like a Brownian motion: eight contain all but 7 %
# of its variance, Σ 1/n².
_WAVES = 8
# With this factor, such waves of 1 σ, each divided by its number, have a mean square of 1: (12/π²) Σ 1/(2n²)
# = 1.
_UNIT = np.sqrt(12) / np.pi


@dataclass(frozen=True)
class AlteredLaw(SumOfLaws):
    """A law at a given size times an unknown change; it competes with a name and is never reported.

    Attributes
    ----------
    own, size
        Its shape and its amplitudes (Q,).
    """

    name: str
    law_of: EffectModel
    own: Shape
    size: Float = field(compare=False)

    def shares(self, points: ImagePoints, shape: Shape, amplitude: Float) -> list[Share]:
        """Return the law at its size times the change."""
        return [(self._change(points, amplitude), self.law_of, self.own, self.size)]

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return nothing: it is never reported."""
        return {}

    def statement(self, shape: Shape, amplitude: Float) -> str:
        """Return what it is."""
        return f"A law like {self.law_of.law} that has another growth or course."

    @abstractmethod
    def _change(self, points: ImagePoints, amplitude: Float) -> Float:
        """Return the relative change (M,) of the law's shift."""


@dataclass(frozen=True)
class OtherGrowth(AlteredLaw):
    """A law times a polynomial in the relative difference of the radius from a reference.

    Attributes
    ----------
    of_line : bool
        Whether the radius is that of the wall, mm, as for a laser's sheet; else it is the polar angle, rad.
    reference : float
        In that unit.
    """

    of_line: bool
    reference: float
    amplitudes: tuple[Amplitude, ...] = tuple(Amplitude(f"power {n}", "", 1.0) for n in _POWERS)

    def _change(self, points: ImagePoints, amplitude: Float) -> Float:
        off = _radius(points, self.of_line) / self.reference - 1
        return np.asarray(sum(a * off**n for a, n in zip(amplitude, _POWERS, strict=True)))


@dataclass(frozen=True)
class OtherCourse(AlteredLaw):
    """A law with a free course: a constant part, and waves of half a period over the run and more.

    Attributes
    ----------
    duration_s : float
        Of the run.
    """

    duration_s: float
    amplitudes: tuple[Amplitude, ...] = tuple(Amplitude(f"wave {n}", "", 1.0) for n in range(_WAVES + 1))

    def _change(self, points: ImagePoints, amplitude: Float) -> Float:
        phase = np.pi * points.time_s / self.duration_s
        waves = (a * _UNIT / n * np.cos(n * phase) for n, a in enumerate(amplitude[1:], 1))
        return np.asarray(sum(waves, np.full(len(phase), amplitude[0])))


def other_growth(term: Term, at: Linearised, of_line: bool) -> OtherGrowth:
    """Return a law like a term's with another growth; its reference is the middle of the rings."""
    middle = float(np.median(_radius(at.rings, of_line)))
    shape, amplitude = term.at(term.amplitude)
    name = f"{term.model.name} {term.shape}, with another growth"
    return OtherGrowth(name, term.model, shape, amplitude, of_line, middle)


def other_course(term: Term, at: Linearised, duration_s: float) -> OtherCourse:
    """Return a law like a term's with another course in time and the same mean square over the rings.

    A swing with two directions is taken along the longer one.
    """
    shape, amplitude = term.at(term.amplitude)
    parts, law, own = term.model.factored(at.rings, shape) or ((np.ones(1),), term.model, shape)
    each = np.split(amplitude, len(parts)) * np.sqrt([[np.mean(p**2)] for p in parts])
    _, sizes, directions = np.linalg.svd(each)
    size = each[0] if len(parts) == 1 else sizes[0] * directions[0]
    return OtherCourse(f"{term.model.name} {term.shape}, with another course", law, own, size, duration_s)


def _radius(points: ImagePoints, of_line: bool) -> Float:
    return points.radius_mm if of_line else points.theta
