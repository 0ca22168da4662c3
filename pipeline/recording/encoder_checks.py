"""Checks implausible encoder readings: continues a counter that restarts, and warns of jumps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.recording.base import Encoder, FrameTable

# A step of the encoder is a jump when it is longer than 1 mm, than ten times the usual largest step (this
# quantile of the steps that are not 0), and than ten times the median of the steps around it: of five, or of
# those within 0.2 s, since a recorder may insert readings between those that come 30 times a second.
_LARGEST, _JUMP_FACTOR, _BESIDE, _BESIDE_S, _JUMP_MM = 0.95, 10.0, 5, 0.2, 1.0


def checked_encoder(encoder: Encoder | None, frames: FrameTable) -> tuple[Encoder | None, tuple[str, ...]]:
    """Return the encoder with its counter continued, and warnings of partial cover, pauses and jumps."""
    if encoder is None or frames.frame.size == 0:
        return encoder, ()
    encoder, began_anew = counted_on(encoder)
    step_s, slack = np.diff(encoder.time_s), _slack_s(encoder, frames)
    found = [*began_anew]
    if encoder.time_s[0] > frames.time_s[0] + slack:
        found.append(f"the encoder begins {encoder.time_s[0] - frames.time_s[0]:.2f} s after the first frame")
    if encoder.time_s[-1] < frames.time_s[-1] - slack:
        found.append(f"the encoder ends {frames.time_s[-1] - encoder.time_s[-1]:.2f} s before the last frame")
    if np.any(step_s > 10 * slack):
        found.append(f"the encoder has no readings for up to {step_s.max():.2f} s")
    return encoder, (*found, *_warned_of_jumps(encoder))


def _slack_s(encoder: Encoder, frames: FrameTable) -> float:
    """Return two periods of the slower of encoder and camera, s."""
    periods = [np.median(np.diff(t)) for t in (encoder.time_s, frames.time_s) if t.size > 1]
    return 2 * float(max(periods))


def counted_on(encoder: Encoder) -> tuple[Encoder, tuple[str, ...]]:
    """Return the readings of a restarting counter, continued without the jumps, and a warning.

    Such a counter always jumps back by its whole range; after a slip of the wheel the reading continues from
    its current value.
    """
    jumps = _jumps(encoder)
    if not jumps.size:
        return encoder, ()
    step_mm, by_mm = np.diff(encoder.distance_mm), np.diff(encoder.distance_mm)[jumps]
    moves_mm = step_mm[step_mm != 0]
    usual_mm = float(np.median(moves_mm))
    whole_mm = float(np.median(by_mm)) - usual_mm
    near_mm = 2 * _usual_largest(step_mm)
    counts = np.ptp(encoder.distance_mm) < abs(whole_mm) + near_mm and whole_mm * usual_mm < 0
    if not counts or np.any(np.abs(by_mm - usual_mm - whole_mm) > near_mm):
        return encoder, ()
    begun = np.zeros(len(encoder.time_s))
    begun[jumps + 1] = -whole_mm
    times = f"{jumps.size} time{'s' * (jumps.size > 1)}"
    return replace(encoder, distance_mm=encoder.distance_mm + np.cumsum(begun)), (
        f"the encoder's counter restarts {times}, after {abs(whole_mm):.4g} mm each: its readings are "
        "continued without these jumps",
    )


def _jumps(encoder: Encoder) -> Int:
    """Return the readings (K,) after which the encoder jumps.

    A coarse encoder repeats most readings, and so does that of a waiting probe: only steps that are not 0
    define the usual step. A start is not a jump, since the encoder then continues as fast.
    """
    step_mm = np.abs(np.diff(encoder.distance_mm))
    if not step_mm.any():
        return np.empty(0, np.int64)
    usual_mm = _usual_largest(step_mm)
    jumps = np.flatnonzero(step_mm > max(_JUMP_FACTOR * usual_mm, _JUMP_MM))
    step_s = np.diff(encoder.time_s)
    a_while = int(0.5 * _BESIDE_S / np.median(step_s[step_s > 0])) if step_s.any() else 0
    beside = min(max(_BESIDE // 2, a_while), len(step_mm))
    return jumps[step_mm[jumps] > _JUMP_FACTOR * _median_around(step_mm, jumps, beside)]


def _usual_largest(step_mm: Float) -> float:
    """Return the usual largest size, mm, of the steps (N,) that are not 0; a jump does not raise it."""
    size_mm = np.abs(step_mm)
    return float(np.quantile(size_mm[size_mm > 0], _LARGEST, method="lower"))


def _median_around(values: Float, at: Int, beside: int) -> Float:
    """Return the median (K,) of values (N,) ``at`` places (K,) and ``beside`` each, mirrored at the ends."""
    last = len(values) - 1
    index = np.abs(at[:, None] + np.arange(-beside, beside + 1))
    return np.asarray(np.median(values[np.maximum(last - np.abs(last - index), 0)], axis=1))


def _warned_of_jumps(encoder: Encoder) -> tuple[str, ...]:
    jumps = _jumps(encoder)
    if jumps.size == 0:
        return ()
    largest_mm = float(np.abs(np.diff(encoder.distance_mm)).max())
    at = ", ".join(f"{encoder.time_s[j]:.2f} s" for j in jumps[:5])
    return (f"the encoder jumps by up to {largest_mm:.4g} mm at {at} ({jumps.size} in all)",)
