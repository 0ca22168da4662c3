"""Defects of the wall as depths and stains over offsets from their middle, on any grid."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.simulator.wall.description import Defect, Tint
from pipeline.simulator.wall.noise import plane_waves

# Reflectances in red, green, blue of what a defect leaves: chosen by eye for a plausible picture.
_RUST: Tint = (0.34, 0.13, 0.05)
_DARK: Tint = (0.06, 0.06, 0.06)
_BRIGHT: Tint = (0.62, 0.62, 0.60)
_PALE: Tint = (0.50, 0.47, 0.36)


@dataclass(frozen=True)
class Imprint:
    """What a defect does to the wall at some offsets.

    Attributes
    ----------
    depth_mm : (n, m)
        Added to the radius: positive into the wall.
    cover : (n, m)
        Share, 0 to 1, of the colour that replaces the wall's own.
    colour : tuple of float
        Reflectance in red, green, blue of that colour.
    """

    depth_mm: Float
    cover: Float
    colour: Tint


_Shape = Callable[[Defect, np.random.Generator, Float, Float], Imprint]


def imprint(defect: Defect, random: np.random.Generator, along_mm: Float, around_mm: Float) -> Imprint:
    """Return what a defect does at offsets (n, 1) and (1, m) from its middle."""
    return _SHAPES[defect.kind](defect, random, along_mm, around_mm)


def reach_mm(defect: Defect) -> tuple[float, float]:
    """Return the half length and half width of the window outside which a defect does nothing."""
    half = 0.65 * max(defect.length_mm, defect.width_mm) + 1.0
    if defect.angle_deg or defect.kind == "crack":
        return half, half
    return 0.65 * defect.length_mm + 1.0, 0.65 * defect.width_mm + 1.0


def _pit(d: Defect, random: np.random.Generator, along: Float, around: Float) -> Imprint:
    q = _distance(d, random, along, around, 0.06)
    return Imprint(d.depth_mm * np.clip(1 - q**2, 0, 1) ** 1.5, 0.6 * np.clip(1 - q, 0, 1), _DARK)


def _dent(d: Defect, random: np.random.Generator, along: Float, around: Float) -> Imprint:
    q = np.clip(_distance(d, random, along, around, 0.0), 0, 1)
    bump = 0.5 * (1 + np.cos(np.pi * q))
    return Imprint(-d.depth_mm * bump, np.zeros_like(bump), _DARK)


def _gouge(d: Defect, random: np.random.Generator, along: Float, around: Float) -> Imprint:
    u, v = _turned(d, along, around)
    run = np.clip(1 - (2 * u / d.length_mm) ** 2, 0, 1) ** 0.5
    across = 2 * v / d.width_mm
    groove = run * np.clip(1 - across**2, 0, 1)
    lip = 0.12 * run * np.exp(-(((np.abs(across) - 1.15) / 0.12) ** 2))
    return Imprint(d.depth_mm * (groove - lip), 0.8 * np.clip(2 * groove, 0, 1), _BRIGHT)


def _crack(d: Defect, random: np.random.Generator, along: Float, around: Float) -> Imprint:
    u, v = _turned(d, along, around)
    wander = plane_waves(random, d.length_mm, d.length_mm / 10)
    v = v - 0.03 * d.length_mm * wander(u, np.zeros_like(u))
    run = np.clip(1 - (2 * u / d.length_mm) ** 2, 0, 1)
    slit = run * np.clip(1 - np.abs(2 * v / d.width_mm), 0, 1)
    return Imprint(d.depth_mm * slit, np.clip(3 * slit, 0, 1), _DARK)


def _corrosion(d: Defect, random: np.random.Generator, along: Float, around: Float) -> Imprint:
    size = min(d.length_mm, d.width_mm)
    bumps = plane_waves(random, size, size / 8)
    inside = np.clip(3 * (1 - _distance(d, random, along, around, 0.15)), 0, 1)
    depth = inside * np.clip(0.6 + 0.2 * bumps(along, around), 0, 1)
    return Imprint(d.depth_mm * depth, 0.9 * inside, _RUST)


def _deposit(d: Defect, random: np.random.Generator, along: Float, around: Float) -> Imprint:
    size = min(d.length_mm, d.width_mm)
    lumps = plane_waves(random, size, size / 5)
    q = np.clip(_distance(d, random, along, around, 0.12), 0, 1)
    heap = np.clip((1 - q**2) * (1 + 0.12 * lumps(along, around)), 0, 1)
    return Imprint(-d.depth_mm * heap, np.clip(4 * heap, 0, 0.85), _PALE)


_SHAPES: Mapping[str, _Shape] = {
    "pit": _pit,
    "dent": _dent,
    "gouge": _gouge,
    "crack": _crack,
    "corrosion": _corrosion,
    "deposit": _deposit,
}


def _turned(d: Defect, along: Float, around: Float) -> tuple[Float, Float]:
    """Return offsets (n, m) along and across the direction of an elongated defect."""
    c, s = np.cos(np.radians(d.angle_deg)), np.sin(np.radians(d.angle_deg))
    return along * c + around * s, around * c - along * s


def _distance(d: Defect, random: np.random.Generator, along: Float, around: Float, irregular: float) -> Float:
    """Return (n, m) how far out an offset lies: 1 at an outline that wavers by a share."""
    u, v = _turned(d, along, around)
    q = np.hypot(2 * u / d.length_mm, 2 * v / d.width_mm)
    if irregular == 0:
        return np.asarray(q)
    size = min(d.length_mm, d.width_mm)
    waver = plane_waves(random, size, size / 4)
    return np.asarray(q * (1 + irregular * waver(along, around)))
