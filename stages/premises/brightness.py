"""Pictures whose dark parts are not dark, as in fog, and pictures whose brightness swings."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Bool, Float, Image, Int
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.recording.base import Recording
from pipeline.recording.decoded_once import read_luma
from stages.premises.light import Light
from stages.premises.pictures import PolarView

# So many pictures of each light are looked at; of fewer than the least nothing is said (chosen).
_MOST, _LEAST = 40, 8
# Share of a picture that is dark in every good recording: the far end of the pipe.
_DARK = 0.02
# Brightness beside the laser line over its height. Real rings (pipeblaser_cmu) have .013 at most, mist that
# takes away half of the light .45 (open-1 and open-2): the geometric middle.
_MOST_BESIDE_LINE = 0.08
# Darkest part of a lit picture over its mean. Real lit pipes (pipeblaser_cmu) have .037 at most, open-1 and
# open-3 in such mist .26: the geometric middle.
_MOST_AHEAD = 0.1
# Factor between the brightest and the darkest of nine in ten pictures. Nine good recordings (open and blind)
# have 1.03 to 1.35, exposure that swings by 40 % to either side 2.3.
_MOST_SWING = 1.6


def warn_of_brightness(recording: Recording, probe: Probe, light: Int, context: Context) -> None:
    """Warn of pictures that are veiled, and of brightness that swings, in the ``light`` (F,) they show."""
    polar = PolarView(recording.source.image_size, probe.camera.centre_px)
    line, wall = (_looked_at(recording, polar, light == kind) for kind in (Light.LINE, Light.WALL))
    if len(line) >= _LEAST:
        _warn_of_veil(line[:, 0] / line[:, 2], _MOST_BESIDE_LINE, "beside the laser line", context)
    elif len(wall) >= _LEAST:
        _warn_of_veil(wall[:, 1] / wall[:, 0], _MOST_AHEAD, "at the far end of the pipe", context)
    _warn_of_swing(line[:, 2], "the laser line", context)
    _warn_of_swing(wall[:, 0], "the lit wall", context)


def _looked_at(recording: Recording, polar: PolarView, like: Bool) -> Float:
    """Return of pictures in one light (N, 3): mean and darkest without line, and the line's height."""
    frames = recording.frames.frame[like]
    few = frames[:: max(-(-len(frames) // _MOST), 1)]
    seen = [_measured(polar, luma) for _, luma in read_luma(recording, few) if luma is not None]
    return np.array(seen).reshape(-1, 3)


def _measured(polar: PolarView, luma: Image) -> tuple[float, float, float]:
    """Return mean and darkest grey level without thin lines, and the line's height, one or more."""
    wall, line = polar.wall_and_line(luma)
    height = float(np.median(line.max(1)))
    return max(float(wall.mean()), 1.0), float(np.quantile(wall, _DARK)), max(height, 1.0)


def _warn_of_veil(share: Float, most: float, where: str, context: Context) -> None:
    veil = float(np.median(share))
    context.report("brightness of what should be dark", veil, "relative")
    if veil > most:
        context.warn(
            f"pictures are not dark {where}: it is {100 * veil:.0f} % as bright there as where light is "
            f"measured (good recordings: {100 * most:.0f} % at most). Fog, a dirty window or daylight veils "
            "the wall: fine texture and small defects may be missed. What to do: look at these pictures; "
            "clean the window, wait until the air is clear"
        )


def _warn_of_swing(value: Float, what: str, context: Context) -> None:
    """Warn where nine in ten values (N,) differ by too large a factor."""
    if len(value) < _LEAST:
        return
    dark, bright = np.quantile(value, [0.05, 0.95])
    if bright > _MOST_SWING * dark:
        context.warn(
            f"{what} is {bright / dark:.1f} times as bright in some pictures as in others (good recordings: "
            "1.4 times at most): exposure or gain is automatic, a lamp flickers, or the wall changes so "
            "much. Dark pictures are noisier. What to do: set exposure and gain by hand"
        )
