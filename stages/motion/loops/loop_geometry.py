"""Geometry of loops: positions of frames in the pipe, and the influence of pose errors on loops.

Each frame is located by the axis of its own window. The axis of the whole run cannot be used while loops are
open: it is the mean of the windows' axes at a place, and turns where these are far apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.geometry.axis import frames_at, to_pipe
from pipeline.geometry.rigid import from_parts, inverse, rotation_from_vector, transform
from stages.motion.loops.revisits import Revisit
from stages.motion.windows.error_chain import ErrorSums, neighbours
from stages.motion.windows.submap_joining import JoinedRun, PlacedSubmap


@dataclass(frozen=True)
class PipeFrames:
    """Positions of some frames of a run in the pipe.

    Attributes
    ----------
    window : (n,) int
        Window of each frame.
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

    @staticmethod
    def of(joined: JoinedRun, frame: Int) -> PipeFrames:
        """Return the positions of frames (n,) of the list of all.

        The camera's offset from the axis and its angles are known far better within a window than from window
        to window; therefore the axis of the frame's own window is used.
        """
        first = np.array([part.submap.window.first + part.submap.anchor for part in joined.placed])
        window = np.searchsorted(first, frame, side="right") - 1
        T_oc, sections = joined.T_pc[frame], _sections(joined.placed)
        distance, axis_o = np.empty(len(frame)), np.empty((len(frame), 3))
        section_o = np.empty((len(frame), 3, 3))
        for n in np.unique(window):
            mine = window == n
            distance[mine], axis_o[mine], section_o[mine] = sections[n].beside(T_oc[mine, :3, 3])
        back = np.swapaxes(section_o, 1, 2)
        origin = np.einsum("nij,nj->ni", back, T_oc[:, :3, 3] - axis_o)
        origin[:, 2] = distance
        T_pc = from_parts(back @ T_oc[:, :3, :3], origin)
        return PipeFrames(window, distance, axis_o, section_o, T_pc)


@dataclass(frozen=True)
class LoopEnds:
    """The two ends of M loops: frames and their positions in the pipe."""

    earlier: Int
    later: Int
    there: PipeFrames
    here: PipeFrames

    @staticmethod
    def of(revisits: Sequence[Revisit], joined: JoinedRun) -> LoopEnds:
        """Return the ends of loops."""
        earlier, later = np.array([(r.earlier[0], r.later) for r in revisits]).T
        there, here = (PipeFrames.of(joined, frame) for frame in (earlier, later))
        return LoopEnds(earlier, later, there, here)

    def by_error(self, joined: JoinedRun) -> ErrorSums:
        """Return the errors of the difference of both ends as sums of errors at the chain's frames, 6 M sums.

        Six for each loop: along x, y and z of its section, mm, and rotations about them, rad.
        """
        at, loops = joined.chain.at, len(self.earlier)
        knots, weights = [], []
        for frame, view, sign in ((self.later, self.here, 1.0), (self.earlier, self.there, -1.0)):
            seen = sign * _in_section(frame, view, joined)
            left, right, share = neighbours(frame, at)
            for knot, part in ((left, 1 - share), (right, share)):
                knots.append(np.repeat(knot, 6))
                weights.append((part[:, None, None] * seen).reshape(-1, 6))
        column = np.tile(np.arange(6 * loops), len(knots))
        return ErrorSums.of(np.concatenate(knots), column, np.concatenate(weights), 6 * loops)

    def axis_difference(self) -> Float:
        """Return the offset (M, 6) of the later window's axis from the earlier's; 0 along and about it."""
        section = self.there.section_o
        shift = np.einsum("nji,nj->ni", section, self.here.axis_o - self.there.axis_o)
        lean = np.einsum("nji,nj->ni", section, self.here.section_o[..., 2])
        zero = np.zeros(len(shift))
        return np.stack([shift[:, 0], shift[:, 1], zero, -lean[:, 1], lean[:, 0], zero], -1)


def _in_section(frame: Int, view: PipeFrames, joined: JoinedRun) -> Float:
    """Return matrices (n, 6, 6) from errors at frames (n,) to motions along and about sections' axes."""
    back = np.swapaxes(view.section_o, 1, 2)
    seen = np.zeros((len(frame), 6, 6))
    seen[:, :3, :3], seen[:, 3:, 3:] = back, back @ joined.T_pc[frame, :3, :3]
    return seen


@dataclass(frozen=True)
class _Sections:
    """Sections of a window's axis, all turned about it by one angle."""

    part: PlacedSubmap
    turn_rad: float

    def beside(self, xyz_o: Float) -> tuple[Float, Float, Float]:
        """Return distance (n,), axis points (n, 3) and sections (n, 3, 3) beside points (n, 3)."""
        axis, T_ow = self.part.submap.axis, self.part.T_ow
        distance = to_pipe(axis, transform(inverse(T_ow), xyz_o))[0]
        origin, rotation = frames_at(axis, distance)
        turn = rotation_from_vector(np.array([0.0, 0.0, self.turn_rad]))
        return distance + self.part.distance_mm, transform(T_ow, origin), T_ow[:3, :3] @ rotation @ turn


def _sections(placed: Sequence[PlacedSubmap]) -> list[_Sections]:
    """Return every window's sections, turned to agree with those of the window before at the anchor."""
    found = [_Sections(placed[0], 0.0)]
    for part in placed[1:]:
        anchor_o = part.T_pc[[part.submap.anchor], :3, 3]
        before, own = found[-1].beside(anchor_o)[2][0], _Sections(part, 0.0).beside(anchor_o)[2][0]
        x, y = before[:, 0] @ own[:, :2]
        found.append(_Sections(part, float(np.arctan2(y, x))))
    return found
