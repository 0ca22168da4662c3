"""The photometric state of a run, from frames that its measurement used."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.machine.stage import Context
from pipeline.recording.base import Illumination, Recording
from stages.twin.burnt_in import burnt_in
from stages.twin.fixed_pattern import FixedPattern, fixed_pattern
from stages.twin.lamp_light import LampLight, LampSamples
from stages.twin.line_colour import FULL_SCALE, Coloured, line_colour
from stages.twin.line_light import LineLight, LineSamples
from stages.twin.noise import CameraNoise, black_and_white, photon_transfer, windows_of
from stages.twin.scene import LitSight, Scene

_LEAST_LEVEL = 4.0
"""Grey levels above black below which lit wall is not used."""
_USUAL_WIDTH_PX = 1.2
_ZONES = 4
_MOST_CLIPPED = 0.25
"""Share of the line's middle: if a quarter of it is clipped to half of its light, an eighth is lost, which is
half of the smallest sector loss that is named."""
_MOST_BLACK = 2.0
"""Grey levels: for wall at thirty they change the contrast by .06, the smallest departure that is named a
response."""
_NOISE_FRAMES = 6
_OUTSIDE_LEVEL, _EDGE_PX = 6.0, 8
"""Pixels that no lit frame shows brighter are outside the view; its border is as wide as the second number,
px."""
_RIM_PX = 2
"""Rows and columns at each side of the picture that cameras and coders fill differently, px: the middle of a
5 × 5 filter, as of demosaicing (H. Malvar et al., 2004), is that far from its rim."""


@dataclass(frozen=True)
class PhotometricState:
    """What turns a scene into grey levels, and their noise.

    Attributes
    ----------
    noise : CameraNoise
    lamp : LampLight or None
        None where no lit frame could be used.
    line : LineLight or None
        None where no laser frame could be used.
    sharpness_theta, sharpness : (Z,)
        Polar angles, and half of the difference of blur variances between frames and photo there, px²;
        positive where the frames are more blurred.
    place_px : (Z,)
        1 σ of the photo's displacement from the frames at those angles, from pixel to pixel, per direction.
    outside, edge : (H, W) bool
        Pixels outside the camera's view; next to its border, or of burnt-in text.
    line_clipped : float
        Share of the line's middle at which its strongest channel is at full scale.
    photo_black : float
        Grey level without light in the colours of the wall's photo, which contains it, too. NaN where no
        frame shows it.
    power : float
        Exponent of the frames' contrast relative to the photo's; differs from 1 only when a response is
        tested.
    gain_map : (H, W) float32 or None
        Transmission of the window, where dirt was found on it.
    aside : (2, H, W) float32 or None
        Displacement by the window of what is behind it, px to the right and down.
    pattern : FixedPattern or None
        The pixels' own offsets and gains; None with too few frames.
    """

    noise: CameraNoise
    lamp: LampLight | None
    line: LineLight | None
    sharpness_theta: Float
    sharpness: Float
    place_px: Float
    outside: Bool
    edge: Bool
    line_clipped: float = 0.0
    photo_black: float = 0.0
    power: float = 1.0
    gain_map: Float32 | None = None
    aside: Float32 | None = None
    pattern: FixedPattern | None = None

    @property
    def black_in_photo(self) -> bool:
        """Whether the photo may contain so much black that its contrast does not show the response."""
        return not self.photo_black <= _MOST_BLACK

    @property
    def line_is_clipped(self) -> bool:
        """Whether so much of the line is clipped that its brightness hardly shows its power."""
        return self.line_clipped > _MOST_CLIPPED

    @property
    def shows_wall(self) -> tuple[Illumination, ...]:
        """Lights whose frames show the wall, and no line or a line whose pixels are left out."""
        both = (Illumination.BOTH,) if self.line is None else ()
        return Illumination.LED, *both


@dataclass(frozen=True)
class Sampled:
    """A frame of the sample: number, light, picture (H, W), and for some the next frame of the same light."""

    frame: int
    light: Illumination
    image: Float32
    after: Sampled | None = None


def sample_frames(recording: Recording, usable: Int, light: NDArray[np.str_], most: int) -> list[Sampled]:
    """Read up to ``most`` frames of each light, spread over the recording; for some, the next frame, too."""
    numbers, kinds = np.asarray(usable), np.asarray(light)
    after: dict[int, int] = {}
    for kind in np.unique(kinds):
        own = numbers[kinds == kind]
        chosen = np.unique(np.linspace(0, len(own) - 1, min(most, len(own))).round().astype(int))
        after |= {int(own[k]): -1 for k in chosen}
        paired = chosen[:: max(len(chosen) // _NOISE_FRAMES, 1)]
        if kind != Illumination.LASER.value:
            after |= {int(own[k]): int(own[k + 1]) for k in paired if k + 1 < len(own)}
    of = dict(zip(numbers.tolist(), kinds.tolist(), strict=True))
    wanted = np.unique([n for n in (*after, *after.values()) if n >= 0])
    read = {
        frame: Sampled(frame, Illumination(of[frame]), image.astype(np.float32))
        for frame, image in recording.read(wanted, "grey")
        if image is not None
    }
    return [replace(read[n], after=read.get(after[n])) for n in sorted(after) if n in read]


def estimate_state(
    scene: Scene, sampled: list[Sampled], coloured: Coloured, rings: RingSamples, context: Context
) -> PhotometricState:
    """Return the state that fits the sampled frames best; ``coloured`` are laser frames (H, W, 3)."""
    black, white = black_and_white([s.image for s in sampled])
    width = float(np.nanmedian(rings.width_px)) if np.isfinite(rings.width_px).any() else _USUAL_WIDTH_PX
    lamps = LampSamples(scene, black.value, white)
    colour = line_colour(scene, coloured, width)
    lines = LineSamples(scene, black.value, white, scene.probe.laser.line_sigma_mm, width, colour)
    lit: list[tuple[Sampled, LitSight]] = []
    for done, s in enumerate(sampled):
        T_pc = scene.pose(s.frame)
        if s.light != Illumination.LASER:
            lit.append((s, scene.lit(T_pc)))
            lamps.add(s.frame, s.image, lit[-1][1], context.random)
        if s.light == Illumination.LASER:
            lines.add(s.frame, s.image, scene.line(T_pc))
        context.progress(done, 2 * len(sampled))
    lamp, line = lamps.solve(), lines.solve()
    outside, edge = _view([s.image for s, _ in lit], black.value, scene)
    edge |= burnt_in(scene, sampled, black.value)
    at, sharpness, left = _sharpness(scene, lamp, lit, black.value, white, edge | outside)
    twice = [(f, f.again) for f in left if f.again is not None]
    windows = [windows_of(f.rest, again, f.level, f.use & np.isfinite(again)) for f, again in twice]
    noise = photon_transfer(windows, black, white)
    place_px = _place_error(left, noise)
    if line is not None:
        line = lines.with_speckle(line, noise.variance)
    pattern = fixed_pattern([(f.rest, f.level, f.use) for f in left])
    return PhotometricState(noise, lamp, line, at, sharpness, place_px, outside, edge, pattern=pattern)


def clipped_line(scene: Scene, frames: Coloured) -> float:
    """Return the share of the line's middle at which its strongest channel is at full scale.

    ``frames`` yields numbers and colour pictures (H, W, 3). Their grey does not show it, because it continues
    to rise with the other channels.
    """
    found = []
    for frame, image in frames:
        if image is None:
            continue
        line = scene.line(scene.pose(frame))
        middle = np.abs(line.offset_px) < _USUAL_WIDTH_PX
        colour = image[line.row[middle], line.column[middle]]
        if len(colour):
            found.append(float((colour[:, int(colour.mean(0).argmax())] >= FULL_SCALE).mean()))
    return float(np.median(found)) if found else 0.0


def clipped_pixels(frames: Coloured) -> dict[int, Bool]:
    """Return, by frame number, the pixels (H, W) of colour pictures that have a channel at full scale."""
    return {n: np.asarray((image >= FULL_SCALE).any(-1)) for n, image in frames if image is not None}


def black_of_photo(frames: Coloured) -> float:
    """Return the grey level of the darkest tenth of colour laser frames, which have the photo's range.

    NaN without any such frame.
    """
    grey = [np.asarray(image[::4, ::4].mean(2)) for _, image in frames if image is not None]
    # A tenth (chosen): line and stray light cover far less than nine tenths of a laser frame.
    return float(np.median([np.median(g[g <= np.quantile(g, 0.1)]) for g in grey])) if grey else float("nan")


def _view(lit: list[Float32], black: float, scene: Scene) -> tuple[Bool, Bool]:
    """Return pixels that no lit frame shows, and pixels next to those or to the rim of the picture."""
    valid = scene.polar[2]
    rim = np.ones_like(valid)
    rim[_RIM_PX:-_RIM_PX, _RIM_PX:-_RIM_PX] = False
    if not lit:
        return ~valid, rim
    outside = (np.max(lit, 0) < black + _OUTSIDE_LEVEL) | ~valid
    # The dark middle of the pipe and dark wall are inside: only what is connected to the picture's corners is
    # outside.
    count, label = cv2.connectedComponents(outside.astype(np.uint8))
    corners = {int(label[r, c]) for r in (0, -1) for c in (0, -1) if outside[r, c]}
    outside = np.isin(label, list(corners)) if count > 1 and corners else np.zeros_like(outside)
    kernel = np.ones((2 * _EDGE_PX + 1,) * 2, np.uint8)
    border = cv2.dilate(outside.astype(np.uint8), kernel) - cv2.erode(outside.astype(np.uint8), kernel)
    return outside, (border > 0) | rim


@dataclass(frozen=True)
class _LeftOver:
    """Of a lit frame, (H, W): recorded − predicted, predicted, zone of polar angle, which pixels count.

    ``again`` is recorded minus predicted of the next frame, at the same places of the wall.
    """

    rest: Float32
    level: Float32
    zone: Int
    use: Bool
    again: Float32 | None


def _sharpness(
    scene: Scene, lamp: LampLight | None, lit: list[tuple[Sampled, LitSight]], black: float, white: float,
    border: Bool,
) -> tuple[Float, Float, list[_LeftOver]]:  # fmt: skip
    """Return polar angles, the half excess of the frames' blur variance there, px², and residuals."""
    theta, phi, _ = scene.polar
    if lamp is None or not lit:
        return np.arange(_ZONES, dtype=float), np.zeros(_ZONES), []
    zones = np.linspace(lamp.theta_rad[0], lamp.theta_rad[-1], _ZONES + 1)
    above, below = np.zeros(_ZONES), np.zeros(_ZONES)
    left: list[tuple[Float32, Float32, Bool, Float32, Float32 | None]] = []
    zone_of = np.clip(np.searchsorted(zones, theta) - 1, 0, _ZONES - 1)
    white_wall = lamp.factor(theta, phi)
    for s, sight in lit[:: max(len(lit) // _NOISE_FRAMES, 1)]:
        level = white_wall * sight.reflectance * sight.irradiance * np.float32(np.exp(lamp.gain.at(s.frame)))
        use = np.isfinite(level) & (level > _LEAST_LEVEL) & (s.image < white) & ~border
        rest = s.image - np.float32(black) - level
        curved = cv2.Laplacian(np.nan_to_num(level), cv2.CV_32F)
        zone = zone_of[use]
        above += np.bincount(zone, (rest * curved)[use], _ZONES)
        below += np.bincount(zone, (curved**2)[use], _ZONES)
        left.append((rest, level, use, curved, _again(scene, lamp, s, black, white, white_wall)))
    at, sharpness = (zones[1:] + zones[:-1]) / 2, above / np.maximum(below, 1e-9)
    sharp = np.interp(theta, at, sharpness).astype(np.float32)
    return at, sharpness, [_LeftOver(r - sharp * c, level, zone_of, use, a) for r, level, use, c, a in left]


def _again(
    scene: Scene, lamp: LampLight, first: Sampled, black: float, white: float, white_wall: Float32
) -> Float32 | None:
    """Return recorded minus predicted (H, W) of the next frame, at the wall places that this frame shows."""
    if first.after is None:
        return None
    here, there = scene.pose(first.frame), scene.pose(first.after.frame)
    sight, image = scene.lit(there), first.after.image
    gain = np.float32(np.exp(lamp.gain.at(first.after.frame)))
    level = white_wall * sight.reflectance * sight.irradiance * gain
    rest = np.where(
        (level > _LEAST_LEVEL) & (image < white), image - np.float32(black) - level, np.float32(np.nan)
    )
    u, v = scene.seen_again(here, there)
    return np.asarray(cv2.remap(rest, u, v, cv2.INTER_NEAREST, borderValue=float("nan")), np.float32)


def _place_error(left: list[_LeftOver], noise: CameraNoise) -> Float:
    """Return the 1 σ (Z,) by which single places of the photo are displaced, px per direction.

    It is the part of the residual beyond the camera's noise that grows with the square of the slope: errors
    of the radius map and of poses, which shift the photo from place to place. Residuals above four σ count as
    four.
    """
    above, below = np.zeros(_ZONES), np.zeros(_ZONES)
    for f in left:
        square = slope_squared(f.level)[f.use].astype(float)
        variance = noise.variance(f.level[f.use]).astype(float)
        excess = np.minimum(f.rest[f.use].astype(float) ** 2, 16 * variance) - variance
        above += np.bincount(f.zone[f.use], square * excess, _ZONES)
        below += np.bincount(f.zone[f.use], square**2, _ZONES)
    return np.sqrt(np.maximum(above / np.maximum(below, 1e-9), 0.0))


def slope_squared(level: Float32) -> Float32:
    """Return the squared slope, per px, of grey levels (H, W); 0 where a neighbour is unknown."""
    down, right = np.gradient(level)
    return np.asarray(np.nan_to_num(down**2 + right**2), np.float32)
