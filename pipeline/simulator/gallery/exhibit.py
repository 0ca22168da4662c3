"""One effect rendered, measured and put in numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Float32
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.gallery.course import Course, course_of
from pipeline.simulator.gallery.line import SeenLine, read_radii, seen_line
from pipeline.simulator.gallery.stage_set import scene_pair
from pipeline.simulator.laws.bench import RADII_MM
from pipeline.simulator.laws.harmonics import exponent, harmonic, strongest
from pipeline.simulator.render import renderer_of
from pipeline.simulator.truth import SceneTruth

AZIMUTHS = 180
# Less than a third of a micrometre around the ring is the rendering's own error.
NOTHING_MM = 3e-4
_GREEN = 1


@dataclass(frozen=True)
class Residual:
    """What an effect changes around the ring in one bore: with it less without it, over azimuth (A,).

    Attributes
    ----------
    error_mm : (A,)
        Radius as the stated instrument reads the line's centroid.
    light : (A,)
        The line's light, relative.
    width_px, skewness : (A,)
        Of the line's profile.
    """

    error_mm: Float
    light: Float
    width_px: Float
    skewness: Float

    @property
    def rms_mm(self) -> float:
        """Root mean square of the radius error."""
        return _rms(self.error_mm)

    @property
    def largest_mm(self) -> float:
        """Largest radius error, with its sign."""
        return float(self.error_mm[np.argmax(np.abs(self.error_mm))])

    @property
    def profile_rms(self) -> tuple[float, float, float]:
        """Root mean squares of light, width and skewness."""
        return _rms(self.light), _rms(self.width_px), _rms(self.skewness)


@dataclass(frozen=True)
class Exhibit:
    """What an effect does at its size.

    Attributes
    ----------
    switch : Switch
    scene : SceneTruth
        In 4 inch, without the effect.
    plain, changed : (H, W) float32
        Light of the green channel after lens and sensor, full scales, in 4 inch, without and with it.
    azimuth_rad : (A,)
    residual : mapping of radius, mm, to Residual
    course : Course or None
        How it goes with time.
    """

    switch: Switch
    scene: SceneTruth
    plain: Float32
    changed: Float32
    azimuth_rad: Float
    residual: Mapping[float, Residual]
    course: Course | None

    @property
    def name(self) -> str:
        """Of the effect."""
        return self.switch.name

    @property
    def shows_on_ring(self) -> bool:
        """Whether the radius is read wrongly at all."""
        return max(r.rms_mm for r in self.residual.values()) > NOTHING_MM

    @property
    def harmonic(self) -> int | None:
        """The harmonic, 0 to 6, that is most of the radius error in 4 inch; None where none is."""
        if not self.shows_on_ring:
            return None
        residual = self.residual[max(self.residual)]
        order = strongest(self.azimuth_rad, residual.error_mm)
        size = abs(harmonic(self.azimuth_rad, residual.error_mm, order))
        mean_square = size**2 / (2 if order else 1)
        return order if mean_square >= residual.rms_mm**2 / 2 else None

    @property
    def exponent(self) -> float | None:
        """Slope of ln rms over ln radius, from the smallest to the largest bore; None without an error."""
        sizes = np.array([r.rms_mm for r in self.residual.values()])
        return exponent(np.array(list(self.residual)), sizes) if sizes.min() > NOTHING_MM else None


def exhibit(switch: Switch) -> Exhibit:
    """Render and measure one effect in 2, 3 and 4 inch."""
    azimuth = -np.pi + 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    residual = {}
    for radius in RADII_MM:
        scene, with_effect = scene_pair(switch, radius)
        plain, changed = recorded(scene), recorded(with_effect)
        lines = seen_line(plain, scene, azimuth), seen_line(changed, scene, azimuth)
        residual[radius] = _residual(*lines, scene, azimuth)
    return Exhibit(switch, scene, plain, changed, azimuth, residual, course_of(switch))


def recorded(truth: SceneTruth) -> Float32:
    """Return the green light (H, W) of the scene's frame, clipped and by its gamma, noise left out."""
    sensor = truth.instrument.sensor
    renderer = renderer_of(truth)
    if sensor.fixed_pattern > 0:
        return np.asarray(renderer.frame(0)[..., _GREEN] / np.float32(255), np.float32)
    light = np.clip(renderer.seen(0)[..., _GREEN], 0, 1)
    return np.asarray(light**sensor.gamma, np.float32)


def _residual(before: SeenLine, after: SeenLine, scene: SceneTruth, azimuth_rad: Float) -> Residual:
    read = [read_radii(line.radius_px, scene, azimuth_rad) for line in (before, after)]
    return Residual(
        read[1] - read[0],
        after.light / before.light - 1,
        after.width_px - before.width_px,
        after.skewness - before.skewness,
    )


def _rms(values: Float) -> float:
    return float(np.sqrt(np.mean(values**2)))
