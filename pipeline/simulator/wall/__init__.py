"""The wall of a scene from its description, and the facts of the pipe that a recording states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from pipeline.arrays import Float, Float32
from pipeline.errors import InputError
from pipeline.geometry.axis import PipeAxis, straight_axis
from pipeline.geometry.rigid import rotation_from_vector
from pipeline.recording.base import BoreSection, PipeFacts
from pipeline.recording.base import Fiducials as StatedFiducials
from pipeline.simulator.wall.albedo import (
    FINEST_OVER_RADIUS,
    lay_photograph,
    markers_of,
    paint,
    paint_fiducials,
    require_room,
    stain,
)
from pipeline.simulator.wall.description import Bend, Fiducials, Pipe
from pipeline.simulator.wall.grid import Grid, Seeds, Wall, WallGrid, grid_over
from pipeline.simulator.wall.shape import add_relief, axis_curvature, base_radius


def facts_of(pipe: Pipe) -> PipeFacts:
    """Return the section ``pipe`` of recording.yaml: the nominal bore, and of a gauge also its fiducials."""
    return PipeFacts(
        nominal_diameter_mm=pipe.nominal_diameter_mm or pipe.diameter_mm,
        bore=tuple(BoreSection(b.length_mm, b.diameter_mm) for b in pipe.bore),
        bore_tolerance_mm=pipe.bore_tolerance_mm if pipe.bore else 0.0,
        fiducials=None if pipe.fiducials is None else _stated(pipe.fiducials),
    )


def _stated(fiducials: Fiducials) -> StatedFiducials:
    return StatedFiducials(
        dictionary=fiducials.dictionary,
        size_mm=fiducials.size_mm,
        columns_along="+azimuth",
        rows_along="+distance",
        markers=markers_of(fiducials),
    )


# Spacing of a bent axis' points: at the smallest bend (50 mm) the sagitta is 0.25²/(8·50) = 0.16 µm.
_AXIS_STEP_MM = 0.25


def build_wall(pipe: Pipe, seed: int, folder: Path) -> Wall:
    """Return the wall of a pipe.

    Parameters
    ----------
    pipe : Pipe
    seed : int
        Of everything random about it; the same seed gives the same wall.
    folder : Path
        In which a photograph is looked for.

    Raises
    ------
    InputError
        When fiducials have no room, or a photograph or a measured wall cannot be read.
    """
    seeds = Seeds(seed)
    if pipe.measured is not None:
        return _with_defects(read_measured(folder / pipe.measured).wall, pipe, seeds)
    span, radius = (pipe.from_mm, pipe.to_mm), pipe.diameter_mm / 2
    shape = grid_over(span, radius, pipe.cell_mm)
    texture = grid_over(span, radius, texel_mm(pipe))
    radius_mm = add_relief(base_radius(shape, pipe), shape, pipe, seeds)
    albedo = albedo_of(texture, pipe, seeds, folder)
    axis = bent_axis(span, pipe.bends) if pipe.bends else straight_axis(*span)
    return Wall(
        axis=axis,
        shape=shape.cells,
        radius_mm=np.asarray(radius_mm, np.float32),
        texture=texture.cells,
        albedo_bgr=np.ascontiguousarray(albedo[..., ::-1]),
        gloss=pipe.surface.gloss,
    )


def _with_defects(wall: Wall, pipe: Pipe, seeds: Seeds) -> Wall:
    """Return a measured wall with the scene's welds, defects and branches added."""
    radius_mm = float(wall.radius_mm.mean(dtype=float))
    shape, texture = Grid(wall.shape, radius_mm), Grid(wall.texture, radius_mm)
    albedo = stain(wall.albedo_bgr[..., ::-1].copy(), texture, pipe, seeds)
    return replace(
        wall,
        radius_mm=np.asarray(add_relief(wall.radius_mm.astype(float), shape, pipe, seeds), np.float32),
        albedo_bgr=np.ascontiguousarray(albedo[..., ::-1]),
        gloss=pipe.surface.gloss,
    )


def texel_mm(pipe: Pipe) -> float:
    """Return the cell of the albedo, mm: as stated, or the finest that one frame resolves in this bore."""
    return pipe.texel_mm or round(FINEST_OVER_RADIUS * pipe.diameter_mm / 2, 4)


def albedo_of(grid: Grid, pipe: Pipe, seeds: Seeds, folder: Path) -> Float32:
    """Return the albedo (S, A, 3) in red, green, blue, with fiducials."""
    if pipe.photograph is None:
        albedo = paint(grid, pipe, seeds)
    else:
        albedo = stain(lay_photograph(grid, pipe.photograph, folder), grid, pipe, seeds)
    if pipe.fiducials is not None:
        require_room(pipe, pipe.fiducials)
        paint_fiducials(albedo, grid, pipe, pipe.fiducials)
    return albedo


def bent_axis(span_mm: tuple[float, float], bends: Sequence[Bend]) -> PipeAxis:
    """Return the axis of a pipe with bends, at distance 0 in the origin of P and along its z.

    The section's frame is carried along without twist: with tangent t and section axes x, y, the change of t
    per distance is κ_x x + κ_y y (R. L. Bishop, "There is more than one way to frame a curve", 1975). Over
    each step the axis is an exact arc.
    """
    first, last = (int(np.floor(span_mm[0] / _AXIS_STEP_MM)), int(np.ceil(span_mm[1] / _AXIS_STEP_MM)))
    distance = np.asarray(np.arange(min(first, 0), max(last, 0) + 1) * _AXIS_STEP_MM, np.float64)
    start = int(np.flatnonzero(distance == 0)[0])
    middle = np.asarray(distance[:-1] + _AXIS_STEP_MM / 2, np.float64)
    ahead = _carried(axis_curvature(middle[start:], bends), _AXIS_STEP_MM)
    behind = _carried(axis_curvature(middle[:start][::-1], bends), -_AXIS_STEP_MM)
    origin, rotation = (np.concatenate([b[:0:-1], a]) for a, b in zip(ahead, behind, strict=True))
    return PipeAxis(distance, origin, rotation)


def _carried(curvature: Float, step_mm: float) -> tuple[Float, Float]:
    """Return points (K + 1, 3) and frames (K + 1, 3, 3) integrated over K steps of one curvature each."""
    turn = np.stack([-curvature[:, 1], curvature[:, 0], np.zeros(len(curvature))], -1) * step_mm
    half = rotation_from_vector(turn / 2)
    angle = np.linalg.norm(turn, axis=1)
    chord = step_mm * np.sinc(angle / (2 * np.pi))
    origin, rotation = np.zeros((len(turn) + 1, 3)), np.empty((len(turn) + 1, 3, 3))
    rotation[0] = np.eye(3)
    for k in range(len(turn)):
        to_middle = rotation[k] @ half[k]
        origin[k + 1] = origin[k] + chord[k] * to_middle[:, 2]
        rotation[k + 1] = to_middle @ half[k]
    return origin, rotation


_WHITE = 255.0


@dataclass(frozen=True)
class MeasuredPipe:
    """What a run has measured of pipe and motion.

    Attributes
    ----------
    wall : Wall
    time_s : (N,)
        From 0 on.
    T_pc : (N, 4, 4)
        The camera at these times.
    """

    wall: Wall
    time_s: Float
    T_pc: Float


def write_measured(measured: MeasuredPipe, file: Path) -> None:
    """Write a file that `read_measured` reads; the reflectance in 255 steps, as the photo has it."""
    wall = measured.wall
    with file.open("wb") as stream:
        np.savez_compressed(
            stream,
            axis_distance_mm=wall.axis.distance_mm, axis_origin_p=wall.axis.origin_p,
            axis_R_pa=wall.axis.R_pa,
            radius_from_mm=wall.shape.distance_from_mm, radius_step_mm=wall.shape.step_mm,
            radius_mm=wall.radius_mm,
            albedo_from_mm=wall.texture.distance_from_mm, albedo_step_mm=wall.texture.step_mm,
            albedo_bgr=np.rint(_WHITE * wall.albedo_bgr).astype(np.uint8),
            time_s=measured.time_s, T_pc=measured.T_pc,
        )  # fmt: skip


def read_measured(file: Path) -> MeasuredPipe:
    """Read what `write_measured` wrote.

    Raises
    ------
    InputError
        When the file is missing, damaged, or holds something else.
    """
    try:
        with np.load(file) as held:
            axis = PipeAxis(held["axis_distance_mm"], held["axis_origin_p"], held["axis_R_pa"])
            radius, albedo = held["radius_mm"], held["albedo_bgr"].astype(np.float32) / np.float32(_WHITE)
            shape, texture = (
                WallGrid(float(held[f"{name}_from_mm"]), float(held[f"{name}_step_mm"]), *values.shape[:2])
                for name, values in (("radius", radius), ("albedo", albedo))
            )
            return MeasuredPipe(Wall(axis, shape, radius, texture, albedo), held["time_s"], held["T_pc"])
    except (OSError, ValueError, KeyError, TypeError, BadZipFile) as error:
        raise InputError(
            file, f"holds no measured pipe: {error}", expected="the NPZ file of boresight simulate --like"
        ) from error
