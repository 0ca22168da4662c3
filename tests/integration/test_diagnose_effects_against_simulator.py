"""The predictions of the diagnosis against the simulator, which shares no model with it.

Rings are traced by the simulator with each effect switched on, for a camera on the axis and for an off-centre
one that leans. Points of the wall are traced back along its viewing rays. Signs and sizes must agree.
"""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.physics.catalogue import effect
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.laws import bench_truth, trace_ring
from pipeline.simulator.motion import Motion, Odometer, Signal, Slip, Wave, constant
from pipeline.simulator.rays import viewing_rays
from stages.diagnose.effects.base import Travel
from stages.diagnose.effects.library import LIBRARY, ring_shift_px, texture_shift_px
from tests.unit.wall_points import Bore, ring_points, texture_points

COUNT, TIME_S = 144, 3.0
RADIUS_MM, YAW = 42.0, 0.03
CENTRED = Motion(constant(20.0))
ASIDE = Motion(constant(20.0), constant(5.0), constant(-4.0), constant(YAW))
# Seen from a camera at (5, −4) that leans by the yaw towards +x.
BESIDE = Bore(RADIUS_MM, (-5.0 * np.cos(YAW), 4.0, -5.0 * np.sin(YAW)), (-np.sin(YAW), 0.0, np.cos(YAW)))
PLACES = {"on the axis": (CENTRED, Bore(RADIUS_MM)), "beside it and leaning": (ASIDE, BESIDE)}
# Large effects; allowed error of a prediction, per cent. The simulator undoes the straight tube, with which
# the lens was calibrated, by glass the other way round: far ahead this differs from subtracting it.
SWITCHES = {
    "laser_tilt": ((0.6, 40.0), 0.1),
    "laser_cone": ((0.3,), 0.1),
    "baseline": ((0.4,), 0.1),
    "beam_decentre": ((0.2, 70.0), 0.1),
    "sheet_waviness": ((2.0, 5.0, 30.0), 0.1),
    "laser_rocking": ((3.0, 0.7, 200.0), 0.1),
    "principal_point": ((2.0, -60.0), 0.1),
    "focal_scale": ((0.004,), 0.1),
    "radial_distortion": ((0.004,), 0.1),
    "sensor_tilt": ((0.001, 25.0), 0.1),
    "pixel_aspect": ((0.004,), 0.4),
    "pupil_shift": ((1.0,), 0.1),
    "baseline_drift": ((0.4, 2.0), 0.1),
    "focal_drift": ((0.004, 2.0), 0.1),
    "centre_drift": ((2.0, 100.0, 2.0), 0.1),
    "housing_glass": ((2.0,), 0.1),
    "tube_wedge": ((0.5, 40.0), 4.0),
    "tube_tilt": ((4.0, 40.0), 35.0),
    "dome_axial": ((0.5,), 1.0),
    "dome_lateral": ((0.5, 40.0), 1.0),
    "outside_index": ((0.333,), 0.1),
    "ovality": ((0.15, 40.0), 1.0),
}

# Of the ring, where that differs.
OF_RING = {"tube_wedge": 1.0, "tube_tilt": 2.0}


def asked(name, values):
    """Return shape and amplitudes of the quantities of a switch."""
    found = dict(zip((q.name for q in effect(name).quantities), values, strict=True))
    model, size = LIBRARY[name], values[0]
    shape = tuple(found[n] for n in ("order", "frequency_hz", "time_s") if n in found)
    shape = (1.0,) if name == "tube_tilt" else shape
    turns = found.get("order", 2.0 if name == "ovality" else 1.0)
    direction = turns * np.radians(found.get("direction_deg", 0.0))
    amplitude = size * np.array([np.cos(direction), np.sin(direction), 0.0, 0.0])[: len(model.amplitudes)]
    return model, shape, amplitude


@pytest.mark.parametrize("place", PLACES.values(), ids=list(PLACES))
@pytest.mark.parametrize("name", SWITCHES)
def test_the_simulators_ring_is_where_the_diagnosis_predicts_it(name, place):
    values, per_cent = SWITCHES[name]
    per_cent = OF_RING.get(name, per_cent)
    motion, bore = place
    plain = bench_truth(RADIUS_MM, motion)
    changed = switch_on(plain, [Switch(name, values)])
    points = ring_points(plain.stated, bore, COUNT, TIME_S)
    assert trace_ring(plain, TIME_S, COUNT).uv == pytest.approx(points.uv, abs=1e-6)
    moved = np.sum((trace_ring(changed, TIME_S, COUNT).uv - points.uv) * points.outward, axis=1)
    model, shape, amplitude = asked(name, values)
    predicted = ring_shift_px(model, points, shape, amplitude)
    assert np.abs(moved).max() > 0.02
    assert predicted == pytest.approx(moved, abs=per_cent / 100 * np.abs(moved).max())


@pytest.mark.parametrize("ahead_mm", [12.0, 30.0, 70.0])
@pytest.mark.parametrize("name", [n for n in SWITCHES if effect(n).family in ("camera", "window")])
def test_predicted_wall_points_lie_on_the_simulators_rays_of_their_pixels(name, ahead_mm):
    values, per_cent = SWITCHES[name]
    changed = switch_on(bench_truth(RADIUS_MM), [Switch(name, values)])
    points = texture_points(changed.stated, Bore(RADIUS_MM), ahead_mm)
    points = replace(points, time_s=np.full(len(points.uv), TIME_S))
    model, shape, amplitude = asked(name, values)
    shift = texture_shift_px(model, points, shape, amplitude)

    def missed_mm(uv):
        origin, ray = viewing_rays(changed.instrument_at(TIME_S).camera, uv)
        return np.linalg.norm(np.cross(points.xyz_c - origin, ray), axis=1).max()

    assert missed_mm(points.uv + shift) <= per_cent / 100 * missed_mm(points.uv) + 1e-9


def test_the_simulators_rolling_shutter_bends_the_ring_as_predicted():
    sway = Motion(constant(20.0), Signal(np.zeros(1), np.array([2.0]), (Wave(0.5, 2.0),)), constant(-1.0))
    plain = bench_truth(RADIUS_MM, sway)
    changed = switch_on(plain, [Switch("rolling_shutter", (0.016,))])
    points = ring_points(plain.stated, Bore(RADIUS_MM, (-2.0, 1.0, 0.0)), COUNT, TIME_S)
    assert trace_ring(plain, TIME_S, COUNT).uv == pytest.approx(points.uv, abs=1e-6)
    later, earlier = (trace_ring(plain, TIME_S + step, COUNT).uv for step in (1e-3, -1e-3))
    moving = replace(points, velocity_px=(later - earlier) / 2e-3)
    moved = np.sum((trace_ring(changed, TIME_S, COUNT).uv - points.uv) * points.outward, axis=1)
    predicted = ring_shift_px(LIBRARY["rolling_shutter"], moving, (), np.array([0.016]))
    assert np.abs(moved).max() > 0.05
    # Within a row's delay of up to 5 ms the speed of the sway itself changes by some per cent.
    assert predicted == pytest.approx(moved, abs=0.05 * np.abs(moved).max())


ODOMETERS = {
    "encoder_scale": ((), [0.01], Odometer(quantum_mm=0.0, scale=0.01)),
    "encoder_slip": ((4.005,), [3.0], Odometer(quantum_mm=0.0, slips=(Slip(4.005, 3.0),))),
    "encoder_backlash": ((), [0.8], Odometer(quantum_mm=0.0, backlash_mm=0.8)),
    "time_offset": ((), [0.1], Odometer(quantum_mm=0.0, delay_s=0.1)),
}


@pytest.mark.parametrize("name", ODOMETERS)
def test_the_simulators_encoder_reads_too_much_by_the_predicted_amount(name):
    shape, amplitude, odometer = ODOMETERS[name]
    to_and_fro = Motion(Signal(np.zeros(1), np.zeros(1), (Wave(20.0, 0.15),)))
    true, read = (meter.readings(to_and_fro, 10.0) for meter in (Odometer(quantum_mm=0.0), odometer))
    time, way = true.time_s, true.distance_mm
    travel = Travel(time, way, np.gradient(way, time))
    predicted = LIBRARY[name].reading_shift_mm(travel, shape, np.array(amplitude))
    excess = read.distance_mm - way
    # Readings count from the first; a delay needs the distance before it, which is not known.
    settled = time > 0.5
    difference = (excess - predicted)[settled]
    assert np.ptp(excess[settled]) > 0.3
    assert difference - difference.mean() == pytest.approx(np.zeros(settled.sum()), abs=2e-3)
