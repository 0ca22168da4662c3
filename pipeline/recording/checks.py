"""Contradictions within a recording: each is mended and named in a warning, or refused.

`CheckedFrames` is the table of frames as the pictures show it: in which light each was taken, and when.
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
            hint=_size_hint(tuple(found), tuple(wanted)),
        )  # fmt: skip


def _size_hint(found: tuple[int, ...], wanted: tuple[int, ...]) -> str:
    """Return what to do about images (width, height) of another size than the camera's."""
    if found == wanted[::-1]:
        return "turn the pictures back by 90° in the recorder, or give a probe file of this camera so turned"
    cut = [name for name, f, w in zip(("columns", "rows"), found, wanted, strict=True) if f < w]
    if len(cut) == 1 and any(f == w for f, w in zip(found, wanted, strict=True)):
        return (
            f"if the recorder cut {cut[0]} off, switch that off; or give a probe file with this image_size, "
            "and with centre_px less what was cut off at the left and above"
        )
    return "give the probe file of this camera at this resolution with --probe"


def refuse_changed(recording: Recording) -> None:
    """Raise `InputError` when a file of a recording is no longer as it was when it was opened."""
    for file in recording.files:
        file.refuse_changed()


# Stands in the table of frames in place of a light: the frame has a pose, but no stage looks at its picture.
WITHHELD = "withheld"


@dataclass(frozen=True)
class CheckedFrames:
    """The table of frames and the encoder's unit after they were compared with the pictures.

    Attributes
    ----------
    frame : (N,) int
        Numbers of the pictures that are used: all of the recording's but repeated ones.
    time_s : (N,)
        When each was taken: the recording's own times, or those of the rows that belong to the pictures.
    illumination : (N,) str
        `Illumination` values as the pictures show them.
    encoder_factor : float
        By which the encoder's readings are to be multiplied: 1 unless its unit or sign was wrong.
    relabelled, retimed : int
        In how many frames light and time differ from the recording's table.
    withheld : (N,) bool or None
        Frames whose pictures no stage of the run may measure, so that `boresight twin` can compare with them
        what the run predicts; None where there are none.
    stays : (h, w) bool or None
        As in `Recording`.
    interlaced : bool
        Whether odd rows were taken at another time than even ones; then the even ones alone are used.
    cut : tuple of int
        Frames whose wall does not continue that of the frames before: how far the probe went is not known.
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

    def applied_to(self, recording: Recording) -> Recording:
        """Return the recording with these frames, and its encoder in mm and with the motion's sign.

        The light of a withheld frame is `WITHHELD`, so that asking for frames of a light passes over it.
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

    The lights take turns, so that the frames beside a withheld one are measured where lights alternate.
    """
    withheld = np.zeros(len(label), bool)
    kinds = np.unique(label)
    for turn, kind in enumerate(kinds):
        first = every * (2 * turn + 1) // (2 * len(kinds))
        withheld[np.flatnonzero(label == kind)[first :: max(every, 1)]] = every > 0
    return withheld
