"""Interface of an effect: how it changes each kind of measurement.

An effect has *amplitudes*, in which predictions are linear near zero (Cartesian where the effect has a
direction), and a *shape* (frequency, time constant, order) that is searched on a grid. All predictions are
true minus stated: where the measurement is found, minus where the stated instrument would find it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
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
    frame : (M,) int
    time_s : (M,)
        Since the first frame.
    uv : (M, 2)
        Image of the point, px.
    xyz_c : (M, 3)
        The wall point in C, mm.
    normal_c : (M, 3)
        Unit normal of the wall, outward, in C.
    along_c : (M, 3)
        Unit direction of the pipe's distance, in C.
    velocity_px : (M, 2)
        Velocity of the point's image due to the camera's motion, px/s: of a wall point for texture, of the
        line for rings.
    speed_mm_s : (M,)
        Of the camera along the pipe.
    on_line : bool
        True for the laser's line, false for texture and fiducials.
    line_width_px : (M,)
        1 σ of the line's profile; NaN off the line.
    wall_azimuth_rad, distance_mm : (M,), optional
        Azimuth and distance of the wall point in P; without them P is assumed to have the camera's roll, and
        effects that depend on distance predict nothing.
    per_px_c : (M, 3), optional
        Displacement in C, mm, of the line's point for each px that it is found farther out; None off the
        line.
    across_px : (M,), optional
        Range of the image radius over the samples that a point averages.
    albedo_slope_per_mm : (M,), optional
        ∂ ln A / ∂s of the wall's albedo along the pipe; without it the albedo displaces no line.
    shifted_px : (M,), optional
        By how much the effects that are included shift the line outward.
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
    shifted_px: Float | None = None

    @cached_property
    def fraction(self) -> Float:
        """(M, 2) cosine and sine of 2πρ of the image radius ρ, px, averaged over each point's samples."""
        rho = np.linalg.norm(self.uv - self.probe.camera.centre_px, axis=1)
        rho += self.shifted_px if self.shifted_px is not None else 0.0
        left = np.sinc(self.across_px) if self.across_px is not None else np.ones(len(rho))
        return np.asarray(left[:, None] * np.stack([np.cos(2 * np.pi * rho), np.sin(2 * np.pi * rho)], -1))

    @cached_property
    def patterns(self) -> dict[tuple[str, Shape, bool], Float]:
        """Cache of what static laws predict here, for all courses: by name, shape, and on the line or not."""
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
        """(M,) distance of the camera, not of the wall point, along the pipe; 0 where unknown."""
        if self.distance_mm is None:
            return np.zeros(len(self.uv))
        return np.asarray(self.distance_mm - np.sum(self.xyz_c * self.along_c, axis=1))

    @cached_property
    def radius_mm(self) -> Float:
        """(M,) distance from the optical axis."""
        return np.asarray(np.hypot(self.xyz_c[:, 0], self.xyz_c[:, 1]))

    @cached_property
    def azimuth_p_rad(self) -> Float:
        """(M,) azimuth in P, or, where that is unknown, of the outward wall normal in C."""
        if self.wall_azimuth_rad is not None:
            return self.wall_azimuth_rad
        return np.asarray(np.arctan2(self.normal_c[:, 1], self.normal_c[:, 0]))

    @cached_property
    def roll_rad(self) -> Float:
        """(M,) azimuth in P minus that in C of a direction across the pipe; 0 where unknown."""
        return np.asarray(self.azimuth_p_rad - np.arctan2(self.normal_c[:, 1], self.normal_c[:, 0]))

    @cached_property
    def outward(self) -> Float:
        """(M, 2) unit direction of the image radius."""
        away = self.uv - self.probe.camera.centre_px
        return np.asarray(away / np.maximum(np.linalg.norm(away, axis=1), 1e-9)[:, None])


@dataclass(frozen=True)
class Travel:
    """Motion of the camera along the pipe, at the frames' times.

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
    """One linear amplitude: its name, unit, and plausible size; its prior is wider by a factor for all."""

    name: str
    unit: str
    plausible: float


class EffectModel(ABC):
    """The predictions of one effect of the catalogue.

    A measurement that the effect does not change has a prediction of zero. ``amplitude`` is (Q,), in the
    order of `amplitudes`; ``shape`` is one of `shapes`.
    """

    name: str
    amplitudes: tuple[Amplitude, ...]
    kind: CourseKind = CourseKind.CONSTANT
    # 1 σ of what the law neglects, as a fraction of the effect's size.
    law_sigma: float = 0.002
    # Whether it may occur more than once, with different shapes.
    repeats: bool = False
    # Whether predictions are exactly proportional to the amplitudes.
    linear: bool = False

    @property
    def law(self) -> str:
        """Name of the law in the catalogue, without its course."""
        return self.name

    def course(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the numbers of the effect's course by name."""
        return {}

    def shape_step(self, shape: Shape) -> float | None:
        """Return the uncertainty of the shape's number between grid points; None for a discrete shape."""
        return None

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return the shapes to be searched; one empty shape when there is nothing to search."""
        return ((),)

    def factored(self, points: ImagePoints, shape: Shape) -> Factored | None:
        """Return the factors of a `Product`, else None."""
        return None

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the shift (M, 2) of the image of every wall point, line or texture alike, px."""
        return np.zeros((len(points.uv), 2))

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the shift (M,) of the sheet forward along the optical axis at each line point, mm."""
        return np.zeros(len(points.uv))

    def line_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the outward shift (M,) of the line's centroid for photometric reasons, px."""
        return np.zeros(len(points.uv))

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the outward shift (M,) of the wall itself (effects of the pipe), mm."""
        return np.zeros(len(points.uv))

    def reading_shift_mm(self, travel: Travel, shape: Shape, amplitude: Float) -> Float:
        """Return the excess (N,) of the encoder's reading, mm."""
        return np.zeros(len(travel.time_s))

    @abstractmethod
    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the catalogue's quantities, such as magnitude and direction, by name."""

    @abstractmethod
    def statement(self, shape: Shape, amplitude: Float) -> str:
        """Return a sentence that states the effect with its size."""

    def equation(self, shape: Shape, amplitude: Float) -> str:
        """Return the catalogue's law with its numbers."""
        numbers = (f"{name} = {value:.5g}" for name, value in self.quantities(shape, amplitude).items())
        return f"{effect(self.law).law}, {', '.join(numbers)}"

    def possible(self, shape: Shape, amplitude: Float) -> bool:
        """Return whether every quantity lies within the catalogue's range."""
        ranges = {q.name: (q.low, q.high) for q in effect(self.law).quantities}
        found = self.quantities(shape, amplitude)
        return all(low <= found[name] <= high for name, (low, high) in ranges.items() if name in found)


# A law, its shape and its amplitudes, and the fraction (M,) of its shift at each point.
Share: TypeAlias = tuple[Float, EffectModel, Shape, Float]
# Fractions (M,) of the size at each point, a law, and its shape: the factors of a `Product`.
Factored: TypeAlias = tuple[tuple[Float, ...], EffectModel, Shape]


class SumOfLaws(EffectModel):
    """Shifts by other laws, each times a fraction at each point."""

    @abstractmethod
    def shares(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Sequence[Share]:
        """Return the laws with their fractions."""

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the sum of the laws' shifts, px."""
        each = self.shares(points, shape, amplitude)
        return np.asarray(sum(p[:, None] * law.image_shift_px(points, own, a) for p, law, own, a in each))

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the sum of the laws' shifts, mm."""
        each = self.shares(points, shape, amplitude)
        return np.asarray(sum(p * law.sheet_shift_mm(points, own, a) for p, law, own, a in each))

    def line_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the sum of the laws' shifts, px."""
        each = self.shares(points, shape, amplitude)
        return np.asarray(sum(p * law.line_shift_px(points, own, a) for p, law, own, a in each))

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the sum of the laws' shifts, mm."""
        each = self.shares(points, shape, amplitude)
        return np.asarray(sum(p * law.wall_shift_mm(points, own, a) for p, law, own, a in each))


class Product(SumOfLaws):
    """A law multiplied by a function of time, speed or place; it has the law's amplitudes once per factor."""

    @abstractmethod
    def factored(self, points: ImagePoints, shape: Shape) -> Factored:
        """Return the fractions (M,) of the size at each point, the law, and its shape."""

    def shares(self, points: ImagePoints, shape: Shape, amplitude: Float) -> list[Share]:
        """Return the law once per factor."""
        parts, law, own = self.factored(points, shape)
        return [(p, law, own, a) for p, a in zip(parts, np.split(amplitude, len(parts)), strict=True)]
