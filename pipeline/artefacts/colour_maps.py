"""Colour maps as a few colours each, between which they run straight.

Safe for colour-blind readers and even in lightness: blue-white-red and two others of ColorBrewer (C. Brewer,
colorbrewer2.org) for signed values; `cividis` (Nuñez, Anderton, Renslow 2018) and `viridis` (van der Walt,
Smith 2015) for values that only grow, thinned out to at most 4 of 255 levels.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Byte

_COLOURS = {
    "RdBu_r": "053061 2065ab 4393c3 90c4dd d1e5f0 f7f6f6 fddbc7 f3a481 d6604d b1182b 67001f",
    "PuOr_r": "2d004b 532687 8073ac b1aad1 d8daeb f7f7f6 fee0b6 fcb761 e08214 b25706 7f3b08",
    "BrBG": "543005 8b500a bf812d dec17b f6e8c3 f4f5f5 c7eae5 7fccc0 35978f 01655d 003c30",
    "cividis": (
        "00224e 002758 002b62 002f6d 053371 163770 213b6e 2a3f6d 32436d 39486c 3f4c6c 46516c "
        "4c556c 52596d 575d6d 5d616e 62656f 676a71 6c6e72 727274 777776 7d7c78 828079 888578 "
        "8e8978 938e78 999277 9f9775 a59c74 aba072 b1a570 b8aa6e bfb06b c5b568 ccba64 d2c060 "
        "d9c55c dfca57 e6d051 edd54a f3db42 fbe138 fee838"
    ),
    "viridis": (
        "440154 460a5d 471365 481b6d 482374 472a7a 46327e 443983 424086 3f4788 3d4e8a 39558c "
        "365c8d 33628d 31688e 2e6e8e 2c738e 29798e 277f8e 25848e 238a8d 21918c 1f968b 1e9c89 "
        "1fa187 22a785 26ad81 2db27d 35b779 3fbc73 4ac16d 56c667 65cb5e 73d056 81d34d 90d743 "
        "a0da39 b0dd2f c0df25 d0e11c dfe318 efe51c fde725"
    ),
}  # red, green, blue


def colours_bgr(name: str, count: int) -> Byte:
    """Return ``count`` colours (count, 3), blue, green, red, evenly from one end of a map to the other."""
    known = np.array([list(bytes.fromhex(c)) for c in _COLOURS[name].split()], float)
    place = np.linspace(0, len(known) - 1, count)
    rgb = [np.interp(place, np.arange(len(known)), channel) for channel in known.T]
    return np.asarray(np.rint(np.stack(rgb[::-1], -1)), np.uint8)
