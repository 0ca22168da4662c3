"""Laws of the library with a course: a knocked sheet, a lens that warms, a baseline that swings.

Any geometric law may come with any course. A product that the catalogue has as an effect of its own
(`laser_rocking`, `baseline_drift`, ...) keeps its own name and model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.arrays import Bool, Float
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import COURSES, Course, CourseKind
from stages.diagnose.effects.base import Amplitude, EffectModel, Factored, ImagePoints, Product, Shape
from stages.diagnose.effects.kinds import Drifting

# Laws of parts that a knock, heat or play can move during a recording, each with its shapes.
_MOVABLE: Mapping[str, tuple[Shape, ...]] = {
    "laser_tilt": ((),), "laser_cone": ((),), "baseline": ((),), "beam_decentre": ((),),
    "sheet_waviness": ((2.0,), (3.0,)), "principal_point": ((),), "focal_scale": ((),),
    "radial_distortion": ((),), "sensor_tilt": ((),), "pixel_aspect": ((),),
}  # fmt: skip
# What the catalogue has under names of its own.
_NAMED = {
    ("laser_tilt", CourseKind.SINUSOID), ("baseline", CourseKind.EXPONENTIAL),
    ("focal_scale", CourseKind.EXPONENTIAL), ("principal_point", CourseKind.EXPONENTIAL),
}  # fmt: skip
# Courses that are searched for every law.
SEARCHED = (
    CourseKind.STEP, CourseKind.RAMP, CourseKind.EXPONENTIAL, CourseKind.SPEED, CourseKind.REVERSAL,
    CourseKind.DISTANCE,
)  # fmt: skip
# Courses that tell of times of their own recording alone.
_OWN_CLOCK = frozenset({CourseKind.STEP, CourseKind.RAMP, CourseKind.EXPONENTIAL, CourseKind.SINUSOID})
# Times of a step on the first grid: a step half a cell off (a 64th of the recording) still keeps 97 % of
# its information in the middle of the recording, n (T − n) / T² of what is before and after.
_TIMES = 32
# Share of the recording at either end in which no step is searched: half a second of 7 s shows 8 rings at
# 15 a second, and from fewer the spread of their common errors is not known.
_EDGE = 1 / 14
_SHARES = (0.1, 0.2, 0.4, 0.8, 1.6)
_SPEED_MM_S, _DISTANCE_MM = 20.0, 100.0
# A probe stands that is slower than a tenth of its fastest so many seconds before and after: after a sudden
# stop `rates` of `stages.diagnose.gauge.points`, taken over a third of a second and more where frames are
# few, go back by up to .08 of it, unless the stop is in the last ten frames. It stands, too, where it is
# slower than a hundredth of its fastest anywhere: noise of poses makes .1 mm/s.
_STANDS, _ABOUT_S, _STILL = 0.1, 0.4, 0.01
_WORDS: Mapping[CourseKind, str] = {
    CourseKind.STEP: "a step at {time_s:.2f} s: before it there is none of it",
    CourseKind.RAMP: "growing evenly from nothing at the first frame to this at {time_s:.1f} s",
    CourseKind.EXPONENTIAL: "grown in the first second, with a time constant of {time_s:.1f} s",
    CourseKind.SINUSOID: "the amplitude of a swing at {frequency_hz:.2f} Hz",
    CourseKind.SPEED: "at a speed of {speed_mm_s:.0f} mm/s, and in proportion to the speed",
    CourseKind.REVERSAL: "while the probe travels forward, and the opposite while it travels backward",
    CourseKind.DISTANCE: "at a distance of {distance_mm:.0f} mm, and in proportion to the distance",
}
_FORMULAS: Mapping[CourseKind, str] = {
    CourseKind.STEP: "0 before time_s, 1 from then on", CourseKind.RAMP: "t / time_s",
    CourseKind.EXPONENTIAL: "1 − exp(−t / time_s)", CourseKind.SINUSOID: "sin(2π frequency_hz t + phase)",
    CourseKind.SPEED: "v / speed_mm_s", CourseKind.REVERSAL: "sgn v", CourseKind.DISTANCE: "s / distance_mm",
}  # fmt: skip


@dataclass(frozen=True)
class Coursed(Product):
    """A law of the library at one shape of its own, with a course; the shape is the course's number.

    A swing has every amplitude twice: of its sine, then of its cosine.
    """

    static: EffectModel
    own: Shape
    kind: CourseKind
    name: str = field(init=False)
    amplitudes: tuple[Amplitude, ...] = field(init=False)
    law_sigma: float = field(init=False)

    def __post_init__(self) -> None:
        amplitudes = self.static.amplitudes
        if self.kind is CourseKind.SINUSOID:
            amplitudes = tuple(
                replace(a, name=f"{a.name}, {wave}") for wave in ("sine", "cosine") for a in amplitudes
            )
        order = "".join(f" {n:.0f}" for n in self.own)
        object.__setattr__(self, "name", f"{self.static.name}{order}, {self.kind}")
        object.__setattr__(self, "amplitudes", amplitudes)
        object.__setattr__(self, "law_sigma", self.static.law_sigma)

    @property
    def law(self) -> str:
        """See `EffectModel.law`."""
        return self.static.law

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return the course's numbers to be searched; the size of the others is at a fixed reference."""
        if self.kind is CourseKind.STEP:
            inside = _EDGE + (1 - 2 * _EDGE) * (np.arange(_TIMES) + 0.5) / _TIMES
            return tuple((float(t),) for t in duration_s * inside)
        if self.kind is CourseKind.EXPONENTIAL:
            return tuple((duration_s * share,) for share in _SHARES)
        if self.kind is CourseKind.SINUSOID:
            step = 0.5 / duration_s
            return tuple((float(f),) for f in np.arange(2 * step, frame_rate / 2 + step / 2, step))
        reference = {
            CourseKind.RAMP: duration_s, CourseKind.SPEED: _SPEED_MM_S, CourseKind.DISTANCE: _DISTANCE_MM
        }  # fmt: skip
        return ((reference[self.kind],),) if self.kind in reference else ((),)

    def shape_step(self, shape: Shape) -> float | None:
        """Return a part of the time constant, the step of a frequency; None where nothing is continuous."""
        return {CourseKind.EXPONENTIAL: 0.3 * sum(shape), CourseKind.SINUSOID: 0.05}.get(self.kind)

    def factored(self, points: ImagePoints, shape: Shape) -> Factored:
        """Return the course's factor, of a swing its sine's and its cosine's, and the law."""
        return factors(self.kind, points, shape), self.static, self.own

    def _swing(self, amplitude: Float) -> tuple[Float, float]:
        """Return the law's amplitudes (Q,) along the longer axis of a swing's ellipse, and the phase, deg."""
        both = np.asarray(amplitude).reshape(2, -1)
        axis = np.linalg.svd(both)[2][0]
        sine, cosine = both @ axis
        return np.asarray(np.hypot(sine, cosine) * axis), float(np.degrees(np.arctan2(cosine, sine)))

    def _size(self, amplitude: Float) -> Float:
        """Return the law's amplitudes (Q,)."""
        return self._swing(amplitude)[0] if self.kind is CourseKind.SINUSOID else np.asarray(amplitude)

    def course(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the numbers of the course, the phase of a swing among them."""
        values = shape
        if self.kind is CourseKind.SINUSOID:
            values = (shape[0], self._swing(amplitude)[1])
        return Course(self.kind, values).quantities

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the law's quantities at its size; the course's numbers stand in `course`."""
        return self.static.quantities(self.own, self._size(amplitude))

    def statement(self, shape: Shape, amplitude: Float) -> str:
        """Return the law's sentence, and how it comes."""
        words, size = _WORDS[self.kind].format(**self.course(shape, amplitude)), self._size(amplitude)
        if self.kind is CourseKind.EXPONENTIAL:
            # What it comes to in the end, a short run only continues.
            size = size * Course(self.kind, shape).factor(1.0, 0.0, 0.0)
        return f"{self.static.statement(self.own, size).rstrip('.')} ({words})."

    def equation(self, shape: Shape, amplitude: Float) -> str:
        """Return the law and its course with the numbers to put into them."""
        known = self.quantities(shape, amplitude) | self.course(shape, amplitude)
        numbers = ", ".join(f"{name} = {value:.5g}" for name, value in known.items())
        return f"({effect(self.law).law}) × ({_FORMULAS[self.kind]}), {numbers}"


def of_own_clock(model: EffectModel) -> bool:
    """Return whether an effect comes at times of its own recording, which no other has to share."""
    return model.kind in _OWN_CLOCK


def factors(kind: CourseKind, points: ImagePoints, shape: Shape) -> tuple[Float, ...]:
    """Return the factor (M,) of a course; of a swing that of its sine, then of its cosine."""
    swings = kind is CourseKind.SINUSOID
    courses = [(shape[0], phase) for phase in (0.0, 90.0)] if swings else [shape]
    speed = points.speed_mm_s
    if kind is CourseKind.REVERSAL:
        speed = np.where(_stands(points.time_s, np.abs(speed)), 0.0, speed)
    at = points.time_s, points.camera_distance_mm, speed
    return tuple(Course(kind, c).factor(*at) for c in courses)


def in_words(kind: CourseKind, shape: Shape) -> str:
    """Return a course as a formula with its numbers; of a swing its phase is left open."""
    numbers = ", ".join(f"{q.name} = {v:.3g}" for q, v in zip(COURSES[kind], shape, strict=False))
    return f"{_FORMULAS[kind]}, {numbers}" if numbers else _FORMULAS[kind]


def with_courses(
    library: Mapping[str, EffectModel], kinds: tuple[CourseKind, ...] = SEARCHED
) -> dict[str, EffectModel]:
    """Return the library with every movable law of it also with each course."""
    more = [
        Coursed(library[name], own, kind)
        for name, shapes in _MOVABLE.items()
        if name in library
        for own in shapes
        for kind in kinds
        if (name, kind) not in _NAMED
    ]
    return {**library, **{model.name: model for model in more}}


def shape_alike(
    model: EffectModel, other: EffectModel, shape: Shape, amplitude: Float, duration_s: float
) -> Shape | None:
    """Return the shape at which a model grows as another does in a run, if one drifts as the other's ramp.

    A ramp and a slow drift are one curve under two names: with a time constant of 6.4 runs the drift is off
    a straight line by 1.6 % of its size. What it comes to in the end must be possible, so that only a quicker
    one, which is bent more, may be in a large ramp's place.

    Parameters
    ----------
    other, shape, amplitude
        The effect that was found, its shape and its amplitudes (Q,).
    """
    if isinstance(other, Drifting) and isinstance(model, Coursed):
        ramps = model.kind is CourseKind.RAMP and model.law == other.static.law
        return (duration_s,) if ramps else None
    if not (isinstance(model, Drifting) and isinstance(other, Coursed) and other.kind is CourseKind.RAMP):
        return None
    reached, end = amplitude * duration_s / shape[0], np.array(duration_s)
    slowest_first = reversed(model.shapes(duration_s, 0.0) if model.static.law == other.law else ())
    return next((s for s in slowest_first if model.possible(s, reached / model.reached(end, s))), None)


def _stands(time_s: Float, speed: Float) -> Bool:
    """Return where a probe of such speeds (M,) at times (M,), in any order, stands."""
    if not len(time_s):
        return np.zeros(0, bool)
    order = np.argsort(time_s, kind="stable")
    times, ends = time_s[order], np.append(speed[order], 0.0)
    first = np.searchsorted(times, time_s - _ABOUT_S)
    end = np.searchsorted(times, time_s + _ABOUT_S, side="right")
    fastest_about = np.maximum.reduceat(ends, np.stack([first, end], -1).ravel())[::2]
    return np.asarray(speed < np.maximum(_STANDS * fastest_about, _STILL * speed.max()))
