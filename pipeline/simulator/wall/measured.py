"""A wall and a way that a run has measured, as a scene refers to them: one NPZ file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from pipeline.arrays import Float
from pipeline.errors import InputError
from pipeline.geometry.axis import PipeAxis
from pipeline.simulator.wall.grid import Wall, WallGrid

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
