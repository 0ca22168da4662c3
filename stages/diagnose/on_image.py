"""The residual on the picture in which it was measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Byte, Float
from pipeline.recording.base import Recording
from stages.diagnose.compared import Compared


@dataclass(frozen=True)
class OnImage:
    """One frame with its ring residuals.

    Attributes
    ----------
    frame : int
    grey : (H, W) uint8
    uv_before, uv_after : (M, 2), (K, 2)
    before_px, after_px : (M,), (K,)
    """

    frame: int
    grey: Byte
    uv_before: Float
    uv_after: Float
    before_px: Float
    after_px: Float


def image_of(seen: Compared | None, field: Recording | None, gauge: Recording | None) -> OnImage | None:
    """Return the ring frame with the most usable bins, or None where there is none."""
    if seen is None or not seen.before.usable.any():
        return None
    recording = field if seen.before.source == "field" else gauge
    if recording is None:
        return None
    frames, count = np.unique(seen.before.frame[seen.before.usable], return_counts=True)
    number = int(frames[np.argmax(count)])
    picture = next(iter(recording.read([number], "grey")))[1]
    if picture is None:
        return None
    before, after = (r.usable & (r.frame == number) for r in (seen.before, seen.after))
    return OnImage(
        number, picture.copy(), seen.before.uv[before], seen.after.uv[after],
        seen.before.residual_px[before], seen.after.residual_px[after],
    )  # fmt: skip
