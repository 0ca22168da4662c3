"""The line's profile on a narrow strip of the sensor at azimuth 0: fast, but made by the real renderer."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pipeline.arrays import Float, Float32
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.instrument import TrueSensor
from pipeline.simulator.laws import FOCAL_PX, bench_truth
from pipeline.simulator.render import renderer_of
from pipeline.simulator.sensor import shade_of, through_lens
from pipeline.simulator.truth import SceneTruth, with_sensor

# Strip of the sensor, px, that holds the ring of a 4 inch pipe (atan(50.8/22) × 360 = 419 px) at azimuth 0.
_SIZE, _CENTRE = (480, 65), (20.0, 32.0)
# Rows used on each side of the middle; those beyond are needed by the blur.
_ROWS = 24
# Channel of the laser's light in BGR pictures.
_GREEN = 1


class Profiles(NamedTuple):
    """The line in several rows: ``rho`` (R, N), px, the image radius; ``grey`` (R, N), full scales."""

    rho: Float
    grey: Float

    def centroid(self) -> Float:
        """Return the centroids (R,), px."""
        return np.asarray(np.sum(self.rho * self.grey, 1) / np.sum(self.grey, 1))

    def sigma(self) -> Float:
        """Return 1 σ (R,) of the profiles, px."""
        spread = (self.rho - self.centroid()[:, None]) ** 2
        return np.asarray(np.sqrt(np.sum(spread * self.grey, 1) / np.sum(self.grey, 1)))


def strip_truth(radius_mm: float, psf_sigma_px: float = 0.7) -> SceneTruth:
    """Return the bench with a sensor that shows only a strip of the ring."""
    truth = bench_truth(radius_mm)
    model = replace(truth.stated.camera, image_size=_SIZE, centre=_CENTRE)  # type: ignore[type-var]
    stated = replace(truth.stated, camera=model)
    camera = replace(truth.instrument.camera, model=model)
    instrument = replace(truth.instrument, camera=camera, sensor=TrueSensor(psf_sigma_px=psf_sigma_px))
    rendering = truth.rendering.model_copy(update={"line_samples": 6})
    return replace(truth, stated=stated, instrument=instrument, rendering=rendering)


def profiles(truth: SceneTruth, *switches: Switch) -> Profiles:
    """Return the line's profiles after lens and sensor, without noise and not rounded to grey levels."""
    changed = switch_on(truth, switches)
    sensor = changed.instrument.sensor
    seen = through_lens(renderer_of(changed).light(0), sensor, _shade(sensor))
    return _cut(np.clip(seen[..., _GREEN].astype(float), 0, 1) ** sensor.gamma)


def exposed_profiles(truth: SceneTruth, *switches: Switch) -> Profiles:
    """Return the line's profiles in a recorded frame with hardly any noise except rounding."""
    changed = with_sensor(switch_on(truth, switches), full_well_e=1e12, read_noise_e=0.0)
    return _cut(renderer_of(changed).frame(0)[..., _GREEN].astype(float) / 255.0)


def _cut(grey: Float) -> Profiles:
    rows = np.arange(-_ROWS, _ROWS + 1)
    u = np.arange(_SIZE[0]) - _CENTRE[0]
    return Profiles(np.hypot(u[None, :], rows[:, None].astype(float)), grey[rows + round(_CENTRE[1])])


def _shade(sensor: TrueSensor) -> Float32 | None:
    """Return the share of light that vignetting leaves on the strip; the bench's lens is equidistant."""
    height = np.arange(_SIZE[1]) - _CENTRE[1]
    radius = np.hypot((np.arange(_SIZE[0]) - _CENTRE[0])[None, :], height[:, None])
    return shade_of(sensor, np.cos(radius / FOCAL_PX).astype(np.float32))
