"""Renders frames of a worked-out scene."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from pipeline.arrays import Float, Float32, Image
from pipeline.recording.base import Illumination
from pipeline.simulator.instrument import TrueCamera, TrueInstrument, TrueSensor
from pipeline.simulator.kernel import in_bands
from pipeline.simulator.line_light import add_line
from pipeline.simulator.rays import RayTable, focal_px, ray_table
from pipeline.simulator.sensor import exposed, shade_of, through_lens
from pipeline.simulator.sheet import ghost_table, profile_table, sheet_table
from pipeline.simulator.surface import Surface, Texture, surface_of, texture_of
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.view import Line, View, line_of, line_tiles
from pipeline.simulator.wall_light import Lamps, add_wall_light, lamps_of, stray_light

# Moments of an exposure at which a changing sheet is tabulated; linear between them.
_SHEET_MOMENTS = 5


@dataclass(frozen=True)
class Renderer:
    """Renders any frame of a scene, each on its own: the same scene and seed give the same bytes.

    Attributes
    ----------
    truth : SceneTruth
    surface, texture
        Its wall as the kernels take it.
    """

    truth: SceneTruth
    surface: Surface
    texture: Texture

    def frame(self, number: int) -> Image:
        """Return frame ``number`` (H, W, 3), BGR."""
        sensor = self.truth.instrument_at(self._time_s(number)).sensor
        return exposed(self.seen(number), sensor, self.truth.seed, number)

    def seen(self, number: int) -> Float32:
        """Return the light (H, W, 3) at each pixel, through the lens and without noise, in full scales."""
        instrument = self.truth.instrument_at(self._time_s(number))
        return through_lens(
            self.light(number), instrument.sensor, _shade(instrument.camera, instrument.sensor)
        )

    def frames(self, numbers: Sequence[int]) -> Iterator[Image]:
        """Yield several frames in order."""
        return (self.frame(number) for number in numbers)

    def light(self, number: int) -> Float32:
        """Return the light (H, W, 3) that would reach each pixel through a perfect lens, in full scales."""
        instrument = self.truth.instrument_at(self._time_s(number))
        width, height = instrument.camera.model.image_size
        light = np.zeros((height, width, 3), np.float32)
        view = self.view(number, instrument)
        kind = self.truth.frames.illumination[number]
        if kind != Illumination.LED.value:
            self._add_laser(number, view, instrument, light)
        if kind != Illumination.LASER.value:
            ring, samples = instrument.light, self.truth.rendering.wall_samples
            _add_wall(view, lamps_of(ring), np.array(ring.colour_bgr), samples, light)
        return light

    def view(self, number: int, instrument: TrueInstrument) -> View:
        """Return camera and wall at a frame."""
        opened, span = self._opened(number, instrument)
        T_wc = self.surface.T_wp @ self.truth.motion.pose(opened, self.truth.wall.axis)
        pose = np.ascontiguousarray(T_wc[..., :3, :])
        moment = (opened - opened.min()) / max(span, 1e-9)
        distance = float(self.truth.motion.distance_mm.at(np.array(self._time_s(number))))
        table = _rays(instrument.camera)
        return View(table, self.surface, self.texture, pose, moment, distance, focal_px(instrument.camera))

    def _time_s(self, number: int) -> float:
        return float(self.truth.frames.time_s[number])

    def _opened(self, number: int, instrument: TrueInstrument) -> tuple[Float, float]:
        """Return moments (rows or 1, T) within each row's exposure, and the span of them all, s."""
        shutter, samples = instrument.shutter, self.truth.rendering.time_samples
        within = ((np.arange(samples) + 0.5) / samples - 0.5) * shutter.exposure_s
        height = instrument.camera.model.image_size[1]
        late = np.zeros(1)
        if shutter.kind == "rolling" and shutter.readout_s > 0:
            late = ((np.arange(height) + 0.5) / height - 0.5) * shutter.readout_s
        opened = self._time_s(number) + late[:, None] + within
        return opened, float(np.ptp(opened))

    def _add_laser(self, number: int, view: View, instrument: TrueInstrument, light: Float32) -> None:
        laser, rendering = instrument.laser, self.truth.rendering
        lines = self.lines(number, view, instrument)
        speckle = (laser.speckle_contrast, laser.speckle_grain_mm, self.truth.seed)
        tiles = line_tiles(view, lines, instrument.camera.model.image_size)
        colour = np.array(laser.colour_bgr)
        for line in lines:

            def band(first: int, last: int, line: Line = line) -> None:
                add_line(view, line, colour, speckle, tiles, rendering.line_samples, first, last, light)

            in_bands(band, len(light))
        if instrument.sensor.ambient > 0:
            _add_wall(view, stray_light(instrument.sensor.ambient), np.ones(3), 1, light)

    def lines(self, number: int, view: View, instrument: TrueInstrument) -> tuple[Line, ...]:
        """Return the laser's sheet and, where the wall mirrors, its bounce across the bore."""
        opened = self._opened(number, instrument)[0]
        moments = np.linspace(opened.min(), opened.max(), _SHEET_MOMENTS if self.truth.changes else 1)
        lasers = tuple(self.truth.instrument_at(float(t)).laser for t in moments)
        profile = profile_table(instrument.laser.profile)
        direct = line_of(sheet_table(lasers), profile, self.surface)
        T_wc = view.pose[len(view.pose) // 2, view.pose.shape[1] // 2]
        ghost = ghost_table(self.surface, instrument.laser, T_wc, view.distance_mm)
        return (direct,) if ghost is None else (direct, line_of(ghost, profile, self.surface))


def renderer_of(truth: SceneTruth) -> Renderer:
    """Return the renderer of a scene."""
    return Renderer(truth, surface_of(truth.wall), texture_of(truth.wall))


@lru_cache(maxsize=4)
def _rays(camera: TrueCamera) -> RayTable:
    return ray_table(camera)


@lru_cache(maxsize=2)
def _shade(camera: TrueCamera, sensor: TrueSensor) -> Float32 | None:
    """Return what vignetting and dust leave, from the table's rays scaled up."""
    table = _rays(camera)
    width, height = camera.model.image_size
    u = ((np.arange(width) - table.first) / table.step).astype(np.float32)
    v = ((np.arange(height) - table.first) / table.step).astype(np.float32)
    at_u, at_v = (np.ascontiguousarray(at) for at in np.meshgrid(u, v))
    cosine = cv2.remap(table.node[..., 5].astype(np.float32), at_u, at_v, cv2.INTER_LINEAR)
    return shade_of(sensor, np.asarray(np.nan_to_num(cosine, nan=-1.0), np.float32))


def _add_wall(view: View, lamps: Lamps, colour: Float, samples: int, image: Float32) -> None:
    def band(first: int, last: int) -> None:
        add_wall_light(view, lamps, colour, samples, first, last, image)

    in_bands(band, len(image))
