"""Reads the encoder at the frames' times, decides whether it is used, and predicts the next frame's pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Bool, Float, Int, runs_of
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from pipeline.machine.stage import Context
from pipeline.recording.base import Recording
from stages.motion.tracking.landmarks import TrackedPoses

_JUMP_MM = 3.0
_JUMP_TIMES = 5.0
"""A step between frames is a jump of the counter, not motion, if it is longer than 3 mm and five times as
fast as nine in ten steps are at most. Not measured."""
_LEAST_COVERED = 0.2
"""Share of the frames that an encoder must cover. Not measured."""
_MOST_OUTSIDE = 0.05
"""Share of the frames without a reading from which a warning is given (chosen): a clock that starts a little
late needs none."""
_NAMED = 4
"""Runs of frames without a reading that are named, the longest."""
_COUNTS = 1.5
"""Counts between two readings from which readings are missing, if a counter logs only its changes: such
readings are one count apart, so the bound lies half-way between one and two."""
_LEAST_STEPS = 8
"""Steps by which an encoder is judged at least. Not measured."""
_CONTRADICTED = 0.3
"""Share of steps in which the encoder may differ from texture, and relative difference that counts. A true
encoder differs by its scale, some per mille, and where it slips; a stuck or reversed one in every step."""
_DIFFERENCE_MM = 0.5
"""Smaller differences of a step never count, since texture may err as much in a single frame. Not
measured."""
_COARSE = 3.5
"""Differences within so many σ of a reading do not count either: one quantum of a coarse counter is √12 σ."""
_USUAL_PERCENT = 90.0
_LIKE_USUAL = 3.0
"""An encoder has caught up if its jump is the distance that the probe went meanwhile at its mean speed,
within this factor. Not measured."""


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
    not used. All of this is reported.
    """
    encoder = recording.encoder
    if encoder is None or len(encoder.time_s) < 2:
        return None
    time_s = recording.frames.time_s
    slack = _frame_time(time_s)
    read_s, read_mm = _without_held(encoder.time_s, encoder.distance_mm)
    known = (time_s >= read_s[0] - slack) & (time_s <= read_s[-1] + slack)
    known &= ~_in_gaps(time_s, read_s, read_mm, slack)
    at_frames, jumps = _without_jumps(time_s, np.interp(time_s, *_going_on(read_s, read_mm, slack)))
    context.report("frames outside the encoder's time", int((~known).sum()), "frames")
    context.report("encoder jumps removed", jumps, "")
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


def warn_of_unread(encoder: EncoderReadings, tracked: TrackedPoses, frames: Int, context: Context) -> None:
    """Warn if the encoder has no readings for many frames (N,) in which the wall's texture moves.

    A counter that logs only its changes has no readings at rest, before its first count and after its last.
    """
    if len(tracked.frames) < 2:
        return
    at_mm = np.interp(np.arange(len(frames)), tracked.frames, tracked.T_pc[:, 2, 3])
    least_mm = max(_DIFFERENCE_MM, _COUNTS * _COARSE * encoder.sigma_mm)
    unread = [
        run
        for run in runs_of(~encoder.known)
        if np.ptp(at_mm[max(run.start - 1, 0) : run.stop + 1]) > least_mm
    ]
    count = sum(run.stop - run.start for run in unread)
    if count <= _MOST_OUTSIDE * len(frames):
        return
    longest = sorted(sorted(unread, key=lambda run: run.start - run.stop)[:_NAMED], key=lambda run: run.start)
    where = ", ".join(f"{frames[run.start]} to {frames[run.stop - 1]}" for run in longest)
    context.warn(
        f"the encoder has no readings for {count} of {len(frames)} frames"
        f"{', most of them' * (len(unread) > _NAMED)} (frames {where}), in which the probe moved: distances "
        "there depend on laser and texture, and their σ includes that. What to do: check whether encoder.csv "
        "was cut off, and whether its clock is that of frames.csv"
    )


def contradicted(encoder: EncoderReadings, tracked: TrackedPoses) -> bool:
    """Return whether the wall's texture shows another motion than the encoder."""
    differs, judged = _differing_steps(encoder, tracked)
    return bool(judged.sum() >= _LEAST_STEPS and differs[judged].mean() >= _CONTRADICTED)


def warn_of_contradiction(
    encoder: EncoderReadings, tracked: TrackedPoses, frames: Int, context: Context
) -> None:
    """Report an encoder that is not used, with the longest run of ``frames`` (N,) in which it differs."""
    differs, judged = _differing_steps(encoder, tracked)
    longest = max(runs_of(differs & judged), key=lambda run: run.stop - run.start)
    first, last = frames[tracked.frames[[longest.start, longest.stop]]]
    context.report("encoder left out", "the wall's texture contradicts it")
    context.warn(
        f"the encoder is not used: in {int(differs[judged].sum())} of {int(judged.sum())} steps, the longest "
        f"run of them in frames {first} to {last}, the wall's texture shows another motion, so that distance "
        "depends on the laser's baseline alone. What to do: check the encoder's scale and clock, and whether "
        "its wheel slipped"
    )


def _differing_steps(encoder: EncoderReadings, tracked: TrackedPoses) -> tuple[Bool, Bool]:
    """Return in which steps (L - 1,) between lit frames encoder and texture differ, and which are judged."""
    found = ~tracked.lost[1:] & ~tracked.lost[:-1]
    by_wall = np.diff(tracked.T_pc[:, 2, 3])
    by_encoder = np.diff(encoder.distance_mm[tracked.frames])
    least_mm = max(_DIFFERENCE_MM, _COARSE * encoder.sigma_mm)
    differs = np.abs(by_encoder - by_wall) > np.maximum(least_mm, _CONTRADICTED * np.abs(by_wall))
    return differs, found & encoder.known[tracked.frames][1:]


def _without_held(time_s: Float, distance_mm: Float) -> tuple[Float, Float]:
    """Return times and readings (M,) without those at which the encoder hung and then caught up.

    There, readings do not change and then jump by about the probe's usual advance in that time.
    """
    step, usual = np.diff(distance_mm), _usual(np.diff(distance_mm))
    kept = np.ones(len(time_s), bool)
    per_row = np.abs(step[step != 0]).mean() if np.any(step) else 0.0
    for rest in runs_of(step == 0):
        begin, end = rest.start, rest.stop
        jumps = end < len(step) and abs(step[end]) > max(_JUMP_TIMES * usual, _DIFFERENCE_MM)
        if jumps and 1 / _LIKE_USUAL < abs(step[end]) / ((end - begin) * per_row) < _LIKE_USUAL:
            kept[begin + 1 : end + 1] = False
    return time_s[kept], distance_mm[kept]


def _going_on(time_s: Float, distance_mm: Float, by_s: float) -> tuple[Float, Float]:
    """Return times and readings (M + 2,) extrapolated at both ends: a frame may lie just outside."""
    inner = np.interp([time_s[0] + by_s, time_s[-1] - by_s], time_s, distance_mm)
    before, behind = 2 * distance_mm[[0, -1]] - inner
    return np.r_[time_s[0] - by_s, time_s, time_s[-1] + by_s], np.r_[before, distance_mm, behind]


def _in_gaps(time_s: Float, read_s: Float, read_mm: Float, frame_s: float) -> Bool:
    """Return which frames (N,) lie in gaps of the readings during which the probe moved."""
    usual_s = float(np.median(np.diff(read_s)))
    gap = np.diff(read_s) > max(_JUMP_TIMES * usual_s, 2 * frame_s)
    gap &= np.abs(np.diff(read_mm)) > max(_DIFFERENCE_MM, _COUNTS * _quantum(read_mm))
    at = np.clip(np.searchsorted(read_s, time_s) - 1, 0, len(gap) - 1)
    return np.asarray(gap[at] & (time_s > read_s[at]) & (time_s < read_s[at + 1]))


def _without_jumps(time_s: Float, distance_mm: Float) -> tuple[Float, int]:
    """Return distances (N,) from 0 with impossible steps removed, and the number of these steps.

    Where frames were lost or left out, a step takes longer, and the probe goes farther meanwhile.
    """
    step, passed = np.diff(distance_mm), np.diff(time_s)
    jump = np.abs(step) > np.maximum(_JUMP_TIMES * _usual(step / passed) * passed, _JUMP_MM)
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


class PosePredictor:
    """Predicts poses in the straightened pipe.

    Roll continues at constant speed, and so does distance, or it follows the encoder if there is one. The
    rings give the position of the pipe's axis; pitch and yaw are taken as zero.

    Parameters
    ----------
    time_s : (N,)
        Times of all frames, s.
    encoder : EncoderReadings or None
    centre_c : (N, 2)
        Point at which the pipe's axis passes through the laser's plane, mm, frame C.
    """

    def __init__(self, time_s: Float, encoder: EncoderReadings | None, centre_c: Float) -> None:
        self._time, self._centre, self._encoder = time_s, centre_c, encoder
        self._known: list[tuple[int, float, float]] = []  # frame, distance, roll of the last two

    def learn(self, frame: int, T_pc: Float) -> None:
        """Store a frame's pose (4, 4)."""
        roll = float(np.arctan2(T_pc[1, 0], T_pc[0, 0]))
        self._known = [*self._known[-1:], (frame, float(T_pc[2, 3]), roll)]

    def predict(self, frame: int) -> Float:
        """Return the predicted pose (4, 4) of a frame."""
        z, roll = self._distance_and_roll(frame)
        rotation = rotation_from_vector(np.array([0, 0, roll]))
        offset = rotation @ np.append(-self._centre[frame], 0.0)
        return from_parts(rotation, offset + np.array([0, 0, z]))

    def between(self, tracked: TrackedPoses) -> Float:
        """Return first guesses (N, 4, 4) of all poses, interpolated between the tracked ones."""
        count = len(self._time)
        z = self._encoder.distance_mm if self._encoder is not None else np.zeros(count)
        roll = np.zeros(count)
        if len(tracked.frames):
            every, T_pc = np.arange(count), tracked.T_pc
            z = np.interp(every, tracked.frames, T_pc[:, 2, 3])
            roll = np.interp(every, tracked.frames, np.unwrap(np.arctan2(T_pc[:, 1, 0], T_pc[:, 0, 0])))
        turn = rotation_from_vector(np.stack([0 * roll, 0 * roll, roll], -1))
        centre = np.concatenate([-self._centre, np.zeros((count, 1))], 1)
        origin = np.einsum("nij,nj->ni", turn, centre)
        origin[:, 2] = z
        return from_parts(turn, origin)

    def _distance_and_roll(self, frame: int) -> tuple[float, float]:
        if not self._known:
            return 0.0, 0.0
        last, z, roll = self._known[-1]
        before, z_before, roll_before = self._known[0]
        ratio = (self._time[frame] - self._time[last]) / max(self._time[last] - self._time[before], 1e-9)
        turn = (roll - roll_before + np.pi) % (2 * np.pi) - np.pi
        if self._encoder is not None and self._encoder.known[[last, frame]].all():
            advance = self._encoder.distance_mm[frame] - self._encoder.distance_mm[last]
            return z + float(advance), roll + turn * ratio
        return z + (z - z_before) * ratio, roll + turn * ratio
