"""Interlaced pictures: their even and odd rows, the two fields, were taken one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Image, Int
from pipeline.recording.base import FrameSource, Planes


@dataclass(frozen=True)
class OneField:
    """Pictures of a ``source`` reconstructed from their even rows: one time and one light in each."""

    source: FrameSource

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height, px, as before."""
        return self.source.image_size

    def read(self, frames: Sequence[int] | Int, planes: Planes) -> Iterator[tuple[int, Image | None]]:
        """See `FrameSource.read`."""
        read = self.source.read(frames, planes)
        return ((number, None if image is None else even_rows(image)) for number, image in read)


def even_rows(image: Image) -> Image:
    """Return a picture (H, W) or (H, W, 3) whose odd rows are the mean of the even ones beside them."""
    out = image.copy()
    below = image[2::2].astype(np.uint16)
    out[1 : 2 * len(below) : 2] = (image[:-2:2][: len(below)] + below + 1) // 2
    out[2 * len(below) + 1 :] = image[2 * len(below)]
    return out
