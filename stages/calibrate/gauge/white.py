"""Grey level at which a gauge run's pictures are clipped, which displaces the edges beside white."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from pipeline.arrays import Image, Int
from pipeline.recording.base import Recording
from pipeline.recording.images import WHITE, luma_of_white

# White counts as overexposed so few grey levels below the brightest, of which compression takes a few off.
BELOW_WHITE_GREY = 5
# Pictures are clipped below the range's white where so many times more pixels lie within 5 levels of the
# commonest bright one than in as many below (chosen: a ridge of light on a wall has 2.4 times), of
# this share of all, and hardly any above. Below 230, the clip of limited range, bright wall is no clip.
_PILED, _LEAST_SHARE, _ABOVE_PILE, _DARKEST_CLIP = 4.0, 1e-4, 0.05, 230
# Chosen: so many pictures show at which grey level all of them are clipped.
LOOKED_AT = 6


def clip_level(images: Iterable[Image], white: int) -> int:
    """Return the grey level at which images are clipped: ``white``, or below it where pixels pile up there.

    Some cameras clip below the white that their video's range allows, or state another range.
    """
    count = sum((np.bincount(image.ravel(), minlength=256) for image in images), np.zeros(256, np.int64))
    level = _DARKEST_CLIP + int(np.argmax(count[_DARKEST_CLIP:]))
    low, high = level - BELOW_WHITE_GREY, level + BELOW_WHITE_GREY + 1
    pile, above, below = count[low:high].sum(), count[high:].sum(), count[2 * low - high : low].sum()
    piled = pile > max(_PILED * below, _LEAST_SHARE * count.sum()) and above < _ABOVE_PILE * pile
    return min(white, level) if piled else white


def brightest_grey(recording: Recording, frames: Int) -> int:
    """Return the grey level at which pictures are clipped, from a few of the ``frames`` that can be read.

    The first of them tells the luma of white.
    """
    few = frames[:: max(len(frames) // LOOKED_AT, 1)]
    both = zip(recording.read(few, "grey"), recording.read(few, "bgr"), strict=True)
    seen = [(grey.copy(), bgr) for (_, grey), (_, bgr) in both if grey is not None and bgr is not None]
    return clip_level((grey for grey, _ in seen), luma_of_white(*seen[0])) if seen else WHITE
