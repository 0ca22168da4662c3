"""Checks of the laws of time, pose, odometer and bend."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pipeline.geometry.axis import frames_at
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import Switch, typical_switch
from pipeline.simulator.laws import (
    BASELINE_MM,
    FOCAL_PX,
    IMAGE_SIZE,
    Check,
    TracedRing,
    bench_truth,
    harmonic,
    strongest,
    trace_ring,
)
from pipeline.simulator.laws.closed_form import baseline, focal_scale, principal_point, theta_of
from pipeline.simulator.laws.radius import SHARE, effect_ring
from pipeline.simulator.motion import Motion, Odometer, Signal, constant
from pipeline.simulator.truth import SceneTruth

# Radius of a 4 inch pipe, mm.
_RADIUS_MM = 50.8
# Offset and yaw of the examples: large enough for second-order terms to show, small enough for the laws.
_OFF_CENTRE_MM, _YAW_DEG = 2.0, 5.0
# Speed of a slow crawler; a vibration above half of 30 frames/s, so that only its alias is seen.
_SPEED_MM_S, _ALIASED_HZ = 15.0, 26.0


def moving_checks() -> Iterator[Check]:
    """Yield the checks."""
    yield from _drifts()
    yield _rocking()
    yield from _rolling()
    yield from _vibration()
    yield from _off_centre()
    yield from _yaw()


def _drifts() -> Iterator[Check]:
    """Check the static law × (1 − exp(−t/t₀)), at t = t₀."""
    psi, gone = np.linspace(-np.pi, np.pi, 73)[:-1], -math.expm1(-1.0)
    laws = (
        ("baseline_drift", "✓", "−(r/l) δl (1 − exp(−t/t₀))", 0, baseline),
        ("focal_drift", "✓", "S κ θ (1 − exp(−t/t₀))", 0, focal_scale),
        ("centre_drift", "○", "(S/f) c c₁ (1 − exp(−t/t₀))", 1, principal_point),
    )
    for name, mark, text, order, law in laws:
        switch = typical_switch(name)
        static = law(_RADIUS_MM, psi, *switch.values[:-1])
        ring = effect_ring(switch, _RADIUS_MM, switch.quantities["time_s"])
        crest = np.exp(1j * order * math.radians(switch.quantities.get("direction_deg", 0.0)))
        predicted = float((harmonic(psi, static, order) * crest.conjugate()).real) * gone
        computed = float((harmonic(ring.azimuth_rad, ring.error_mm, order) * crest.conjugate()).real)
        yield Check(
            name, mark, text, "δr at t = t₀, 4 inch", predicted, computed, "mm", SHARE * abs(predicted),
            (order, strongest(ring.azimuth_rad, ring.error_mm)),
        )  # fmt: skip


def _rocking() -> Check:
    """Check the tilt's law at the crest of the swing."""
    switch = typical_switch("laser_rocking")
    ring = effect_ring(switch, _RADIUS_MM, 0.25 / switch.quantities["frequency_hz"])
    predicted = _RADIUS_MM**2 / 22.0 * 1e-3 * switch.values[0]
    computed = abs(harmonic(ring.azimuth_rad, ring.error_mm, 1))
    return Check(
        "laser_rocking", "✓", "(r²/l) φ c₁ at one frequency", "δr at the crest, 1 mrad, 4 inch", predicted,
        computed, "mm", SHARE * predicted, (1, strongest(ring.azimuth_rad, ring.error_mm)),
    )  # fmt: skip


def _rolling() -> Iterator[Check]:
    """Check ė_x: (ė_x τ/2) sin 2ψ; ė_y: (ė_y τ/2)(1 − cos 2ψ); axial v τ sin ψ; τ = readout ρ₀/H."""
    switch = typical_switch("rolling_shutter")
    rate = 2 * math.pi * 5.3 * 0.2
    rho = FOCAL_PX * theta_of(_RADIUS_MM)
    size = rate * switch.values[0] * rho / IMAGE_SIZE[1] / 2
    # motion of the camera in one direction is motion of the ring in the other
    sideways = trace_ring(switch_on(_moving(x_mm=_steady(-rate)), [switch]))
    yield _shutter_check("(ė_x τ/2) sin 2ψ", "m2, sine part, ring going right", size, _part(sideways, 2).imag)
    upright = trace_ring(switch_on(_moving(y_mm=_steady(-rate)), [switch]))
    law = "(ė_y τ/2)(1 − cos 2ψ)"
    yield _shutter_check(law, "m0, ring going down", size, _part(upright, 0).real)
    yield _shutter_check(law, "m2, cosine part, ring going down", -size, _part(upright, 2).real)
    forward = switch_on(_moving(distance_mm=_steady(_SPEED_MM_S)), [switch])
    ring = trace_ring(forward)
    late = ((ring.uv[:, 1] + 0.5) / IMAGE_SIZE[1] - 0.5) * switch.values[0]
    along = forward.motion.distance_mm.at(late) - forward.motion.distance_mm.at(np.zeros(1))
    axial = _SPEED_MM_S * switch.values[0] * rho / IMAGE_SIZE[1]
    computed = harmonic(ring.azimuth_rad, along, 1).imag
    yield _shutter_check("v τ sin ψ, axial", f"axial, {_SPEED_MM_S:g} mm/s", axial, computed)


def _vibration() -> Iterator[Check]:
    """Check that the ring is displaced by e(t), which frames see at the frequency |f − k · frame rate|."""
    amplitude, frequency, direction = 0.2, _ALIASED_HZ, 40.0
    switch = Switch("probe_vibration", (amplitude, frequency, direction))
    truth = switch_on(bench_truth(_RADIUS_MM, frames=300), [switch])
    ring = trace_ring(truth, 0.25 / frequency)
    crest = np.exp(1j * math.radians(direction))
    computed = float((harmonic(ring.azimuth_rad, ring.error_mm, 1) * crest.conjugate()).real)
    law = "e(t) = a sin 2πft of the camera: −e c₁ on the ring"
    yield Check("probe_vibration", "✓", law, "ring at the crest", -amplitude, computed, "mm", 0.004, (1, 1))
    swing = truth.poses()[:, 0, 3]
    seen = np.fft.rfftfreq(300, 1 / truth.frame_rate)[np.argmax(np.abs(np.fft.rfft(swing)))]
    alias = abs(frequency - truth.frame_rate)
    law = "seen at |f − k · frame rate|"
    yield Check("probe_vibration", "✓", law, "26 Hz at 30 frames/s", alias, float(seen), "Hz", 0.1)


def _off_centre() -> Iterator[Check]:
    """E c₁ − (e²/4r)(1 − c₂)."""
    ring = trace_ring(_moving(x_mm=constant(-_OFF_CENTRE_MM)))
    e, second = _OFF_CENTRE_MM, _OFF_CENTRE_MM**2 / (4 * _RADIUS_MM)
    law = "e c₁ − (e²/4r)(1 − c₂)"
    for order, predicted in ((1, e), (0, -second), (2, second)):
        of = f"m{order}, e = {e:g} mm, 4 inch"
        tolerance = 2 * e * (e / _RADIUS_MM) ** (3 if order != 1 else 2)
        yield Check("off-centre", "✓", law, of, predicted, _part(ring, order).real, "mm", tolerance)


def _yaw() -> Iterator[Check]:
    """Check (rβ²/4)(1 + c₂) around a centre that is displaced by βl."""
    beta = math.radians(_YAW_DEG)
    truth = _moving(yaw_rad=constant(beta))
    read = truth.stated.triangulate(trace_ring(truth).uv)[:, :2]
    centre = 0.5 * (read.max(0) + read.min(0))
    own = read - centre
    psi, radius = np.arctan2(own[:, 1], own[:, 0]), np.linalg.norm(own, axis=1) - _RADIUS_MM
    size, law = _RADIUS_MM * beta**2 / 4, "(rβ²/4)(1 + c₂), centre βl"
    tolerance = 4 * size * beta**2
    yield Check("probe yaw", "○", law, "centre, 5°", -22.0 * beta, float(centre[0]), "mm", 22 * beta**3)
    yield Check("probe yaw", "○", law, "m0, 5°, 4 inch", size, harmonic(psi, radius, 0).real, "mm", tolerance)
    yield Check("probe yaw", "○", law, "m2, 5°, 4 inch", size, harmonic(psi, radius, 2).real, "mm", tolerance)


def _moving(
    distance_mm: Signal | None = None, x_mm: Signal | None = None, y_mm: Signal | None = None,
    yaw_rad: Signal | None = None,
) -> SceneTruth:  # fmt: skip
    still = constant(0.0)
    motion = Motion(distance_mm or still, x_mm or still, y_mm or still, yaw_rad or still)
    return replace(bench_truth(_RADIUS_MM), motion=motion)


def _steady(rate: float) -> Signal:
    """Return a value that changes linearly and is 0 at time 0."""
    return Signal(np.array([-1.0, 1.0]), np.array([-rate, rate]))


def _part(ring: TracedRing, order: int) -> complex:
    return harmonic(ring.azimuth_rad, ring.error_mm, order)


def _shutter_check(law: str, of: str, predicted: float, computed: float) -> Check:
    return Check("rolling_shutter", "✓", law, of, predicted, computed, "mm", SHARE * abs(predicted))


# Chord over which the bend's sagitta is checked.
_CHORD_MM = 100.0
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
    law = "(way by pictures) / (way by encoder) = (1 − δl/l)/(1 + κ)"
    tolerance = 2 * (grown / BASELINE_MM) ** 2
    return Check("encoder_scale", "✓", law, "κ = 0.5 %, δl = 0.05 mm", predicted, computed, "", tolerance)


def _slip() -> Check:
    switch = typical_switch("encoder_slip")
    truth = _travelling([switch])
    time = switch.quantities["time_s"]
    steps = [_way(truth, t) - _reading(truth, t) for t in (time - 0.1, time + 0.1)]
    law = "a step in (way by pictures) − (way by encoder)"
    of, size = f"slip of {switch.values[0]:g} mm", -switch.values[0]
    return Check("encoder_slip", "○", law, of, size, steps[1] - steps[0], "mm", _READING_MM)


def _backlash() -> Check:
    switch = typical_switch("encoder_backlash")
    truth = _travelling([switch])
    # forward at 3 s, back at the mirrored time after the reversal at 7 s
    apart = _reading(truth, 11.0) - _reading(truth, 3.0) - (_way(truth, 11.0) - _way(truth, 3.0))
    law = "reading = s − (b/2) sgn v: b apart, forth and back"
    return Check("encoder_backlash", "✓", law, "b = 0.5 mm", switch.values[0], apart, "mm", _READING_MM)


def _late() -> Iterator[Check]:
    """Check readings that are late by τ, and stamps of a clock that is behind by τ.

    Their signs are opposite.
    """
    switch = typical_switch("time_offset")
    delay, predicted = switch.values[0], _SPEED_MM_S * switch.values[0]
    late, punctual = _travelling([switch]), _travelling([])
    computed = _way(late, 5.0) - _way(late, -delay) - _reading(late, 5.0)
    law = "(way by pictures) − (way by encoder) = v τ, the reading at t being that of t − τ"
    yield Check("time_offset", "✓", law, "20 ms at 15 mm/s", predicted, computed, "mm", _READING_MM)
    # a stamp t of a clock that is behind was made at t + τ
    computed = _way(punctual, 5.0) - _way(punctual, 0.0) - _reading(punctual, 5.0 + delay)
    law = "(way by pictures) − (way by encoder) = −v τ where the encoder's clock is behind by τ"
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
    """Return a bench that is driven forward for 7 s and back, with a fine odometer and some effects."""
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
