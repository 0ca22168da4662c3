"""Effects on pictures alone: light, window, lens, sensor; no ray changes its way, but through a drop."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.arrays import Float
from pipeline.simulator.effects.surroundings import mean_radius_mm
from pipeline.simulator.instrument import Dust, Flicker, Sector, lamp_azimuth_rad
from pipeline.simulator.truth import SceneTruth, with_laser, with_sensor


def light_flicker(truth: SceneTruth, relative: float, frequency_hz: float) -> SceneTruth:
    """Let laser and LEDs flicker together, as on an uneven supply."""
    return replace(truth, instrument=replace(truth.instrument, flicker=Flicker(relative, frequency_hz)))


def led_dead(truth: SceneTruth, lost: float, azimuth_deg: float) -> SceneTruth:
    """Dim the LED next to an azimuth."""
    ring = truth.instrument.light
    away = np.angle(np.exp(1j * (lamp_azimuth_rad(ring.leds) - math.radians(azimuth_deg))))
    pattern = list(ring.pattern or (1.0,) * ring.leds)
    pattern[int(np.argmin(np.abs(away)))] *= 1.0 - lost
    dimmed = replace(ring, pattern=tuple(pattern))
    return replace(truth, instrument=replace(truth.instrument, light=dimmed))


def laser_sector(truth: SceneTruth, lost: float, azimuth_deg: float, width_deg: float) -> SceneTruth:
    """Dim or block the sheet over a sector."""
    sector = Sector(lost, math.radians(azimuth_deg), math.radians(width_deg))
    return with_laser(truth, sectors=(*truth.instrument.laser.sectors, sector))


def bloom(truth: SceneTruth, relative: float, length_px: float) -> SceneTruth:
    """Let charge above the full well leak along columns."""
    return with_sensor(truth, bloom_relative=relative, bloom_px=length_px)


def black_level(truth: SceneTruth, grey: float) -> SceneTruth:
    """Set the grey level without light."""
    return with_sensor(truth, black_level=grey)


def defocus(truth: SceneTruth, middle_px: float, edge_px: float) -> SceneTruth:
    """Blur further, more towards the picture's edge."""
    sensor = truth.instrument.sensor
    blur = math.hypot(sensor.psf_sigma_px, middle_px)
    return with_sensor(truth, psf_sigma_px=blur, psf_edge_px=math.hypot(sensor.psf_edge_px, edge_px))


def window_scatter(truth: SceneTruth, share: float, azimuth_deg: float, width_deg: float) -> SceneTruth:
    """Put a spot on the front glass that scatters light instead of taking it away."""
    centre, sigma = _on_the_ring(truth, azimuth_deg, width_deg)
    spot = Dust(share, (float(centre[0]), float(centre[1])), (sigma, sigma))
    return with_sensor(truth, scatter=(*truth.instrument.sensor.scatter, spot))


def droplet(truth: SceneTruth, power: float, azimuth_deg: float, width_deg: float) -> SceneTruth:
    """Put a drop on the front glass; its radius is twice the width, where a spot of that width ends."""
    centre, sigma = _on_the_ring(truth, azimuth_deg, width_deg)
    drop = Dust(power, (float(centre[0]), float(centre[1])), (2 * sigma, 2 * sigma))
    return with_sensor(truth, drops=(*truth.instrument.sensor.drops, drop))


def defective_pixels(truth: SceneTruth, share: float, level: float) -> SceneTruth:
    """Make some pixels hot and as many dead."""
    return with_sensor(truth, defective_share=share, hot_level=level)


def read_noise(truth: SceneTruth, electrons: float) -> SceneTruth:
    """Add to the noise of reading a pixel."""
    return with_sensor(truth, read_noise_e=math.hypot(truth.instrument.sensor.read_noise_e, electrons))


def full_well(truth: SceneTruth, electrons: float) -> SceneTruth:
    """Set the electrons at full scale: fewer make more shot noise."""
    return with_sensor(truth, full_well_e=electrons)


def dark_pattern(truth: SceneTruth, relative: float) -> SceneTruth:
    """Give every pixel a dark signal of its own."""
    return with_sensor(truth, dark_pattern=relative)


def interreflection(truth: SceneTruth, relative: float) -> SceneTruth:
    """Let the wall light itself, once."""
    return replace(truth, wall=replace(truth.wall, interreflection=relative))


def _on_the_ring(truth: SceneTruth, azimuth_deg: float, width_deg: float) -> tuple[Float, float]:
    """Return where a centred pipe shows the line at an azimuth, and a width around the ring, px."""
    model, azimuth, radius = truth.instrument.camera.model, math.radians(azimuth_deg), mean_radius_mm(truth)
    place = np.array([radius * math.cos(azimuth), radius * math.sin(azimuth), truth.stated.laser.baseline_mm])
    uv = model.project(place).uv
    return uv, math.radians(width_deg) * float(np.linalg.norm(uv - model.centre_px))
