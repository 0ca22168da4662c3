"""Effects on the whole picture applied to frames rendered again: grey levels without and with each.

Sizes come from other frames. Where an effect needs a nuisance parameter of the frame itself (the direction of
its motion), one half of the picture determines it for the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from pipeline.arrays import Bool, Float, Float32
from stages.twin.lamp_light import Figure, LampLight
from stages.twin.laws import dim_share
from stages.twin.line_light import LineLight
from stages.twin.render import Region, TwinFrame
from stages.twin.scene import Scene

TILE, STEP = 16, 2
"""Side of the tiles that divide a picture into halves, in units of every second pixel."""
BLOOM_PX, _NEAR = 6.0, 0.02
"""Distance along a column over which bloom falls to 1/e, px, and the smallest spread that is examined."""
IN_FOCUS_PX = 1.2
"""Largest 1 σ of lens and pixel, px, for lenses in focus: a pixel's own is 0.29, and a spot two pixels wide
at half height has 0.85."""
_NEAREST_RAD, _THETAS = 0.2, 12
"""Least polar angle at which the share of an LED is computed, and number of angles."""
_NODES = ((-1.732051, 1 / 6), (0.0, 2 / 3), (1.732051, 1 / 6))
"""Gauss-Hermite nodes: three displacements whose mean blurs like a Gaussian, exact to the fifth power of its
width. Two rounds of them make nine."""
_ON_RING = 0.05
"""Share of a second ring's peak above which pixels belong to it."""


@dataclass(frozen=True)
class Shown:
    """A recorded frame beside its twin.

    Attributes
    ----------
    above : (H, W) float32
        Recorded grey levels above black.
    twin : TwinFrame
        With the exposure of the frame.
    free : (H, W) bool
        Pixels that are not clipped.
    scene : Scene
    again : callable
        Renders the frame, at its exposure, with other attributes of the photometric state.
    lit : callable
        Renders the frame as the LEDs would show it.
    direction : (2, 2) float
        Cosine and sine of twice the direction of the frame's blur, from each half of the picture.
    number : int
        Frame number.
    """

    above: Float32
    twin: TwinFrame
    free: Bool
    scene: Scene
    again: Callable[..., Float32]
    lit: Callable[[], TwinFrame]
    direction: Float
    number: int = -1

    @property
    def wall(self) -> Bool:
        """(H, W) pixels of lit wall, away from its borders."""
        return inner(self.free & (self.twin.region == Region.WALL))


@dataclass(frozen=True)
class Pair:
    """Grey levels (H, W) without and with an effect, and the pixels that count.

    ``free_of`` is what is fitted freely in both before they are judged: ``scale`` the exposure, ``offset`` a
    constant.
    """

    without: Float32
    with_it: Float32
    use: Bool
    free_of: str = ""


Law = Callable[[Shown, Float], Pair]


def motion_blur(shown: Shown, size: Float) -> Pair:
    """Return a frame that moved during its exposure; ``size`` is σ, px, and 1 for motion along the pipe."""
    sigma, even = float(size[0]), shown.again(sharpness=None)
    phi = shown.scene.polar[1]
    made = np.empty_like(even)
    half = halves(even.shape)
    for h in (0, 1):
        if size[1]:
            c, s = np.cos(phi), np.sin(phi)
        else:
            angle = 0.5 * np.arctan2(shown.direction[1 - h, 1], shown.direction[1 - h, 0])
            c, s = (np.full(even.shape, f(angle), np.float32) for f in (np.cos, np.sin))
        made = np.where(half == h, smeared(even, c, s, sigma), made)
    return Pair(shown.twin.level, made, shown.wall, "scale")


def smeared(level: Float32, c: Float32, s: Float32, sigma: float) -> Float32:
    """Return a picture (H, W) blurred by 1 σ ``sigma``, px, along directions of cosine and sine (H, W)."""
    v, u = np.mgrid[0 : level.shape[0], 0 : level.shape[1]].astype(np.float32)
    step = np.float32(sigma / np.sqrt(2))
    for _ in range(2):
        made = np.zeros_like(level)
        for away, weight in _NODES:
            d = np.float32(away) * step
            moved = cv2.remap(level, u + d * c, v + d * s, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
            made += np.float32(weight) * moved
        level = made
    return level


def halves(shape: tuple[int, ...]) -> Float32:
    """Return the half, 0 or 1, that each pixel of a picture belongs to: alternating tiles."""
    row, column = ((np.arange(n) - STEP) // (STEP * TILE) for n in shape)
    return np.asarray((row[:, None] + column) % 2)


def defocus(shown: Shown, size: Float) -> Pair:
    """Return a frame blurred in all directions; ``size`` is half the blur's variance, px²."""
    plain = shown.again(sharpness=None)
    sigma = float(np.sqrt(2 * max(size[0], 1e-3)))
    blurred = np.asarray(cv2.GaussianBlur(plain, (0, 0), sigma), np.float32)
    return Pair(plain, blurred, shown.wall, "scale")


def response(shown: Shown, size: Float) -> Pair:
    """Return a frame whose wall has the photo's contrast raised to the power ``size``."""
    return Pair(shown.twin.level, shown.again(power=float(size[0])), shown.wall, "scale")


def bloom(shown: Shown, size: Float) -> Pair:
    """Return a frame with the leak from clipped pixels along columns, beside as much isotropic glow.

    ``size`` is what leaks along columns and along rows, grey levels.
    """
    along, across = leaked(shown.free)
    beside = np.isin(shown.twin.region, (Region.DARK, Region.WALL))
    use = shown.free & beside & (along + across > _NEAR)
    level, even = shown.twin.level, np.float32(size.mean())
    with_it = level + np.float32(size[0]) * along + np.float32(size[1]) * across
    return Pair(level + even * (along + across), with_it, use)


def leaked(free: Bool) -> tuple[Float32, Float32]:
    """Return exp(−distance / 6 px) (H, W) to clipped pixels along columns, and along rows."""
    reach = np.arange(-int(4 * BLOOM_PX), int(4 * BLOOM_PX) + 1)
    tail, one = np.exp(-np.abs(reach) / BLOOM_PX), np.ones(1)
    full, tail = (~free).astype(np.float32), tail / tail.sum()
    along, across = (cv2.sepFilter2D(full, -1, *k) for k in ((one, tail), (tail, one)))
    return np.asarray(along, np.float32), np.asarray(across, np.float32)


def second_line(shown: Shown, size: Float) -> Pair:
    """Return a frame with the line repeated; ``size`` is its share and its place, as for `ratio_around`."""
    level = shown.twin.level
    copy = _copied(shown, size[1:])
    use = shown.free & (copy > _ON_RING * copy.max()) & (shown.twin.region == Region.DARK)
    return Pair(level, level + np.float32(size[0]) * copy, use)


def share_of_second(shown: Shown, size: Float) -> float:
    """Return the brightness of the second ring in a frame, relative to the line.

    Recorded frame and twin are fitted with the same profile, each free to be slightly displaced.
    """
    copy, line = _copied(shown, size[1:]), shown.twin.level
    dark = shown.free & (shown.twin.region == Region.DARK) & (copy > _ON_RING * copy.max())
    own = shown.free & (shown.twin.region == Region.LINE_CORE)
    sizes = [_size_at_place(shown, basis, use) for basis, use in ((copy, dark), (line, own))]
    return sizes[0] / max(sizes[1], 1e-9)


def _size_at_place(shown: Shown, basis: Float32, use: Bool) -> float:
    """Return the size of a ring's picture (H, W), fitted together with a small radial displacement."""
    phi, weight = shown.scene.polar[1][use], 1 / np.sqrt(shown.twin.variance[use])
    down, right = (np.asarray(np.gradient(basis, axis=k)) for k in (0, 1))
    outward = np.cos(phi) * right[use] + np.sin(phi) * down[use]
    columns = np.stack([basis[use], outward, np.ones(int(use.sum()), np.float32)]) * weight
    return float(np.linalg.lstsq(columns.T, shown.above[use] * weight, rcond=None)[0][0])


def _copied(shown: Shown, place: Float) -> Float32:
    """Return the line's light (H, W) as a ring at a ``place`` (3,), as for `ratio_around`."""
    (u, v), shape = shown.scene.ring.centre_px, shown.twin.level.shape
    row, column = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    back = np.float32(1) / ratio_around(place, shown.scene.polar[1])
    at_u, at_v = (np.float32(c) + back * (x - np.float32(c)) for c, x in ((u, column), (v, row)))
    line = np.where(on_line(shown.twin), shown.twin.level, np.float32(0))
    return np.asarray(cv2.remap(line, at_u, at_v, cv2.INTER_LINEAR), np.float32)


def ratio_around(place: Float, phi_rad: Float32) -> Float32:
    """Return the radius of a second ring over the line's at image azimuths.

    ``place`` (3,) is the mean of the ratio's logarithm, and what varies with the cosine and the sine: a ghost
    of a window that is askew is displaced, and so is a mirror image in a probe that is.
    """
    mean, cosine, sine = place.astype(np.float32)
    return np.asarray(np.exp(mean + cosine * np.cos(phi_rad) + sine * np.sin(phi_rad)), np.float32)


def lamp_pattern(shown: Shown, size: Float) -> Pair:
    """Return a frame in the light of lamps that shine unevenly, beside one in even light."""
    return Pair(shown.again(lamp=_even), shown.twin.level, shown.wall, "scale")


def dim_led(shown: Shown, size: Float) -> Pair:
    """Return a frame whose LED at an azimuth sends less light, beside even light; ``size``: loss, azimuth."""
    even, scene = shown.again(lamp=_even), shown.scene
    share = share_at(scene, float(size[1]), *scene.polar[:2])
    return Pair(even, even * (1 - np.float32(size[0]) * share), shown.wall, "scale")


def share_at(scene: Scene, azimuth_rad: float, theta_rad: Float32, phi_rad: Float32) -> Float32:
    """Return an LED's share of the light at polar angles and image azimuths, both of one shape."""
    theta = np.linspace(_NEAREST_RAD, np.pi / 2, _THETAS)
    share = dim_share(scene.probe.lighting, azimuth_rad, scene.ring.radius_mm, theta).mean(0)
    wrapped = np.concatenate([share[:, -1:], share, share[:, :1]], 1)
    column = (phi_rad / (2 * np.pi) + 0.5) * share.shape[1] + 0.5
    row = (np.nan_to_num(theta_rad) - theta[0]) / (theta[1] - theta[0])
    found = map_coordinates(wrapped.astype(np.float32), [row, column], order=1, mode="nearest")
    return np.asarray(found, np.float32)


def _even(lamp: LampLight) -> LampLight:
    return replace(lamp, pattern=np.zeros_like(lamp.pattern))


def wide_line(shown: Shown, size: Float) -> Pair:
    """Return a frame with the line as wide as measured, beside one with the line of a lens in focus."""
    sharp = shown.again(line=_in_focus)
    return Pair(sharp, shown.twin.level, shown.free & on_line(shown.twin), "scale")


def _in_focus(line: LineLight) -> LineLight:
    return replace(line, blur_px=Figure(IN_FOCUS_PX, 0.0))


def on_line(twin: TwinFrame) -> Bool:
    """Return pixels (H, W) that show the line."""
    return np.asarray((twin.region == Region.LINE_CORE) | (twin.region == Region.LINE_FLANK))


def inner(use: Bool) -> Bool:
    """Return pixels (H, W) whose neighbours within two pixels are all in use."""
    return np.asarray(cv2.erode(use.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0)
