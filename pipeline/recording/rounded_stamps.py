"""Corrects stamps of frames that were rounded until some are equal: 0.1, 0.1, 0.1, 0.2, ..."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.arrays import Float
from pipeline.errors import InputError
from pipeline.recording.base import FrameTable

# Rounding moves a stamp by half a unit; a line laid through many rounded stamps is off by less than a tenth.
# Their errors are a sawtooth: the line's slope may be off by some σ of independent errors.
_WITHIN_UNITS, _SIGMAS = 0.6, 3.0
# The unit of time is at least 1.1 frames long, else rounding makes no two stamps equal. It holds at most 1.5
# times the frames of the stated rate, and one more: a unit in which the clock stood still holds more.
_SHORTEST, _LONGEST = 1.1, 1.5
# Stamps are multiples of their unit except for rounding of floats.
_EXACT = 1e-6


def without_rounding(file: Path, table: FrameTable, rate: float) -> tuple[FrameTable, tuple[str, ...]]:
    """Return a table with strictly rising times, and warnings: equal stamps are separated if rounded.

    Times are those of an even rhythm if it lies within the rounding of all stamps; else frames with equal
    stamps are spread evenly over the time that rounds to their stamp. ``rate`` is the stated frame rate, 1/s.

    Raises
    ------
    InputError
        At the first of equal stamps that no rounding explains.
    """
    step = np.diff(table.time_s)
    if np.all(step > 0):
        return table, ()
    unit_s = float(step[step > 0].min()) if np.any(step > 0) else np.inf
    in_units = (table.time_s - table.time_s[0]) / unit_s
    count = np.unique(table.time_s, return_counts=True)[1]
    whole = np.allclose(in_units, np.rint(in_units), rtol=0, atol=_EXACT * max(float(in_units[-1]), 1.0))
    held = rate * unit_s
    if not (np.isfinite(held) and whole and held > _SHORTEST and count.max() <= _LONGEST * held + 1):
        _refuse(file, table, int(count.max()))
    even = _even_rhythm(table, unit_s, 1 / rate)
    time_s, how = even, "an even rhythm, which rounds to all of them, replaces them"
    if time_s is None:
        time_s, how = (
            _shared(table.time_s, unit_s),
            "frames with one time are spread evenly over its rounding",
        )
    return replace(table, time_s=time_s), (
        f"the times in {file.name} are rounded to {unit_s:.3g} s, so that up to {count.max()} frames have "
        f"one time: {how}. What to do: write time_s with three decimals at least",
    )


def _even_rhythm(table: FrameTable, unit_s: float, stated_s: float) -> Float | None:
    """Return the even times (N,) that round to all stamps, None if there are none.

    Their period is the stated one unless the stamps clearly show another: a few seconds show little.
    """
    place = table.frame - table.frame.mean()
    fitted_s = float(place @ table.time_s / (place @ place))
    sigma_s = unit_s / np.sqrt(12 * float(place @ place))
    period_s = stated_s if abs(fitted_s - stated_s) < _SIGMAS * sigma_s else fitted_s
    even = table.time_s.mean() + period_s * place
    return np.asarray(even) if np.abs(even - table.time_s).max() < _WITHIN_UNITS * unit_s else None


def _shared(time_s: Float, unit_s: float) -> Float:
    """Return times (N,) at which frames with one stamp are spread over the unit around it."""
    _, first, index, count = np.unique(time_s, return_index=True, return_inverse=True, return_counts=True)
    place = (np.arange(len(time_s)) - first[index] + 0.5) / count[index]
    return np.asarray(time_s + (place - 0.5) * unit_s)


def _refuse(file: Path, table: FrameTable, most: int) -> None:
    i = int(np.flatnonzero(np.diff(table.time_s) <= 0)[0])
    stands = f"{table.time_s[i]:g}"
    raise InputError(
        file, f"time_s goes from {stands} to {stands}; up to {most} frames have one time",
        place=f"reading {i + 2}", expected="time_s that rises, with three decimals at least",
        hint="write the times as the camera stamped them, or cut the recording where its clock stood",
    )  # fmt: skip
