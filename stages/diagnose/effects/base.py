"""Interface of an effect: by how much it moves each kind of measurement.

An effect has *amplitudes*, in which predictions are linear near zero (Cartesian where the effect has a
direction), and a *shape* (frequency, time constant, order) that is searched on a grid. All predictions are
true minus stated: where the measurement is found, less where the stated instrument would find it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.instrument.probe import Probe
from pipeline.physics.catalogue import effect
from pipeline.physics.effect import CourseKind
from stages.diagnose.effects.ring_geometry import RingGeometry, ring_geometry

Shape = tuple[float, ...]


@dataclass(frozen=True)
class ImagePoints:
    """Points of the wall as the stated instrument sees them.

    Attributes
    ----------
    probe : Probe
    frame : (M,) int
    time_s : (M,)
        Since the first frame.
    uv : (M, 2)
    xyz_c : (M, 3)
        The wall point in C, mm.
    normal_c : (M, 3)
        Unit normal of the wall, outward, in C.
    along_c : (M, 3)
        Unit direction of the pipe's distance, in C.
    velocity_px : (M, 2)
        Motion of the point's image while the camera moves, px/s: of a wall point for texture, of the
        line for rings.
    speed_mm_s : (M,)
        Of the camera along the pipe.
    on_line : bool
        True for the laser's line, false for texture and fiducials.
    line_width_px : (M,)
        1 σ of the line's profile; NaN off the line.
    wall_azimuth_rad, distance_mm : (M,), optional
        Azimuth and distance of the wall point in P; without them P is taken to have the camera's roll, and
        effects that follow the distance predict nothing.
    per_px_c : (M, 3), optional
        Way of the line's point in C, mm per px that it is found farther out; none off the line.
    across_px : (M,), optional
        By how much the image radius changes over the samples that a point is the mean of.
    albedo_slope_per_mm : (M,), optional
        ∂ ln A of the wall's albedo along the pipe; without it the albedo moves no line.
    """

    probe: Probe
    frame: Int
    time_s: Float
    uv: Float
    xyz_c: Float
    normal_c: Float
    along_c: Float
    velocity_px: Float
    speed_mm_s: Float
    on_line: bool
    line_width_px: Float
    wall_azimuth_rad: Float | None = None
    distance_mm: Float | None = None
    albedo_slope_per_mm: Float | None = None
    per_px_c: Float | None = None
    across_px: Float | None = None

    @cached_property
    def fraction(self) -> Float:
        """(M, 2) cosine and sine of 2πρ of the image radius ρ, px, each the mean over a point's samples."""
        rho = np.linalg.norm(self.uv - self.probe.camera.centre_px, axis=1)
        left = np.sinc(self.across_px) if self.across_px is not None else np.ones(len(rho))
        return np.asarray(left[:, None] * np.stack([np.cos(2 * np.pi * rho), np.sin(2 * np.pi * rho)], -1))

    @cached_property
    def patterns(self) -> dict[tuple[str, Shape, bool], Float]:
        """What static laws do here, for all their courses: by name, shape, and whether on the line."""
        return {}

    @cached_property
    def theta(self) -> Float:
        """(M,) polar angle from the optical axis, rad."""
        return np.asarray(np.arctan2(np.hypot(self.xyz_c[:, 0], self.xyz_c[:, 1]), self.xyz_c[:, 2]))

    @cached_property
    def azimuth_rad(self) -> Float:
        """(M,) azimuth ψ in C, rad."""
        return np.asarray(np.arctan2(self.xyz_c[:, 1], self.xyz_c[:, 0]))

    @cached_property
    def projected_uv(self) -> Float:
        """(M, 2) image of the points by the stated camera."""
        return np.asarray(self.probe.camera.project(self.xyz_c).uv)

    @cached_property
    def ring(self) -> RingGeometry:
        """The laser's line at these points."""
        return ring_geometry(self.probe, self.xyz_c, self.normal_c, self.uv)

    @cached_property
    def camera_distance_mm(self) -> Float:
        """(M,) distance of the camera, not of the wall point, along the pipe; 0 where that is not known."""
        if self.distance_mm is None:
            return np.zeros(len(self.uv))
        return np.asarray(self.distance_mm - np.sum(self.xyz_c * self.along_c, axis=1))

    @cached_property
    def radius_mm(self) -> Float:
        """(M,) distance from the optical axis."""
        return np.asarray(np.hypot(self.xyz_c[:, 0], self.xyz_c[:, 1]))

    @cached_property
    def azimuth_p_rad(self) -> Float:
        """(M,) azimuth in P, or where the wall faces in C."""
        if self.wall_azimuth_rad is not None:
            return self.wall_azimuth_rad
        return np.asarray(np.arctan2(self.normal_c[:, 1], self.normal_c[:, 0]))

    @cached_property
    def outward(self) -> Float:
        """(M, 2) unit direction of the image radius."""
        away = self.uv - self.probe.camera.centre_px
        return np.asarray(away / np.maximum(np.linalg.norm(away, axis=1), 1e-9)[:, None])


@dataclass(frozen=True)
class Travel:
    """How the camera moved along the pipe, at the frames' times.

    Attributes
    ----------
    time_s : (N,)
        Since the first frame.
    distance_mm, speed_mm_s : (N,)
    """

    time_s: Float
    distance_mm: Float
    speed_mm_s: Float


@dataclass(frozen=True)
class Amplitude:
    """One linear amplitude: its name, unit, and how large it may plausibly be (1 σ)."""

    name: str
    unit: str
    plausible: float


class EffectModel(ABC):
    """The prediction of one effect of the catalogue.

    A prediction that an effect does not make is zero. ``amplitude`` is (Q,), in the order of
    `amplitudes`; ``shape`` is one of `shapes`.
    """

    name: str
    amplitudes: tuple[Amplitude, ...]
    kind: CourseKind = CourseKind.CONSTANT
    # 1 σ of what the law leaves out, as a part of the effect's size.
    law_sigma: float = 0.002
    # Whether it may come more than once, at different shapes.
    repeats: bool = False
    # Whether predictions are proportional to the amplitudes.
    linear: bool = False

    @property
    def law(self) -> str:
        """Name of the law in the catalogue, whatever its course."""
        return self.name

    def course(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the numbers of the effect's course by name."""
        return {}

    def shape_step(self, shape: Shape) -> float | None:
        """Return by how much the shape's number may be off the grid; None where it is a choice."""
        return None

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return the shapes to be searched; one empty shape when there is nothing to search."""
        return ((),)

    def factored(self, points: ImagePoints, shape: Shape) -> Factored | None:
        """Return what a `Product` is made of, else None."""
        return None

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return (M, 2) by which the image of every wall point moves, line or texture alike."""
        return np.zeros((len(points.uv), 2))

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return (M,) by which the sheet lies farther along the optical axis at each line point."""
        return np.zeros(len(points.uv))

    def line_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return (M,) by which the line's centroid moves outward for photometric reasons."""
        return np.zeros(len(points.uv))

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return (M,) by which the wall itself lies farther out (pipe effects)."""
        return np.zeros(len(points.uv))

    def reading_shift_mm(self, travel: Travel, shape: Shape, amplitude: Float) -> Float:
        """Return (N,) by which the encoder reads too much."""
        return np.zeros(len(travel.time_s))

    @abstractmethod
    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the catalogue's quantities, such as magnitude and direction, by name."""

    @abstractmethod
    def statement(self, shape: Shape, amplitude: Float) -> str:
        """Return the effect in a plain sentence with its size."""

    def equation(self, shape: Shape, amplitude: Float) -> str:
        """Return the catalogue's law with the numbers to put into it."""
        numbers = (f"{name} = {value:.5g}" for name, value in self.quantities(shape, amplitude).items())
        return f"{effect(self.law).law}, {', '.join(numbers)}"

    def possible(self, shape: Shape, amplitude: Float) -> bool:
        """Return whether every quantity lies within the catalogue's range."""
        ranges = {q.name: (q.low, q.high) for q in effect(self.law).quantities}
        found = self.quantities(shape, amplitude)
        return all(low <= found[name] <= high for name, (low, high) in ranges.items() if name in found)


# Parts (M,) of a size, a law, and its shape: what an effect is that is a product.
Factored: TypeAlias = tuple[tuple[Float, ...], EffectModel, Shape]


class Product(EffectModel):
    """A law times parts of its size; the amplitudes are the law's, once for each part."""

    @abstractmethod
    def factored(self, points: ImagePoints, shape: Shape) -> Factored:
        """Return the parts (M,) of the size that are there, the law, and its shape."""

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the law's shift at each point's part of the size."""
        each = self._each(points, shape, amplitude)
        return np.asarray(sum(p[:, None] * law.image_shift_px(points, own, a) for p, law, own, a in each))

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the law's shift at each point's part of the size."""
        each = self._each(points, shape, amplitude)
        return np.asarray(sum(p * law.sheet_shift_mm(points, own, a) for p, law, own, a in each))

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the law's shift at each point's part of the size."""
        each = self._each(points, shape, amplitude)
        return np.asarray(sum(p * law.wall_shift_mm(points, own, a) for p, law, own, a in each))

    def _each(
        self, points: ImagePoints, shape: Shape, amplitude: Float
    ) -> list[tuple[Float, EffectModel, Shape, Float]]:
        parts, law, own = self.factored(points, shape)
        return [(p, law, own, a) for p, a in zip(parts, np.split(amplitude, len(parts)), strict=True)]
