"""The encoder at the frames' times, and whether it may be believed at all."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from pipeline.machine.stage import Context
from pipeline.recording.base import Recording
from stages.motion.bundle_adjustment.unknowns import EncoderReadings
from stages.motion.tracking.observations import Course

_JUMP_MM = 3.0
_JUMP_TIMES = 5.0
_LEAST_COVERED = 0.2
_LEAST_STEPS = 8
_CONTRADICTED = 0.3
_DIFFERENCE_MM = 0.5


def encoder_at_frames(
    recording: Recording, sigma_mm: float, farthest_mm: float, context: Context
) -> EncoderReadings | None:
    """Return the encoder's distance at the frames' times, relative to the first, or None.

    Its quantum q adds q²/12 to the readings' variance. Frames outside its time
    are not known; jumps are taken out. An encoder that covers too little, or that usually advances from
    frame to frame by more than the wall in view (``farthest_mm``), is left out. All of it is reported.
    """
    encoder = recording.encoder
    if encoder is None or len(encoder.time_s) < 2:
        return None
    time_s = recording.frames.time_s
    known = (time_s >= encoder.time_s[0] - _slack(time_s)) & (time_s <= encoder.time_s[-1] + _slack(time_s))
    at_frames, jumps = _without_jumps(np.interp(time_s, encoder.time_s, encoder.distance_mm))
    context.report("frames outside the encoder's time", int((~known).sum()), "frames")
    context.report("encoder jumps taken out", jumps, "")
    if known.mean() < _LEAST_COVERED or _usual(np.diff(at_frames)) > farthest_mm:
        context.report("encoder left out", "it does not fit the frames")
        context.logger.warning("the encoder does not fit the frames and is left out")
        return None
    sigma = float(np.hypot(sigma_mm, _quantum(encoder.distance_mm) / np.sqrt(12)))
    return EncoderReadings(at_frames, sigma, known)


def contradicted(encoder: EncoderReadings, tracks: Course, context: Context) -> bool:
    """Return whether the wall's texture says that the probe moved otherwise; reported if so."""
    if len(tracks.frames) < 2:
        return False
    followed = ~tracks.lost[1:] & ~tracks.lost[:-1]
    by_wall = np.diff(tracks.T_pc[:, 2, 3])
    by_encoder = np.diff(encoder.distance_mm[tracks.frames])
    off = np.abs(by_encoder - by_wall) > np.maximum(_DIFFERENCE_MM, _CONTRADICTED * np.abs(by_wall))
    judged = followed & encoder.known[tracks.frames][1:]
    if judged.sum() < _LEAST_STEPS or off[judged].mean() < _CONTRADICTED:
        return False
    context.report("encoder left out", "the wall's texture contradicts it")
    context.logger.warning(
        "the encoder is left out: in %d of %d steps the wall's texture shows another motion",
        int(off[judged].sum()), int(judged.sum()),
    )  # fmt: skip
    return True


def _without_jumps(distance_mm: Float) -> tuple[Float, int]:
    """Return distances (N,) from 0 with impossible steps taken out, and how many."""
    step = np.diff(distance_mm)
    jump = np.abs(step) > max(_JUMP_TIMES * _usual(step), _JUMP_MM)
    return np.concatenate([[0.0], np.cumsum(np.where(jump, 0.0, step))]), int(jump.sum())


def _quantum(distance_mm: Float) -> float:
    """Return the finest unit of the readings: the smallest step, or difference of two steps, mm."""
    sizes = np.unique(np.round(np.abs(np.diff(distance_mm)), 6))
    units = np.concatenate([sizes, np.diff(sizes)])
    return float(units[units > 0].min()) if np.any(units > 0) else 0.0


def _usual(step: Float) -> float:
    """Return the step that nine in ten do not exceed, mm."""
    return float(np.percentile(np.abs(step), 90)) if step.size else 0.0


def _slack(time_s: Float) -> float:
    """Return one frame's time, s."""
    return float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
