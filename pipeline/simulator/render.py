"""Renders frames of a worked-out scene: the shot of every frame, and noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Float32, Image
from pipeline.simulator.instrument import TrueInstrument
from pipeline.simulator.sensor import exposed
from pipeline.simulator.shot import Scenery, Shot, light, scenery_of, seen
from pipeline.simulator.truth import SceneTruth

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
        late = np.zeros(1)
        if shutter.kind == "rolling" and shutter.readout_s > 0:
            late = ((np.arange(height) + 0.5) / height - 0.5) * shutter.readout_s
        opened = self._time_s(number) + late[:, None] + within
        return opened, float(np.ptp(opened))


def renderer_of(truth: SceneTruth) -> Renderer:
    """Return the renderer of a scene."""
    return Renderer(truth, scenery_of(truth.wall))
