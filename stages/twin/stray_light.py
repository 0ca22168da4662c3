"""Light on the wall while the LEDs are off: other light, and light of the line from wall to wall."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Float32
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Scene
from stages.twin.switched import Law, Pair, Shown, inner, on_line

STRAY_NAMES = ("ambient_light", "interreflection", "ambient_light")
"""Of `stray_lights`."""
_OF_MEAN = (0.3, 0.6, 0.3)
"""Share by which the wall's mean brightness may differ from what each of the `stray_lights` predicts from its
pattern. Chosen: simulated light that is even, or the lamps' own, differs by .00 to .08, a glow that is not
exactly light bounced once by .03 to .25; a pattern without light, as a codec leaves it, by all of it."""
_TRIMMED, _LEAST_SPREAD = 4, 0.1
"""Rounds of excluding blocks that differ, and least scatter of blocks, grey levels."""
_SURE = 3.0
"""σ by which brightness must agree with a pattern, and beyond which blocks differ from it."""
_ANGLE_RAD, _MOST_PALE = 0.05, 3.0
"""Step of polar angle within which the light changes by a few per cent, and the largest ratio of a place to
the mean at its angle: more is not reflectance but an angle at which hardly any wall is seen."""


def stray(which: int) -> Law:
    """Return the law of the stray light with this index in `stray_lights`."""

    def law(shown: Shown, size: Float) -> Pair:
        lit, line = shown.lit(), _dilated(on_line(shown.twin))
        column = stray_lights(shown.scene, shown.twin, lit)[which]
        use = inner(~line & (lit.region == Region.WALL) & shown.free)
        level = shown.twin.level
        return Pair(level, level + np.float32(size[which]) * column, use, "offset")

    return law


def stray_lights(scene: Scene, twin: TwinFrame, lit: TwinFrame) -> tuple[Float32, Float32, Float32]:
    """Return light (H, W) on the wall while the LEDs are off, up to factors; see `STRAY_NAMES`.

    First light distributed like the LEDs', then light of the line from wall to wall, then uniform light,
    which is brighter on paler wall only.
    """
    paler = np.minimum(lit.level / _at_angle(scene.polar[0], lit), _MOST_PALE)
    bounced = np.nan_to_num(_once_bounced(scene, twin, lit)) * paler
    return lit.level, np.asarray(bounced, np.float32), np.asarray(100 * paler, np.float32)


def _once_bounced(scene: Scene, twin: TwinFrame, lit: TwinFrame) -> Float32:
    """Return the line's light (H, W) after one reflection in a round bore of uniform reflectance."""
    on = twin.distance_mm[twin.region == Region.LINE_CORE]
    middle = float(np.nanmedian(on)) if len(on) else np.nan
    x = np.abs(lit.distance_mm - np.float32(middle)) / np.float32(2 * scene.surface.mean_radius_mm)
    return np.asarray(100 * (1 - x * (2 * x**2 + 3) / (2 * (x**2 + 1) ** 1.5)), np.float32)


def _at_angle(theta_rad: Float32, lit: TwinFrame) -> Float32:
    """Return the mean level (H, W) of lit wall at the same polar angle: the effect of lamps and lens."""
    some = (slice(None, None, 4),) * 2
    wall, theta = lit.region[some] == Region.WALL, np.nan_to_num(theta_rad[some])
    cell = (theta[wall] / _ANGLE_RAD).astype(int)
    count = np.bincount(cell, minlength=2)
    mean = np.bincount(cell, lit.level[some][wall], len(count)) / np.maximum(count, 1)
    at = np.interp(np.nan_to_num(theta_rad), (np.arange(len(mean)) + 0.5) * _ANGLE_RAD, mean)
    return np.maximum(at, 1.0).astype(np.float32)


def _dilated(use: Bool) -> Bool:
    return np.asarray(cv2.dilate(use.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0)


def brings_light(law: int, mean: Float, more: Float) -> bool:
    """Return whether the wall is as bright as an effect's pattern on it predicts.

    ``mean`` (F,) is predicted, ``more`` the wall's brightness beyond that; NaN in frames that see no place
    without wall, from which black is known. A pattern without light does not count: a codec leaves some.
    """
    known = np.isfinite(more)
    if known.sum() < 2:
        return False
    sd = float(np.std(more[known], ddof=1) / np.sqrt(known.sum()))
    return abs(float(more[known].mean())) + _SURE * sd < _OF_MEAN[law] * abs(float(mean[known].mean()))


def size_beside_one(value: Float, column: Float) -> Float:
    """Return the size of a column (N,) fitted beside a constant, its 95 % quantile, and the fall of squares.

    Then its mean level, and the brightness that remains beside it.
    """
    use, size, c = np.ones(len(value), bool), 0.0, column
    for _ in range(_TRIMMED):  # a second line or a glint is not light on the wall
        c = (column - column[use].mean()) * use
        size = float(c @ (value - value[use].mean())) / max(float(c @ c), 1e-9)
        rest = value - size * column
        away = np.abs(rest - np.median(rest))
        use = away < _SURE * max(robust_spread(away), _LEAST_SPREAD)
    mean = size * float(column[use].mean())
    more = float(value[use].mean()) - mean
    return np.array([size, float(np.quantile(column, 0.95)), size**2 * float(c @ c), mean, more])
