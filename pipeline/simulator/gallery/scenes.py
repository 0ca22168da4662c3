"""The scenes in which the gallery shows an effect, and the effect's course over time."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline.arrays import Float
from pipeline.recording.base import FrameTable
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.surroundings import line_peak
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.laws import BASELINE_MM, RADII_MM, bench_truth, harmonic, trace_ring
from pipeline.simulator.motion import Motion, Odometer, Signal, constant
from pipeline.simulator.truth import SceneTruth, with_laser
from pipeline.simulator.wall import build_wall
from pipeline.simulator.wall.description import Pipe
from pipeline.simulator.wall.grid import Wall

# The smallest square picture in which the ring of a 4 inch pipe fits at 360 px/rad.
SIDE_PX = 880
# The line's peak before blur, full scales.
_PEAK = 0.8
# Speed of a vibration of 0.2 mm at 5.3 Hz at its fastest, to the lower right.
_RATE_MM_S = 2 * math.pi * 5.3 * 0.2
_SHAKEN = frozenset({"rolling_shutter", "motion_blur"})
_ROUGH = frozenset({"albedo_bias", "slope_bias"})
_WELD_MM, _WELD_WIDTH_MM = BASELINE_MM - 1.5, 6.0
_COMPANIONS = {
    "ghost_ring": Switch("laser_tilt", (0.6, 40.0)),
    "gamma": Switch("line_skew", (1.0,)),
    "saturation": Switch("line_skew", (1.0,)),
}


def surroundings(name: str) -> str:
    """Return in words what is added to the bench to show an effect; empty for the plain bench."""
    if name in _SHAKEN:
        return f"the camera moves at {_RATE_MM_S:.1f} mm/s to the lower right"
    if name in _ROUGH:
        return "mottled wall, the line on the flank of a weld"
    other = _COMPANIONS.get(name)
    return "" if other is None else f"{other.text} in both pictures"


def scene_pair(switch: Switch, radius_mm: float) -> tuple[SceneTruth, SceneTruth]:
    """Return the scene without and with an effect at a time when the effect is largest or typical."""
    base = _exposed(bench_truth(radius_mm, image_size=(SIDE_PX, SIDE_PX)))
    if switch.name in _ROUGH:
        base = replace(base, wall=_rough_wall(radius_mm))
    if switch.name in _SHAKEN:
        base = replace(base, motion=_shaken())
    if switch.name in _COMPANIONS:
        # with a straight sheet a ghost lies on the line; clipping and gamma do not move a symmetric line
        base = switch_on(base, [_COMPANIONS[switch.name]])
    moment = FrameTable(np.zeros(1, int), np.array([moment_s(switch)]), np.array(["laser"]))
    return replace(base, frames=moment), replace(switch_on(base, [switch]), frames=moment)


def moment_s(switch: Switch) -> float:
    """Return the time at which the effect is shown.

    A swing's crest, a drift's time constant, else the start.
    """
    sizes = switch.quantities
    if "frequency_hz" in sizes:
        return 0.25 / sizes["frequency_hz"]
    return sizes["time_s"] if switch.effect.time == "drift" else 0.0


def _exposed(truth: SceneTruth) -> SceneTruth:
    """Return the scene with the line equally bright in every bore, and not clipped."""
    return with_laser(truth, power_mm=truth.instrument.laser.power_mm * _PEAK / line_peak(truth))


def _shaken() -> Motion:
    share = _RATE_MM_S / math.sqrt(2)
    way = Signal(np.array([-1.0, 1.0]), np.array([-share, share]))
    return Motion(constant(0.0), way, way)


def _rough_wall(radius_mm: float) -> Wall:
    weld = {"distance_mm": _WELD_MM, "width_mm": _WELD_WIDTH_MM, "height_mm": 0.5}
    pipe = Pipe.model_validate(
        {"diameter_mm": 2 * radius_mm, "from_mm": 0.0, "to_mm": 60.0, "welds": (weld,)}
    )
    return build_wall(pipe, 1, Path())


_RADIUS_MM = max(RADII_MM)
# Points of a plotted course, and azimuths of each ring on it: enough for the first six harmonics.
_MOMENTS, _AZIMUTHS = 61, 24
# Speed of a slow crawler, and the duration of each of the four legs that encoder effects are shown on.
_SPEED_MM_S, _LEG_S = 15.0, 4.0


@dataclass(frozen=True)
class Course:
    """A quantity over time: ``time_s`` (N,), ``value_mm`` (N,), and its name."""

    time_s: Float
    value_mm: Float
    of: str


def course_of(switch: Switch) -> Course | None:
    """Return the course of an effect that has one."""
    if switch.name.startswith("encoder") or switch.name == "time_offset":
        return _against_encoder(switch)
    sizes = switch.quantities
    if "frequency_hz" in sizes:
        return _of_ring(switch, np.linspace(0, 3 / sizes["frequency_hz"], _MOMENTS))
    if switch.effect.time == "drift":
        return _of_ring(switch, np.linspace(0, 4 * sizes["time_s"], _MOMENTS))
    return None


def _of_ring(switch: Switch, time_s: Float) -> Course:
    """Return the amplitude of the ring's harmonic along the effect's crest over time, 4 inch."""
    truth, order = switch_on(bench_truth(_RADIUS_MM), [switch]), switch.effect.harmonic or 0
    crest = np.exp(1j * order * math.radians(switch.quantities.get("direction_deg", 0.0)))
    rings = [trace_ring(truth, float(t), _AZIMUTHS) for t in time_s]
    size = [(harmonic(r.azimuth_rad, r.error_mm, order) * crest.conjugate()).real for r in rings]
    return Course(time_s, np.array(size), "radius error at the crest, 4 inch")


def _against_encoder(switch: Switch) -> Course:
    """Return true minus read distance.

    The probe drives forward, rests, drives forward faster, and returns.
    """
    truth = switch_on(_driven(), [switch])
    encoder = truth.encoder()
    if encoder is None:
        raise ValueError("the bench has an odometer")
    way = truth.motion.distance_mm.at(encoder.time_s)
    return Course(encoder.time_s, way - way[0] - encoder.distance_mm, "motion less encoder")


def _driven() -> SceneTruth:
    speeds = _SPEED_MM_S * np.array([1.0, 0.0, 2.0, -1.0])
    knots = np.arange(len(speeds) + 1) * _LEG_S
    time = np.arange(0.0, knots[-1] + 0.05, 0.05)
    rate = speeds[np.clip((time / _LEG_S).astype(int), 0, len(speeds) - 1)]
    way = np.concatenate([[0.0], np.cumsum(rate[:-1] * np.diff(time))])
    frames = round(knots[-1] * 30)
    truth = bench_truth(_RADIUS_MM, Motion(Signal(time, way)), frames=frames)
    return replace(truth, odometer=Odometer(quantum_mm=0.0))
