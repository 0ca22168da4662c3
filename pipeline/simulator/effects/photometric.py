"""Effects on the line's light: its profile, light on wrong paths, and the sensor's response."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.simulator.instrument import Dust
from pipeline.simulator.line_light import REFERENCE_MM
from pipeline.simulator.truth import SceneTruth, with_laser, with_sensor


def albedo_bias(truth: SceneTruth, line_sigma_mm: float) -> SceneTruth:
    """Set the line's width: changes of the wall's reflectance pull the centroid of a wide line."""
    profile = replace(truth.instrument.laser.profile, sigma_mm=max(line_sigma_mm, 1e-3))
    return with_laser(truth, profile=profile)


def slope_bias(truth: SceneTruth, gloss: float) -> SceneTruth:
    """Make the wall glossy, so that slopes of its relief reflect towards the camera."""
    return replace(truth, wall=replace(truth.wall, gloss=gloss))


def subsurface(truth: SceneTruth, transport_mm: float) -> SceneTruth:
    """Let light travel forward within the wall."""
    return with_laser(truth, profile=replace(truth.instrument.laser.profile, transport_mm=transport_mm))


def ghost_ring(truth: SceneTruth, relative: float) -> SceneTruth:
    """Let the wall mirror a share of the line across the bore."""
    return with_laser(truth, ghost_relative=relative)


def tube_ghost(truth: SceneTruth, relative: float, separation_mm: float) -> SceneTruth:
    """Add the faint copy that a window's two faces make of the line."""
    profile = replace(truth.instrument.laser.profile, copy_relative=relative, copy_mm=separation_mm)
    return with_laser(truth, profile=profile)


def line_skew(truth: SceneTruth, skewness: float) -> SceneTruth:
    """Make the sheet's own profile asymmetric."""
    return with_laser(truth, profile=replace(truth.instrument.laser.profile, skewness=skewness))


def speckle(truth: SceneTruth, contrast: float) -> SceneTruth:
    """Set the speckle's contrast."""
    return with_laser(truth, speckle_contrast=contrast)


def saturation(truth: SceneTruth, exposure_gain: float) -> SceneTruth:
    """Raise the laser's power until the line's mean peak, before blur, is so many full scales."""
    gain = exposure_gain / line_peak(truth)
    return with_laser(truth, power_mm=truth.instrument.laser.power_mm * gain)


def gamma(truth: SceneTruth, exponent: float) -> SceneTruth:
    """Let grey be light to a power."""
    return with_sensor(truth, gamma=exponent)


def vignetting(truth: SceneTruth, falloff: float) -> SceneTruth:
    """Let the light fall towards the image's edge by a higher power."""
    return with_sensor(truth, vignetting=truth.instrument.sensor.vignetting + falloff)


def ambient_light(truth: SceneTruth, relative: float) -> SceneTruth:
    """Light the wall besides the line, a share of the line's mean peak."""
    stray = relative * line_peak(truth) / mean_albedo(truth)
    return with_sensor(truth, ambient=truth.instrument.sensor.ambient + stray)


def fixed_pattern(truth: SceneTruth, relative: float) -> SceneTruth:
    """Make the pixels' gains unequal."""
    return with_sensor(truth, fixed_pattern=relative)


def dust(truth: SceneTruth, attenuation: float, azimuth_deg: float, width_deg: float) -> SceneTruth:
    """Put a spot on the front glass where the line is seen in a centred pipe."""
    model, azimuth = truth.instrument.camera.model, math.radians(azimuth_deg)
    radius = mean_radius_mm(truth)
    place = np.array([radius * math.cos(azimuth), radius * math.sin(azimuth), truth.stated.laser.baseline_mm])
    uv = model.project(place).uv
    sigma = math.radians(width_deg) * float(np.linalg.norm(uv - model.centre_px))
    spot = Dust(attenuation, (float(uv[0]), float(uv[1])), (sigma, sigma))
    return with_sensor(truth, dust=(*truth.instrument.sensor.dust, spot))


def line_peak(truth: SceneTruth) -> float:
    """Return the line's peak on the mean wall before blur, full scales."""
    laser = truth.instrument.laser
    low, high = laser.profile.reach_mm()
    density = float(laser.profile.density(np.linspace(low, high, 2001)).max())
    return laser.power_mm * density * mean_albedo(truth) * REFERENCE_MM / mean_radius_mm(truth)


def mean_albedo(truth: SceneTruth) -> float:
    """Return the wall's mean reflectance in the laser's strongest channel."""
    strongest = int(np.argmax(truth.instrument.laser.colour_bgr))
    return float(truth.wall.albedo_bgr[..., strongest].mean())


def mean_radius_mm(truth: SceneTruth) -> float:
    """Return the radius the pipe is said to have."""
    return truth.facts.nominal_diameter_mm / 2
