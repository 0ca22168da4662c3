"""What the pictures say of a recording's tables: which light each frame was taken in, and when."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Bool, Float, Int
from pipeline.recording.base import Encoder, FrameTable, Recording

# Stands in the table of frames in place of a light: the frame has a pose, but no stage looks at its picture.
WITHHELD = "withheld"


@dataclass(frozen=True)
class CheckedFrames:
    """The table of frames and the encoder's unit after they were held against the pictures.

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
    """

    frame: Int
    time_s: Float
    illumination: NDArray[np.str_]
    encoder_factor: float = 1.0
    relabelled: int = 0
    retimed: int = 0
    withheld: Bool | None = None

    def applied_to(self, recording: Recording) -> Recording:
        """Return the recording with these frames, and its encoder in mm and with the motion's sign.

        The light of a withheld frame is `WITHHELD`, so that asking for frames of a light passes over it.
        """
        hidden = np.zeros(len(self.frame), bool) if self.withheld is None else self.withheld
        table = FrameTable(self.frame, self.time_s, np.where(hidden, WITHHELD, self.illumination))
        encoder = recording.encoder
        if encoder is not None and self.encoder_factor != 1.0:
            encoder = Encoder(encoder.time_s, encoder.distance_mm * self.encoder_factor)
        return replace(recording, frames=table, encoder=encoder)


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
