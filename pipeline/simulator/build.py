"""From a scene to its truth: draws the true instrument, builds the wall, sets the lights, applies effects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.files.json_yaml import Section
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import probe_from
from pipeline.recording.base import FrameTable
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import switches_from_mapping
from pipeline.simulator.instrument import (
    LedRing,
    LineProfile,
    TrueCamera,
    TrueInstrument,
    TrueLaser,
    TrueSensor,
    lamp_azimuth_rad,
)
from pipeline.simulator.motion import Motion, Odometer, motion_of, motion_through
from pipeline.simulator.scene import LightScene, Scene, SensorScene
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.view import REFERENCE_MM
from pipeline.simulator.wall import build_wall, facts_of, read_measured
from pipeline.simulator.wall.grid import Wall

# Number of the random stream of the instrument's draw; the wall's streams hash their purpose (`Seeds`).
_INSTRUMENT_STREAM = 1


def build_truth(scene: Scene, file: Path) -> SceneTruth:
    """Return the truth of a scene; ``file`` is where it was read from.

    Raises
    ------
    InputError
        When the probe or an effect is invalid, or the wall cannot be made.
    """
    truth = plain_truth(scene, file)
    return switch_on(truth, switches_from_mapping(scene.effects, file))


def plain_truth(scene: Scene, file: Path) -> SceneTruth:
    """Return the truth of a scene without its effects. See `build_truth`."""
    stated = probe_from(Section(file, scene.probe, "probe"))
    wall = build_wall(scene.pipe, scene.seed, file.parent)
    time_s = np.arange(scene.frames) / scene.frame_rate
    light = np.array([scene.pattern[k % len(scene.pattern)] for k in range(scene.frames)], np.str_)
    return SceneTruth(
        name=scene.name,
        kind=scene.kind,
        seed=scene.seed,
        stated=stated,
        instrument=true_instrument(scene, stated, wall),
        wall=wall,
        facts=facts_of(scene.pipe),
        motion=_motion(scene, wall, float(time_s[-1]), file.parent),
        odometer=_odometer(scene),
        frames=FrameTable(np.arange(scene.frames), time_s, light),
        frame_rate=scene.frame_rate,
        rendering=scene.rendering,
    )


def _motion(scene: Scene, wall: Wall, last_s: float, folder: Path) -> Motion:
    if scene.motion.measured is None:
        return motion_of(scene.motion, last_s + 1.0)
    way = read_measured(folder / scene.motion.measured)
    return motion_through(way.T_pc, way.time_s / scene.motion.speed, wall.axis)


def true_instrument(scene: Scene, stated: Probe, wall: Wall) -> TrueInstrument:
    """Return the true instrument: the stated one or a draw from its stated uncertainty, with its lights."""
    seed = scene.seed if scene.probe_seed is None else scene.probe_seed
    probe = stated if scene.truth == "stated" else drawn(stated, seed)
    profile = LineProfile(stated.laser.line_sigma_mm, scene.laser.skewness)
    laser = TrueLaser(
        probe.laser,
        profile=profile,
        power_mm=_power(scene.laser.peak, profile, wall),
        colour_bgr=scene.laser.colour_bgr,
        ghost_relative=scene.laser.ghost,
        speckle_contrast=scene.laser.speckle,
        speckle_grain_mm=scene.laser.speckle_grain_mm,
    )
    light = _light(scene.light, stated, wall)
    return TrueInstrument(TrueCamera(probe.camera), laser, light, _sensor(scene.sensor), stated.shutter)


def drawn(stated: Probe, seed: int) -> Probe:
    """Return a probe drawn from the stated normal distribution."""
    random = np.random.default_rng([seed, _INSTRUMENT_STREAM])
    directions = stated.principal_uncertainties()
    moved = directions @ random.standard_normal(directions.shape[1])
    return stated.with_parameters(stated.parameters + moved, stated.covariance)


def _power(peak: float, profile: LineProfile, wall: Wall) -> float:
    """Return the power with which the line's peak is ``peak`` on the mean wall at the mean radius."""
    highest = float(profile.density(np.linspace(*profile.reach_mm(), 2001)).max())
    return peak * _radius(wall) / (REFERENCE_MM * _albedo(wall) * highest)


def _light(scene: LightScene, stated: Probe, wall: Wall) -> LedRing:
    """Return LEDs with which the mean wall has the scene's ``level`` where it is brightest."""
    lighting = stated.lighting
    ring = LedRing(
        lighting.leds, lighting.radius_mm, lighting.z_mm, 1.0, scene.lobe, scene.even, scene.colour_bgr
    )
    ahead = np.linspace(1.0, 4.0 * _radius(wall), 400)
    around = lamp_azimuth_rad(ring.leds)
    x = _radius(wall) - ring.radius_mm * np.cos(around)
    y = ring.radius_mm * np.sin(around)
    z = (ahead - ring.z_mm)[:, None]
    d = np.sqrt(x**2 + y**2 + z**2)
    lit = REFERENCE_MM**2 * np.mean(
        (ring.even + (1 - ring.even) * (z / d) ** ring.lobe) * np.clip(x, 0, None) / d**3, axis=1
    )
    return replace(ring, level=scene.level / (_albedo(wall) * float(lit.max())))


def _radius(wall: Wall) -> float:
    return float(np.mean(wall.radius_mm))


def _albedo(wall: Wall) -> float:
    return float(np.mean(wall.albedo_bgr))


def _sensor(scene: SensorScene) -> TrueSensor:
    return TrueSensor(
        full_well_e=scene.full_well_e,
        read_noise_e=scene.read_noise_e,
        black_level=scene.black_level,
        gamma=scene.gamma,
        psf_sigma_px=scene.psf_sigma_px,
        veil_relative=scene.veil,
        veil_sigma_px=scene.veil_sigma_px,
        vignetting=scene.vignetting,
        fixed_pattern=scene.fixed_pattern,
    )


def _odometer(scene: Scene) -> Odometer | None:
    if scene.odometer is None:
        return None
    return Odometer(scene.odometer.rate_hz, scene.odometer.quantum_mm, scene.odometer.scale)
