"""A gauge run with fixed weights, the effects included in its model, and its linearisation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields

import numpy as np

from pipeline.adjustment.levenberg_marquardt import Watch, unwatched
from pipeline.adjustment.rows import Rows
from pipeline.arrays import Float, Int
from pipeline.files.codec import NOT_STORED
from pipeline.physics.catalogue import EFFECTS
from pipeline.recording.base import Encoder
from stages.calibrate.gauge.edges import Edges
from stages.calibrate.gauge.geometry import BoreRings
from stages.diagnose.effects.base import Amplitude, EffectModel, Factored, ImagePoints, Shape, Travel
from stages.diagnose.effects.courses import IN_TIME, Coursed
from stages.diagnose.effects.nameless import Nameless
from stages.diagnose.gauge.equations import EDGE, KINDS, RING, Equations, InCourses
from stages.diagnose.gauge.points import one_of_each_frame


@dataclass(frozen=True)
class Term:
    """An effect included in the model: at one shape, with amplitudes (Q,).

    With ``bounds`` its shape, a continuous number, is free within them: the difference from ``shape`` is then
    one more amplitude, the last.
    """

    model: EffectModel
    shape: Shape
    amplitude: Float
    bounds: tuple[float, float] | None = None

    @property
    def amplitudes(self) -> tuple[Amplitude, ...]:
        """The model's amplitudes, and that of a free shape."""
        step = self.model.shape_step(self.shape) if self.bounds is not None else None
        more = () if step is None else (Amplitude("shape", "", step),)
        return (*self.model.amplitudes, *more)

    def at(self, amplitude: Float) -> tuple[Shape, Float]:
        """Return the model's own shape and amplitudes for the term's amplitudes."""
        if self.bounds is None:
            return self.shape, amplitude
        low, high = self.bounds
        first = min(max(self.shape[0] + float(amplitude[-1]), low), high)
        return (first, *self.shape[1:]), amplitude[:-1]


@dataclass(frozen=True)
class GaugeRun:
    """The measurements of a gauge run with fixed weights.

    Attributes
    ----------
    width_px : (R,)
        Line width at the ring bins.
    time_s : (N,)
    bore_sigma_mm : float or (B,)
        1 σ of the bores' radii; of all, or of each.
    motion_sigma : (N − 3, 6)
        1 σ of each of the poses' third differences.
    edge_weight, ring_weight : (E,), (R,)
        Fixed, so that hypotheses are compared on the same measurements.
    watch : Watch
        Called at every linearisation; not part of the measurements, and not stored.
    """

    edges: Edges
    rings: BoreRings
    width_px: Float
    time_s: Float
    encoder: Encoder | None
    bore_sigma_mm: float | Float
    motion_sigma: Float
    edge_weight: Float
    ring_weight: Float
    watch: Watch = field(default=unwatched, repr=False, compare=False, metadata=NOT_STORED)

    def measures_as(self, other: GaugeRun) -> bool:
        """Return whether another run has the same measurements and weights."""
        return all(getattr(self, f.name) is getattr(other, f.name) for f in fields(self) if f.compare)


@dataclass(frozen=True)
class Linearised:
    """Measurements as equations, the motion's prior, and the points where effects were predicted."""

    equations: Equations
    motion: Rows
    rings: ImagePoints
    edges: ImagePoints
    travel: Travel

    def in_courses(
        self, asked: Sequence[tuple[EffectModel, Shape]], frames: int
    ) -> tuple[list[tuple[EffectModel, Shape]], InCourses]:
        """Return the laws of what is asked about, each once, and the columns: the equations' own, then those.

        The laws' columns follow the equations' own ones in that order.
        """
        own = end = self.equations.by_global.shape[1]
        laws, place = list[tuple[EffectModel, Shape]](), dict[tuple[str, Shape], Int]()
        parts = [InCourses.plain(np.arange(own), frames)]
        moments = {RING: one_of_each_frame(self.rings), EDGE: one_of_each_frame(self.edges)}
        for model, shape in asked:
            factored = {kind: model.factored(points, shape) for kind, points in moments.items()}
            _, law, of_law = factored[RING] or ((), model, shape)
            if (law.name, of_law) not in place:
                place[law.name, of_law] = np.arange(end, end + len(law.amplitudes))
                end += len(law.amplitudes)
                laws.append((law, of_law))
            columns = place[law.name, of_law]
            if factored[RING] is None:
                parts.append(InCourses.plain(columns, frames))
            else:
                when = {kind: points.frame for kind, points in moments.items()}
                parts.append(_in_course(columns, factored, when, frames))
        return laws, InCourses.joined(parts)


def _in_course(
    columns: Int, factored: Mapping[int, Factored | None], when: Mapping[int, Int], frames: int
) -> InCourses:
    """Return a law's columns times each factor of its course, by kind at the frames of its points.

    Courses of the library have no influence on the encoder's readings.
    """
    known = {kind: np.stack(of[0], -1) for kind, of in factored.items() if of is not None}
    times = known[RING].shape[1]
    each = np.zeros((len(KINDS), frames, times * len(columns)))
    for kind, factors in known.items():
        each[kind, when[kind]] = np.repeat(factors, len(columns), axis=1)
    return InCourses(np.tile(columns, times), each)


def pattern_of(term: Term) -> tuple[str, str, int | None]:
    """Return what a term is fixed to, its behaviour in time, and its harmonic."""
    model = term.model
    if isinstance(model, Nameless):
        fixed_to, time, harmonic = model.goes_with(term.shape)
        return str(fixed_to), time, harmonic
    known = EFFECTS[model.law]
    numbers = model.quantities(term.shape, term.amplitude)
    order = int(numbers["order"]) if "order" in numbers else known.harmonic
    return str(known.fixed_to), behaviour(model), order


def behaviour(model: EffectModel) -> str:
    """Return how an effect of the library behaves in time."""
    return IN_TIME[model.kind] if isinstance(model, Coursed) else EFFECTS[model.law].time
