"""Frames of joined windows as seen from the pipe: each from the axis of its own window.

The one axis of a run is no good for this while loops are open: it is the mean of what the windows say of a
place, and turns where these are far apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.geometry.axis import frames_at, to_pipe
from pipeline.geometry.rigid import from_parts, inverse, rotation_from_vector, transform
from stages.motion.windows.submap_joining import Joined, Laid


@dataclass(frozen=True)
class PipeFrames:
    """Where some frames of a run are in the pipe.

    Attributes
    ----------
    window : (n,) int
        The window that each belongs to.
    distance_mm : (n,)
        Along the windows' axes, one after the other.
    axis_o : (n, 3)
        The point of the own window's axis beside the camera.
    section_o : (n, 3, 3)
        Section there: z along the own window's axis, x carried on from the first window without a turn.
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
    T_oc, sections = joined.T_pc[frame], _sections(laid)
    distance, axis_o, section_o = (
        np.empty(len(frame)),
        np.empty((len(frame), 3)),
        np.empty((len(frame), 3, 3)),
    )
    for n in np.unique(window):
        mine = window == n
        distance[mine], axis_o[mine], section_o[mine] = sections[n].beside(T_oc[mine, :3, 3])
    back = np.swapaxes(section_o, 1, 2)
    origin = np.einsum("nij,nj->ni", back, T_oc[:, :3, 3] - axis_o)
    origin[:, 2] = distance
    return PipeFrames(window, distance, axis_o, section_o, from_parts(back @ T_oc[:, :3, :3], origin))


@dataclass(frozen=True)
class _Sections:
    """Sections of a window's axis, turned about it by so much."""

    part: Laid
    turn_rad: float

    def beside(self, xyz_o: Float) -> tuple[Float, Float, Float]:
        """Return distance (n,), axis points (n, 3) and sections (n, 3, 3) beside points (n, 3)."""
        axis, T_ow = self.part.submap.axis, self.part.T_ow
        distance = to_pipe(axis, transform(inverse(T_ow), xyz_o))[0]
        origin, rotation = frames_at(axis, distance)
        turn = rotation_from_vector(np.array([0.0, 0.0, self.turn_rad]))
        return distance + self.part.distance_mm, transform(T_ow, origin), T_ow[:3, :3] @ rotation @ turn


def _sections(laid: Sequence[Laid]) -> list[_Sections]:
    """Return every window's sections, which at the seam are turned as those of the window before."""
    found = [_Sections(laid[0], 0.0)]
    for part in laid[1:]:
        seam_o = part.T_pc[[part.submap.anchor], :3, 3]
        before, own = found[-1].beside(seam_o)[2][0], _Sections(part, 0.0).beside(seam_o)[2][0]
        x, y = before[:, 0] @ own[:, :2]
        found.append(_Sections(part, float(np.arctan2(y, x))))
    return found
