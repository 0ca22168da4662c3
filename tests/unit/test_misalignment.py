"""The equation of the paper, the exact model, and the quantities derived from them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.misalignment import (
    MisalignedScan,
    allowed_tilt_deg,
    fit_circle,
    implied_baselines_mm,
    misalignment_error,
    misread_ring,
    paper_error,
)

CAMERA = KannalaBrandt((1600, 1200), (366.0, 366.0), (797.0, 592.0), (-0.0118, 0.0008, -0.0008, 0.0))


def test_the_numbers_of_the_paper_are_reproduced():
    error = misalignment_error(MisalignedScan(101.6, 22.0, 0.6))
    assert error.paper_equation_mm == pytest.approx(1.199, abs=5e-4)
    assert error.max_radial_mm == pytest.approx(1.259, abs=5e-4)
    # |X| |z − l| / z on the far side, by hand
    lift = 50.8 * math.tan(math.radians(0.6))
    assert error.max_euclidean_mm == pytest.approx(math.hypot(50.8, 22 - lift) * lift / (22 - lift), rel=1e-9)


def test_the_larger_error_is_on_the_side_the_sheet_leans_away_from():
    scan = MisalignedScan(101.6, 22.0, 0.6, tilt_direction_deg=40.0)
    ring = misread_ring(scan)
    worst = ring.azimuth_rad[np.argmax(np.abs(ring.radial_mm))]
    assert np.cos(worst - np.radians(220.0)) == pytest.approx(1.0)


@given(
    st.floats(0.0, 2.0), st.floats(-180.0, 180.0), st.floats(20.0, 150.0), st.floats(15.0, 60.0)
)  # fmt: skip
def test_the_paper_equation_holds_at_every_azimuth_of_a_centred_probe(tilt, direction, diameter, baseline):
    scan = MisalignedScan(diameter, baseline, tilt, direction)
    ring = misread_ring(scan)
    law = paper_error(
        scan.radius_mm, baseline, math.radians(tilt), ring.azimuth_rad - math.radians(direction)
    )
    np.testing.assert_allclose(ring.radial_mm, -law, atol=1e-10)


@pytest.mark.parametrize("tilt_deg", [0.05, 0.2])
def test_the_second_order_is_half_r_t2_phi2_in_harmonics_0_and_2(tilt_deg):
    scan = MisalignedScan(101.6, 22.0, tilt_deg)
    ring = misread_ring(scan)
    second = scan.radius_mm / 2 * (scan.radius_mm / 22.0 * math.radians(tilt_deg)) ** 2
    spectrum = np.fft.rfft(ring.radial_mm).real / len(ring.radial_mm)
    assert spectrum[0] == pytest.approx(second, rel=1e-3)
    assert 2 * spectrum[2] == pytest.approx(second, rel=1e-3)


def test_a_small_tilt_shifts_the_ring():
    error = misalignment_error(MisalignedScan(101.6, 22.5, 0.05))
    assert error.max_radial_mm == pytest.approx(0.100, abs=5e-4)
    assert error.ring_centre_shift_mm == pytest.approx(0.100, abs=5e-4)
    assert 1000 * error.ring_radius_change_mm == pytest.approx(0.1, abs=0.05)


def test_one_ring_cannot_distinguish_a_small_tilt_from_an_off_centre_probe():
    tilted = misread_ring(MisalignedScan(101.6, 22.0, 0.05)).xyz_assumed_c[:, :2]
    centre, _ = fit_circle(tilted)
    moved = misread_ring(
        MisalignedScan(101.6, 22.0, offset_x_mm=-centre[0], offset_y_mm=-centre[1])
    ).xyz_assumed_c[:, :2]
    difference = np.linalg.norm(tilted, axis=1) - np.linalg.norm(moved, axis=1)
    assert np.abs(difference).max() < 3e-4  # 0.3 % of the tilt's effect of 0.1 mm
    # far off centre one ring is enough: a shift alone no longer explains it
    far = MisalignedScan(101.6, 22.0, 0.05, offset_x_mm=20.0, offset_y_mm=10.0)
    shifted = misread_ring(far).xyz_assumed_c[:, :2]
    centre, radius = fit_circle(shifted)
    residual = np.linalg.norm(shifted - centre, axis=1) - radius
    assert np.abs(residual).max() > 5e-3


def test_baseline_implied_by_the_paper():
    radial, euclidean = implied_baselines_mm(101.6, 0.05, 0.1)
    assert radial == pytest.approx(22.5, abs=0.05)
    assert euclidean == pytest.approx(25.1, abs=0.05)
    near = MisalignedScan(101.6, euclidean, 0.05)
    assert misread_ring(near, azimuth_rad=np.zeros(1)).euclidean_mm[0] == pytest.approx(0.1, rel=1e-9)


@pytest.mark.parametrize("offset", [0.0, 12.0])
def test_without_tilt_there_is_no_error(offset):
    error = misalignment_error(MisalignedScan(101.6, 22.0, offset_x_mm=offset), CAMERA)
    assert error.paper_equation_mm == 0
    assert max(error.max_radial_mm, error.max_euclidean_mm, error.ring_centre_shift_mm) < 1e-9
    assert abs(error.ring_radius_change_mm) < 1e-9


def test_rays_of_the_assumed_camera_make_no_difference():
    scan = MisalignedScan(101.6, 22.0, 0.6, 40.0, 179.5, 3.0, -2.0)
    without, seen = misalignment_error(scan), misalignment_error(scan, CAMERA)
    assert seen.max_radial_mm == pytest.approx(without.max_radial_mm, abs=1e-8)
    assert seen.ring_centre_shift_mm == pytest.approx(without.ring_centre_shift_mm, abs=1e-8)


def test_cone_law():
    cone = math.radians(0.05)
    ring = misread_ring(MisalignedScan(101.6, 22.0, opening_angle_deg=180 - 0.1))
    np.testing.assert_allclose(ring.radial_mm, -(50.8**2) / 22 * cone, rtol=3e-3)


def test_allowed_tilt_meets_its_accuracy_and_grows_with_it():
    scan = MisalignedScan(101.6, 22.0, tilt_direction_deg=30.0, offset_x_mm=4.0)
    allowed = [allowed_tilt_deg(scan, a) for a in (0.02, 0.1, 0.5, 2.0)]
    assert np.all(np.diff(allowed) > 0)
    at_limit = MisalignedScan(101.6, 22.0, allowed[1], 30.0, offset_x_mm=4.0)
    assert misalignment_error(at_limit).max_radial_mm == pytest.approx(0.1, rel=1e-6)


def test_allowed_tilt_in_closed_form():
    product = 0.1 / (50.8 + 0.1)
    expected = math.degrees(math.atan(product * 22 / 50.8))
    assert allowed_tilt_deg(MisalignedScan(101.6, 22.0), 0.1) == pytest.approx(expected, rel=1e-9)


def test_no_tilt_is_allowed_where_the_cone_alone_costs_more():
    assert math.isnan(allowed_tilt_deg(MisalignedScan(101.6, 22.0, opening_angle_deg=179.0), 0.1))


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"diameter_mm": -101.6}, "diameter_mm"),
        ({"baseline_mm": 0.0}, "baseline_mm"),
        ({"tilt_deg": -1.0}, "tilt_deg"),
        ({"tilt_deg": 60.0}, "tilt_deg"),
        ({"diameter_mm": math.nan}, "diameter_mm"),
        ({"opening_angle_deg": 0.0}, "opening_angle_deg"),
        ({"offset_x_mm": 60.0}, "offset_x_mm"),
    ],
)
def test_values_out_of_range_are_refused_with_their_name(values, named):
    with pytest.raises(InputError, match=named):
        MisalignedScan(**({"diameter_mm": 101.6, "baseline_mm": 22.0} | values))


def test_accuracy_must_be_positive():
    with pytest.raises(InputError, match="accuracy_mm"):
        allowed_tilt_deg(MisalignedScan(101.6, 22.0), 0.0)


def test_a_camera_that_sees_too_little_is_named():
    narrow = KannalaBrandt((640, 480), (400.0, 400.0), (320.0, 240.0), (-0.3, 0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="camera sees"):
        misalignment_error(MisalignedScan(101.6, 10.0, 0.6), narrow)
