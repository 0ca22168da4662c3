"""Dense normal equations, cluster-robust scores and the Levenberg-Marquardt search against brute force."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from pipeline.adjustment.bordered import BorderedSystem
from pipeline.adjustment.elimination import BLOCK
from pipeline.adjustment.levenberg_marquardt import Damping, Minimum, Stop, minimise
from pipeline.adjustment.local_spread import running_median
from pipeline.adjustment.normal_equations import (
    ArrowEquations,
    covariance_of,
    log_determinant,
    marginalised,
    solved,
)
from pipeline.adjustment.robust import cluster_covariance, cluster_variance, two_way_variance
from pipeline.adjustment.rows import Rows
from pipeline.arrays import Float


def information(random: np.random.Generator, size: int, rows: int = 40) -> tuple[Float, Float]:
    """Return a design, its columns of very different scale, and residuals."""
    return random.normal(size=(rows, size)) * np.geomspace(1e-5, 1e4, size), random.normal(size=rows)


@pytest.mark.parametrize("rcond", [None, 1e-13])
def test_marginalisation_agrees_with_least_squares_over_free_parameters(rcond: float | None) -> None:
    design, residual = information(np.random.default_rng(1), 6)
    out, kept = np.array([4, 0, 2]), [1, 3, 5]
    found = marginalised(design.T @ design, -design.T @ residual, out, rcond)
    free = np.linalg.qr(design[:, out])[0]
    own = design[:, kept] - free @ (free.T @ design[:, kept])
    rest = residual - free @ (free.T @ residual)
    np.testing.assert_allclose(
        found.information, own.T @ own, rtol=1e-8, atol=1e-9 * np.abs(own.T @ own).max()
    )
    np.testing.assert_allclose(found.right, -own.T @ rest, rtol=1e-7)
    assert residual @ residual - found.gain == pytest.approx(rest @ rest)
    np.testing.assert_allclose(design @ found.step + residual, rest, atol=1e-9)
    np.testing.assert_allclose(design @ found.follow, own, rtol=1e-6, atol=1e-8 * np.abs(own).max())


def test_unknowns_of_which_only_the_sum_is_known_are_eliminated_by_least_squares_only() -> None:
    design, residual = information(np.random.default_rng(2), 3)
    tied = np.concatenate([design, design[:, :1]], 1)
    alone = marginalised(design.T @ design, design.T @ residual, np.array([0]))
    both = marginalised(tied.T @ tied, tied.T @ residual, np.array([0, 3]), 1e-13)
    np.testing.assert_allclose(both.information, alone.information, rtol=1e-8)
    with pytest.raises(np.linalg.LinAlgError):
        marginalised(np.zeros((2, 2)), np.zeros(2), np.array([0]))


def test_covariance_and_determinant_are_right_for_very_different_scales() -> None:
    design, _ = information(np.random.default_rng(3), 5)
    a = design.T @ design
    np.testing.assert_allclose(covariance_of(a) @ a, np.eye(5), atol=1e-6)
    scale = np.sqrt(np.diag(a))
    wanted = np.linalg.slogdet(a / np.outer(scale, scale))[1] + 2 * np.sum(np.log(scale))
    assert log_determinant(a) == pytest.approx(wanted)
    np.testing.assert_allclose(a @ solved(a, a[:, 0]), a[:, 0], rtol=1e-8)


def test_unobserved_parameters_stay_uncertain() -> None:
    assert covariance_of(np.array([[1.0, 1.0], [1.0, 1.0]]))[0, 0] > 1e12


def test_the_predicted_decrease_with_shared_and_block_parameters_agrees_with_dense_squares() -> None:
    random = np.random.default_rng(4)
    shared, block, residual = (
        random.normal(size=(3, 9, 2)),
        random.normal(size=(3, 9, 4)),
        random.normal(size=(3, 9)),
    )
    system = ArrowEquations(
        np.einsum("vmf,vmg->fg", shared, shared), np.einsum("vmf,vmp->vfp", shared, block),
        np.einsum("vmp,vmq->vpq", block, block), np.einsum("vmf,vm->vf", shared, residual),
        np.einsum("vmp,vm->vp", block, residual),
    )  # fmt: skip
    step = system.step(0.1)
    after = residual + shared @ step[0] + np.einsum("vmp,vp->vm", block, step[1])
    assert system.decrease(step) == pytest.approx(np.sum(residual**2) - np.sum(after**2))
    own, gradients = system.marginal()
    np.testing.assert_allclose(-np.linalg.solve(own, gradients.sum(0)), system.step(0.0)[0], rtol=1e-8)


def test_scores_of_clusters_are_summed_before_they_are_squared() -> None:
    random = np.random.default_rng(5)
    scores, cluster = random.normal(size=(60, 3)), random.integers(0, 7, 60) * 11 - 5
    sums = np.array([scores[cluster == c].sum(0) for c in np.unique(cluster)])
    np.testing.assert_allclose(cluster_covariance(scores, cluster), sums.T @ sums * 7 / 6)
    np.testing.assert_allclose(
        cluster_variance(scores, cluster), np.diag(cluster_covariance(scores, cluster))
    )
    every = np.arange(60)
    np.testing.assert_allclose(
        two_way_variance(scores, cluster, every), cluster_variance(scores, cluster), rtol=1e-12
    )


def test_independent_errors_do_not_widen_sigma_and_repeated_ones_do() -> None:
    random = np.random.default_rng(6)
    scores = random.normal(size=(4000, 1))
    plain = np.sum(scores**2)
    assert cluster_variance(scores, np.arange(4000) // 4)[0] / plain == pytest.approx(1, abs=0.2)
    copies = np.repeat(scores[:1000], 4, axis=0)
    assert cluster_variance(copies, np.arange(4000) // 4)[0] / np.sum(copies**2) == pytest.approx(4, rel=1e-2)


@pytest.mark.parametrize("rows", [1, 2, 5, 8, 9, 40])
def test_running_medians_are_of_every_other_of_nine_cells_each_way(rows: int) -> None:
    value = np.random.default_rng(rows).normal(size=(rows, 30)).astype(np.float32)
    found = running_median(value)
    for i, j in np.ndindex(*value.shape):
        # Beyond an edge the last cell that is reached from here in steps of two is repeated.
        near = [
            np.clip(at + np.arange(-4, 5, 2), at % 2, count - 1 - (count - 1 - at) % 2)
            for at, count in zip((i, j), value.shape, strict=True)
        ]
        assert found[i, j] == np.median(value[np.ix_(*near)])


def test_the_response_of_border_parameters_keeps_frames_at_their_optimum() -> None:
    random = np.random.default_rng(7)
    count, frames, border = 120, 6, 4
    rows = Rows(
        random.integers(0, frames, count)[:, None], random.normal(size=(count, 1, BLOCK)),
        random.normal(size=(count, border)), random.normal(size=count), random.uniform(0.5, 2, count),
    )  # fmt: skip
    system = BorderedSystem(frames, border, 0)
    system.add(rows)
    factor = system.factor()
    of_frames = np.zeros((count, frames, BLOCK))
    of_frames[np.arange(count), rows.frame[:, 0]] = rows.by_frame[:, 0]
    root = np.sqrt(rows.weight)[:, None]
    free = np.linalg.qr(of_frames.reshape(count, -1) * root)[0]
    own = rows.by_border * root
    own -= free @ (free.T @ own)
    np.testing.assert_allclose(factor.border_rows(rows) * root, own, atol=1e-9)
    np.testing.assert_allclose(factor.border_information(), own.T @ own, rtol=1e-8)
    np.testing.assert_allclose(
        factor.border_right, -own.T @ (rows.residual * root[:, 0]), rtol=1e-7, atol=1e-9
    )
    _, response = factor.response(np.array([2, 0]))
    wanted = marginalised(own.T @ own, np.zeros(border), np.array([1, 3])).follow[:, ::-1]
    np.testing.assert_allclose(response, wanted, rtol=1e-7, atol=1e-9)


# --- the Levenberg-Marquardt search


@dataclass(frozen=True)
class Valley:
    """Rosenbrock's residuals (10 (y − x²), 1 − x), with an optional error in their derivatives."""

    at: Float
    wrong: float = 0.0

    @property
    def residual(self) -> Float:
        return np.array([10 * (self.at[1] - self.at[0] ** 2), 1 - self.at[0]])

    @property
    def slope(self) -> Float:
        return np.array([[-20 * self.at[0] + self.wrong, 10.0], [-1.0, 0.0]])

    @property
    def cost(self) -> float:
        return float(0.5 * self.residual @ self.residual)

    def step(self, damping: float) -> Float:
        normal = self.slope.T @ self.slope
        return np.asarray(
            -np.linalg.solve(normal + damping * np.diag(np.diag(normal)), self.slope.T @ self.residual)
        )

    def decrease(self, step: Float) -> float:
        change = self.slope @ step
        return float(-change @ (self.residual + 0.5 * change))


def search(start: Float, stop: Stop, wrong: float = 0.0) -> Minimum[Float, Valley]:
    return minimise(start, lambda x, _: Valley(x, wrong), lambda x, step: x + step, lambda e: (e, None), stop)


def test_the_minimum_of_a_curved_valley_is_found() -> None:
    found = search(np.array([-1.2, 1.0]), Stop(200, 1e-9))
    assert found.settled
    np.testing.assert_allclose(found.state, [1.0, 1.0], atol=1e-6)


def test_the_cost_never_rises_and_few_trials_are_needed() -> None:
    starts = [search(np.array([-1.2, 1.0]), Stop(n, 0.0)) for n in range(1, 12)]
    cost = [s.equations.cost for s in starts]
    assert np.all(np.diff(cost) <= 0)
    assert not starts[2].settled


def test_wrong_derivatives_end_the_search_when_they_predict_too_little_decrease() -> None:
    found = search(np.array([-1.2, 1.0]), Stop(200, 1e-9, doubtful=0.5), wrong=8.0)
    assert found.settled
    assert found.trials < 200


def test_a_rough_search_ends_at_a_step_that_fails_and_promises_less_than_enough() -> None:
    """Shorter and shorter steps for less than a hundredth of the cost took 14 of 18 trials of open-3."""
    roughly, undamped, damped = Stop(100, 1e-2), Damping(), Damping(1e-3)
    assert roughly.reached(undamped, gain=-7.0, promised=0.9, cost=100.0)
    assert not roughly.reached(undamped, gain=-7.0, promised=1.1, cost=100.0)
    assert not roughly.reached(damped, gain=-7.0, promised=0.9, cost=100.0), "a longer step may gain more"
    assert replace(roughly, doubtful=2.0).reached(damped, gain=-7.0, promised=1.1, cost=100.0)
