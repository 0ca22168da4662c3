"""The pipe's section of a scene file; every length in mm, every angle in degrees."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pipeline.machine.stage import Parameters

Tint = tuple[float, float, float]


class Bore(Parameters):
    """One section of a stepped bore."""

    length_mm: float = Field(gt=0, description="length of the section, mm")
    diameter_mm: float = Field(gt=2, description="its diameter, mm")


class Ovality(Parameters):
    """Second harmonic of the radius."""

    amplitude_mm: float = Field(0.0, ge=0, le=20, description="amplitude of cos 2(ψ − ψ₀), mm")
    direction_deg: float = Field(0.0, description="azimuth ψ₀ of the largest radius, deg")


class Bend(Parameters):
    """A stretch over which the axis is an arc."""

    distance_mm: float = Field(description="where the arc begins, mm")
    length_mm: float = Field(gt=0, description="length of the arc along the axis, mm")
    curvature_per_mm: float = Field(ge=0, le=0.02, description="one over its radius, 1/mm")
    direction_deg: float = Field(0.0, description="azimuth toward which the axis turns, deg")


class Joint(Parameters):
    """Two pipes put together: an open gap, and the second one out of line."""

    distance_mm: float = Field(description="where, mm")
    gap_mm: float = Field(1.0, ge=0, le=50, description="width of the gap, mm")
    depth_mm: float = Field(3.0, ge=0, le=30, description="depth of the gap, mm")
    offset_mm: float = Field(0.0, ge=0, le=10, description="by which the second pipe is out of line, mm")
    direction_deg: float = Field(0.0, description="azimuth of that offset, deg")
    chamfer_mm: float = Field(0.4, gt=0, le=5, description="length over which its edges fall, mm")


class Weld(Parameters):
    """A bead around the pipe that stands inward."""

    distance_mm: float = Field(description="middle of the bead, mm")
    width_mm: float = Field(6.0, gt=0, le=50, description="along the pipe, mm")
    height_mm: float = Field(0.8, ge=0, le=10, description="inward, mm")
    ripple_mm: float = Field(0.1, ge=0, le=2, description="height of the ripples on the bead, mm")
    heat_mm: float = Field(8.0, ge=0, le=100, description="width of the discoloured wall on each side, mm")


DefectKind = Literal["pit", "dent", "gouge", "crack", "corrosion", "deposit"]


class Defect(Parameters):
    """A local departure from the pipe's shape."""

    kind: DefectKind = Field(description="pits, gouges, cracks, corrosion go into the wall, the rest inward")
    distance_mm: float = Field(description="middle along the pipe, mm")
    azimuth_deg: float = Field(description="middle around the pipe, deg")
    length_mm: float = Field(gt=0, le=500, description="along the pipe, or along a gouge or crack, mm")
    width_mm: float = Field(gt=0, le=500, description="across, mm")
    depth_mm: float = Field(gt=0, le=30, description="largest, mm")
    angle_deg: float = Field(0.0, description="of a gouge or crack, from the pipe's axis, deg")


class Branch(Parameters):
    """A hole to a side pipe."""

    distance_mm: float = Field(description="middle, mm")
    azimuth_deg: float = Field(description="middle, deg")
    diameter_mm: float = Field(gt=1, le=500, description="of the side pipe, mm")
    depth_mm: float = Field(15.0, gt=0, le=200, description="how far into it the wall reaches, mm")


class Relief(Parameters):
    """Roughness and general corrosion."""

    form_mm: float = Field(0.0, ge=0, le=5, description="1 σ of the slow error of form, mm")
    roughness_mm: float = Field(0.01, ge=0, le=1, description="1 σ of the roughness, mm")
    roughness_longest_mm: float = Field(12.0, gt=0.1, le=200, description="longest wave of it, mm")
    roughness_slope: float = Field(1.2, ge=0, le=4, description="exponent of amplitude over wavelength")
    rust_mm: float = Field(0.0, ge=0, le=3, description="height of rust where there is rust, inward, mm")
    corrosion_mm: float = Field(0.0, ge=0, le=5, description="mean depth of general corrosion, mm")


class Surface(Parameters):
    """What the wall reflects; linear reflectances from 0 to 1."""

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
    """A picture laid on the wall, its rows along the distance; tiled mirror-wise."""

    file: str = Field(min_length=1, description="picture file, relative to the scene's folder")
    mm_per_px: float = Field(gt=0, le=10, description="scale along the wall, mm per pixel")
    mean_albedo: float = Field(0.4, gt=0, le=1, description="mean reflectance given to it")


class MarkerRing(Parameters):
    """Fiducials evenly around the bore at one distance."""

    distance_mm: float = Field(description="of the centres, mm")
    count: int = Field(ge=1, le=60, description="how many")
    azimuth_deg: float = Field(-180.0, description="of the first, deg")


class Fiducials(Parameters):
    """ArUco markers painted on the bore, numbered on from 0 in the order of the rings."""

    dictionary: str = Field("DICT_4X4_100", description="predefined dictionary of OpenCV")
    size_mm: float = Field(9.0, gt=0.5, le=200, description="edge of the black square along the wall, mm")
    quiet: float = Field(0.16, ge=0, le=1, description="white zone around it, over its edge")
    rings: tuple[MarkerRing, ...] = Field(min_length=1, description="rings of markers")


class Pipe(Parameters):
    """The pipe of a scene."""

    diameter_mm: float = Field(gt=4, le=3000, description="inner diameter (of the first bore), mm")
    nominal_diameter_mm: float | None = Field(None, gt=4, description="what the operator believes, mm")
    from_mm: float = Field(-40.0, description="distance at which the laid out wall begins, mm")
    to_mm: float = Field(300.0, description="distance at which it ends, mm")
    cell_mm: float = Field(0.25, ge=0.02, le=5, description="cell of the relief, mm")
    texel_mm: float = Field(
        0.0, ge=0, le=5, description="cell of the albedo; 0: by the bore's finest texture"
    )
    taper: float = Field(0.0, ge=-0.2, le=0.2, description="gain of radius per distance")
    bore: tuple[Bore, ...] = Field((), description="sections of a stepped bore, the first at distance 0")
    bore_tolerance_mm: float = Field(0.01, ge=0, description="stated for the bore, mm")
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
