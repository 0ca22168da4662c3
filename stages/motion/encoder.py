"""The encoder at the frames' times, and whether it is used at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Bool, Float
from pipeline.machine.stage import Context
from pipeline.recording.base import Recording
from stages.motion.tracking.landmarks import TrackedPoses

_JUMP_MM = 3.0
_JUMP_TIMES = 5.0
"""A step between frames is a jump of the counter, not motion, if it is longer than 3 mm and than five times
the step that nine in ten frames do not exceed. Not measured."""
_LEAST_COVERED = 0.2
"""Share of the frames that an encoder must cover. Not measured."""
_LEAST_STEPS = 8
"""Steps by which an encoder is judged at least. Not measured."""
_CONTRADICTED = 0.3
"""Share of steps in which the encoder may differ from texture, and relative difference that counts. A true
encoder differs by its scale, some per mille, and where it slips; a stuck or reversed one in every step."""
_DIFFERENCE_MM = 0.5
"""Smaller differences of a step never count, since texture may err as much in a single frame. Not
measured."""
_USUAL_PERCENT = 90.0


@dataclass(frozen=True)
class EncoderReadings:
    """The encoder's distance at all frames.

    Attributes
    ----------
    distance_mm : (N,)
        Relative to the first frame.
    sigma_mm : float
        1 σ of one reading.
    known : (N,) bool
        Frames that lie within the encoder's time.
    """

    distance_mm: Float
    sigma_mm: float
    known: Bool


def encoder_at_frames(
    recording: Recording, sigma_mm: float, farthest_mm: float, context: Context
) -> EncoderReadings | None:
    """Return the encoder's distance at the frames' times, relative to the first, or None.

    A quantum q adds q²/12 to the variance of the readings. Jumps are removed. An encoder that covers too few
    frames, or that usually advances from frame to frame by more than the wall in view (``farthest_mm``), is
    not used. All of it is reported.
    """
    encoder = recording.encoder
    if encoder is None or len(encoder.time_s) < 2:
        return None
    time_s = recording.frames.time_s
    slack = _frame_time(time_s)
    known = (time_s >= encoder.time_s[0] - slack) & (time_s <= encoder.time_s[-1] + slack)
    at_frames, jumps = _without_jumps(np.interp(time_s, encoder.time_s, encoder.distance_mm))
    context.report("frames outside the encoder's time", int((~known).sum()), "frames")
    context.report("encoder jumps taken out", jumps, "")
    if known.mean() < _LEAST_COVERED or _usual(np.diff(at_frames)) > farthest_mm:
        context.report("encoder left out", "it does not fit the frames")
        context.warn(
            f"the encoder is not used: it covers {100 * known.mean():.0f} % of the frames and usually "
            f"advances by {_usual(np.diff(at_frames)):.3g} mm from one frame to the next, where a frame "
            f"shows the wall up to {farthest_mm:.3g} mm ahead. What to do: check unit (mm) and clock (s, as "
            "in frames.csv) of encoder.csv"
        )
        return None
    sigma = float(np.hypot(sigma_mm, _quantum(encoder.distance_mm) / np.sqrt(12)))
    return EncoderReadings(at_frames, sigma, known)


def contradicted(encoder: EncoderReadings, tracked: TrackedPoses, context: Context) -> bool:
    """Return whether the wall's texture shows another motion than the encoder; reported if so."""
    if len(tracked.frames) < 2:
        return False
    found = ~tracked.lost[1:] & ~tracked.lost[:-1]
    by_wall = np.diff(tracked.T_pc[:, 2, 3])
    by_encoder = np.diff(encoder.distance_mm[tracked.frames])
    differs = np.abs(by_encoder - by_wall) > np.maximum(_DIFFERENCE_MM, _CONTRADICTED * np.abs(by_wall))
    judged = found & encoder.known[tracked.frames][1:]
    if judged.sum() < _LEAST_STEPS or differs[judged].mean() < _CONTRADICTED:
        return False
    context.report("encoder left out", "the wall's texture contradicts it")
    context.warn(
        f"the encoder is not used: in {int(differs[judged].sum())} of {int(judged.sum())} steps the wall's "
        "texture shows another motion, so that distance rests on the laser's baseline alone. What to do: "
        "check the encoder's scale and clock, and whether its wheel slipped"
    )
    return True


def _without_jumps(distance_mm: Float) -> tuple[Float, int]:
    """Return distances (N,) from 0 with impossible steps removed, and how many."""
    step = np.diff(distance_mm)
    jump = np.abs(step) > max(_JUMP_TIMES * _usual(step), _JUMP_MM)
    return np.concatenate([[0.0], np.cumsum(np.where(jump, 0.0, step))]), int(jump.sum())


def _quantum(distance_mm: Float) -> float:
    """Return the finest unit of the readings, mm: the smallest step, or difference of two steps."""
    sizes = np.unique(np.round(np.abs(np.diff(distance_mm)), 6))
    units = np.concatenate([sizes, np.diff(sizes)])
    return float(units[units > 0].min()) if np.any(units > 0) else 0.0


def _usual(step: Float) -> float:
    """Return the step that nine in ten do not exceed, mm."""
    return float(np.percentile(np.abs(step), _USUAL_PERCENT)) if step.size else 0.0


def _frame_time(time_s: Float) -> float:
    """Return the time from one frame to the next, s."""
    return float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
