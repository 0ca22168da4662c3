"""Keeps what lies beyond the pipe's end out of the texture: it does not move as the wall does.

There is wall up to the laser line of the last ring on it. So pictures behind that ring are not used, and of
those before in which the end may be in view, only the wall up to the line.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.artefacts.measured import RingPoints
from pipeline.machine.stage import Context
from pipeline.recording.base import Recording
from pipeline.recording.checks import WITHHELD
from stages.motion.tracking.strips import NEVER
from stages.triangulate.possible import A_WHILE, rings_at_an_end


def last_on_wall(recording: Recording, points: RingPoints, behind_end: int) -> int | None:
    """Return the place, in the list of frames, of the last ring if the run goes on behind it without wall.

    ``behind_end`` is as in `CheckedFrames`. None if there is no sign of an end.
    """
    count = len(points.frame)
    behind = [end for end in rings_at_an_end(points.xyz_c) if end.stop == count and end.start > 0]
    last = behind[0].start - 1 if behind else count - 1
    if not behind and behind_end <= A_WHILE:
        return None
    return int(np.searchsorted(recording.frames.frame, points.frame[last]))


def without_pictures_behind(recording: Recording, last: int | None) -> Recording:
    """Return the recording in which the pictures behind the last ring on the wall are not lit."""
    if last is None:
        return recording
    frames = recording.frames
    behind = np.arange(len(frames.frame)) > last
    light = np.where(behind, WITHHELD, frames.illumination)
    return replace(recording, frames=replace(frames, illumination=light))


def end_in_view(recording: Recording, last: int | None, far_mm: float, context: Context) -> int:
    """Return the first place, in the list of frames, at which the pipe's end may be in view; `NEVER` if none.

    Texture is followed up to ``far_mm`` ahead of the camera, which has less than that to go to the last ring
    from there on. Without an encoder this is not known; a probe that went backwards to the last ring left
    the pipe by the end behind it.
    """
    if last is None:
        return NEVER
    frame, encoder = recording.frames.frame, recording.encoder
    why = f"the laser line is last seen on the wall in frame {frame[last]}: the pipe may end there. "
    if encoder is None:
        context.warn(
            f"{why}Without an encoder it is not known from where on the lit pictures show what lies beyond, "
            "which does not move as the wall does: distance and roll may err by more than their σ. What to "
            "do: use the encoder, or keep only the part of the recording without the end in view"
        )
        return NEVER
    way_mm = np.interp(recording.frames.time_s, encoder.time_s, encoder.distance_mm)
    to_go_mm = way_mm[last] - way_mm[: last + 1]
    near = np.flatnonzero((to_go_mm >= 0) & (to_go_mm < far_mm))
    if not (to_go_mm > 0).any():
        return NEVER
    context.warn(
        f"{why}From frame {frame[near[0]]} on, texture is followed only up to the line, and behind frame "
        f"{frame[last]} the encoder alone gives the motion. What to do: nothing, if the pipe ends there; "
        "else find out why the line is missing"
    )
    return int(near[0])
