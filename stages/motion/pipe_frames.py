"""Frames of joined windows as seen from the pipe: each from the axis of its own window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.geometry.axis import frames_at, to_pipe
from pipeline.geometry.rigid import from_parts, inverse, transform
from stages.motion.joining import Joined, Laid

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class PipeFrames:
    """Where some frames of a run are in the pipe.

    Attributes
    ----------
    window : (n,) int
        The window that each belongs to.
    distance_mm : (n,)
        Along the one axis of the run.
    axis_o : (n, 3)
        The point of the own window's axis beside the camera.
    section_o : (n, 3, 3)
        Section there: z along the own window's axis, x next to that of the run's axis.
    T_pc : (n, 4, 4)
        Poses in the straightened pipe.
    """

    window: Int
    distance_mm: Float
    axis_o: Float
    section_o: Float
    T_pc: Float


def pipe_frames(laid: Sequence[Laid], joined: Joined, frame: Int) -> PipeFrames:
    """Return where frames (n,) of the list of all are in the pipe.

    The camera's offset from the axis and its angles are known far better in a window than from window to
    window, hence the own window's axis.
    """
    first = np.array([part.submap.window.first + part.submap.anchor for part in laid])
    window = np.searchsorted(first, frame, side="right") - 1
    T_oc = joined.T_pc[frame]
    axis_o, section_o = np.empty((len(frame), 3)), np.empty((len(frame), 3, 3))
    for n in np.unique(window):
        mine = window == n
        axis_o[mine], section_o[mine] = _own_sections(laid[n], T_oc[mine, :3, 3])
    distance = to_pipe(joined.axis, T_oc[:, :3, 3])[0]
    section_o = _turned(section_o, frames_at(joined.axis, distance)[1][..., 0])
    back = np.swapaxes(section_o, 1, 2)
    origin = np.einsum("nij,nj->ni", back, T_oc[:, :3, 3] - axis_o)
    origin[:, 2] = distance
    return PipeFrames(window, distance, axis_o, section_o, from_parts(back @ T_oc[:, :3, :3], origin))


def _own_sections(part: Laid, xyz_o: Float) -> tuple[Float, Float]:
    """Return a window's axis points (n, 3) and sections (n, 3, 3) beside points (n, 3)."""
    axis = part.submap.axis
    origin, rotation = frames_at(axis, to_pipe(axis, transform(inverse(part.T_ow), xyz_o))[0])
    return transform(part.T_ow, origin), part.T_ow[:3, :3] @ rotation


def _turned(section_o: Float, x_o: Float) -> Float:
    """Return sections (n, 3, 3) turned about their z so that their x is next to ``x_o`` (n, 3)."""
    z = section_o[..., 2]
    x = x_o - z * np.sum(z * x_o, -1, keepdims=True)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], -1)
