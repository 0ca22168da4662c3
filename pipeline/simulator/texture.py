"""The wall's reflectance for the kernels: averaged along the pipe as coarsely as a pixel sees it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.arrays import Float, Float32, Int
from pipeline.simulator.kernel import kernel
from pipeline.simulator.wall.base import Wall

_LEVELS = 6
_SHEEN_NODES = 4097


class Texture(NamedTuple):
    """Reflectance at several resolutions along the pipe, one below the other.

    Attributes
    ----------
    albedo : (rows of all levels, columns + 2, 3) float32
        Each level halves the rows of the one before; a column more on each side.
    first : (levels + 1,)
        Row at which each level begins.
    from_mm, step_mm : float
        Of the finest level's rows.
    sheen : (N,)
        What the wall sends to the camera over what a dull one would, by the cosine, 0 to 1, between its
        normal and the direction halfway between light and camera (Blinn-Phong, normalised).
    """

    albedo: Float32
    first: Int
    from_mm: float
    step_mm: float
    sheen: Float


def texture_of(wall: Wall) -> Texture:
    """Lay a wall's reflectance out for the kernels."""
    wide = np.concatenate([wall.albedo_bgr[:, -1:], wall.albedo_bgr, wall.albedo_bgr[:, :1]], 1)
    levels = [np.ascontiguousarray(wide, np.float32)]
    while len(levels) < _LEVELS and len(levels[-1]) >= 4:
        even = levels[-1][: len(levels[-1]) // 2 * 2]
        levels.append(0.5 * (even[0::2] + even[1::2]))
    first = np.cumsum([0, *(len(level) for level in levels)])
    grid = wall.texture
    cosine = np.linspace(0.0, 1.0, _SHEEN_NODES)
    lobe = (wall.gloss_lobe + 8) / 8 * cosine**wall.gloss_lobe
    sheen = 1 - wall.gloss + wall.gloss * lobe
    return Texture(np.concatenate(levels), first, grid.distance_from_mm, grid.step_mm, sheen)


@kernel
def albedo_at(texture: Texture, s: float, psi: float, footprint_mm: float, out: Float) -> None:
    """Write the reflectance (3,) at a place, averaged over a footprint along the pipe."""
    level = 0.0
    if footprint_mm > texture.step_mm:
        level = np.log2(footprint_mm / texture.step_mm)
    last = texture.first.shape[0] - 2
    k = min(int(level), last)
    w = min(level - k, 1.0)
    _level_at(texture, k, s, psi, 1.0 - w if k < last else 1.0, True, out)
    if w > 0.0 and k < last:
        _level_at(texture, k + 1, s, psi, w, False, out)


@kernel
def _level_at(texture: Texture, k: int, s: float, psi: float, weight: float, fresh: bool, out: Float) -> None:
    """Add one level's reflectance, linear between its samples."""
    top, rows = texture.first[k], texture.first[k + 1] - texture.first[k]
    scale = 1 << k
    y = ((s - texture.from_mm) / texture.step_mm - 0.5 * (scale - 1)) / scale
    y = min(max(y, 0.0), rows - 1.0)
    i = min(int(y), rows - 2)
    columns = texture.albedo.shape[1] - 2
    x = (psi + np.pi) * columns / (2.0 * np.pi) + 0.5
    x -= np.floor((x - 0.5) / columns) * columns
    j = min(max(int(x), 0), columns)
    wy, wx = y - i, x - j
    i += top
    a = texture.albedo
    for c in range(3):
        upper = (1.0 - wx) * a[i, j, c] + wx * a[i, j + 1, c]
        lower = (1.0 - wx) * a[i + 1, j, c] + wx * a[i + 1, j + 1, c]
        value = weight * ((1.0 - wy) * upper + wy * lower)
        out[c] = value if fresh else out[c] + value


@kernel
def sheen_at(texture: Texture, cosine: float) -> float:
    """Return the table's sheen at a cosine, linear between its nodes."""
    x = min(max(cosine, 0.0), 1.0) * (texture.sheen.shape[0] - 1)
    j = min(int(x), texture.sheen.shape[0] - 2)
    return float(texture.sheen[j] + (x - j) * (texture.sheen[j + 1] - texture.sheen[j]))
