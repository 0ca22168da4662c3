"""The bordered solver of the adjustment against dense algebra; losses and damping."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.adjustment.bordered import BorderedSystem, landmark_steps
from pipeline.adjustment.elimination import BLOCK
from pipeline.adjustment.levenberg_marquardt import Damping
from pipeline.adjustment.normal_equations import BandedCholesky
from pipeline.adjustment.robust import Cauchy, GemanMcClure, Loss, Squares
from tests.unit.dense_equations import BORDER, FRAMES, dense, frame_covariance, random_landmarks, random_rows


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
