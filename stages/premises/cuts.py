"""Finds places where a picture does not continue the one before: recordings cut, joined or paused there."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter

from pipeline.arrays import Bool, Float, Int
from pipeline.machine.stage import Context
from stages.premises.light import Light
from stages.premises.pictures import Pictures

# At a cut the wall's picture changes this many times as much as in any step around it. Two joined runs make
# 3.0, 2.1 and 2.0 (open-1 to open-3), 8 lost pictures 1.4, everything else in 90 spoilt copies of open-1 at
# most 1.1; the bound is the middle between 1.4 and 2.0. Failing lamps change more, but texture goes on.
_CHANGES = 1.7
# Texture continues if the wall's step differs from the usual one by less than this many usual steps.
_CONTINUES = 3.0
# Eight steps on either side, with which one is compared, and fewest of them in a recording.
_BESIDE, _FEWEST = np.arange(-8, 9) != 0, 12


def cuts(pictures: Pictures, shown: Int, left_out: Bool, time_s: Float) -> Int:
    """Return the places (K,) of lit pictures whose wall is not that of the picture before them.

    Parameters
    ----------
    shown, left_out, time_s : (F,)
        `Light` of each picture, whether it is left out, and its time. A gap in the times is no cut: there
        pictures are known to be missing, and the encoder shows how far the probe went. Yet it is a step that
        others are compared with: of a hand-pulled probe, stamped with varying times, only the short ones had
        no gap, and the longest of these was told as a cut.
    """
    place = np.flatnonzero((pictures.partner >= 0) & (shown == Light.WALL) & ~left_out)
    before = pictures.partner[place]
    lit = (shown[before] == Light.WALL) & np.isfinite(pictures.change[place])
    place, before = place[lit], before[lit]
    if len(place) < _FEWEST:
        return np.empty(0, np.int64)
    same = time_s[place] - time_s[before] < (place - before + 0.5) * np.median(np.diff(time_s))
    if same.sum() < _FEWEST:
        return np.empty(0, np.int64)
    change, step = pictures.change[place], pictures.step[place]
    usual = np.nanmedian(step[same]) if np.any(np.isfinite(step[same])) else np.nan
    continues = np.abs(step - usual) < _CONTINUES * np.abs(usual)
    beside = maximum_filter(change, footprint=_BESIDE, mode="nearest")
    return np.asarray(place[same & (change > _CHANGES * beside) & ~continues])


def warn_of_cuts(place: Int, pictures: Pictures, frame: Int, context: Context) -> None:
    """Warn between which of the frames (F,) the recording was cut: before ``place`` (K,) of `cuts`."""
    for k in place:
        context.warn(
            f"frame {frame[k]} does not continue the wall of frame {frame[pictures.partner[k]]}: the picture "
            "changes much more than in any step around, and no texture is common to both. Probably the "
            "recording was cut or paused here, or two were joined. The distance travelled in between is "
            "unknown: distances from here on are wrong by it. Their σ is a guess: the length of the run, or "
            "of the pipe that one picture shows if that is longer. Laser, encoder or pipe may seem to jump. "
            "What to do: process the two parts as separate recordings"
        )
