"""The pipe's section of a scene file; every length in mm, every angle in degrees."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field

from pipeline.arrays import Float
from pipeline.machine.stage import Parameters
from pipeline.simulator.wall.grid import plane_waves

Tint = tuple[float, float, float]


class Bore(Parameters):
    """One section of a stepped bore."""

    length_mm: float = Field(gt=0, description="length of the section, mm")
    diameter_mm: float = Field(gt=2, description="diameter of the section, mm")


class Ovality(Parameters):
    """Second harmonic of the radius."""

    amplitude_mm: float = Field(0.0, ge=0, le=20, description="amplitude of cos 2(ψ − ψ₀), mm")
    direction_deg: float = Field(0.0, description="azimuth ψ₀ of the largest radius, deg")


class Bend(Parameters):
    """A stretch over which the axis is an arc."""

    distance_mm: float = Field(description="where the arc begins, mm")
    length_mm: float = Field(gt=0, description="length of the arc along the axis, mm")
    curvature_per_mm: float = Field(ge=0, le=0.02, description="curvature of the axis, 1/mm")
    direction_deg: float = Field(0.0, description="azimuth toward which the axis turns, deg")


class Joint(Parameters):
    """Two pipes joined: an open gap, and an offset of the second pipe."""

    distance_mm: float = Field(description="distance along the pipe, mm")
    gap_mm: float = Field(1.0, ge=0, le=50, description="width of the gap, mm")
    depth_mm: float = Field(3.0, ge=0, le=30, description="depth of the gap, mm")
    offset_mm: float = Field(0.0, ge=0, le=10, description="lateral offset of the second pipe, mm")
    direction_deg: float = Field(0.0, description="azimuth of that offset, deg")
    chamfer_mm: float = Field(0.4, gt=0, le=5, description="length over which its edges fall, mm")


class Weld(Parameters):
    """A bead around the pipe that reduces its radius."""

    distance_mm: float = Field(description="middle of the bead, mm")
    width_mm: float = Field(6.0, gt=0, le=50, description="along the pipe, mm")
    height_mm: float = Field(0.8, ge=0, le=10, description="height of the bead, inward, mm")
    ripple_mm: float = Field(0.1, ge=0, le=2, description="height of the ripples on the bead, mm")
    heat_mm: float = Field(8.0, ge=0, le=100, description="width of the discoloured wall on each side, mm")


DefectKind = Literal["pit", "dent", "gouge", "crack", "corrosion", "deposit"]


class Defect(Parameters):
    """A local departure from the pipe's shape."""

    kind: DefectKind = Field(description="pits, gouges, cracks, corrosion go into the wall, the rest inward")
    distance_mm: float = Field(description="middle along the pipe, mm")
    azimuth_deg: float = Field(description="middle around the pipe, deg")
    length_mm: float = Field(gt=0, le=500, description="along the pipe, or along a gouge or crack, mm")
    width_mm: float = Field(gt=0, le=500, description="size across the length, mm")
    depth_mm: float = Field(gt=0, le=30, description="largest depth, mm")
    angle_deg: float = Field(0.0, description="of a gouge or crack, from the pipe's axis, deg")


class Branch(Parameters):
    """A hole to a side pipe."""

    distance_mm: float = Field(description="middle along the pipe, mm")
    azimuth_deg: float = Field(description="middle around the pipe, deg")
    diameter_mm: float = Field(gt=1, le=500, description="diameter of the side pipe, mm")
    depth_mm: float = Field(15.0, gt=0, le=200, description="depth of the wall visible in it, mm")


class Relief(Parameters):
    """Roughness and general corrosion."""

    form_mm: float = Field(0.0, ge=0, le=5, description="1 σ of the slow error of form, mm")
    roughness_mm: float = Field(0.01, ge=0, le=1, description="1 σ of the roughness, mm")
    roughness_longest_mm: float = Field(12.0, gt=0.1, le=200, description="longest wave of it, mm")
    roughness_slope: float = Field(1.2, ge=0, le=4, description="exponent of amplitude over wavelength")
    rust_mm: float = Field(0.0, ge=0, le=3, description="height of rust where there is rust, inward, mm")
    corrosion_mm: float = Field(0.0, ge=0, le=5, description="mean depth of general corrosion, mm")


class Surface(Parameters):
    """The wall's reflection; linear reflectances from 0 to 1."""

    albedo: float = Field(0.4, gt=0, le=1, description="mean reflectance of the bare wall")
    tint: Tint = Field((0.98, 1.0, 1.05), description="its red, green and blue over the mean")
    mottle: float = Field(0.25, ge=0, le=1, description="1 σ of the mottling over all scales, relative")
    mottle_longest_mm: float = Field(30.0, gt=0.5, le=500, description="longest wave of the mottling, mm")
    grain: float = Field(0.12, ge=0, le=1, description="1 σ of the finest texture, relative")
    grain_mm: float = Field(0.0, ge=0, le=5, description="wave of it, mm; 0: the finest that a frame shows")
    rust: float = Field(0.0, ge=0, le=1, description="share of the wall that is rusty")
    rust_patch_mm: float = Field(60.0, gt=1, le=500, description="size of the largest patches, mm")
    lime: float = Field(0.0, ge=0, le=1, description="share of the wall under pale lime")
    streaks: float = Field(0.0, ge=0, le=1, description="depth of dark streaks along the pipe, relative")
    spots: float = Field(0.0, ge=0, le=1, description="share of the wall under dark blots")
    seam_deg: float | None = Field(None, description="azimuth of a seam along the pipe, deg; absent: none")
    gloss: float = Field(0.1, ge=0, le=1, description="share of the reflectance that is a glossy lobe")


class Photograph(Parameters):
    """A picture applied to the wall, its rows along the distance, tiled with alternate tiles mirrored."""

    file: str = Field(min_length=1, description="picture file, relative to the scene's folder")
    mm_per_px: float = Field(gt=0, le=10, description="scale along the wall, mm per pixel")
    mean_albedo: float = Field(0.4, gt=0, le=1, description="mean reflectance to which it is scaled")


class MarkerRing(Parameters):
    """Fiducials evenly around the bore at one distance."""

    distance_mm: float = Field(description="distance of the markers' centres, mm")
    count: int = Field(ge=1, le=60, description="number of markers")
    azimuth_deg: float = Field(-180.0, description="azimuth of the first marker, deg")


class Fiducials(Parameters):
    """ArUco markers painted on the bore, numbered from 0 in the order of the rings."""

    dictionary: str = Field("DICT_4X4_100", description="predefined dictionary of OpenCV")
    size_mm: float = Field(9.0, gt=0.5, le=200, description="edge of the black square along the wall, mm")
    quiet: float = Field(
        0.16, ge=0, le=1, description="width of the white zone around it, over its edge length"
    )
    rings: tuple[MarkerRing, ...] = Field(min_length=1, description="rings of markers")


class Pipe(Parameters):
    """The pipe of a scene."""

    diameter_mm: float = Field(gt=4, le=3000, description="inner diameter (of the first bore), mm")
    nominal_diameter_mm: float | None = Field(None, gt=4, description="diameter stated by the operator, mm")
    from_mm: float = Field(-40.0, description="distance at which the simulated wall begins, mm")
    to_mm: float = Field(300.0, description="distance at which the wall ends, mm")
    cell_mm: float = Field(0.25, ge=0.02, le=5, description="cell of the relief, mm")
    texel_mm: float = Field(
        0.0, ge=0, le=5, description="cell of the albedo; 0: by the bore's finest texture"
    )
    taper: float = Field(0.0, ge=-0.2, le=0.2, description="gain of radius per distance")
    bore: tuple[Bore, ...] = Field((), description="sections of a stepped bore, the first at distance 0")
    bore_tolerance_mm: float = Field(0.01, ge=0, description="stated tolerance of the bore, mm")
    chamfer_mm: float = Field(1.0, gt=0, le=20, description="length over which a step falls, mm")
    ovality: Ovality = Field(default_factory=lambda: Ovality.model_validate({}))
    bends: tuple[Bend, ...] = ()
    joints: tuple[Joint, ...] = ()
    welds: tuple[Weld, ...] = ()
    defects: tuple[Defect, ...] = ()
    branches: tuple[Branch, ...] = ()
    relief: Relief = Field(default_factory=lambda: Relief.model_validate({}))
    surface: Surface = Field(default_factory=lambda: Surface.model_validate({}))
    photograph: Photograph | None = None
    measured: str | None = Field(
        None, description="wall of a run (NPZ of simulate --like), relative to the scene's folder"
    )
    fiducials: Fiducials | None = None


# Reflectances of defects in red, green, blue: chosen by eye for a plausible picture.
_RUST: Tint = (0.34, 0.13, 0.05)
_DARK: Tint = (0.06, 0.06, 0.06)
_BRIGHT: Tint = (0.62, 0.62, 0.60)
_PALE: Tint = (0.50, 0.47, 0.36)


@dataclass(frozen=True)
class Imprint:
    """The effect of a defect on the wall at some offsets.

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
    """Return the change of the wall by a defect at offsets (n, 1) and (1, m) from its middle."""
    return _SHAPES[defect.kind](defect, random, along_mm, around_mm)


def reach_mm(defect: Defect) -> tuple[float, float]:
    """Return half length and half width of the window outside which a defect has no effect."""
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
    """Return the relative distance (n, m) of an offset from the middle: 1 at an irregular outline."""
    u, v = _turned(d, along, around)
    q = np.hypot(2 * u / d.length_mm, 2 * v / d.width_mm)
    if irregular == 0:
        return np.asarray(q)
    size = min(d.length_mm, d.width_mm)
    waver = plane_waves(random, size, size / 4)
    return np.asarray(q * (1 + irregular * waver(along, around)))
