"""Renders the frames of a scene with noise, or one frame from a wall, an instrument, a pose and its lights.

``picture(scenery_of(wall), still(instrument, "led", T_pc))`` returns the grey levels that the camera should
see. The photometric state is in the instrument: `TrueSensor` (exposure, response, black level, blur, dirt),
`LedRing` (LED pattern) and `TrueLaser` (power around the ring, line profile). For many frames
of one wall, call `scenery_of` only once; rays and shade of a camera are cached from frame to frame.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np

from pipeline.arrays import Float, Float32, Image
from pipeline.geometry.axis import PipeAxis, distance_along
from pipeline.recording.base import Illumination
from pipeline.simulator.calm import clear_mm
from pipeline.simulator.instrument import TrueCamera, TrueInstrument, TrueLaser, TrueSensor
from pipeline.simulator.kernel import in_bands
from pipeline.simulator.rays import RayTable, focal_px, ray_table
from pipeline.simulator.scene import Rendering
from pipeline.simulator.sensor import exposed, shade_of, through_lens, with_dark_signal
from pipeline.simulator.sheet import ghost_table, profile_table, sheet_table
from pipeline.simulator.surface import Surface, Texture, surface_of, texture_of
from pipeline.simulator.truth import SceneTruth, row_late_s
from pipeline.simulator.view import Line, View, add_line, line_of, line_tiles
from pipeline.simulator.wall.grid import Wall
from pipeline.simulator.wall_light import glow_of_lamps, glow_of_line, lamps_of, stray_light
from pipeline.simulator.wall_tiles import add_wall


@dataclass(frozen=True)
class Scenery:
    """A wall as the kernels take it.

    Attributes
    ----------
    axis : PipeAxis
        The wall's axis in P.
    surface : Surface
    texture : Texture
    radius_mm : float
        Mean of the wall.
    thrown_back : (3,)
        Share of its light, by colour, that is rendered as bounced once: mean reflectance, or 0.
    """

    axis: PipeAxis
    surface: Surface
    texture: Texture
    radius_mm: float
    thrown_back: Float


def scenery_of(wall: Wall) -> Scenery:
    """Prepare a wall for rendering; this takes about a second, once for all frames."""
    thrown_back = wall.interreflection * wall.albedo_bgr.mean((0, 1), dtype=float)
    radius = float(wall.radius_mm.mean(dtype=float))
    return Scenery(wall.axis, surface_of(wall), texture_of(wall), radius, thrown_back)


@dataclass(frozen=True)
class Shot:
    """What one frame is rendered from, the wall apart.

    Attributes
    ----------
    instrument : TrueInstrument
        At the frame's time.
    illumination : str
        ``laser``, ``led`` or ``both``.
    T_pc : (rows or 1, T, 4, 4)
        Camera in P at T moments of each row's exposure; one row of poses where all rows see the same.
    moment : (rows or 1, T)
        When that is, 0 to 1 of the frame's span from the first row's opening to the last row's closing.
    lasers : tuple of TrueLaser
        The laser at evenly spaced moments of that span; one where it does not change.
    rendering : Rendering
    seed : int
        Of the speckle and of the pixels' dark signals and defects.
    row_gain : (rows or 1,)
        Power of all lights in each row's exposure, relative to their mean power.
    """

    instrument: TrueInstrument
    illumination: str
    T_pc: Float
    moment: Float
    lasers: tuple[TrueLaser, ...]
    rendering: Rendering
    seed: int = 0
    row_gain: Float = field(default_factory=lambda: np.ones(1))


def still(
    instrument: TrueInstrument, illumination: str, T_pc: Float, rendering: Rendering | None = None
) -> Shot:
    """Return the shot of a camera that stands still at ``T_pc`` (4, 4) during the exposure."""
    finely = Rendering.model_validate({}) if rendering is None else rendering
    pose, moment = np.asarray(T_pc, float)[None, None], np.zeros((1, 1))
    return Shot(instrument, illumination, pose, moment, (instrument.laser,), finely)


def picture(scenery: Scenery, shot: Shot) -> Float32:
    """Return the mean grey levels (H, W, 3), BGR, 0 to 255, of a shot: lens and response, but no noise.

    They are not rounded to whole grey levels.
    """
    return mean_grey(seen(scenery, shot), shot.instrument.sensor)


def mean_grey(light: Float32, sensor: TrueSensor) -> Float32:
    """Return grey levels (...) of light (...): clipped, with gamma, above the black level."""
    share = np.clip(light, 0, 1)
    if sensor.gamma != 1.0:
        share = share**sensor.gamma
    return np.asarray(sensor.black_level + (255.0 - sensor.black_level) * share, np.float32)


def seen(scenery: Scenery, shot: Shot) -> Float32:
    """Return the light (H, W, 3) at each pixel, through the lens and without noise, in full scales."""
    instrument = shot.instrument
    shade = _shade(instrument.camera, instrument.sensor)
    return with_dark_signal(
        through_lens(light(scenery, shot), instrument.sensor, shade), instrument.sensor, shot.seed
    )


def light(scenery: Scenery, shot: Shot) -> Float32:
    """Return the light (H, W, 3) that would reach each pixel through a perfect lens, in full scales."""
    width, height = shot.instrument.camera.model.image_size
    image = np.zeros((height, width, 3), np.float32)
    view = view_of(scenery, shot)
    if shot.illumination != Illumination.LED.value:
        _add_laser(scenery, view, shot, image)
    if shot.illumination != Illumination.LASER.value:
        ring, lamps = shot.instrument.light, lamps_of(shot.instrument.light)
        if scenery.thrown_back.any():
            lamps = glow_of_lamps(lamps, scenery.radius_mm, scenery.thrown_back, view.distance_mm)
        add_wall(view, lamps, np.array(ring.colour_bgr), shot.rendering.wall_samples, image)
    if np.any(shot.row_gain != 1.0):
        image *= shot.row_gain.astype(np.float32)[:, None, None]
    return image


def view_of(scenery: Scenery, shot: Shot) -> View:
    """Return camera and wall of a shot as the kernels take them."""
    T_wc = scenery.surface.T_wp @ shot.T_pc
    row, moment = len(shot.T_pc) // 2, shot.T_pc.shape[1] // 2
    camera, ring = shot.instrument.camera, shot.instrument.light
    distance = float(distance_along(scenery.axis, shot.T_pc[row, moment]))
    clear = clear_mm(scenery.surface, T_wc[row, moment, :3], distance, ring.radius_mm)
    return View(
        _rays(camera),
        scenery.surface,
        scenery.texture,
        np.ascontiguousarray(T_wc[..., :3, :]),
        shot.moment,
        distance,
        focal_px(camera),
        clear,
    )


def _add_laser(scenery: Scenery, view: View, shot: Shot, image: Float32) -> None:
    laser, samples = shot.instrument.laser, shot.rendering.line_samples
    lines = _lines(view, shot)
    speckle = (laser.speckle_contrast, laser.speckle_grain_mm, shot.seed)
    tiles = line_tiles(view, lines, shot.instrument.camera.model.image_size)
    colour = np.array(laser.colour_bgr)
    for line in lines:

        def band(first: int, last: int, line: Line = line) -> None:
            add_line(view, line, colour, speckle, tiles, samples, first, last, image)

        in_bands(band, len(image))
    ambient = shot.instrument.sensor.ambient
    if ambient > 0:
        add_wall(view, stray_light(ambient), np.ones(3), 1, image)
    if scenery.thrown_back.any():
        dark, back = stray_light(0.0), scenery.thrown_back
        add_wall(view, glow_of_line(dark, laser, scenery.radius_mm, back, view.distance_mm), colour, 1, image)


def _lines(view: View, shot: Shot) -> tuple[Line, ...]:
    """Return the laser's sheet and, where the wall mirrors, its bounce across the bore."""
    laser = shot.instrument.laser
    profile = profile_table(laser.profile)
    direct = line_of(sheet_table(shot.lasers), profile, view.surface)
    T_wc = view.pose[len(view.pose) // 2, view.pose.shape[1] // 2]
    ghost = ghost_table(view.surface, laser, T_wc, view.distance_mm)
    return (direct,) if ghost is None else (direct, line_of(ghost, profile, view.surface))


@lru_cache(maxsize=4)
def _rays(camera: TrueCamera) -> RayTable:
    return ray_table(camera)


@lru_cache(maxsize=2)
def _shade(camera: TrueCamera, sensor: TrueSensor) -> Float32 | None:
    """Return the share of light that vignetting and dust leave, from an enlarged table of rays."""
    table = _rays(camera)
    width, height = camera.model.image_size
    u = ((np.arange(width) - table.first) / table.step).astype(np.float32)
    v = ((np.arange(height) - table.first) / table.step).astype(np.float32)
    at_u, at_v = (np.ascontiguousarray(at) for at in np.meshgrid(u, v))
    cosine = cv2.remap(table.node[..., 5].astype(np.float32), at_u, at_v, cv2.INTER_LINEAR)
    return shade_of(sensor, np.asarray(np.nan_to_num(cosine, nan=-1.0), np.float32))


# Moments of an exposure at which a changing sheet is tabulated; linear between them.
_SHEET_MOMENTS = 5


@dataclass(frozen=True)
class Renderer:
    """Renders any frame of a scene, each on its own: the same scene and seed give the same bytes.

    Attributes
    ----------
    truth : SceneTruth
    scenery : Scenery
        Its wall as the kernels take it.
    """

    truth: SceneTruth
    scenery: Scenery

    def frame(self, number: int) -> Image:
        """Return frame ``number`` (H, W, 3), BGR."""
        sensor = self.truth.instrument_at(self._time_s(number)).sensor
        return exposed(self.seen(number), sensor, self.truth.seed, number)

    def frames(self, numbers: Sequence[int]) -> Iterator[Image]:
        """Yield several frames in order."""
        return (self.frame(number) for number in numbers)

    def seen(self, number: int) -> Float32:
        """Return the light (H, W, 3) at each pixel, through the lens and without noise, in full scales."""
        return seen(self.scenery, self.shot(number))

    def light(self, number: int) -> Float32:
        """Return the light (H, W, 3) that would reach each pixel through a perfect lens, in full scales."""
        return light(self.scenery, self.shot(number))

    def shot(self, number: int) -> Shot:
        """Return instrument, lights and poses at a frame."""
        truth = self.truth
        instrument = truth.instrument_at(self._time_s(number))
        opened, span = self._opened(number, instrument)
        moments = np.linspace(opened.min(), opened.max(), _SHEET_MOMENTS if truth.changes else 1)
        return Shot(
            instrument=instrument,
            illumination=str(truth.frames.illumination[number]),
            T_pc=truth.motion.pose(opened, truth.wall.axis),
            moment=(opened - opened.min()) / max(span, 1e-9),
            lasers=tuple(truth.instrument_at(float(t)).laser for t in moments),
            rendering=truth.rendering,
            seed=truth.seed,
            row_gain=instrument.flicker.mean(opened.mean(axis=1), instrument.shutter.exposure_s),
        )

    def _time_s(self, number: int) -> float:
        return float(self.truth.frames.time_s[number])

    def _opened(self, number: int, instrument: TrueInstrument) -> tuple[Float, float]:
        """Return moments (rows or 1, T) within each row's exposure, and the span of them all, s."""
        shutter, samples = instrument.shutter, self.truth.rendering.time_samples
        within = ((np.arange(samples) + 0.5) / samples - 0.5) * shutter.exposure_s
        height = instrument.camera.model.image_size[1]
        rows = np.arange(float(height if shutter.kind == "rolling" and shutter.readout_s > 0 else 1))
        late = self.truth.late_s(instrument) + row_late_s(instrument, rows)
        opened = self._time_s(number) + late[:, None] + within
        return opened, float(np.ptp(opened))


def renderer_of(truth: SceneTruth) -> Renderer:
    """Return the renderer of a scene."""
    return Renderer(truth, scenery_of(truth.wall))
