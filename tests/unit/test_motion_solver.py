"""The bordered solver against dense algebra, and the joint adjustment against a dense Levenberg–Marquardt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from pipeline.geometry.rigid import vector_from_rotation
from stages.motion import terms
from stages.motion.adjustment import MATCH_BIASES, adjust, landmark_rows
from stages.motion.bordered import BLOCK, BorderedSystem, LandmarkRows, Rows, landmark_steps
from stages.motion.parameters import MotionParameters
from stages.motion.state import State
from stages.motion.tridiagonal import BlockTridiagonal
from tests.motion_scene import Scene, displaced, scene

Float = NDArray[np.float64]
FRAMES, BORDER, OWN = 9, 6, 3


def random_rows(random: np.random.Generator, count: int = 90, reach: int = 3) -> Rows:
    first = random.integers(0, FRAMES - reach, count)
    frame = first[:, None] + np.array([0, 1, reach])
    return Rows(
        frame, random.standard_normal((count, 3, BLOCK)), random.standard_normal((count, BORDER)),
        random.standard_normal(count), random.uniform(0.5, 2, count),
    )  # fmt: skip


def random_landmarks(random: np.random.Generator, count: int = 7, reach: int = 4) -> LandmarkRows:
    first = random.integers(0, FRAMES - reach, count)
    frame = np.concatenate([f + np.arange(reach) for f in first])
    m = len(frame)
    draw = random.standard_normal
    return LandmarkRows(
        reach * np.arange(count + 1), frame, draw((m, 2, 6)), draw((m, 2, 3)), draw((m, 2, OWN)),
        draw((m, 2)), random.uniform(0.5, 2, m), draw((count, 3)), draw((count, BORDER)), draw(count),
        random.uniform(0.5, 2, count),
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


@pytest.mark.parametrize("seed", range(3))
def test_steps_and_covariances_are_those_of_the_dense_normal_equations(seed: int) -> None:
    random = np.random.default_rng(seed)
    rows, marks = random_rows(random), random_landmarks(random)
    j, r, w = dense(rows, marks)
    normal = (j * w[:, None]).T @ j
    wanted = np.linalg.solve(normal, -(j * w[:, None]).T @ r)
    system = BorderedSystem(FRAMES, BORDER, 4)
    system.add(rows)
    inverse, right = system.add_landmarks(marks)
    factor = system.factor()
    frames, border = factor.step()
    points = landmark_steps(marks, inverse, right, frames, border)
    got = np.concatenate([frames.ravel(), border, points.ravel()])
    np.testing.assert_allclose(got, wanted, rtol=1e-7, atol=1e-9)
    covariance = np.linalg.inv(normal)
    own = slice(BLOCK * FRAMES, BLOCK * FRAMES + BORDER)
    np.testing.assert_allclose(factor.border_covariance(), covariance[own, own], rtol=1e-7, atol=1e-10)
    for f, block in zip((0, 4, 8), factor.frame_covariance(np.array([0, 4, 8])), strict=True):
        at = slice(BLOCK * f, BLOCK * f + BLOCK)
        np.testing.assert_allclose(block, covariance[at, at], rtol=1e-7, atol=1e-10)


@pytest.mark.parametrize(("size", "width"), [(1, 1), (7, 7), (23, 5), (24, 6), (40, 3), (5, 12)])
def test_block_tridiagonal_solves_banded_systems(size: int, width: int) -> None:
    random = np.random.default_rng(size)
    width = min(width, size)
    a = random.standard_normal((size, size))
    lag = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    full = np.where(lag < width, a + a.T, 0) + 4 * size * np.eye(size)
    band = np.zeros((width, size))
    for i in range(width):
        band[i, : size - i] = np.diagonal(full, -i)
    right = random.standard_normal((size, 3))
    np.testing.assert_allclose(
        BlockTridiagonal.of_band(band).solve(right), np.linalg.solve(full, right), atol=1e-10
    )


def test_what_is_not_determined_is_refused() -> None:
    system = BorderedSystem(FRAMES, BORDER, 4)
    with pytest.raises(np.linalg.LinAlgError):
        system.factor()


def stepped(at: State, step: Float) -> State:
    n, b = len(at.T_pc), at.border_size
    return at.step(step[: 7 * n].reshape(n, 7), step[7 * n : 7 * n + b], step[7 * n + b :].reshape(-1, 3))


def pose_difference(T_pc: Float, other_T_pc: Float) -> Float:
    """Return (N, 6) translation and rotation vector between poses."""
    turn = vector_from_rotation(np.swapaxes(other_T_pc[:, :3, :3], 1, 2) @ T_pc[:, :3, :3])
    return np.concatenate([T_pc[:, :3, 3] - other_T_pc[:, :3, 3], turn], -1)


def all_residuals(step: Float, at: State, given: Scene, parameters: MotionParameters) -> Float:
    """Return every residual over its σ, without robust weights, after a step from a state."""
    state = stepped(at, step)
    measured = given.measured
    assert measured.encoder is not None
    plain = [terms.origin_rows(state)]
    plain += terms.encoder_rows(state, measured.encoder, parameters.encoder_slip_sigma_mm)
    out = [rows.residual * np.sqrt(rows.weight) for rows in plain[:2]]
    moved = state.T_pc[0, :3, 3] - at.T_pc[0, :3, 3]
    out[0] = np.concatenate([moved / 1e-4, step[3:6] / 1e-6])
    out.append(plain[2].residual / parameters.encoder_slip_sigma_mm)
    out.append(terms.turn_rows(state, parameters.turn_sigma_rad).residual / parameters.turn_sigma_rad)
    out.append(terms.ring_rows(state, measured.rings).residual / measured.rings.sigma_mm)
    smooth = terms.smooth_rows(state, measured.time_s, measured.smooth_sigma).residual
    out.append((smooth.reshape(-1, 6) / measured.smooth_sigma).ravel())
    border = terms.border_rows(state, parameters.axis_bend_sigma, 0.002, 0.1 * state.nominal_radius_mm)
    loose = replace(state, curve=0 * state.curve, instrument=0 * state.instrument)
    sigma = (
        terms.border_rows(loose, parameters.axis_bend_sigma, 0.002, 0.1 * state.nominal_radius_mm).weight
        ** -0.5
    )
    out.append(border.residual / sigma)
    texture = landmark_rows(state, measured, parameters, 1.0)[0]
    out.append((texture.residual / measured.tracks.sigma_px[:, None]).ravel())
    out.append(texture.surface_residual / parameters.surface_sigma_mm)
    return np.concatenate(out)


def test_optimum_is_that_of_a_dense_levenberg_marquardt(monkeypatch: pytest.MonkeyPatch) -> None:
    """With unit weights both minimise the same sum of squares."""
    given = scene(7, 9, noise=1.0, seed=3)
    parameters = MotionParameters(iterations=25, alike=1.0)
    unit = lambda x, scale=2.5: np.ones_like(x)  # noqa: E731
    monkeypatch.setattr("stages.motion.terms.cauchy", unit)
    monkeypatch.setattr("stages.motion.adjustment.cauchy", unit)
    monkeypatch.setattr("stages.motion.terms.redescending", unit)
    monkeypatch.setattr("stages.motion.adjustment._excess_of", lambda size, sigma: 1.0)
    start = displaced(given.truth, np.random.default_rng(0))
    estimate = adjust(start, given.measured, parameters)
    zero = np.zeros(7 * len(start.T_pc) + start.border_size + start.xyz_p.size)
    best = least_squares(
        lambda x: all_residuals(x, start, given, parameters), zero, method="lm", x_scale="jac"
    )
    wanted = stepped(start, best.x)
    frames = np.arange(1, len(start.T_pc))
    sigma = np.sqrt(np.diagonal(estimate.factor.frame_covariance(frames), axis1=1, axis2=2))
    apart = np.abs(pose_difference(estimate.state.T_pc, wanted.T_pc))[1:]
    # Where its frames turn as the axis bends is left out of the derivatives; 1 σ off would cost 1.
    assert np.max(apart / sigma[:, :6]) < 0.4
    cost = np.sum(all_residuals(zero, estimate.state, given, parameters) ** 2)
    assert cost < 2 * best.cost + 1
    np.testing.assert_allclose(
        estimate.state.xyz_p, wanted.xyz_p, atol=0.1
    )  # the surface alone has a σ of 0.1 mm
    np.testing.assert_allclose(estimate.state.globals, wanted.globals, atol=5e-3)


def test_adjustment_finds_the_truth_from_exact_measurements() -> None:
    given = scene(12, 30)
    start = displaced(given.truth, np.random.default_rng(1))
    got = adjust(start, given.measured, MotionParameters(iterations=30, alike=1.0)).state
    np.testing.assert_allclose(got.T_pc[:, :3, 3], given.truth.T_pc[:, :3, 3], atol=0.02)
    np.testing.assert_allclose(got.T_pc[:, :3, :3], given.truth.T_pc[:, :3, :3], atol=5e-4)


def test_stated_sigma_covers_the_errors() -> None:
    """Over drawn noise the normalised errors of the poses are about one."""
    ratio = []
    for seed in (2, 3, 4, 5):
        given = scene(10, 30, noise=1.0, seed=seed)
        got = adjust(given.truth, given.measured, MotionParameters(iterations=15, alike=1.0))
        covariance = got.factor.frame_covariance(np.arange(1, 10))[:, :3, :3]
        error = got.state.T_pc[1:, :3, 3] - given.truth.T_pc[1:, :3, 3]
        ratio.append(np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error) / 3)
    assert 0.2 < np.mean(ratio) < 2.0


def test_match_biases_come_last() -> None:
    given = scene(8, 14, seed=2)
    assert len(given.truth.instrument) == given.measured.unsure.shape[1] + MATCH_BIASES
