"""The bordered solver against dense algebra, and the joint adjustment against a dense Levenberg–Marquardt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from pipeline.adjustment.elimination import BLOCK
from pipeline.adjustment.motion_priors import trembling
from pipeline.adjustment.rows import Step
from pipeline.arrays import Float
from pipeline.geometry.rigid import from_parts, rotation_from_vector, vector_from_rotation
from stages.motion.bundle_adjustment.equations import Equations, Measurements, Scales, linearised, scales_of
from stages.motion.bundle_adjustment.solver import adjust, ends_in_line, estimate_state, trembles
from stages.motion.bundle_adjustment.unknowns import State
from stages.motion.parameters import MotionParameters
from tests.motion_scene import SHAKE, displaced, scene
from tests.unit.dense_equations import BORDER, FRAMES, dense, frame_covariance, random_landmarks, random_rows


def stepped(at: State, step: Float) -> State:
    n, b = len(at.T_pc), at.border_size
    return at.step(step[: 7 * n].reshape(n, 7), step[7 * n : 7 * n + b], step[7 * n + b :].reshape(-1, 3))


def pose_difference(T_pc: Float, other_T_pc: Float) -> Float:
    """Return translations and rotation vectors (N, 6) between poses."""
    turn = vector_from_rotation(np.swapaxes(other_T_pc[:, :3, :3], 1, 2) @ T_pc[:, :3, :3])
    return np.concatenate([T_pc[:, :3, 3] - other_T_pc[:, :3, 3], turn], -1)


def roots_of_costs(equations: Equations, step: Float) -> Float:
    """Return numbers whose half squares are the costs, with the first frame's step included.

    The first frame defines the coordinate frame.
    """
    texture = equations.texture
    out = [step[:3] / 1e-4, step[3:6] / 1e-6]
    for row in (*equations.rows, equations.rings):
        out.append(np.sign(row.residual) * np.sqrt(2 * row.loss.cost(row.residual, row.sigma)))
    size = np.linalg.norm(texture.residual, axis=1)
    root = np.sqrt(2 * texture.loss.cost(size, texture.sigma))
    out.append((texture.residual * (root / np.maximum(size, 1e-12))[:, None]).ravel())
    relief = texture.surface_residual
    out.append(np.sign(relief) * np.sqrt(2 * texture.loss.cost(relief, texture.surface_sigma)))
    return np.concatenate(out)


@pytest.mark.parametrize("seed", [3, 4])
def test_the_optimum_agrees_with_dense_levenberg_marquardt(seed: int) -> None:
    """Both minimise the same robust cost, with the scales that the adjustment ended with."""
    given, parameters = scene(7, 9, noise=1.0, seed=seed), MotionParameters(alike=1.0)
    start = displaced(given.truth, np.random.default_rng(0))
    got = adjust(start, given.measured, parameters, 1e-6)
    scales = scales_of(got.equations, given.measured.tracks, parameters.alike)

    def roots(step: Float) -> Float:
        return roots_of_costs(linearised(stepped(start, step), given.measured, parameters, scales), step)

    zero = np.zeros(7 * len(start.T_pc) + start.border_size + start.xyz_p.size)
    # Steps that gain less than 10⁻⁴ of the cost, .01 here, are not taken: that is .15 σ in one number.
    best = least_squares(roots, zero, method="lm", x_scale="jac", ftol=1e-4)
    assert got.settled
    # The derivatives neglect the rotation of the axis' frames; 1 σ off in one number would cost 0.5.
    assert got.equations.cost < best.cost + 0.5
    wanted = stepped(start, best.x)
    covariance = frame_covariance(got.equations.factor(), np.arange(1, len(start.T_pc)))
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    apart = np.abs(pose_difference(got.state.T_pc, wanted.T_pc))[1:]
    assert np.max(apart / sigma[:, :6]) < 0.6
    np.testing.assert_allclose(got.state.xyz_p, wanted.xyz_p, atol=0.1)  # of the surface alone: a σ of 0.1 mm
    np.testing.assert_allclose(got.state.globals, wanted.globals, atol=5e-3)


def test_the_predicted_decrease_agrees_with_the_dense_equations() -> None:
    random = np.random.default_rng(7)
    rows, marks = random_rows(random), random_landmarks(random)
    j, r, w = dense(rows, marks)
    x = random.standard_normal(j.shape[1])
    border, points = BLOCK * FRAMES, BLOCK * FRAMES + BORDER
    step = Step(x[:border].reshape(-1, BLOCK), x[border:points], x[points:].reshape(-1, 3))
    wanted = 0.5 * (np.sum(w * r * r) - np.sum(w * (r + j @ x) ** 2))
    assert rows.decrease(step) + marks.decrease(step) == pytest.approx(wanted)


def test_a_step_that_increases_the_cost_is_not_taken() -> None:
    given, parameters = scene(12, 30, noise=1.0, seed=6), MotionParameters(alike=1.0, iterations=8)
    start = displaced(given.truth, np.random.default_rng(5), 80.0)
    first = linearised(start, given.measured, parameters, Scales(3.0, 1.0))
    scales = scales_of(first, given.measured.tracks, parameters.alike)
    first = linearised(start, given.measured, parameters, scales)
    plain = first.step(0.0)
    there = start.step(plain.frames, plain.border, plain.landmarks)
    assert linearised(there, given.measured, parameters, scales).cost > first.cost, (
        "control: the full step increases it"
    )
    got = adjust(start, given.measured, parameters, 1e-6)
    assert linearised(got.state, given.measured, parameters, scales).cost < 0.5 * first.cost


def test_the_optimum_is_found_from_a_distant_start() -> None:
    given, parameters = scene(12, 30, noise=1.0, seed=6), MotionParameters(alike=1.0)
    got = adjust(displaced(given.truth, np.random.default_rng(3), 40.0), given.measured, parameters, 1e-6)
    assert got.settled
    np.testing.assert_allclose(got.state.T_pc[:, :3, 3], given.truth.T_pc[:, :3, 3], atol=0.2)


def test_adjustment_finds_the_truth_from_exact_measurements() -> None:
    given = scene(12, 30)
    start = displaced(given.truth, np.random.default_rng(1))
    got = adjust(start, given.measured, MotionParameters(alike=1.0), 1e-6).state
    np.testing.assert_allclose(got.T_pc[:, :3, 3], given.truth.T_pc[:, :3, 3], atol=0.02)
    np.testing.assert_allclose(got.T_pc[:, :3, :3], given.truth.T_pc[:, :3, :3], atol=5e-4)


def test_the_stated_sigma_covers_the_errors() -> None:
    """Over drawn noise the normalised errors of the poses are about one."""
    ratio = []
    for seed in (2, 3, 4, 5):
        given = scene(10, 30, noise=1.0, seed=seed)
        got = adjust(given.truth, given.measured, MotionParameters(alike=1.0), 1e-5)
        covariance = frame_covariance(got.equations.factor(), np.arange(1, 10))[:, :3, :3]
        error = got.state.T_pc[1:, :3, 3] - given.truth.T_pc[1:, :3, 3]
        ratio.append(np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error) / 3)
    assert 0.2 < np.mean(ratio) < 2.0


def swung(T_pc: Float, by_rad: Float) -> Float:
    """Return poses rotated about their x-axes and the ring's centre, a motion that rings hardly show."""
    ahead = np.array([0.0, 0.0, 22.0])
    turned = T_pc[:, :3, :3] @ rotation_from_vector(by_rad[:, None] * np.array([1.0, 0.0, 0.0]))
    return from_parts(turned, T_pc[:, :3, 3] + (T_pc[:, :3, :3] - turned) @ ahead)


def test_a_rotation_of_the_first_frames_without_texture_is_no_local_minimum() -> None:
    """Half of the radii were wrong: free motion had rotated by 14° before the first texture was seen."""
    given = scene(60, 140, noise=1.0, seed=2)
    measured, truth = given.measured, given.truth
    tracks, seen = measured.tracks.some(measured.tracks.frame >= 3)
    swing = 0.2 * np.clip(1 - np.arange(60) / 3, 0, None) ** 2
    start = replace(truth, xyz_p=truth.xyz_p[seen], T_pc=swung(truth.T_pc, swing))
    fresh = Measurements.of(tracks, measured.rings, measured.time_s, measured.encoder, measured.probe)
    got = estimate_state(start, fresh, MotionParameters(alike=1.0)).state.T_pc
    across = vector_from_rotation(np.swapaxes(truth.T_pc, 1, 2)[:, :3, :3] @ got[:, :3, :3])[:, :2]
    assert np.abs(across).max() < 0.02


def test_ends_without_texture_continue_the_next_poses_unless_they_are_long() -> None:
    time_s = np.r_[np.arange(12), 14, 15] / 30
    turn = np.outer(time_s, [0.1, 0.0, 0.3])
    straight = from_parts(rotation_from_vector(turn), np.outer(time_s, [1.0, 2.0, 30.0]))
    swing = np.zeros(14)
    swing[[0, 1, 13]] = 0.2, 0.1, -0.3
    found = ends_in_line(swung(straight, swing), time_s, np.arange(2, 13))
    np.testing.assert_allclose(found, straight, atol=1e-3)
    for seen in (np.arange(6, 12), np.arange(2, 5), np.array([], np.int64)):
        poses = swung(straight, swing)
        np.testing.assert_array_equal(ends_in_line(poses, time_s, seen)[:2], poses[:2])


def test_vibration_loosens_the_prior_of_motion_across_the_pipe_only() -> None:
    """A prior of 0 with the 1 σ of the vibration would shrink all lengths together."""
    parameters = MotionParameters(alike=1.0)
    steady, shaken = (scene(60, 140, noise=1.0, seed=2, shake=s) for s in (0.0, 1.0))
    across = np.array([0, 1, 3, 4])
    loose = estimate_state(shaken.truth, shaken.measured, parameters).smooth_sigma
    ratio = loose[across] / (np.sqrt(20) * SHAKE[across])
    assert ratio.min() > 2
    assert ratio.max() < 6
    known = steady.measured.tracks.poses.frames
    assert not trembles(trembling(steady.truth.T_pc, steady.measured.time_s, known))
    assert trembles(trembling(shaken.truth.T_pc, shaken.measured.time_s, known))
