"""A run repeated end to end along a straight pipe: rings, motion, the wall's photo, and its video."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Image, Int
from pipeline.artefacts.measured import RingSamples, Trajectory, Wall, WallTexture
from pipeline.geometry.axis import PipeAxis
from pipeline.machine.scratch import Scratch
from pipeline.recording.base import Planes, Recording


def repeated_rings(rings: RingSamples, times: int, coarser: int, scratch: Scratch) -> RingSamples:
    """Return the rings so many times over, every ``coarser``-th azimuth of them."""
    last = int(rings.frame[-1]) + 2
    frame = (rings.frame + last * np.arange(times)[:, None]).ravel()
    per_sample = {f.name: getattr(rings, f.name) for f in fields(rings)
                  if np.ndim(getattr(rings, f.name)) == 2}  # fmt: skip
    long = {n: _tiled(v[:, ::coarser], times, scratch) for n, v in per_sample.items()}
    return replace(rings, frame=frame, azimuth_rad=rings.azimuth_rad[::coarser], **long)


def _tiled(values: NDArray[Any], times: int, scratch: Scratch) -> NDArray[Any]:
    out = scratch.zeros((times * len(values), *values.shape[1:]), values.dtype)
    for k in range(times):
        out[k * len(values) : (k + 1) * len(values)] = values
    return out


def repeated_motion(motion: Trajectory, times: int, length_mm: float) -> Trajectory:
    """Return the motion along a straight pipe; the ends of the source's bent axis would not join."""
    count, every = len(motion.frame), np.arange(times)
    T_pc = np.tile(motion.T_pc, (times, 1, 1))
    T_pc[:, 2, 3] += np.repeat(length_mm * every, count)
    frame = (motion.frame + (int(motion.frame[-1]) + 1) * every[:, None]).ravel()
    s = np.arange(-100.0, times * length_mm + 200.0, 2.0)
    axis = PipeAxis(s, np.stack([0 * s, 0 * s, s], -1), np.tile(np.eye(3), (len(s), 1, 1)))
    time_s = (motion.time_s + (motion.time_s[-1] + 1 / 30) * every[:, None]).ravel()
    covariance = np.tile(motion.covariance, (times, 1, 1))
    return replace(motion, frame=frame, time_s=time_s, T_pc=T_pc, covariance=covariance, axis=axis, events=())


def repeated_photo(
    photo: WallTexture, times: int, length_mm: float, coarser: int, scratch: Scratch
) -> WallTexture:
    """Return the wall's photo so many times over, at a coarser resolution."""
    rows = round(length_mm / photo.mm_per_px)
    one = photo.bgra[np.minimum(np.arange(0, rows, coarser), len(photo.bgra) - 1), ::coarser]
    return replace(
        photo, bgra=_tiled(one, times, scratch), mm_per_px=length_mm / len(one),
        rad_per_px=photo.rad_per_px * coarser,
    )  # fmt: skip


class RepeatedFrames:
    """A video repeated again and again, decoded anew each time."""

    def __init__(self, recording: Recording) -> None:
        self._recording, self._count = recording, int(recording.frames.frame[-1]) + 1

    @property
    def image_size(self) -> tuple[int, int]:
        return self._recording.source.image_size

    def read(self, frames: Sequence[int] | Int, planes: Planes) -> Iterator[tuple[int, Image | None]]:
        wanted = np.asarray(frames)
        for k in np.unique(wanted // self._count):
            first = int(k) * self._count
            for frame, image in self._recording.read(wanted[wanted // self._count == k] - first, planes):
                yield first + frame, image


def even_wall(wall: Wall, times: int, length_mm: float) -> Wall:
    """Return a wall of the mean radius at every place: only the photo matters here."""
    radius_map = wall.radius_map
    s = np.arange(radius_map.distance_mm[0], radius_map.distance_mm[0] + times * length_mm, 0.5)
    even = {f.name: np.full((len(s), len(radius_map.azimuth_rad)), np.nanmedian(getattr(radius_map, f.name)),
                            getattr(radius_map, f.name).dtype)
            for f in fields(radius_map) if np.ndim(getattr(radius_map, f.name)) == 2}  # fmt: skip
    axis = PipeAxis(s, np.stack([0 * s, 0 * s, s], -1), np.tile(np.eye(3), (len(s), 1, 1)))
    return Wall(wall.cloud, replace(radius_map, distance_mm=s, **even), axis)
