"""How an effect goes with time: along the ring's crest, or between motion and encoder."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float
from pipeline.simulator.effects.catalogue import switch_on
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.laws.bench import RADII_MM, bench_truth
from pipeline.simulator.laws.harmonics import harmonic
from pipeline.simulator.laws.trace import trace_ring
from pipeline.simulator.motion import Motion, Odometer, Signal
from pipeline.simulator.truth import SceneTruth

_RADIUS_MM = max(RADII_MM)
_MOMENTS, _AZIMUTHS = 61, 24
_SPEED_MM_S, _LEG_S = 15.0, 4.0


@dataclass(frozen=True)
class Course:
    """Something over time: ``time_s`` (N,), ``value_mm`` (N,) and what it is."""

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
    """Return the ring's harmonic along the effect's crest, 4 inch."""
    truth, order = switch_on(bench_truth(_RADIUS_MM), [switch]), switch.effect.harmonic or 0
    crest = np.exp(1j * order * math.radians(switch.quantities.get("direction_deg", 0.0)))
    rings = [trace_ring(truth, float(t), _AZIMUTHS) for t in time_s]
    size = [(harmonic(r.azimuth_rad, r.error_mm, order) * crest.conjugate()).real for r in rings]
    return Course(time_s, np.array(size), "radius error at the crest, 4 inch")


def _against_encoder(switch: Switch) -> Course:
    """Return true less read distance on a way forth, at rest, forth faster and back."""
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
