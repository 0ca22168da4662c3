"""The priors of motion against simulated motion: the law of strides, derivatives, spacing, drift."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.adjustment.motion_priors import (
    LOOSE,
    jerking_sigma,
    local_third_difference_sigma,
    slip_drift_rows,
    smooth_motion_rows,
    third_difference_growth,
    third_difference_sigma,
    trembling,
)
from pipeline.arrays import Float
from pipeline.geometry.rigid import from_parts, rotation_from_vector

SIGMA = np.array([0.02, 0.03, 0.05, 3e-5, 4e-5, 5e-5])
FRAMES = 6000


def white_jerk(seed: int, frames: int = FRAMES) -> Float:
    """Return poses whose third differences from frame to frame are independent, 1 σ ``SIGMA``."""
    third = np.random.default_rng(seed).standard_normal((frames, 6)) * SIGMA
    # Rotations are kept so small that rotation vectors add up.
    third[:, 3:] -= third[:, 3:].mean(0)
    return poses(np.cumsum(np.cumsum(np.cumsum(third, 0), 0), 0))


TIME_S = np.arange(FRAMES) / 30


def poses(path: Float) -> Float:
    return from_parts(rotation_from_vector(path[:, 3:]), path[:, :3])


def learned(stride: int) -> Float:
    """Return the process noise estimated from every ``stride``-th frame over the true one."""
    T_pc = white_jerk(1)
    return third_difference_sigma(T_pc, TIME_S, np.arange(0, FRAMES, stride))[:3] / SIGMA[:3]


@pytest.mark.parametrize("stride", [1, 2, 3, 5])
def test_every_stride_gives_the_same_process_noise(stride: int) -> None:
    error = 1.2 / np.sqrt(FRAMES / (3 * stride - 2))  # robust 1 σ of overlapping values
    np.testing.assert_allclose(learned(stride), 1, atol=4 * error)


@pytest.mark.parametrize("power", [2.0, 2.5])
def test_a_power_law_of_the_stride_would_fail(power: float) -> None:
    """At stride 2, σ × stride² and σ × stride^2.5 are 12 % and 27 % off: the test above would notice."""
    found = np.mean(learned(2)) * third_difference_growth(2) / 2**power
    assert abs(found - 1) > 0.08


@pytest.mark.parametrize("stride", range(1, 9))
def test_growth_is_the_norm_of_the_threefold_running_sums(stride: int) -> None:
    one = np.ones(stride)
    thrice = np.convolve(np.convolve(one, one), one)
    assert third_difference_growth(stride) == pytest.approx(np.linalg.norm(thrice))


def test_few_frames_give_no_estimate() -> None:
    np.testing.assert_array_equal(
        third_difference_sigma(white_jerk(2, 60), TIME_S, np.arange(0, 35, 5)), LOOSE
    )


def test_outliers_do_not_loosen_the_prior_of_motion() -> None:
    T_pc = white_jerk(3)
    T_pc[::50, :3, 3] += 40.0
    np.testing.assert_allclose(
        third_difference_sigma(T_pc, TIME_S, np.arange(FRAMES))[:3] / SIGMA[:3], 1, atol=0.2
    )


@pytest.mark.parametrize("stride", [1, 2])
def test_vibration_is_distinguished_from_motion(stride: int) -> None:
    shake = np.array([0.5, 0.4, 0.3, 2e-3, 3e-3, 1e-3])
    T_pc, known = white_jerk(5), np.arange(0, FRAMES, stride)
    assert trembling(T_pc, TIME_S, known)[:3].max() < 0.05 * shake[:3].max()
    T_pc[:, :3, 3] += np.random.default_rng(6).standard_normal((FRAMES, 3)) * shake[:3]
    error = 1.2 / np.sqrt(FRAMES / (6 * stride))
    np.testing.assert_allclose(trembling(T_pc, TIME_S, known)[:3] / shake[:3], 1, atol=4 * error)
    turned = poses(np.random.default_rng(7).standard_normal((FRAMES, 6)) * shake)
    np.testing.assert_allclose(trembling(turned, TIME_S, known)[3:] / shake[3:], 1, atol=4 * error)


def test_lost_pictures_are_no_vibration_and_do_not_loosen_the_prior() -> None:
    """With one picture in five lost, differences by number made a steady camera seem to vibrate."""
    turning = np.zeros((200, 6))
    turning[:, :] = np.sin(np.arange(200)[:, None] / 25) * [3, 3, 3, 0.02, 0.02, 0.02]
    kept = np.arange(200)[np.arange(200) % 5 != 3]
    T_pc, known = poses(turning)[kept], np.arange(len(kept))
    steady = third_difference_sigma(poses(turning), TIME_S, np.arange(200))
    assert np.all(third_difference_sigma(T_pc, kept / 30, known) < 3 * steady)
    assert trembling(T_pc, kept / 30, known)[3:].max() < 1e-5


def test_rows_are_third_differences_with_their_derivatives() -> None:
    random = np.random.default_rng(4)
    path = random.standard_normal((9, 6)) * [1, 1, 1, 0.01, 0.01, 0.01]
    time_s = np.cumsum(random.uniform(0.05, 0.15, 9))
    rows = smooth_motion_rows(poses(path), time_s, SIGMA, 5)
    assert rows.by_border.shape == (36, 5)
    for i in range(3):
        moved = path.copy()
        moved[4, i] += 1e-4
        slope = (smooth_motion_rows(poses(moved), time_s, SIGMA, 5).residual - rows.residual) / 1e-4
        np.testing.assert_allclose(
            np.sum(np.where(rows.frame == 4, rows.by_frame[:, :, i], 0), 1), slope, atol=1e-6
        )
    steady = np.outer(time_s**2, [3.0, -2.0, 5.0, 0, 0, 0])
    np.testing.assert_allclose(smooth_motion_rows(poses(steady), time_s, SIGMA, 5).residual, 0, atol=1e-9)


def late_by(sigma: Float, path: Float, time_s: Float) -> float:
    """Return by how many σ pictures seem late; every fourth picture shows the position without noise."""
    rows = smooth_motion_rows(poses(path), time_s, sigma, 0)
    along, frames = slice(2, None, 6), len(time_s)
    prior = np.zeros((frames - 3, frames))
    np.put_along_axis(prior, rows.frame[along], rows.by_frame[along, :, 2], 1)
    known, accuracy_mm = np.arange(0, frames, 4), 0.005
    speed = np.gradient(path[:, 2], time_s)[known]
    weight = np.r_[rows.weight[along], np.full(len(known), accuracy_mm**-2)]
    design = np.block([[prior, np.zeros((frames - 3, 1))], [np.eye(frames)[known], speed[:, None]]])
    inverse = np.linalg.inv(design.T * weight @ design)
    return float(
        (inverse @ (design.T * weight @ np.r_[np.zeros(frames - 3), path[known, 2]]))[-1]
        / inverse[-1, -1] ** 0.5
    )


def test_a_probe_that_turns_back_does_not_seem_to_be_late() -> None:
    """Speeds of a rendered gauge run, 32, -20, 14 and 39 mm/s, each reached as a motor does."""
    time_s = np.arange(216) / 30
    speed = np.full(216, 32.0)
    for start_s, change in ((3.1, -52.0), (4.3, 34.0), (5.1, 25.0)):
        speed -= change * np.expm1(-np.maximum(time_s - start_s, 0) / 0.07)
    path = np.zeros((216, 6))
    path[:, 2] = np.cumsum(speed) / 30
    usual = np.array([1, 1, 0.0055, 1, 1, 1])
    assert abs(late_by(jerking_sigma(poses(path), time_s, usual), path, time_s)) < 0.5
    assert abs(late_by(usual, path, time_s)) > 2


def test_where_a_probe_jerks_the_prior_allows_jerks() -> None:
    time_s = np.arange(30.0)
    path = np.zeros((30, 6))
    path[15:, 2] = 7.0 * (time_s[15:] - 14)
    found = jerking_sigma(poses(path), time_s, SIGMA)
    np.testing.assert_allclose(found[:12], np.tile(SIGMA, (12, 1)))
    rows = smooth_motion_rows(poses(path), time_s, found, 0)
    assert np.max(rows.residual**2 * rows.weight) <= 1


def test_drift_is_the_change_of_slip_and_jumps_have_little_weight() -> None:
    slip = np.array([0.0, 0.01, 0.02, 5.0, 5.01])
    rows = slip_drift_rows(slip, 0.02, 3)
    np.testing.assert_allclose(rows.residual, np.diff(slip))
    np.testing.assert_allclose(np.einsum("mfi,mf->m", rows.by_frame, slip[rows.frame]), np.diff(slip))
    assert rows.weight[2] < 1e-3 * rows.weight[0]


def test_a_jerk_is_allowed_for_where_known_frames_show_it_and_nowhere_else() -> None:
    third = np.zeros((120, 6))
    third[:, :3] = np.random.default_rng(2).standard_normal((120, 3)) * 1e-3
    third[60, 2] = 0.3
    T_pc, time_s, known = (
        poses(np.cumsum(np.cumsum(np.cumsum(third, 0), 0), 0)),
        TIME_S[:120],
        np.arange(3, 120, 4),
    )
    sigma = local_third_difference_sigma(T_pc, time_s, known)
    as_a_rule = third_difference_sigma(T_pc, time_s, known)
    assert 0.1 < sigma[57, 2] < 0.3
    assert np.all(sigma[57, :2] < 4 * as_a_rule[:2])
    assert np.all(sigma[:40] < 4 * as_a_rule)
    assert np.all(sigma >= as_a_rule)


def test_frames_of_unknown_pose_show_no_jerk() -> None:
    """Across 100 frames without fiducials a steady motion was allowed six thousand times its jerks."""
    third = np.zeros((300, 6))
    third[:, :3] = np.random.default_rng(0).standard_normal((300, 3)) * 1e-3
    T_pc = poses(np.cumsum(np.cumsum(np.cumsum(third, 0), 0), 0))
    time_s, known = 0.04 * np.arange(300), np.r_[0:100, 200:300]
    sigma = local_third_difference_sigma(T_pc, time_s, known)
    assert np.all(sigma[:, :3] < 5e-3)
