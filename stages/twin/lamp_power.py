"""Fit brightness = light^p over frames: p differs from 1 for a nonlinear response or for bounced light.

Lamps that come nearer to one side of the bore brighten it by the inverse square of their distance. Frames in
which the same wall, and the same place of the image, is lit more or less strongly show the power p by which
brightness follows that light: 1 for a linear camera and direct light. A response grey = light^p gives p
itself, whatever the photo was made with. Light that bounces about the bore hardly changes when the lamps
move: a share q of it gives 1 − q. The lamps' lobe depends mostly on the place in the image and has little
influence; it is taken to be uniform, and that error is part of σ.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.polynomial.polynomial import polyvander2d
from scipy.stats import t

from pipeline.arrays import Float, Float32, Int
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.gate import Suspected
from stages.twin.locate import FALSE_ALARM, full_size
from stages.twin.reference import BlockSamples
from stages.twin.scene import Ring
from stages.twin.significance import ratio_over_frames
from stages.twin.switched import Pair, Shown

_LEAST, _SURE = 0.25, 3.0
"""Smallest reported departure of the power from 1, and the number of its σ: a pale bore throws back some
tenths of its light, and the effect of the lamps' lobe and of gloss is below a tenth."""
_OF_LIGHT, _BY_COSINE, _FEWEST_FRAMES = 0.02, 0.04, 6
"""1 σ of a power because the black level is uncertain: one grey level in fifty changes it by this much. By
how much LEDs that emit as the cosine raise it compared with uniform ones: by .032 to .051 in five simulated
recordings in bores of 76 and 102 mm, and by .052 RMS for ten rings of LEDs, 11 and 16 mm wide, 8 mm behind to
5 mm ahead of the camera. It counts as 1 σ, since the lobe of a probe's LEDs is unknown; bounced light is not
part of it. Fewest lit frames."""
_SLOWLY = 3
"""Degree of the polynomial in row and column that describes slowly varying light: for lamps aside it is
mostly linear."""
_LEAST_WANDER = 1e-3
"""Smallest change of light, RMS, from which a power can be measured: a probe that stays centred shows less.
Chosen."""


def lamp_power(samples: BlockSamples | None) -> tuple[NamedFigure, ...]:
    """Return the power by which brightness follows the lamps' light; nothing with too few frames."""
    if samples is None or samples.frame.max() + 1 < _FEWEST_FRAMES:
        return ()
    each = _products(samples)
    if each[:, 1].sum() < _LEAST_WANDER**2 * len(samples.change):
        return ()
    more, spread = ratio_over_frames(each, len(each))
    return (NamedFigure("lamp_power", 1 + more, float(np.linalg.norm([spread, _OF_LIGHT, _BY_COSINE]))),)


def _power(sums: Float) -> Float:
    """Return the power (1,) from the sums (2,) of `_products`, for use as ``size_of``."""
    return np.array([1 + sums[0] / sums[1]])


def power_of_lamps(samples: BlockSamples | None, ring: Ring) -> tuple[Suspected, ...]:
    """Return the finding that brightness follows the lamps' light by a power other than 1, if it does."""
    figure = lamp_power(samples)
    if samples is None or not figure:
        return ()
    each, power, sd = _products(samples), figure[0].value, figure[0].sd
    chance = float(2 * t.sf(abs(power - 1) / max(sd, 1e-9), len(each) - 1))
    if abs(power - 1) < max(_LEAST, _SURE * sd) or chance > FALSE_ALARM:
        return ()
    nan, name = float("nan"), "response" if power > 1 else "response or interreflection"
    said = (
        f"Where the lamps come nearer, the wall brightens by their light to the power {power:.2f} ± {sd:.2f}:"
        f" the camera's response is grey = light^{power:.2f}"
    )
    said += "." if power > 1 else f", or {100 * (1 - power):.0f} % of the light has bounced about the bore."
    found = Mismatch(
        name, "intensity", "image", (), (NamedFigure("exponent", power, sd),), chance, nan, nan, said,
        ring.whole(int(samples.number[0])),
    )  # fmt: skip
    law = partial(to_power, samples.number, by_block(samples, samples.light_and_brightness[0]))
    return (Suspected(found, law, samples.number, each, _power),)


def _products(samples: BlockSamples) -> Float:
    """Return for each frame (F, 2) the sums of slow light × brightness and of slow light²."""
    light, bright = _slowly(samples), samples.light_and_brightness[1]
    frames = samples.frame.max() + 1
    return np.stack([np.bincount(samples.frame, light * a, frames) for a in (bright, light)], 1)


def _slowly(samples: BlockSamples) -> Float:
    """Return the slowly varying part of the blocks' light (N,) over that in their photo."""
    light, out = samples.light_and_brightness[0], np.zeros(len(samples.frame))
    x, y = (2 * a / max(int(a.max()), 1) - 1 for a in (samples.column, samples.row))
    order = np.add.outer(range(_SLOWLY + 1), range(_SLOWLY + 1)).ravel()
    terms = polyvander2d(x, y, [_SLOWLY, _SLOWLY])[:, order <= _SLOWLY]
    for frame in range(int(samples.frame.max()) + 1):
        own = samples.frame == frame
        out[own] = terms[own] @ np.linalg.lstsq(terms[own], light[own], rcond=None)[0]
    return out


def by_block(samples: BlockSamples, values: Float) -> Float32:
    """Return values (N,) of blocks as maps (F, rows, columns) of frames; 0 where there is no block."""
    out = np.zeros((samples.frame.max() + 1, samples.row.max() + 1, samples.column.max() + 1), np.float32)
    out[samples.frame, samples.row, samples.column] = values
    return out


def to_power(number: Int, log_light: Float32, shown: Shown, size: Float) -> Pair:
    """Return a frame whose light, relative to that in its photo, is raised to a power.

    Parameters
    ----------
    number : (F,)
        Frame numbers.
    log_light : (F, rows, columns)
        Logarithm of the blocks' light over that in the photo.
    shown : Shown
    size : (1,)
        1 plus the power: 1 leaves the frame as it is.
    """
    level, own = shown.twin.level, int(np.searchsorted(number, shown.number))
    more = full_size(log_light[own], level.shape, 0.0)
    return Pair(level, level * np.exp(np.float32(size[0] - 1) * more), shown.wall, "scale")
