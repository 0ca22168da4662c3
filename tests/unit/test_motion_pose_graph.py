"""Errors along a chain of windows compared with the explicit chain, and loop closure in it."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.arrays import Float
from stages.motion.loops.pose_graph import Closures, conditioned, contradicted_places
from stages.motion.windows.error_chain import ErrorChain, ErrorSums, Link, interpolated

KNOTS, WINDOWS, SHARED = 4, 5, 2


@pytest.fixture(scope="module")
def chain() -> ErrorChain:
    random = np.random.default_rng(5)
    links = []
    for n in range(WINDOWS):
        carry = np.eye(6) + 0.02 * random.standard_normal((KNOTS, 6, 6))
        carry[0] = np.eye(6)
        root = np.zeros((KNOTS, 6, 24))
        root[1:] = np.cumsum(random.standard_normal((KNOTS - 1, 6, 24)), 0)
        joint = np.einsum("air,bjr->aibj", root, root)
        response = random.standard_normal((KNOTS, 6, SHARED))
        links.append(Link(30 * n + np.arange(0, 31, 10), carry, joint, response))
    return ErrorChain(tuple(links), 0.3 * np.eye(6), np.diag([0.5, 0.2]))


def written_out(chain: ErrorChain) -> Float:
    """Return the covariance (6 K, 6 K) by the linear map from all independent sources to all errors."""
    own = 6 * KNOTS
    sources = 6 + own * WINDOWS + SHARED
    spread = np.zeros((sources, sources))
    spread[:6, :6], spread[-SHARED:, -SHARED:] = chain.start, chain.shared
    rows, anchor = [], np.eye(6, sources)
    for n, link in enumerate(chain.links):
        at = 6 + own * n
        spread[at : at + own, at : at + own] = link.joint.reshape(own, own)
        for k in range(KNOTS):
            row = link.carry[k] @ anchor
            row[:, at + 6 * k : at + 6 * k + 6] += np.eye(6)
            rows.append(row)
        anchor = rows[-1]
    whole = np.stack(rows)
    whole[..., -SHARED:] += np.concatenate([link.response for link in chain.links])
    flat = whole.reshape(-1, sources)
    return np.asarray(flat @ spread @ flat.T)


def sums_of(dense: Float) -> ErrorSums:
    """Return sums given by weights (K, 6, C)."""
    knot, column = np.nonzero(dense.any(1))
    return ErrorSums.of(knot, column, dense[knot, :, column], dense.shape[2])


def dense(sums: ErrorSums, chain: ErrorChain) -> Float:
    return sums.dense(0, len(chain.at))


def closures(chain: ErrorChain, count: int, seed: int = 2) -> Closures:
    """Return differences between distant ends, two components each, with errors drawn from the chain."""
    random = np.random.default_rng(seed)
    knots = len(chain.at)
    by_error = np.zeros((knots, 6, count))
    for c in range(count):
        by_error[c // 2, c % 2, c], by_error[knots - 1 - c // 2, c % 2, c] = -1, 1
    sigma = np.full(count, 0.05)
    error = random.multivariate_normal(np.zeros(6 * knots), written_out(chain)).reshape(knots, 6)
    seen = np.einsum("kic,ki->c", by_error, error) + sigma * random.standard_normal(count)
    return Closures(sums_of(by_error), seen, sigma, np.arange(count) // 2)


def test_covariances_agree_with_the_explicit_chain(chain: ErrorChain) -> None:
    every = np.eye(6 * len(chain.at)).reshape(len(chain.at), 6, -1)
    got = np.concatenate(list(chain.covariances_with(sums_of(every)))).reshape(6 * len(chain.at), -1)
    np.testing.assert_allclose(got, written_out(chain), rtol=1e-9, atol=1e-9)


def test_selected_sums_are_right(chain: ErrorChain) -> None:
    known = closures(chain, 6).by_error
    some = known.select(np.array([4, 1]), np.array([2.0, -1.0]))
    np.testing.assert_array_equal(dense(some, chain), dense(known, chain)[..., [4, 1]] * [2.0, -1.0])
    np.testing.assert_array_equal(known.dense(3, 9), dense(known, chain)[3:9])


def test_loop_closure_is_conditioning(chain: ErrorChain) -> None:
    known = closures(chain, 6)
    full, by_error = written_out(chain), dense(known.by_error, chain).reshape(-1, 6)
    spread = by_error.T @ full @ by_error + np.diag(known.sigma**2)
    gain = full @ by_error @ np.linalg.inv(spread)
    found = conditioned(chain, known)
    np.testing.assert_allclose(found.error.ravel(), gain @ known.residual, rtol=1e-6, atol=1e-8)
    knots, left = len(chain.at), full - gain @ by_error.T @ full
    blocks = left.reshape(knots, 6, knots, 6)[np.arange(knots), :, np.arange(knots)]
    before = full.reshape(knots, 6, knots, 6)[np.arange(knots), :, np.arange(knots)]
    np.testing.assert_allclose(before - found.gained, blocks, rtol=1e-6, atol=1e-7)


def test_remaining_errors_are_within_sigma(chain: ErrorChain) -> None:
    """Over many drawn runs the squared remaining error, over its covariance, averages its dimension."""
    random, full = np.random.default_rng(0), written_out(chain)
    known, knots = closures(chain, 6), len(chain.at)
    by_error = dense(known.by_error, chain)
    marginal = full.reshape(knots, 6, knots, 6)[np.arange(knots), :, np.arange(knots)]
    left = marginal - conditioned(chain, known).gained
    root = np.linalg.cholesky(full + 1e-9 * np.eye(len(full)))
    squares = []
    for _ in range(400):
        error = (root @ random.standard_normal(len(full))).reshape(knots, 6)
        seen = np.einsum("kic,ki->c", by_error, error) + known.sigma * random.standard_normal(6)
        rest = error - conditioned(chain, Closures(known.by_error, seen, known.sigma, known.place)).error
        squares.append(float(rest[-1] @ np.linalg.solve(left[-1], rest[-1])))
    assert np.mean(squares) == pytest.approx(6.0, abs=0.7)
    open_ = (root @ random.standard_normal((len(full), 50))).T[:, -6:]
    plain = np.einsum("ni,ij,nj->n", open_, np.linalg.inv(left[-1]), open_)
    assert np.mean(plain) > 12, "control: without closure they are not"


def off_by(known: Closures, chain: ErrorChain, component: int, sigmas: float) -> Closures:
    """Return the closures with one component off by some σ of its prediction from motion alone."""
    wrong = known.residual.copy()
    wrong[component] += sigmas * np.sqrt(known.residual_covariance(chain)[component, component])
    return Closures(known.by_error, wrong, known.sigma, known.place)


def test_a_contradicting_closure_is_rejected_and_no_other(chain: ErrorChain) -> None:
    known = closures(chain, 16)
    spread = known.residual_covariance(chain)
    assert contradicted_places(spread, known, 1e-6) == set()
    assert contradicted_places(spread, off_by(known, chain, 6, 20.0), 1e-6) == {3}
    assert contradicted_places(spread, off_by(off_by(known, chain, 6, 20.0), chain, 12, -25.0), 1e-6) == {
        3,
        6,
    }


def test_of_two_contradicting_closures_both_are_rejected(chain: ErrorChain) -> None:
    first = closures(chain, 2)
    twice = Closures(
        sums_of(np.repeat(dense(first.by_error, chain), 2, 2)),
        np.repeat(first.residual, 2) + np.array([0.0, 2.0, 0.0, 0.0]),
        np.full(4, 0.05),
        np.array([0, 1, 0, 1]),
    )
    spread = twice.residual_covariance(chain)
    assert np.sqrt(spread[0, 0]) > 2.0, "motion alone would accept either"
    assert contradicted_places(spread, twice, 1e-6) == {0, 1}


def test_values_between_knots_are_interpolated_linearly() -> None:
    at = np.array([0, 10, 10, 20])
    got = interpolated(np.array([0, 5, 10, 15, 20, 25]), at, np.array([[0.0], [1.0], [1.0], [3.0]]))
    np.testing.assert_allclose(got[:5, 0], [0, 0.5, 1, 2, 3])
