"""Contradictions within a recording: each is corrected and named in a warning, or refused.

`CheckedFrames` is the table of frames, corrected by the pictures: light and time of each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Bool, Float, Int
from pipeline.errors import InputError
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Encoder, FrameTable, Recording
from pipeline.recording.one_field import OneField


def common_frames(table: FrameTable, count: int) -> tuple[FrameTable, tuple[str, ...]]:
    """Return the part of a table that ``count`` images cover, and a warning."""
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


def refuse_backward(file: Path, values: Sequence[float] | Float, name: str, *, strictly: bool) -> None:
    """Raise `InputError` at the first value that is less than (``strictly``: not above) its predecessor."""
    steps = np.diff(np.asarray(values, float))
    wrong = np.flatnonzero(steps <= 0 if strictly else steps < 0)
    if wrong.size:
        i = int(wrong[0])
        raise InputError(
            file, f"{name} goes from {values[i]:g} to {values[i + 1]:g}", place=f"reading {i + 2}",
            expected=f"{name} that only rises",
            hint="check the recorder's clock, or cut the recording at that place",
        )  # fmt: skip


def check_probe_fits(recording: Recording, probe: Probe) -> None:
    """Raise `InputError` when the images have another size than the probe's camera."""
    found, wanted = recording.source.image_size, probe.camera.image_size
    if tuple(found) != tuple(wanted):
        raise InputError(
            recording.path, f"its images are {found[0]} x {found[1]} pixels",
            expected=f"{wanted[0]} x {wanted[1]}, as the probe's camera states",
            hint=_size_hint(tuple(found), tuple(wanted)),
        )  # fmt: skip


def _size_hint(found: tuple[int, ...], wanted: tuple[int, ...]) -> str:
    """Return what to do about images (width, height) of another size than the camera's."""
    if found == wanted[::-1]:
        return "rotate the pictures back by 90° in the recorder, or use a probe file of the rotated camera"
    cut = [name for name, f, w in zip(("columns", "rows"), found, wanted, strict=True) if f < w]
    if len(cut) == 1 and any(f == w for f, w in zip(found, wanted, strict=True)):
        return (
            f"if the recorder cut {cut[0]} off, switch that off; or use a probe file with this image_size, "
            "and with centre_px reduced by the parts cut off at the left and above"
        )
    return "state the probe file of this camera at this resolution with --probe"


def refuse_changed(recording: Recording) -> None:
    """Raise `InputError` when a file of a recording has changed since it was opened."""
    for file in recording.files:
        file.refuse_changed()


# Replaces the light in the table of frames: the frame has a pose, but no stage uses its picture.
WITHHELD = "withheld"


@dataclass(frozen=True)
class CheckedFrames:
    """The table of frames and the encoder's unit after they were compared with the pictures.

    Attributes
    ----------
    frame : (N,) int
        Numbers of the used pictures: all of the recording's except repeated ones.
    time_s : (N,)
        Times of the pictures: the recording's own, or those of the rows that belong to the pictures.
    illumination : (N,) str
        `Illumination` values as the pictures show them.
    encoder_factor : float
        Factor on the encoder's readings: 1 unless its unit or sign was wrong.
    relabelled, retimed : int
        Numbers of frames whose light and time differ from the recording's table.
    withheld : (N,) bool or None
        Frames whose pictures no stage of the run may use, so that `boresight twin` can compare them with the
        run's predictions; None without any.
    stays : (h, w) bool or None
        As in `Recording`.
    interlaced : bool
        Whether odd rows were taken at another time than even ones; then the even ones alone are used.
    cut : tuple of int
        First frames that may lie behind a place where the recording was cut: the wall does not continue
        there, and how far the probe went is not known.
    behind_end : int
        Number of last pictures that were left out because they show neither line nor wall that moves on as
        before: the pipe has ended.
    """

    frame: Int
    time_s: Float
    illumination: NDArray[np.str_]
    encoder_factor: float = 1.0
    relabelled: int = 0
    retimed: int = 0
    withheld: Bool | None = None
    stays: Bool | None = None
    interlaced: bool = False
    cut: tuple[int, ...] = ()
    behind_end: int = 0

    def applied_to(self, recording: Recording) -> Recording:
        """Return the recording with these frames, and its encoder in mm and with the motion's sign.

        The light of a withheld frame is `WITHHELD`, so that it is never selected by its light.
        """
        hidden = np.zeros(len(self.frame), bool) if self.withheld is None else self.withheld
        table = FrameTable(self.frame, self.time_s, np.where(hidden, WITHHELD, self.illumination))
        encoder = recording.encoder
        if encoder is not None and self.encoder_factor != 1.0:
            encoder = Encoder(encoder.time_s, encoder.distance_mm * self.encoder_factor)
        source = OneField(recording.source) if self.interlaced else recording.source
        return replace(recording, frames=table, encoder=encoder, source=source, stays=self.stays)


def withheld_frames(label: NDArray[np.str_], every: int) -> Bool:
    """Return which frames (N,) are withheld: one in ``every`` of each light, none for 0.

    The lights are withheld in turn, so that the frames beside a withheld one are used if lights alternate.
    """
    withheld = np.zeros(len(label), bool)
    kinds = np.unique(label)
    for turn, kind in enumerate(kinds):
        first = every * (2 * turn + 1) // (2 * len(kinds))
        withheld[np.flatnonzero(label == kind)[first :: max(every, 1)]] = every > 0
    return withheld
