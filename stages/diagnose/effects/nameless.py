"""Patterns without a known cause, of low harmonic and slow or swinging: causes outside the library."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.effect import FixedTo
from stages.diagnose.effects.base import Amplitude, EffectModel, Factored, ImagePoints, Product, Shape
from stages.diagnose.effects.kinds import cosine, sine_and_cosine_at

_REFERENCE_MM = 50.0
_HARMONICS = (0, 1, 2, 3, 4)
_EXPONENTS = (0, 1, 2, 3)
# Reference values for the units of a pattern's size; any would do.
_REFERENCE_S, _REFERENCE_MM_S = 10.0, 20.0
# Shapes of a term: the coordinate that its size is proportional to.
STEADY, WITH_TIME, WITH_SPEED, WITH_DISTANCE = (0.0,), (1.0,), (2.0,), (3.0,)
_COURSES = ("", " t/10", " v/20", " s/50")
_IN_TIME = ("static", "drift", "speed", "static")


class Nameless(EffectModel):
    """A pattern with m waves around the ring, with a cosine and a sine part; m = 0 has only the first."""

    harmonic: int
    linear = True

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the amplitude and the direction of a crest; for m = 0 only the signed size."""
        if len(amplitude) == 1:
            return {"amplitude": float(amplitude[0])}
        crest = np.degrees(np.arctan2(amplitude[1], amplitude[0])) / max(self.harmonic, 1)
        return {"amplitude": float(np.hypot(*amplitude)), "direction_deg": float(crest)}

    def formula(self, shape: Shape) -> str:
        """Return the pattern as a formula in a, r, ψ, t."""
        raise NotImplementedError

    def goes_with(self, shape: Shape) -> tuple[FixedTo, str, int | None]:
        """Return what the pattern is fixed to, its behaviour in time, and its harmonic."""
        return FixedTo.TIME, "static", self.harmonic

    def equation(self, shape: Shape, amplitude: Float) -> str:
        """Return the formula with its numbers, each under its letter and with its unit."""
        letters = {
            "amplitude": ("a", f" {self.amplitudes[0].unit}"), "frequency_hz": ("f", " Hz"),
            "direction_deg": ("ψ₀", "°"),
        }  # fmt: skip
        numbers = []
        for name, value in self.quantities(shape, amplitude).items():
            letter, unit = letters.get(name, (name, ""))
            numbers.append(f"{letter} = {value:.3g}{unit}")
        return f"{self.formula(shape)}, {', '.join(numbers)}"

    def statement(self, shape: Shape, amplitude: Float) -> str:
        """Return a sentence that states a pattern without a known cause, with its formula."""
        return f"A pattern without a known cause: {self.equation(shape, amplitude)}."

    def possible(self, shape: Shape, amplitude: Float) -> bool:
        """Return True: a pattern without a cause has no bounds."""
        return True


def two_parts(unit: str, plausible: float) -> tuple[Amplitude, ...]:
    """Return the amplitudes of a pattern's cosine and sine."""
    return Amplitude("cosine", unit, plausible), Amplitude("sine", unit, plausible)


def growth(points: ImagePoints, exponent: float) -> Float:
    """Return the power (M,) of the distance from the optical axis, 1 at 50 mm."""
    return np.asarray((points.radius_mm / _REFERENCE_MM) ** exponent)


@dataclass(frozen=True)
class SwingTerm(Nameless, Product):
    """One oscillating harmonic of the line with one power of the radius; amplitudes: sine, cosine."""

    name: str
    harmonic: int
    exponent: int
    amplitudes: tuple[Amplitude, ...]

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return frequencies half a resolution cell apart, up to half the frame rate."""
        step = 0.5 / duration_s
        return tuple((float(f),) for f in np.arange(2 * step, frame_rate / 2 + step / 2, step))

    def shape_step(self, shape: Shape) -> float:
        """Return the step of the frequency: the resolution of the recording's duration."""
        return 0.05

    def factored(self, points: ImagePoints, shape: Shape) -> Factored:
        """Return sine and cosine, and the steady pattern."""
        steady = _term(Moves.LINE, self.harmonic, self.exponent)
        return sine_and_cosine_at(points.time_s, shape[0]), steady, STEADY

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the amplitude and the frequency."""
        return {"amplitude": float(np.linalg.norm(amplitude)), "frequency_hz": shape[0]}

    def goes_with(self, shape: Shape) -> tuple[FixedTo, str, int | None]:
        """Return the laser: the line moves relative to the fiducials, which the camera does not affect."""
        return FixedTo.LASER, "periodic", self.harmonic

    def formula(self, shape: Shape) -> str:
        """Return the pattern as a formula."""
        wave = f" cos {self.harmonic}(ψ − ψ₀)" if self.harmonic else ""
        return f"δr = a (r/50)^{self.exponent}{wave} sin(2πft + φ)"


def _swing(harmonic: int, exponent: int) -> SwingTerm:
    parts = ("along x", "along y") if harmonic else ("size",)
    amplitudes = tuple(
        Amplitude(f"{wave} {part}", "mm", 0.05) for wave in ("sine", "cosine") for part in parts
    )
    return SwingTerm(f"generic_swing_{harmonic}_{exponent}", harmonic, exponent, amplitudes)


# A sheet that moves along the axis, or rocks.
SWINGS: tuple[SwingTerm, ...] = (_swing(0, 1), _swing(1, 2))


class Moves(StrEnum):
    """What a generic term displaces: the line on the wall, images outward or around, or the wall itself."""

    LINE = "line"
    OUTWARD = "outward"
    AROUND = "around"
    WALL = "wall"


_FIXED_TO = {
    Moves.LINE: FixedTo.LASER,
    Moves.OUTWARD: FixedTo.CAMERA,
    Moves.AROUND: FixedTo.CAMERA,
    Moves.WALL: FixedTo.PIPE,
}


@dataclass(frozen=True)
class GenericTerm(Nameless):
    """One harmonic with one power of the radius (line) or of θ (image); the shape is its course."""

    name: str
    moves: Moves
    harmonic: int
    exponent: int
    amplitudes: tuple[Amplitude, ...]

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return constant, and linear in time."""
        return ((0.0,), (1.0,))

    def factored(self, points: ImagePoints, shape: Shape) -> Factored | None:
        """Return the course and the steady pattern."""
        return None if shape == STEADY else ((self._course(points, shape),), self, STEADY)

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return a (r/50)^p cos m(ψ − ψ₀) on the line, or the wall's own a cos m(ψ_P − ψ₀), mm."""
        if self.moves is Moves.WALL:
            parts = np.array([*amplitude, 0.0])[:2]
            return self._course(points, shape) * cosine(points.azimuth_p_rad, parts, self.harmonic)
        if self.moves is not Moves.LINE or not points.on_line:
            return np.zeros(len(points.uv))
        return np.asarray(growth(points, self.exponent) * self._pattern(points, shape, amplitude))

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return a θ^p cos m(ψ − ψ₀) outward or around, px."""
        if self.moves in (Moves.LINE, Moves.WALL):
            return np.zeros((len(points.uv), 2))
        heading = points.outward if self.moves is Moves.OUTWARD else points.outward[:, ::-1] * [-1.0, 1.0]
        size = points.theta**self.exponent * self._pattern(points, shape, amplitude)
        return np.asarray(size[:, None] * heading)

    def formula(self, shape: Shape) -> str:
        """Return the pattern as a formula."""
        wave = f" cos {self.harmonic}(ψ − ψ₀)" if self.harmonic else ""
        course = _COURSES[int(shape[0])]
        if self.moves is Moves.WALL:
            return f"wall: a cos {self.harmonic}(ψ_P − ψ₀){course}"
        if self.moves is Moves.LINE:
            return f"δr = a (r/50)^{self.exponent}{wave}{course}"
        return f"image {self.moves}: a θ^{self.exponent}{wave}{course}"

    def goes_with(self, shape: Shape) -> tuple[FixedTo, str, int | None]:
        """Return what it displaces, or time where it grows with time."""
        time = _IN_TIME[int(shape[0])]
        return FixedTo.TIME if time == "drift" else _FIXED_TO[self.moves], time, self.harmonic

    def _pattern(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        parts = np.array([*amplitude, 0.0])[:2]
        return self._course(points, shape) * cosine(points.azimuth_rad, parts, self.harmonic)

    def _course(self, points: ImagePoints, shape: Shape) -> Float:
        if shape == WITH_TIME:
            return points.time_s / _REFERENCE_S
        if shape == WITH_SPEED:
            return points.speed_mm_s / _REFERENCE_MM_S
        if shape == WITH_DISTANCE and points.distance_mm is not None:
            return points.distance_mm / _REFERENCE_MM
        return np.full(len(points.uv), float(shape == STEADY))


@dataclass(frozen=True)
class RowTerm(Nameless):
    """A delay proportional to the image row: the image shifts by its velocity times the delay."""

    name: str = "generic_rows"
    harmonic: int = 0
    amplitudes: tuple[Amplitude, ...] = (Amplitude("delay", "s", 0.01),)

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return a (v/H − 1/2) times the image's velocity, px."""
        row = (points.uv[:, 1] + 0.5) / points.probe.camera.image_size[1] - 0.5
        return np.asarray(amplitude[0] * row[:, None] * points.velocity_px)

    def goes_with(self, shape: Shape) -> tuple[FixedTo, str, int | None]:
        """Return the camera and its speed."""
        return FixedTo.CAMERA, "speed", None

    def formula(self, shape: Shape) -> str:
        """Return the pattern as a formula."""
        return "image: a (row/H − 1/2) × velocity"


@dataclass(frozen=True)
class FractionTerm(Nameless):
    """A wave in the sub-pixel position of the line."""

    name: str = "generic_fraction"
    harmonic: int = 0
    amplitudes: tuple[Amplitude, ...] = two_parts("px", 0.02)

    def line_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return a cos 2πρ + b sin 2πρ of the line's image radius ρ, px; zero for texture."""
        if not points.on_line:
            return np.zeros(len(points.uv))
        return np.asarray(points.fraction @ amplitude)

    def goes_with(self, shape: Shape) -> tuple[FixedTo, str, int | None]:
        """Return the camera's pixels."""
        return FixedTo.CAMERA, "static", None

    def formula(self, shape: Shape) -> str:
        """Return the pattern as a formula."""
        return "line: a cos(2πρ − φ₀), ρ its image radius in px"


def _term(moves: Moves, harmonic: int, exponent: int) -> GenericTerm:
    in_mm = moves in (Moves.LINE, Moves.WALL)
    amplitudes = two_parts("mm", 0.05) if in_mm else two_parts("px", 0.2)
    kept = amplitudes if harmonic else amplitudes[:1]
    return GenericTerm(f"generic_{moves}_{harmonic}_{exponent}", moves, harmonic, exponent, kept)


GENERIC: tuple[GenericTerm, ...] = tuple(
    _term(moves, harmonic, exponent)
    for moves in (Moves.LINE, Moves.OUTWARD, Moves.AROUND)
    for harmonic in _HARMONICS
    for exponent in _EXPONENTS
)


def _vocabulary() -> tuple[tuple[Nameless, Shape], ...]:
    courses = {Moves.LINE: (STEADY, WITH_TIME, WITH_SPEED), Moves.OUTWARD: (STEADY, WITH_TIME)}
    moving = [(t, course) for t in GENERIC for course in courses.get(t.moves, (STEADY,))]
    wall = [(_term(Moves.WALL, m, 0), course) for m in (1, 2, 3, 4) for course in (STEADY, WITH_DISTANCE)]
    return (*moving, *wall, (RowTerm(), STEADY), (FractionTerm(), STEADY))


# The patterns that empirical formulas are built from, in (r, ψ, t, s, speed, row).
VOCABULARY: tuple[tuple[Nameless, Shape], ...] = _vocabulary()
