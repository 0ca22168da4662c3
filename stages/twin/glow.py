"""Light on the wall of laser frames that follows no known pattern, or comes and goes: a class of causes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.gate import Suspected
from stages.twin.scene import Ring

LEAST_LEVEL, _FEWEST_FRAMES = 1.0, 3
"""Smallest stray light that is reported, grey levels: rounding alone cannot make as much. Fewest frames."""


LIGHT = "ambient_light or codec or halo or interreflection"
ELSE = (
    "light of the line from wall to wall or scattered by the lens, or what a codec retains of the frame "
    "before. What to do: record some frames with laser and LEDs off: other light remains in them"
)


def glow(stray: Sequence[Float], frame: Int, ring: Ring) -> Suspected | None:
    """Return light on the wall away from the line, if at least some frames show it.

    Parameters
    ----------
    stray : sequence of (L, 5)
        Of each frame, for each pattern of stray light: size, level, fall of squares, and the wall's mean
        brightness above places without wall as predicted and beyond that; NaN where a frame sees none.
    frame : (F,)
        Numbers of these laser frames.
    ring
    """
    wall = np.array([sizes[0, 3] + sizes[0, 4] for sizes in stray])
    bright = np.flatnonzero(np.nan_to_num(wall) > LEAST_LEVEL)
    if len(bright) < _FEWEST_FRAMES:
        return None
    # All frames between the first and the last bright one count: the bright ones alone are too bright.
    span = bright[0] + np.flatnonzero(np.isfinite(wall[bright[0] : bright[-1] + 1]))
    level, nan = wall[span], float("nan")
    if level.mean() <= LEAST_LEVEL:
        return None
    first, last = int(frame[span[0]]), int(frame[span[-1]])
    sd = float(level.std(ddof=1) / np.sqrt(len(level)))
    place = tuple(NamedFigure(n, float(f), 0.0) for n, f in (("frame_from", first), ("frame_to", last)))
    said = (
        f"In {len(bright)} of {len(frame)} laser frames that were examined there is light on the wall away "
        f"from the line; from frame {first} to {last} the mean is {level.mean():.1f} grey levels: LEDs "
        f"that are not quite off, other light, {ELSE}."
    )
    size = (NamedFigure("level", float(level.mean()), sd, "grey levels"),)
    found = Mismatch(LIGHT, "intensity", "time", place, size, nan, nan, nan, said, ring.whole(first))
    return Suspected(found, None, frame[span], level[:, None])
