"""Scoring against the true wall: a finding on its relief is real, one elsewhere is not, and errors count."""

import numpy as np
import pytest

from tests.benchmarks.true_wall import errors, relief_of, true_wall

DISTANCE, AZIMUTH = np.arange(0, 60, 0.5), -np.pi + 2 * np.pi / 360 * np.arange(360)
PLACED = {"axial_scale_error": 0.0, "axial_shift_mm": 0.0, "roll_shift_deg": 0.0}


@pytest.fixture
def wall(tmp_path):
    s, psi = np.meshgrid(DISTANCE, AZIMUTH, indexing="ij")
    pit = np.exp(-(((s - 30) / 3) ** 4) - (40 * psi / 3) ** 4)
    radius = 40 + 0.2 * np.cos(2 * psi) + 0.8 * pit - 0.7 * (np.abs(s - 50) < 2)
    np.savez(tmp_path / "truth_wall.npz", distance_mm=DISTANCE, azimuth_rad=AZIMUTH, radius_mm=radius)
    return true_wall(tmp_path)


def finding(distance_mm, clock, depth_mm):
    near = {"distance_from_mm": distance_mm - 2, "distance_to_mm": distance_mm + 2}
    return near | {"clock_from": clock - 0.2, "clock_to": clock + 0.2, "depth_mm": depth_mm}


@pytest.mark.parametrize(
    ("distance_mm", "clock", "depth_mm", "real"),
    [(30, 3, 0.8, True), (30, 3, -0.8, False), (15, 3, 0.8, False), (30, 7, 0.8, False), (50, 7, -0.7, True)],
)
def test_a_finding_is_real_where_the_true_wall_departs_as_it_says(wall, distance_mm, clock, depth_mm, real):
    assert wall.shows(finding(distance_mm, clock, depth_mm)) is real


def test_the_relief_of_a_wide_dent_is_its_whole_depth():
    """An oval fitted in its own rows took .29 mm of 1.61, and a fifth from defects beside it."""
    s, psi = np.meshgrid(np.arange(0, 90, 0.5), AZIMUTH, indexing="ij")
    dent, beside = (np.exp(-(((s - 50) / 8) ** 2) - (50 * (psi - at) / 11) ** 2) for at in (0.5, -1.2))
    radius = 50 + 0.1 * np.cos(2 * psi - 1) - 1.6 * dent + 0.4 * beside
    relief = relief_of(radius, s[:, 0], AZIMUTH)
    assert relief.min() == pytest.approx(-1.6, abs=0.04)
    assert relief.max() == pytest.approx(0.4, abs=0.02)


@pytest.mark.parametrize(("mean_mm", "scale", "inside"), [(0.05, 1.0, 0.95), (0.05, 3.0, 0.49)])
def test_the_mean_error_and_the_rest_are_compared_with_their_own_sigma(
    wall, tmp_path, mean_mm, scale, inside
):
    noise = scale * np.random.default_rng(1).normal(0, 0.03, wall.radius_mm.shape)
    np.savez(
        tmp_path / "radius_map.npz", distance_mm=DISTANCE, azimuth_rad=AZIMUTH,
        radius_mm=wall.radius_mm + mean_mm + noise,
        sigma_mm=np.full(noise.shape, np.hypot(0.03, 0.025)), sigma_random_mm=np.full(noise.shape, 0.03),
        displaced_mm=np.zeros(len(DISTANCE)),
    )  # fmt: skip
    found = errors(tmp_path, wall, PLACED)
    assert found.mean_sigmas == pytest.approx(2.0, abs=0.05)
    assert found.inside_apart == pytest.approx(inside, abs=0.01)
