"""Colour of the laser line in colour frames: how its brightness follows the wall's photo in each channel."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from pipeline.arrays import Byte, Float
from stages.twin.reflectance import LUMA_BGR
from stages.twin.scene import LineSight, Scene

FULL_SCALE = 250
"""Grey level of 255 from which a channel counts as clipped: coding changes clipped pixels by a few levels."""
_WIDTHS, _FEWEST_DEGREES, _CUT_OFF = (3.0, 1.0), 30, 3.0
"""Reach about the line, in its widths: all of its light, and its middle. Fewest degrees of azimuth at which a
frame shows it. Chosen. Error of the weights over the difference between both reaches, from colours coded in a
quarter of the pixels: 2.9 in the main channel of four H.264 recordings by another renderer."""
Colour = tuple[Float, Float]
Coloured = Iterable[tuple[int, Byte | None]]
"""Numbers of frames and their colour pictures (H, W, 3); None where one cannot be decoded."""


def line_colour(scene: Scene, frames: Coloured, width_px: float) -> Colour:
    """Return the weights (3,) of the photo's blue, green and red in the line's grey, and their 1 σ.

    ``frames`` yields numbers and colour pictures (H, W, 3) of the laser alone. A channel of the line is the
    laser's light in it times the wall's reflectance there. Grey frames do not show these apart on grey wall.
    Coding colours in fewer pixels mixes those of a thin line with the dark beside it, and cuts off what is
    then negative: by how much the line's middle differs from all of it gives a part of σ. Without any colour
    frame the weights are equal, with infinite σ.
    """
    seen = ((scene.line(scene.pose(n)), image) for n, image in frames if image is not None)
    tried = [[_in_frame(line, image, reach * width_px) for reach in _WIDTHS] for line, image in seen]
    each = np.array([both for both in tried if all(one is not None for one in both)], float)
    if not len(each):
        return np.full(3, 1 / 3), np.full(3, np.inf)
    whole, middle = each.mean(0)
    sd = each[:, 0].std(0, ddof=1) / np.sqrt(len(each)) if len(each) > 1 else np.full(3, np.inf)
    return whole, np.hypot(sd, _CUT_OFF * (whole - middle))


def _in_frame(line: LineSight, image: Byte, reach_px: float) -> Float | None:
    """Return the weights (3,) in one picture (H, W, 3); None if too little of the line can be used."""
    dark = np.median(image[::4, ::4].reshape(-1, 3), 0)  # nearly all pixels see no line
    own = image[line.row, line.column]
    use = (np.abs(line.offset_px) < reach_px) & (own < FULL_SCALE).all(1)
    use &= np.isfinite(line.reflectance).all(0)
    degree = np.floor(np.degrees(line.phi_rad[use]) + 180).astype(int) % 360
    count = np.bincount(degree, minlength=360)
    wall, light = (
        np.stack([np.bincount(degree, c, 360) for c in part])[:, count > 0]
        for part in (line.reflectance[:, use], (own[use] - dark).T)
    )
    main = int(light.sum(1).argmax()) if light.size else 0
    if light.shape[1] < _FEWEST_DEGREES or light[main].sum() <= 0:
        return None
    # The main channel shows how much of the line's light each degree holds, where pixels clip, too: light is
    # to wall as there. Both sides are multiplied out, since wall may be black in that channel.
    shown, made = light * wall[main], wall * light[main]
    grey = LUMA_BGR * np.maximum((shown * made).sum(1) / np.maximum((made**2).sum(1), 1e-9), 0.0)
    return np.asarray(grey / grey.sum()) if grey.any() else None
