"""Rays through glass, traced in three dimensions by Snell's law, as the reference for predictions."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float


def through_cylinder(
    origin: Float,
    ray: Float,
    axis: Float,
    radius_mm: float,
    ratio: float,
    aside: tuple[float, ...] = (0, 0, 0),
) -> tuple[Float, Float]:
    """Refract rays (M, 3) from inside a cylinder whose axis passes ``aside``.

    ``ratio`` is the index before the surface over the one after it.
    """
    axis = axis / np.linalg.norm(axis)
    flat_origin, flat_ray = _flat(origin - np.array(aside), axis), _flat(ray, axis)
    reach = _leaving(flat_origin, flat_ray, radius_mm)
    place = origin + reach[:, None] * ray
    return place, _refract(ray, _flat(place - np.array(aside), axis) / radius_mm, ratio)


def through_sphere(
    origin: Float, ray: Float, centre: Float, radius_mm: float, ratio: float
) -> tuple[Float, Float]:
    """Refract rays (M, 3) from inside a sphere."""
    reach = _leaving(origin - centre, ray, radius_mm)
    place = origin + reach[:, None] * ray
    return place, _refract(ray, (place - centre) / radius_mm, ratio)


def _leaving(origin: Float, ray: Float, radius_mm: float) -> Float:
    a, b = np.sum(ray * ray, axis=1), np.sum(origin * ray, axis=1)
    c = np.sum(origin * origin, axis=1) - radius_mm**2
    return np.asarray((-b + np.sqrt(b * b - a * c)) / a)


def _refract(ray: Float, normal: Float, ratio: float) -> Float:
    cosine = np.sum(ray * normal, axis=1)
    after = np.sqrt(1 - ratio**2 * (1 - cosine**2))
    return np.asarray(ratio * ray + (after - ratio * cosine)[:, None] * normal)


def _flat(vector: Float, axis: Float) -> Float:
    return np.asarray(vector - (vector @ axis)[:, None] * axis)
