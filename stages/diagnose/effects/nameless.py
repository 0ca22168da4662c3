"""Patterns without a known cause, of low harmonic and slow or swinging: causes outside the library."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.effect import CourseKind, FixedTo
from stages.diagnose.effects.base import Amplitude, EffectModel, ImagePoints, Shape
from stages.diagnose.effects.courses import IN_TIME, InCourse, in_words
from stages.diagnose.effects.kinds import cosine, frequencies

_REFERENCE_MM = 50.0
STEADY: Shape = ()
# Where a probe rolls so little that a pattern fixed to it shares more than this of one fixed to gravity, only
# the former is tested. At an SNR of 8, which is detected, the rest decides at exp(8² (1 − .95²) / 2) = 23:1.
_ROLLS_LITTLE = 0.95
_HANGS = " (always toward this azimuth of the pipe while the probe rolls, like what hangs by its weight)"


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

    @property
    def radial_exponent(self) -> float | None:
        """Exponent of a line's displacement in the radius of the wall; None for other patterns."""
        return None

    def equation(self, shape: Shape, amplitude: Float) -> str:
        """Return the formula with its numbers, each under its letter and with its unit."""
        letters = {"amplitude": ("a", f" {self.amplitudes[0].unit}"), "direction_deg": ("ψ₀", "°")}
        each = ((*letters[name], v) for name, v in self.quantities(shape, amplitude).items())
        numbers = [f"{letter} = {value:.3g}{unit}" for letter, unit, value in each]
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
    """One harmonic with one power of the radius (line), of θ (image), or of the distance (wall).

    What ``hangs`` keeps its direction in the pipe while the probe rolls.
    """

    name: str
    moves: Moves
    harmonic: int
    exponent: int
    amplitudes: tuple[Amplitude, ...]
    hangs: bool = False

    @property
    def radial_exponent(self) -> float | None:
        """See `Nameless.radial_exponent`."""
        return float(self.exponent) if self.moves is Moves.LINE else None

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return a (r/50)^p cos m(ψ − ψ₀) on the line, or the wall's own a (s/50)^p cos m(ψ_P − ψ₀), mm."""
        if self.moves is Moves.WALL:
            return _along(points, self.exponent) * self._wave(points.azimuth_p_rad, amplitude)
        if self.moves is not Moves.LINE or not points.on_line:
            return np.zeros(len(points.uv))
        if self.hangs and abs(np.mean(np.exp(1j * points.roll_rad))) > _ROLLS_LITTLE:
            return np.zeros(len(points.uv))
        azimuth_rad = points.azimuth_rad + (points.roll_rad if self.hangs else 0.0)
        return np.asarray(growth(points, self.exponent) * self._wave(azimuth_rad, amplitude))

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return a θ^p cos m(ψ − ψ₀) outward or around, px."""
        if self.moves in (Moves.LINE, Moves.WALL):
            return np.zeros((len(points.uv), 2))
        heading = points.outward if self.moves is Moves.OUTWARD else points.outward[:, ::-1] * [-1.0, 1.0]
        size = points.theta**self.exponent * self._wave(points.azimuth_rad, amplitude)
        return np.asarray(size[:, None] * heading)

    def formula(self, shape: Shape) -> str:
        """Return the pattern as a formula."""
        azimuth = "ψ + roll − ψ₀" if self.hangs else "ψ − ψ₀"
        wave = f" cos {self.harmonic}({azimuth})" if self.harmonic else ""
        if self.moves is Moves.WALL:
            return f"wall: a cos {self.harmonic}(ψ_P − ψ₀){' s/50' * self.exponent}"
        base = "(r/50)" if self.moves is Moves.LINE else "θ"
        size = f"a {base}^{self.exponent}{wave}" if self.exponent else f"a{wave}"
        return f"δr = {size}" if self.moves is Moves.LINE else f"image {self.moves}: {size}"

    def goes_with(self, shape: Shape) -> tuple[FixedTo, str, int | None]:
        """Return what it displaces."""
        return FixedTo.GRAVITY if self.hangs else _FIXED_TO[self.moves], "static", self.harmonic

    def equation(self, shape: Shape, amplitude: Float) -> str:
        """Return the formula with its numbers, and what a direction that does not roll means."""
        return super().equation(shape, amplitude) + (_HANGS if self.hangs else "")

    def _wave(self, azimuth_rad: Float, amplitude: Float) -> Float:
        return cosine(azimuth_rad, np.array([*amplitude, 0.0])[:2], self.harmonic)


def _along(points: ImagePoints, exponent: int) -> Float:
    """Return the power (M,) of the wall point's distance, 1 at 50 mm; 0 where the distance is unknown."""
    if not exponent:
        return np.ones(len(points.uv))
    known = points.distance_mm
    return np.zeros(len(points.uv)) if known is None else np.asarray((known / _REFERENCE_MM) ** exponent)


@dataclass(frozen=True)
class PatternInCourse(Nameless, InCourse):
    """A steady pattern with a course, which may be that of an effect; the shape is the course's.

    A slow change of the focal length that was not in the library was once named a cone of the sheet at .996:
    the alternatives were patterns of the picture that are constant or grow evenly, and none that settles as
    it did.

    Attributes
    ----------
    like : EffectModel or None
        The effect whose course it is.
    """

    static: Nameless
    kind: CourseKind
    like: EffectModel | None = None
    name: str = field(init=False)
    harmonic: int = field(init=False)
    amplitudes: tuple[Amplitude, ...] = field(init=False)

    def __post_init__(self) -> None:
        waves = ("sine ", "cosine ") if self.kind is CourseKind.SINUSOID else ("",)
        each = tuple(replace(a, name=wave + a.name) for wave in waves for a in self.static.amplitudes)
        # A pattern that grows with time or speed has the steady one's name: no set holds both.
        swing = f", {self.kind}" if self.kind is CourseKind.SINUSOID else ""
        course = f" as {self.like.name}" if self.like is not None else swing
        object.__setattr__(self, "name", f"{self.static.name}{course}")
        object.__setattr__(self, "harmonic", self.static.harmonic)
        object.__setattr__(self, "amplitudes", each)

    @property
    def radial_exponent(self) -> float | None:
        """See `Nameless.radial_exponent`."""
        return self.static.radial_exponent

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return the `frequencies` of a swing."""
        swings = self.kind is CourseKind.SINUSOID
        return tuple((float(f),) for f in frequencies(duration_s, frame_rate)) if swings else ((),)

    def goes_with(self, shape: Shape) -> tuple[FixedTo, str, int | None]:
        """Return what the pattern is fixed to, or time where it drifts, with the behaviour of its course."""
        time = IN_TIME[self.kind]
        fixed_to, _, harmonic = self.static.goes_with(STEADY)
        return FixedTo.TIME if time == "drift" else fixed_to, time, harmonic

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the root sum of squares of all amplitudes; of a pattern with one wave its direction, too."""
        if self.kind is CourseKind.SINUSOID:
            return {"amplitude": float(np.linalg.norm(amplitude))}
        return self.static.quantities(STEADY, amplitude)

    def formula(self, shape: Shape) -> str:
        """Return the pattern and the course as a formula."""
        return f"({self.static.formula(STEADY)}) × ({in_words(self.kind, shape)})"


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
