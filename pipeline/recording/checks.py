"""What does not fit together in a recording: mended and named in a warning, or refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.arrays import Float
from pipeline.errors import InputError
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Encoder, FrameTable, Recording

# A step of the encoder counts as a jump when it is this many times the usual largest, and this long.
_JUMP_FACTOR, _JUMP_MM = 10.0, 1.0


def common_frames(table: FrameTable, count: int) -> tuple[FrameTable, tuple[str, ...]]:
    """Return the part of a table that ``count`` images cover, and what was noticed."""
    listed = int(table.frame[-1]) + 1
    if listed == count:
        return table, ()
    keep = table.frame < count
    kept = replace(
        table, frame=table.frame[keep], time_s=table.time_s[keep], illumination=table.illumination[keep]
    )
    return kept, (
        f"there are {count} images, the table of frames lists {listed}: "
        f"the {min(count, listed)} in common are used",
    )


def encoder_warnings(encoder: Encoder | None, frames: FrameTable) -> tuple[str, ...]:
    """Return what is suspicious about an encoder: it covers only part of the run, pauses, or jumps."""
    if encoder is None or frames.frame.size == 0:
        return ()
    step_s, slack = np.diff(encoder.time_s), _slack_s(encoder, frames)
    found = []
    if encoder.time_s[0] > frames.time_s[0] + slack:
        found.append(f"the encoder begins {encoder.time_s[0] - frames.time_s[0]:.2f} s after the first frame")
    if encoder.time_s[-1] < frames.time_s[-1] - slack:
        found.append(f"the encoder ends {frames.time_s[-1] - encoder.time_s[-1]:.2f} s before the last frame")
    if np.any(step_s > 10 * slack):
        found.append(f"the encoder is silent for up to {step_s.max():.2f} s")
    return (*found, *_jumps(encoder))


def _slack_s(encoder: Encoder, frames: FrameTable) -> float:
    """Return two periods of the slower of encoder and camera, s."""
    periods = [np.median(np.diff(t)) for t in (encoder.time_s, frames.time_s) if t.size > 1]
    return 2 * float(max(periods))


def _jumps(encoder: Encoder) -> tuple[str, ...]:
    step_mm = np.abs(np.diff(encoder.distance_mm))
    usual_mm = float(np.quantile(step_mm, 0.95))
    jumps = np.flatnonzero((step_mm > _JUMP_FACTOR * usual_mm) & (step_mm > _JUMP_MM))
    if jumps.size == 0:
        return ()
    at = ", ".join(f"{encoder.time_s[j]:.2f} s" for j in jumps[:5])
    return (f"the encoder jumps by up to {step_mm.max():.1f} mm at {at} ({jumps.size} in all)",)


def refuse_backward(file: Path, values: Sequence[float] | Float, name: str, *, strictly: bool) -> None:
    """Raise `InputError` at the first value that is less than (``strictly``: not above) its predecessor."""
    steps = np.diff(np.asarray(values, float))
    wrong = np.flatnonzero(steps <= 0 if strictly else steps < 0)
    if wrong.size:
        i = int(wrong[0])
        raise InputError(
            file, f"{name} goes from {values[i]:g} to {values[i + 1]:g}", place=f"reading {i + 2}",
            expected=f"{name} that only rises",
            hint="find out what the recorder's clock did there, or cut the recording at that place",
        )  # fmt: skip


def check_probe_fits(recording: Recording, probe: Probe) -> None:
    """Raise `InputError` when the images are not of the size that the probe's camera has."""
    found, wanted = recording.source.image_size, probe.camera.image_size
    if tuple(found) != tuple(wanted):
        raise InputError(
            recording.path, f"its images are {found[0]} x {found[1]} pixels",
            expected=f"{wanted[0]} x {wanted[1]}, as the probe's camera says",
            hint="give the probe file of this camera at this resolution with --probe",
        )  # fmt: skip


def refuse_changed(recording: Recording) -> None:
    """Raise `InputError` when a file of a recording is no longer as it was when it was opened."""
    for file in recording.files:
        file.refuse_changed()
