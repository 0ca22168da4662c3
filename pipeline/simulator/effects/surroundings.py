"""Effects of the pipe's shape, of the probe's motion, of the odometer, and of the line's light."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.errors import InputError
from pipeline.geometry.axis import PipeAxis
from pipeline.simulator.instrument import Dust
from pipeline.simulator.motion import Signal, Slip, Wave
from pipeline.simulator.truth import (
    SceneTruth,
    cartesian,
    require_odometer,
    with_laser,
    with_odometer,
    with_sensor,
)
from pipeline.simulator.view import REFERENCE_MM
from pipeline.simulator.wall.grid import Wall

# Largest distance between the axis' polyline and its arc, mm.
_SAGITTA_MM = 1e-4


def pipe_bend(truth: SceneTruth, curvature_per_mm: float, direction_deg: float) -> SceneTruth:
    """Bend the whole pipe to an arc that touches the z-axis of P at distance 0.

    Raises
    ------
    InputError
        When the scene's pipe is bent already.
    """
    wall = truth.wall
    if not np.allclose(wall.axis.R_pa, np.eye(3), atol=1e-12):
        raise InputError("scene", "pipe_bend bends a straight pipe, and this one is bent", place="pipe.bends")
    if curvature_per_mm == 0:
        return truth
    return replace(truth, wall=replace(wall, axis=_arc(wall, curvature_per_mm, direction_deg)))


def ovality(truth: SceneTruth, amplitude_mm: float, direction_deg: float) -> SceneTruth:
    """Add a second harmonic to the pipe's radius, largest towards ``direction_deg`` in P."""
    wall = truth.wall
    wave = np.cos(2 * (wall.shape.azimuth_rad - math.radians(direction_deg)))
    radius = (wall.radius_mm + amplitude_mm * wave[None, :]).astype(np.float32)
    return replace(truth, wall=replace(wall, radius_mm=radius))


def probe_vibration(
    truth: SceneTruth, amplitude_mm: float, frequency_hz: float, direction_deg: float
) -> SceneTruth:
    """Add a sinusoidal motion of the camera across the axis, along a direction of the pipe's section."""
    start = float(truth.frames.time_s[0])
    x, y = cartesian(amplitude_mm, direction_deg)
    phase = -2 * math.pi * frequency_hz * start
    motion = replace(
        truth.motion,
        x_mm=_with_wave(truth.motion.x_mm, Wave(x, frequency_hz, phase)),
        y_mm=_with_wave(truth.motion.y_mm, Wave(y, frequency_hz, phase)),
    )
    return replace(truth, motion=motion)


def encoder_scale(truth: SceneTruth, relative: float) -> SceneTruth:
    """Let the encoder count too much by a share."""
    scale = require_odometer(truth, "encoder_scale").scale
    return with_odometer(truth, "encoder_scale", scale=(1 + scale) * (1 + relative) - 1)


def encoder_slip(truth: SceneTruth, slip_mm: float, time_s: float) -> SceneTruth:
    """Add a distance to all readings after a given time since the first frame."""
    odometer = require_odometer(truth, "encoder_slip")
    slip = Slip(float(truth.frames.time_s[0]) + time_s, slip_mm)
    return with_odometer(truth, "encoder_slip", slips=(*odometer.slips, slip))


def encoder_backlash(truth: SceneTruth, backlash_mm: float) -> SceneTruth:
    """Give the encoder play: at each reversal the reading stays until the play is taken up."""
    before = require_odometer(truth, "encoder_backlash").backlash_mm
    return with_odometer(truth, "encoder_backlash", backlash_mm=before + backlash_mm)


def time_offset(truth: SceneTruth, delay_s: float) -> SceneTruth:
    """Delay the encoder's readings."""
    before = require_odometer(truth, "time_offset").delay_s
    return with_odometer(truth, "time_offset", delay_s=before + delay_s)


def _with_wave(signal: Signal, wave: Wave) -> Signal:
    return replace(signal, waves=(*signal.waves, wave))


def _arc(wall: Wall, curvature_per_mm: float, direction_deg: float) -> PipeAxis:
    """Return the arc as an axis over all distances of the wall, its frames turned about its normal."""
    grid = wall.shape.distance_mm
    low, high = min(grid[0], wall.axis.distance_mm[0]), max(grid[-1], wall.axis.distance_mm[-1])
    count = math.ceil((high - low) / math.sqrt(8 * _SAGITTA_MM / curvature_per_mm)) + 1
    distance = np.linspace(low, high, max(count, 3))
    turn = curvature_per_mm * distance
    toward = np.array([*cartesian(1.0, direction_deg), 0.0])
    forward = np.array([0.0, 0.0, 1.0])
    origin = (np.sin(turn)[:, None] * forward + (1 - np.cos(turn))[:, None] * toward) / curvature_per_mm
    tangent = np.cos(turn)[:, None] * forward + np.sin(turn)[:, None] * toward
    inward = np.cos(turn)[:, None] * toward - np.sin(turn)[:, None] * forward
    aside = np.array([-toward[1], toward[0], 0.0])
    R_pa = np.empty((len(distance), 3, 3))
    for column, axis in enumerate(np.eye(3)[:2]):
        R_pa[:, :, column] = (axis @ toward) * inward + (axis @ aside) * aside
    R_pa[:, :, 2] = tangent
    return PipeAxis(distance, origin, R_pa)


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
    """Let the wall reflect a share of the line onto the opposite side of the bore, like a mirror."""
    return with_laser(truth, ghost_relative=relative)


def tube_ghost(truth: SceneTruth, relative: float, separation_mm: float) -> SceneTruth:
    """Add the faint copy that a window's two faces make of the line."""
    profile = replace(truth.instrument.laser.profile, copy_relative=relative, copy_mm=separation_mm)
    return with_laser(truth, profile=profile)


def line_skew(truth: SceneTruth, skewness: float) -> SceneTruth:
    """Make the profile of the sheet asymmetric."""
    return with_laser(truth, profile=replace(truth.instrument.laser.profile, skewness=skewness))


def speckle(truth: SceneTruth, contrast: float) -> SceneTruth:
    """Set the speckle's contrast."""
    return with_laser(truth, speckle_contrast=contrast)


def saturation(truth: SceneTruth, exposure_gain: float) -> SceneTruth:
    """Raise the laser's power until the line's mean peak, before blur, is ``exposure_gain`` full scales."""
    gain = exposure_gain / line_peak(truth)
    return with_laser(truth, power_mm=truth.instrument.laser.power_mm * gain)


def gamma(truth: SceneTruth, exponent: float) -> SceneTruth:
    """Make the grey level a power of the light."""
    return with_sensor(truth, gamma=exponent)


def vignetting(truth: SceneTruth, falloff: float) -> SceneTruth:
    """Use a higher power of the cosine for the fall of light towards the image's edge."""
    return with_sensor(truth, vignetting=truth.instrument.sensor.vignetting + falloff)


def ambient_light(truth: SceneTruth, relative: float) -> SceneTruth:
    """Add uniform light on the wall, as a share of the line's mean peak."""
    stray = relative * line_peak(truth) / mean_albedo(truth)
    return with_sensor(truth, ambient=truth.instrument.sensor.ambient + stray)


def fixed_pattern(truth: SceneTruth, relative: float) -> SceneTruth:
    """Make the pixels' gains unequal."""
    return with_sensor(truth, fixed_pattern=relative)


def dust(truth: SceneTruth, attenuation: float, azimuth_deg: float, width_deg: float) -> SceneTruth:
    """Put a spot on the front glass where the line is seen in a centred pipe."""
    centre_px, sigma = on_the_ring(truth, azimuth_deg, width_deg)
    spot = Dust(attenuation, centre_px, (sigma, sigma))
    return with_sensor(truth, dust=(*truth.instrument.sensor.dust, spot))


def on_the_ring(truth: SceneTruth, azimuth_deg: float, width_deg: float) -> tuple[tuple[float, float], float]:
    """Return where a centred pipe shows the line at an azimuth, and the spot's width there, px."""
    model, azimuth, radius = truth.instrument.camera.model, math.radians(azimuth_deg), mean_radius_mm(truth)
    place = np.array([radius * math.cos(azimuth), radius * math.sin(azimuth), truth.stated.laser.baseline_mm])
    uv = model.project(place).uv
    width_px = math.radians(width_deg) * float(np.linalg.norm(uv - model.centre_px))
    return (float(uv[0]), float(uv[1])), width_px


def line_peak(truth: SceneTruth) -> float:
    """Return the line's peak on the mean wall before blur, in full scales."""
    laser = truth.instrument.laser
    low, high = laser.profile.reach_mm()
    density = float(laser.profile.density(np.linspace(low, high, 2001)).max())
    return laser.power_mm * density * mean_albedo(truth) * REFERENCE_MM / mean_radius_mm(truth)


def mean_albedo(truth: SceneTruth) -> float:
    """Return the wall's mean reflectance, 0 to 1, in the laser's strongest channel."""
    strongest = int(np.argmax(truth.instrument.laser.colour_bgr))
    return float(truth.wall.albedo_bgr[..., strongest].mean())


def mean_radius_mm(truth: SceneTruth) -> float:
    """Return the pipe's nominal radius, mm."""
    return truth.facts.nominal_diameter_mm / 2
