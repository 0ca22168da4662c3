"""The bordered solver against dense algebra, and the joint adjustment against a dense Levenberg–Marquardt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from pipeline.adjustment.bordered import BorderedSystem, Factor, landmark_steps
from pipeline.adjustment.elimination import BLOCK
from pipeline.adjustment.levenberg_marquardt import Damping
from pipeline.adjustment.motion_priors import trembling
from pipeline.adjustment.normal_equations import BandedCholesky
from pipeline.adjustment.robust import Cauchy, GemanMcClure, Loss, Squares
from pipeline.adjustment.rows import LandmarkRows, Rows, Step
from pipeline.arrays import Float, Int
from pipeline.geometry.rigid import from_parts, rotation_from_vector, vector_from_rotation
from stages.motion.bundle_adjustment.equations import Equations, Measurements, Scales, linearised, scales_of
from stages.motion.bundle_adjustment.solver import adjust, ends_in_line, estimate_state, trembles
from stages.motion.bundle_adjustment.unknowns import State
from stages.motion.parameters import MotionParameters
from tests.motion_scene import SHAKE, displaced, scene

FRAMES, BORDER, OWN = 9, 6, 3


def random_rows(random: np.random.Generator, count: int = 90, reach: int = 3) -> Rows:
    first = random.integers(0, FRAMES - reach, count)
    frame = first[:, None] + np.array([0, 1, reach])
    return Rows(
        frame, random.standard_normal((count, 3, BLOCK)), random.standard_normal((count, BORDER)),
        random.standard_normal(count), random.uniform(0.7, 1.4, count),
    )  # fmt: skip


def random_landmarks(random: np.random.Generator, count: int = 7, reach: int = 4) -> LandmarkRows:
    first = random.integers(0, FRAMES - reach, count)
    frame = np.concatenate([f + np.arange(reach) for f in first])
    m = len(frame)
    draw = random.standard_normal
    return LandmarkRows(
        reach * np.arange(count + 1), frame, draw((m, 2, 6)), draw((m, 2, 3)), draw((m, 2, OWN)),
        draw((m, 2)), random.uniform(0.7, 1.4, m), draw((count, 3)), draw((count, BORDER)), draw(count),
        random.uniform(0.7, 1.4, count),
    )  # fmt: skip


def dense(rows: Rows, marks: LandmarkRows) -> tuple[Float, Float, Float]:
    """Return Jacobian, residual and weight of all equations; unknowns are frames, border, landmarks."""
    count = len(marks.start) - 1
    border_at, marks_at = BLOCK * FRAMES, BLOCK * FRAMES + BORDER
    size = marks_at + 3 * count
    j, r, w = [], [], []
    for k in range(len(rows.residual)):
        line = np.zeros(size)
        for p, f in enumerate(rows.frame[k]):
            line[BLOCK * f : BLOCK * f + BLOCK] += rows.by_frame[k, p]
        line[border_at:marks_at] = rows.by_border[k]
        j.append(line), r.append(rows.residual[k]), w.append(rows.weight[k])
    for k in range(count):
        mine = slice(marks_at + 3 * k, marks_at + 3 * k + 3)
        line = np.zeros(size)
        line[border_at:marks_at], line[mine] = marks.surface_by_border[k], marks.surface_by_point[k]
        j.append(line), r.append(marks.surface_residual[k]), w.append(marks.surface_weight[k])
        for m in range(marks.start[k], marks.start[k + 1]):
            for i in range(2):
                line, f = np.zeros(size), BLOCK * marks.frame[m]
                line[f : f + 6], line[mine] = marks.by_pose[m, i], marks.by_point[m, i]
                line[marks_at - OWN : marks_at] = marks.by_instrument[m, i]
                j.append(line), r.append(marks.residual[m, i]), w.append(marks.weight[m])
    return np.array(j), np.array(r), np.array(w)


def frame_covariance(factor: Factor, frames: Int) -> Float:
    """Return (len(frames), 7, 7) marginal covariances."""
    each = np.arange(len(frames))
    return np.asarray(factor.joint_covariance(frames)[each, :, each])


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(3))
def test_steps_and_covariances_agree_with_dense_normal_equations(seed: int, damping: float) -> None:
    random = np.random.default_rng(seed)
    rows, marks = random_rows(random), random_landmarks(random)
    j, r, w = dense(rows, marks)
    normal = (j * w[:, None]).T @ j
    system = BorderedSystem(FRAMES, BORDER, 4)
    system.add(rows)
    inverse, right = system.add_landmarks(marks, damping)
    factor = system.factor()
    frames, border = factor.step()
    points = landmark_steps(marks, inverse, right, frames, border)
    got = np.concatenate([frames.ravel(), border, points.ravel()])
    own = slice(BLOCK * FRAMES, BLOCK * FRAMES + BORDER)
    last = np.arange(len(normal)) >= own.stop
    damped = normal + damping * np.diag(np.diag(normal) * last)
    np.testing.assert_allclose(got, np.linalg.solve(damped, -(j * w[:, None]).T @ r), rtol=1e-7, atol=1e-9)
    covariance = np.linalg.inv(damped)
    np.testing.assert_allclose(factor.border_covariance(), covariance[own, own], rtol=1e-7, atol=1e-10)
    for f, block in zip((0, 4, 8), frame_covariance(factor, np.array([0, 4, 8])), strict=True):
        at = slice(BLOCK * f, BLOCK * f + BLOCK)
        np.testing.assert_allclose(block, covariance[at, at], rtol=1e-7, atol=1e-10)


@pytest.mark.parametrize("sparse", [False, True], ids=["full", "every other frame sees its neighbours only"])
@pytest.mark.parametrize(("frames", "lags"), [(1, 1), (2, 2), (23, 5), (40, 20), (40, 3), (9, 1), (70, 35)])
def test_the_banded_factor_solves_banded_systems(frames: int, lags: int, sparse: bool) -> None:
    random = np.random.default_rng(frames)
    size = 3 * frames
    a = random.standard_normal((size, size))
    lag = np.abs(np.subtract.outer(np.arange(size) // 3, np.arange(size) // 3))
    dark = np.arange(size) // 3 % 2 > 0
    coupled = lag < np.where(sparse & (dark | dark[:, None]), min(lags, 3), lags)
    full = np.where(coupled, a + a.T, 0) + 4 * size * np.eye(size)
    band = np.zeros((frames, lags, 3, 3))
    for f in range(frames):
        for back in range(min(lags, f + 1)):
            band[f, back] = full[3 * f : 3 * f + 3, 3 * (f - back) : 3 * (f - back) + 3]
    right = random.standard_normal((size, 3))
    np.testing.assert_allclose(
        BandedCholesky.of_band(band).solve(right), np.linalg.solve(full, right), atol=1e-10
    )


def test_an_undetermined_system_is_refused() -> None:
    system = BorderedSystem(FRAMES, BORDER, 4)
    with pytest.raises(np.linalg.LinAlgError):
        system.factor()


@pytest.mark.parametrize("loss", [Squares(), Cauchy(2.5), GemanMcClure(0.7)])
def test_weights_are_the_derivatives_of_the_costs(loss: Loss) -> None:
    residual, sigma, h = np.linspace(0.01, 3, 40), np.linspace(0.1, 0.5, 40), 1e-6
    slope = (loss.cost(residual + h, sigma) - loss.cost(residual - h, sigma)) / (2 * h)
    np.testing.assert_allclose(loss.weight(residual, sigma) * residual, slope, rtol=1e-5)
    small = 1e-4 * sigma
    np.testing.assert_allclose(loss.cost(small, sigma), 0.5 * (small / sigma) ** 2, rtol=1e-4)


def test_damping_grows_faster_with_every_failure_and_vanishes_after_good_steps() -> None:
    first = Damping().after(0.0)
    second = first.after(-1.0)
    assert second.value / first.value > first.value / 1e-7 > 1
    assert not second.is_slight
    better = second
    for _ in range(4):
        better = better.after(1.0)
    assert better.is_slight
    assert better.value < 1e-6 * second.value
    assert second.after(0.5).value == pytest.approx(second.value)


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
