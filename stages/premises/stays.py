"""Finds places of the picture where something stays while the wall moves.

Burnt-in text and logos, dirt and reflections on the window, lamps and parts of the probe keep their place in
the picture. If motion followed them, the wall would seem to stand still.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Bool, Byte, Float, Float32, Image, Int
from pipeline.instrument.camera import Camera
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.recording.base import Illumination, Recording
from pipeline.system.parallel import in_threads

_LOOKED_AT = 40
"""Lit pictures, spread over the run, that are examined. With 24, the same text was found in open-1-field."""
_HEIGHT_PX = 600
"""Pictures are reduced by a whole factor to about this height: motion takes finer detail for noise."""
_FARTHEST_DEG, _NEAREST_DEG = 35.0, 80.0
"""Polar angles between which the wall is examined; the stage motion uses the same."""
_EVERY = 4
"""Of so many pixels of the reduced picture, each way, one is unprojected; others are interpolated."""
_FINE, _CELL, _BOX, _GAP = 4 / 600, 16 / 600, 9 / 600, 15 / 600
"""In heights of the picture: σ of the blur against which contrast is taken, size of the cells in which motion
is detected, size of the box over which what stays is summed, and gap between two places that count as one. A
choice: a patch that motion tracks is some 20/600 high."""
_STILL = 0.15
"""Correlation, in the median cell, with the picture before, above which the wall did not move. It is below
`_STAYS`, so that a noisy picture of a wall at rest is not taken for things that stay on a moving one."""
_FEWEST = 12
"""Fewest pictures with a moved wall: the mean of 12 still contains 1/12 of the moving wall's power."""
_STAYS = 0.3
"""Share of the power of contrast that stays, from which a place counts: in open-1, 2 and 3 the 999th of 1000
places shows .02 to .13, burnt-in text .98."""
_FAINTEST = 0.02
"""Contrast that stays and is fainter is no harm: a third of what an open recording's wall has."""
_MOST = 0.5
"""If more than half would count, the wall cannot be distinguished from what stays."""
_DARK = 8.0
"""Grey values added where contrast is taken, so that black has none. Not measured."""
_BLUE, _RED = 0, 2
_YELLOW_NM = 575.0
"""Lasers of a shorter wavelength reach the red channel least, others the blue one."""
_THREADS = 2
_WORTH_A_WORD = 0.01
"""Least share of the wall's picture that is reported: no open recording has any."""


def find_static_places(
    recording: Recording, probe: Probe, lit: Int, context: Context, line_px: Float | None = None
) -> Bool | None:
    """Return where something stays (h, w), on the picture reduced by a whole factor, or None; warn of it.

    Parameters
    ----------
    lit : (N,) int
        Frames that show the wall; with the laser on, the colour channel that its light reaches least is used.
    line_px : (R,) float
        Usual radius of the laser line on rays of equal spacing from -π on. The line stays too where the laser
        is on in lit pictures: it is left out of the warning.
    """
    both = bool(np.any(recording.frames.illumination == Illumination.BOTH.value))
    wall, channel = _wall_in(probe.camera), darkest_channel(probe.laser)
    few = recording.read(lit[:: max(-(-len(lit) // _LOOKED_AT), 1)], "bgr" if both else "grey")
    seen = (image for _, image in few if image is not None)
    places = static_places((np.ascontiguousarray(i[..., channel]) for i in seen) if both else seen, wall)
    told = places & ~_on_line(probe.camera, line_px, wall) if both and line_px is not None else places
    share = float(told.sum() / max(wall.sum(), 1))
    context.report("picture that stays while the wall moves", 100 * share, "%")
    if share > _WORTH_A_WORD:
        context.warn(
            f"{100 * share:.1f} % of the picture of the wall stays in place while the wall moves: burnt-in "
            "text or a logo, dirt, scratches or reflections on the window, a part of the probe, or the rim "
            "of the lens's picture. Motion does not use it, but it hides the wall. What to do: switch the "
            "text off, clean the window"
        )
    return places if places.any() else None


def _on_line(camera: Camera, line_px: Float, wall: Bool) -> Bool:
    """Return where (h, w) a laser line of radius (R,) may be taken for something that stays."""
    by = camera.image_size[1] // wall.shape[0]
    v, u = np.mgrid[: wall.shape[0], : wall.shape[1]]
    x, y = (u + 0.5) * by - 0.5 - camera.centre_px[0], (v + 0.5) * by - 0.5 - camera.centre_px[1]
    rays = np.linspace(-np.pi, np.pi, len(line_px), endpoint=False)
    line = np.interp(np.arctan2(y, x), rays, line_px, period=2 * np.pi)
    return np.asarray(np.abs(np.hypot(x, y) - line) < (_BOX + _GAP) * min(wall.shape) * by)


def in_full(stays: Bool | None, image_size: tuple[int, int]) -> Byte | None:
    """Return places (h, w) of the reduced picture on the whole one (H, W): 1 where something stays."""
    if stays is None:
        return None
    whole = cv2.resize(stays.astype(np.uint8), image_size, interpolation=cv2.INTER_NEAREST)
    return np.asarray(whole, np.uint8)


def darkest_channel(laser: LaserSheet) -> int:
    """Return the colour, of blue, green and red, that a laser's light reaches least."""
    return _RED if laser.wavelength_nm < _YELLOW_NM else _BLUE


def static_places(images: Iterable[Image], wall: Bool) -> Bool:
    """Return where (h, w) something stays in grey pictures (H, W), while the ``wall`` (h, w) moves."""
    last, count = None, 0
    total, power = (np.zeros(wall.shape, np.float32) for _ in range(2))
    on_wall = _cells(wall.astype(np.float32)) > 0.5
    for fine in in_threads(lambda image: _Fine.of(image, wall.shape), images, _THREADS):
        if last is None or _moved(last, fine, on_wall):
            total, power, last, count = total + fine.contrast, power + fine.squared, fine, count + 1
    if count < _FEWEST:
        return np.zeros_like(wall)
    steady = (total / count) ** 2
    moving = (power / count - steady) * (count / (count - 1))
    box, gap = (_odd(part, wall.shape) for part in (_BOX, _GAP))
    stays, varies = (cv2.blur(p, (box, box)) for p in (steady - moving / count, moving))
    places = (stays > _STAYS * (stays + varies)) & (stays > _FAINTEST**2) & wall
    joined = cv2.morphologyEx(places.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((gap, gap)))
    places = (joined > 0) & wall
    return places if places.sum() <= _MOST * wall.sum() else np.zeros_like(places)


def _wall_in(camera: Camera) -> Bool:
    """Return where (h, w), on the reduced picture, the wall is examined."""
    width, height = camera.image_size
    by = max(round(min(width, height) / _HEIGHT_PX), 1)
    w, h = width // by, height // by
    v, u = np.mgrid[:h:_EVERY, :w:_EVERY] + _EVERY / 2
    z = camera.unproject(np.stack([u, v], -1) * by - 0.5).ray[..., 2].astype(np.float32)
    fine = cv2.resize(z, None, fx=_EVERY, fy=_EVERY, interpolation=cv2.INTER_LINEAR)[:h, :w]
    near, far = np.cos(np.radians([_NEAREST_DEG, _FARTHEST_DEG]))
    return np.asarray((fine > near) & (fine < far))


@dataclass(frozen=True)
class _Fine:
    """The fine contrast (h, w) of a picture, its square, and the mean square of each cell."""

    contrast: Float32
    squared: Float32
    power: Float32

    @staticmethod
    def of(image: Image, shape: tuple[int, ...]) -> _Fine:
        """Return the contrast of a picture (H, W), reduced to a ``shape``."""
        grey = cv2.resize(image, shape[::-1], interpolation=cv2.INTER_AREA).astype(np.float32)
        light = cv2.GaussianBlur(grey, (0, 0), _FINE * min(shape))
        contrast = np.asarray((grey - light) / (light + _DARK), np.float32)
        squared = contrast * contrast
        return _Fine(contrast, squared, _cells(squared))


def _cells(picture: Float32) -> Float32:
    """Return the mean of each cell of a picture (h, w)."""
    cell = _odd(_CELL, picture.shape)
    size = (picture.shape[1] // cell, picture.shape[0] // cell)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)


def _moved(before: _Fine, now: _Fine, on_wall: Bool) -> bool:
    """Return whether most cells ``on_wall`` of two pictures differ."""
    both = _cells(before.contrast * now.contrast)
    correlation = (both / np.sqrt(before.power * now.power + 1e-12))[on_wall]
    return bool(correlation.size and np.median(correlation) < _STILL)


def _odd(part: float, shape: tuple[int, ...]) -> int:
    """Return a part of the picture's height as an odd number of pixels."""
    return 2 * round(part * min(shape) / 2) + 1
