"""Refracting surfaces between the probe and the wall, fixed in C, and rays through them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.arrays import Float


class Window(Protocol):
    """One refracting surface; ``index_beyond`` is the index of what lies outside it."""

    @property
    def index_beyond(self) -> float:
        """Refractive index of the medium outside."""

    def intersect(self, origin_c: Float, ray_c: Float) -> tuple[Float, Float]:
        """Return points (..., 3) where rays from inside leave, and outward unit normals (..., 3) there."""


@dataclass(frozen=True)
class CylinderWindow:
    """A cylinder: radius, a point of its axis and the axis' unit direction in C."""

    radius_mm: float
    index_beyond: float
    point_c: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axis_c: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def intersect(self, origin_c: Float, ray_c: Float) -> tuple[Float, Float]:
        """See `Window.intersect`; rays along the axis never meet it: NaN."""
        axis = np.array(self.axis_c) / np.linalg.norm(self.axis_c)
        across = ray_c - (ray_c @ axis)[..., None] * axis
        place = origin_c - np.array(self.point_c)
        place = place - (place @ axis)[..., None] * axis
        a, b = _dot(across, across), _dot(across, place)
        with np.errstate(divide="ignore", invalid="ignore"):
            way = (-b + np.sqrt(b * b + a * (self.radius_mm**2 - _dot(place, place)))) / a
        return origin_c + way[..., None] * ray_c, (place + way[..., None] * across) / self.radius_mm


@dataclass(frozen=True)
class SphereWindow:
    """A sphere: radius and centre in C."""

    radius_mm: float
    index_beyond: float
    centre_c: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def intersect(self, origin_c: Float, ray_c: Float) -> tuple[Float, Float]:
        """See `Window.intersect`."""
        place = origin_c - np.array(self.centre_c)
        b = _dot(place, ray_c)
        way = -b + np.sqrt(b * b + self.radius_mm**2 - _dot(place, place))
        return origin_c + way[..., None] * ray_c, (place + way[..., None] * ray_c) / self.radius_mm


def refracted(windows: tuple[Window, ...], origin_c: Float, ray_c: Float) -> tuple[Float, Float]:
    """Return origins and unit directions (..., 3) of rays behind all windows, by Snell's law.

    A ray that does not hit a surface, or is totally reflected, becomes NaN.
    """
    index = 1.0
    for window in windows:
        origin_c, normal = window.intersect(origin_c, ray_c)
        ray_c = _refract(ray_c, normal, index / window.index_beyond)
        index = window.index_beyond
    return origin_c, ray_c


def _refract(ray: Float, normal: Float, ratio: float) -> Float:
    """Return unit rays behind a surface; ``ratio`` is the index before it over that behind it."""
    cosine = _dot(ray, normal)
    with np.errstate(invalid="ignore"):
        onward = np.sqrt(1 - ratio**2 * (1 - cosine**2))
    return np.asarray(ratio * ray + (onward - ratio * cosine)[..., None] * normal)


def _dot(a: Float, b: Float) -> Float:
    return np.asarray(np.einsum("...i,...i->...", a, b))
