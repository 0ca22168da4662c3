"""Laws of the library with a course in time: a knocked sheet, a lens that warms up, a baseline that swings.

Any geometric law may have any course. Combinations that the catalogue lists as effects (`laser_rocking`,
`baseline_drift`, ...) keep their own name and model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.arrays import Bool, Float
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import COURSES, Course, CourseKind
from stages.diagnose.effects.base import Amplitude, EffectModel, Factored, ImagePoints, Product, Shape
from stages.diagnose.effects.kinds import FREQUENCY_STEP_HZ, Worded, frequencies, within

# Laws of parts that a knock, heat or play can move during a recording, each with its shapes.
_MOVABLE: Mapping[str, tuple[Shape, ...]] = {
    "laser_tilt": ((),), "laser_cone": ((),), "baseline": ((),), "beam_decentre": ((),),
    "sheet_waviness": ((2.0,), (3.0,)), "principal_point": ((),), "focal_scale": ((),),
    "radial_distortion": ((),), "sensor_tilt": ((),), "pixel_aspect": ((),),
}  # fmt: skip
# Combinations that are effects of the catalogue under their own name.
_NAMED = {
    ("laser_tilt", CourseKind.SINUSOID), ("baseline", CourseKind.EXPONENTIAL),
    ("focal_scale", CourseKind.EXPONENTIAL), ("principal_point", CourseKind.EXPONENTIAL),
}  # fmt: skip
# Courses that are searched for every law.
SEARCHED = (
    CourseKind.STEP, CourseKind.RAMP, CourseKind.EXPONENTIAL, CourseKind.SPEED, CourseKind.REVERSAL,
    CourseKind.DISTANCE,
)  # fmt: skip
# Courses whose parameters are times of their own recording.
_OWN_CLOCK = frozenset({CourseKind.STEP, CourseKind.RAMP, CourseKind.EXPONENTIAL, CourseKind.SINUSOID})
# Number of step times on the first grid: a step half a cell off (a 64th of the recording) keeps 97 % of its
# information in the middle of the recording, n (T − n) / T² with n frames before it.
_TIMES = 32
# Share of the recording at either end in which no step is searched: half a second of 7 s has 8 rings at 15
# per second; with fewer, the scatter of their common errors is unknown.
_EDGE = 1 / 14
# Time constants that are searched, in recordings: from the shortest, a step at the start, to the longest, of
# the catalogue's own drifts nearly a straight line.
_SHARES, _DRIFT_SHARES = (0.1, 0.2, 0.4, 0.8, 1.6), (0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4)
# A drift is stated by its growth in the first second, or, where its time constant is longer than this, in a
# tenth of that: of .02 mm in 600 s, the first second has .00003. The recording lasts longer than a tenth: at
# least about a sixth of the time constant, see `_DRIFT_SHARES`.
_SLOW_S = 60.0
_SPEED_MM_S, _DISTANCE_MM = 20.0, 100.0
# A probe counts as standing if for so many seconds before and after it is slower than a tenth of its top
# speed: after a sudden stop, `rates` of `stages.diagnose.gauge.points`, taken over a third of a second or
# more, overshoot backward by up to .08 of it, unless the stop is in the last ten frames. It also counts as
# standing when slower than a hundredth of its top speed: noise of poses makes .1 mm/s.
_STANDS, _ABOUT_S, _STILL = 0.1, 0.4, 0.01
_WORDS: Mapping[CourseKind, str] = {
    CourseKind.STEP: "a step at {time_s:.2f} s: before that it is absent",
    CourseKind.RAMP: "growing evenly from nothing at the first frame to this at {time_s:.1f} s",
    CourseKind.EXPONENTIAL: "grown in the first {first}, with a time constant of {time_s:.1f} s",
    CourseKind.SINUSOID: "the amplitude of a swing at {frequency_hz:.2f} Hz",
    CourseKind.SPEED: "at a speed of {speed_mm_s:.0f} mm/s, and in proportion to the speed",
    CourseKind.REVERSAL: "while the probe travels forward, and the opposite while it travels backward",
    CourseKind.DISTANCE: "at a distance of {distance_mm:.0f} mm, and in proportion to the distance",
}
# How an effect with such a course behaves in time.
IN_TIME: Mapping[CourseKind, str] = {
    CourseKind.CONSTANT: "static", CourseKind.STEP: "event", CourseKind.RAMP: "drift",
    CourseKind.EXPONENTIAL: "drift", CourseKind.SINUSOID: "periodic", CourseKind.SPEED: "speed",
    CourseKind.REVERSAL: "reversal", CourseKind.DISTANCE: "static",
}  # fmt: skip
_FORMULAS: Mapping[CourseKind, str] = {
    CourseKind.STEP: "0 before time_s, 1 from then on", CourseKind.RAMP: "t / time_s",
    CourseKind.EXPONENTIAL: "1 − exp(−t / time_s)", CourseKind.SINUSOID: "sin(2π frequency_hz t + phase)",
    CourseKind.SPEED: "v / speed_mm_s", CourseKind.REVERSAL: "sgn v", CourseKind.DISTANCE: "s / distance_mm",
}  # fmt: skip


class InCourse(Product):
    """A law, at one shape of its own, with a course in time; its shape is the parameter of the course.

    A swing has every amplitude twice: for its sine, then for its cosine.
    """

    static: EffectModel
    own: Shape = ()

    def shape_step(self, shape: Shape) -> float | None:
        """Return a fraction of the time constant, or a frequency step; None if nothing is continuous."""
        steps = {CourseKind.EXPONENTIAL: 0.3 * sum(shape), CourseKind.SINUSOID: FREQUENCY_STEP_HZ}
        return steps.get(self.kind)

    def factored(self, points: ImagePoints, shape: Shape) -> Factored:
        """Return the course's factor (for a swing those of sine and cosine), and the law."""
        return factors(self.kind, points, shape), self.static, self.own


class Drifting(Worded, InCourse):
    """An effect of the catalogue that grows as 1 − exp(−t/t₀); the shape is t₀ in s."""

    kind = CourseKind.EXPONENTIAL

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return the time constants within the catalogue's range."""
        return within(effect(self.name).quantity("time_s"), duration_s * np.array(_DRIFT_SHARES))

    def course(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the time constant."""
        return {"time_s": shape[0]}

    def values_in_words(self, shape: Shape, amplitude: Float) -> dict[str, float | str]:
        """Return the quantities, the growth in its `beginning`, and how long that lasts, in words.

        For a drift slower than its recording the latter is well determined, while the final size is
        extrapolated.
        """
        quantities = self.quantities(shape, amplitude)
        final = abs(quantities[effect(self.name).quantities[0].name])
        beginning_s, first = beginning(shape[0])
        return {**quantities, "at_first": final * reached(beginning_s, shape), "first": first}

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the final size and the time constant."""
        first, *following = self.static.quantities(self.own, amplitude).items()
        return {effect(self.name).quantities[0].name: first[1], **dict(following), "time_s": shape[0]}


@dataclass(frozen=True)
class Coursed(InCourse):
    """A law of the library with a course."""

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
        """Return the course's parameters to be searched; courses without one have a fixed reference."""
        if self.kind is CourseKind.STEP:
            inside = _EDGE + (1 - 2 * _EDGE) * (np.arange(_TIMES) + 0.5) / _TIMES
            return tuple((float(t),) for t in duration_s * inside)
        if self.kind is CourseKind.EXPONENTIAL:
            return tuple((duration_s * share,) for share in _SHARES)
        if self.kind is CourseKind.SINUSOID:
            return tuple((float(f),) for f in frequencies(duration_s, frame_rate))
        reference = {
            CourseKind.RAMP: duration_s, CourseKind.SPEED: _SPEED_MM_S, CourseKind.DISTANCE: _DISTANCE_MM
        }  # fmt: skip
        return ((reference[self.kind],),) if self.kind in reference else ((),)

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
        """Return the parameters of the course, including the phase of a swing."""
        values = shape
        if self.kind is CourseKind.SINUSOID:
            values = (shape[0], self._swing(amplitude)[1])
        return Course(self.kind, values).quantities

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the law's quantities at its size; the parameters of the course are in `course`."""
        return self.static.quantities(self.own, self._size(amplitude))

    def statement(self, shape: Shape, amplitude: Float) -> str:
        """Return the law's sentence, followed by its course."""
        first, size = "", self._size(amplitude)
        if self.kind is CourseKind.EXPONENTIAL:
            # What it comes to in the end, a short run only continues.
            beginning_s, first = beginning(shape[0])
            size = size * reached(beginning_s, shape)
        words = _WORDS[self.kind].format(first=first, **self.course(shape, amplitude))
        return f"{self.static.statement(self.own, size).rstrip('.')} ({words})."

    def equation(self, shape: Shape, amplitude: Float) -> str:
        """Return the law and its course with their numbers."""
        known = self.quantities(shape, amplitude) | self.course(shape, amplitude)
        numbers = ", ".join(f"{name} = {value:.5g}" for name, value in known.items())
        return f"({effect(self.law).law}) × ({_FORMULAS[self.kind]}), {numbers}"


def beginning(time_s: float) -> tuple[float, str]:
    """Return for how long the growth of a drift with such a time constant is stated, s, and that in words."""
    if time_s <= _SLOW_S:
        return 1.0, "second"
    beginning_s = round(time_s / 10)
    return float(beginning_s), f"{beginning_s} s"


def reached(time_s: float, shape: Shape) -> float:
    """Return the fraction of the final size that a drift reaches at a time, s."""
    return float(Course(CourseKind.EXPONENTIAL, shape).factor(time_s, 0.0, 0.0))


def of_own_clock(model: EffectModel) -> bool:
    """Return whether an effect depends on times of its own recording, which no other recording shares."""
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
    words = _FORMULAS[kind]
    for quantity, value in zip(COURSES[kind], shape, strict=False):
        words = words.replace(quantity.name, f"{value:.3g} {quantity.unit}")
    return words


def with_courses(
    library: Mapping[str, EffectModel], kinds: tuple[CourseKind, ...] = SEARCHED
) -> dict[str, EffectModel]:
    """Return the library, with every movable law also in each course."""
    more = [
        Coursed(library[name], own, kind)
        for name, shapes in _MOVABLE.items()
        if name in library
        for own in shapes
        for kind in kinds
        if (name, kind) not in _NAMED
    ]
    return {**library, **{model.name: model for model in more}}


def _stands(time_s: Float, speed: Float) -> Bool:
    """Return when a probe with speeds (M,) at times (M,), in any order, stands still."""
    if not len(time_s):
        return np.zeros(0, bool)
    order = np.argsort(time_s, kind="stable")
    times, ends = time_s[order], np.append(speed[order], 0.0)
    first = np.searchsorted(times, time_s - _ABOUT_S)
    end = np.searchsorted(times, time_s + _ABOUT_S, side="right")
    fastest_about = np.maximum.reduceat(ends, np.stack([first, end], -1).ravel())[::2]
    return np.asarray(speed < np.maximum(_STANDS * fastest_about, _STILL * speed.max()))
