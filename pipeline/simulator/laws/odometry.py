"""Checks of the laws of odometer and bend."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pipeline.geometry.axis import frames_at
from pipeline.simulator.effects.catalogue import switch_on
from pipeline.simulator.effects.switch import Switch, typical_switch
from pipeline.simulator.laws.bench import BASELINE_MM, bench_truth
from pipeline.simulator.laws.check import Check
from pipeline.simulator.laws.harmonics import harmonic
from pipeline.simulator.laws.radius import effect_ring
from pipeline.simulator.motion import Motion, Odometer, Signal
from pipeline.simulator.truth import SceneTruth

_RADIUS_MM, _SPEED_MM_S, _CHORD_MM = 50.8, 15.0, 100.0
# One reading of the encoder at 1 kHz, and rounding.
_READING_MM = 2e-3 * _SPEED_MM_S


def odometry_checks() -> Iterator[Check]:
    """Yield the checks."""
    yield _scale()
    yield _slip()
    yield _backlash()
    yield from _late()
    yield from _bend()


def _scale() -> Check:
    """Check visual over encoder with a baseline error: the visual scale is that of the radius."""
    grown, count = 0.05, 0.005
    truth = _travelling([Switch("encoder_scale", (count,))])
    ring = effect_ring(Switch("baseline", (grown,)), _RADIUS_MM)
    visual = 1 + harmonic(ring.azimuth_rad, ring.error_mm, 0).real / _RADIUS_MM
    computed = visual / (_reading(truth, 6.0) - _reading(truth, 1.0)) * (_way(truth, 6.0) - _way(truth, 1.0))
    predicted = (1 - grown / BASELINE_MM) / (1 + count)
    law = "visual/encoder = (1 − δl/l)/(1 + κ)"
    tolerance = 2 * (grown / BASELINE_MM) ** 2
    return Check("encoder_scale", "✓", law, "κ = 0.5 %, δl = 0.05 mm", predicted, computed, "", tolerance)


def _slip() -> Check:
    switch = typical_switch("encoder_slip")
    truth = _travelling([switch])
    time = switch.quantities["time_s"]
    steps = [_way(truth, t) - _reading(truth, t) for t in (time - 0.1, time + 0.1)]
    law = "a step in visual − encoder"
    of, size = f"slip of {switch.values[0]:g} mm", -switch.values[0]
    return Check("encoder_slip", "○", law, of, size, steps[1] - steps[0], "mm", _READING_MM)


def _backlash() -> Check:
    switch = typical_switch("encoder_backlash")
    truth = _travelling([switch])
    # forth at 3 s, back at the mirrored time after the reversal at 7 s
    apart = _reading(truth, 11.0) - _reading(truth, 3.0) - (_way(truth, 11.0) - _way(truth, 3.0))
    law = "reading = s − (b/2) sgn v: b apart, forth and back"
    return Check("encoder_backlash", "✓", law, "b = 0.5 mm", switch.values[0], apart, "mm", _READING_MM)


def _late() -> Iterator[Check]:
    """Check readings that are late by τ, and stamps of a clock behind by τ: the signs are opposite."""
    switch = typical_switch("time_offset")
    delay, predicted = switch.values[0], _SPEED_MM_S * switch.values[0]
    late, punctual = _travelling([switch]), _travelling([])
    computed = _way(late, 5.0) - _way(late, -delay) - _reading(late, 5.0)
    law = "visual − encoder = v τ, the reading at t being that of t − τ"
    yield Check("time_offset", "✓", law, "20 ms at 15 mm/s", predicted, computed, "mm", _READING_MM)
    # a stamp t of a clock that is behind was made at t + τ
    computed = _way(punctual, 5.0) - _way(punctual, 0.0) - _reading(punctual, 5.0 + delay)
    law = "visual − encoder = −v τ where the encoder's clock is behind by τ: its readings are early"
    yield Check("time_offset", "", law, "20 ms at 15 mm/s", -predicted, computed, "mm", _READING_MM)


def _bend() -> Iterator[Check]:
    """Check the sagitta L²/8ρ over a chord; the wall's way ds (1 − (r/ρ) c₁)."""
    curvature = 1 / (1.5 * 101.6)
    truth = switch_on(bench_truth(_RADIUS_MM), [Switch("pipe_bend", (curvature, 40.0))])
    s = np.array([0.0, _CHORD_MM / 2, _CHORD_MM])
    place, R_pa = frames_at(truth.wall.axis, s)
    sagitta = float(np.linalg.norm(place[1] - 0.5 * (place[0] + place[2])))
    law = "sagitta L²/8ρ; arc ds (1 − (r/ρ) c₁)"
    yield Check(
        "pipe_bend", "○", law, "sagitta, 1.5 D, L = 100 mm", _CHORD_MM**2 * curvature / 8, sagitta, "mm",
        0.05 * sagitta,
    )  # fmt: skip
    step = np.array([20.0, 20.5])
    inner = np.array([np.cos(np.radians(40.0)), np.sin(np.radians(40.0)), 0.0]) * _RADIUS_MM
    place, R_pa = frames_at(truth.wall.axis, step)
    ends = place + R_pa @ inner
    share = float(np.linalg.norm(ends[1] - ends[0])) / 0.5
    inside = 1 - _RADIUS_MM * curvature
    yield Check("pipe_bend", "○", law, "way along the inside of the bend", inside, share, "", 1e-3)


def _travelling(switches: list[Switch]) -> SceneTruth:
    """Return a bench driven forth for 7 s and back, its odometer fine, with effects."""
    time = np.arange(-2.0, 16.0, 0.5)
    way = Signal(time, _SPEED_MM_S * (7.0 - np.abs(time - 7.0)))
    truth = replace(
        bench_truth(_RADIUS_MM, Motion(way), frames=420), odometer=Odometer(rate_hz=1000.0, quantum_mm=0.0)
    )
    return switch_on(truth, switches)


def _reading(truth: SceneTruth, time_s: float) -> float:
    encoder = truth.encoder()
    if encoder is None:
        raise ValueError("the bench has an odometer")
    return float(np.interp(time_s, encoder.time_s, encoder.distance_mm))


def _way(truth: SceneTruth, time_s: float) -> float:
    return float(truth.motion.distance_mm.at(np.array(time_s)))
