"""Inference of the diagnosis against dense brute force, on small linear problems."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from pipeline.adjustment.rows import Rows
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.effects.vocabulary import VOCABULARY
from stages.diagnose.gauge.elimination import FrameSums, OwnUnknowns, eliminate_globals, eliminate_poses
from stages.diagnose.gauge.equations import KINDS, Equations, InCourses, Part, of_no_edge
from stages.diagnose.gauge.formula import joint_p
from stages.diagnose.gauge.score_spread import score_inflation
from stages.diagnose.inference import (
    INSTRUMENT,
    Around,
    Column,
    Evidence,
    Stated,
    estimate,
    places_of,
    total,
)

FRAMES, GLOBALS = 9, 5
TILT, CONE = LIBRARY["laser_tilt"], LIBRARY["laser_cone"]


def equations(random: np.random.Generator, rows: int = 200) -> Equations:
    by_global = random.normal(size=(rows, GLOBALS))
    kind = random.integers(0, 2, rows)
    # One global parameter that one kind of measurement does not depend on.
    by_global[kind == 1, 0] = 0.0
    return Equations(
        random.integers(0, FRAMES, rows), random.normal(size=(rows, 6)), by_global,
        random.normal(size=rows), random.uniform(0.5, 2, rows), random.integers(0, 30, rows), kind,
        random.uniform(0, 60, (rows, 2)), *of_no_edge(rows),
    )  # fmt: skip


def motion(random: np.random.Generator) -> Rows:
    frame = np.arange(FRAMES - 3)[:, None] + np.arange(4)
    shape = (len(frame), 4, 6)
    return Rows(
        frame, random.normal(size=shape), np.zeros((len(frame), 0)), random.normal(size=len(frame)),
        random.uniform(0.7, 1, len(frame)),
    )  # fmt: skip


def dense(e: Equations, m: Rows) -> tuple[np.ndarray, np.ndarray]:
    """Return all weighted rows over poses and globals, and their residuals."""
    of_poses = np.zeros((len(e.frame), FRAMES, 6))
    of_poses[np.arange(len(e.frame)), e.frame] = e.by_pose
    tied = np.zeros((len(m.frame), FRAMES, 6))
    for k in range(4):
        tied[np.arange(len(m.frame)), m.frame[:, k]] += m.by_frame[:, k]
    measured = np.concatenate([of_poses.reshape(len(e.frame), -1), e.by_global], 1)
    prior = np.concatenate([tied.reshape(len(m.frame), -1), np.zeros((len(m.frame), GLOBALS))], 1)
    weight = np.sqrt(np.concatenate([e.weight, m.weight]))
    return (
        np.concatenate([measured, prior]) * weight[:, None],
        np.concatenate([e.residual, m.residual]) * weight,
    )


def test_eliminating_poses_and_globals_agrees_with_dense_least_squares():
    random = np.random.default_rng(1)
    e, m = equations(random), motion(random)
    reduced = eliminate_poses(e, m, FRAMES)
    none = np.zeros(2)
    own = OwnUnknowns(np.array([3, 4]), none, none, none)
    left, misfit = eliminate_globals(reduced, own)
    rows, residual = dense(e, m)
    nuisance = [*range(6 * FRAMES), 6 * FRAMES + 3, 6 * FRAMES + 4]
    free = np.linalg.qr(rows[:, nuisance])[0]
    kept = rows[:, 6 * FRAMES : 6 * FRAMES + 3]
    kept = kept - free @ (free.T @ kept)
    rest = residual - free @ (free.T @ residual)
    assert left.information == pytest.approx(kept.T @ kept, rel=1e-6)
    assert left.right == pytest.approx(-kept.T @ rest, rel=1e-6, abs=1e-6)
    assert misfit == pytest.approx(rest @ rest, rel=1e-8)


def test_fiducial_edges_that_few_measurements_see_are_eliminated_like_dense_globals():
    random = np.random.default_rng(8)
    dense_rows, m = equations(random), motion(random)
    seen = dense_rows.kind == 0
    edge = np.where(seen, random.integers(1, 4, len(seen)), -1)
    by_edge = np.where(seen, dense_rows.by_global[np.arange(len(seen)), edge], 0.0)
    few = replace(
        dense_rows, by_global=dense_rows.by_global[:, [0, 4]], edge=edge, by_edge=by_edge, edges=slice(1, 4)
    )
    dense_rows.by_global[:, 1:4] = np.where(edge[:, None] == [1, 2, 3], by_edge[:, None], 0.0)
    told = []
    for e in (dense_rows, few):
        reduced, none = eliminate_poses(e, m, FRAMES), np.zeros(3)
        left, _ = eliminate_globals(reduced, OwnUnknowns(np.arange(1, 4), none, none, none))
        spread, _ = score_inflation(e, reduced, left, np.arange(1, 4), np.array([-1, 0]), np.eye(1))
        told.append((left.information, left.right, reduced.misfit, spread))
    for sparse, full in zip(*told[::-1], strict=True):
        assert sparse == pytest.approx(full, rel=1e-9)


def test_a_part_in_which_some_frames_are_not_seen_can_be_eliminated():
    random = np.random.default_rng(2)
    e, m = equations(random), motion(random)
    frames = np.arange(FRAMES) < 2
    part = e.of(Part(frames, (0, 1)))
    assert set(part.frame) == {0, 1}
    assert np.isfinite(eliminate_poses(part, replace(m, sigma=np.inf * m.sigma), FRAMES).information).all()


def evidence_of(
    design: np.ndarray, measured: np.ndarray, columns: tuple[Column, ...], inflation: float = 1.0
) -> Evidence:
    a = design.T @ design
    surely = np.full(len(a), np.inf)
    return Evidence(columns, a, design.T @ measured, inflation * a, float(measured @ measured), surely)


def test_the_evidence_of_a_set_is_its_marginal_likelihood():
    random = np.random.default_rng(3)
    design, measured = random.normal(size=(40, 3)), random.normal(size=40)
    columns = (Column(INSTRUMENT, "fx"), Column("laser_cone", "a"), Column("baseline", "b"))
    stated = Stated(("fx",), np.array([[4.0]]))
    of = evidence_of(design, measured, columns)

    def exact(sigma: np.ndarray) -> float:
        covariance = np.eye(40) + design @ np.diag([0.25, *sigma**2]) @ design.T
        return float(-2 * stats.multivariate_normal(np.zeros(40), covariance).logpdf(measured))

    wide, narrow = np.array([1.0, 2.0]), np.array([0.1, 5.0])
    deviance = [estimate(of, stated, np.array([np.inf, *s])).deviance for s in (wide, narrow)]
    assert deviance[0] - deviance[1] == pytest.approx(exact(wide) - exact(narrow), abs=1e-8)


def cone_and_sheet() -> tuple[tuple[Column, ...], Stated]:
    columns = (Column(INSTRUMENT, "cone"), Column("laser_cone", CONE.amplitudes[0].name))
    return columns, Stated(("cone",), np.array([[0.01**-2]]))


def test_a_deviation_within_the_stated_uncertainty_is_no_discovery():
    columns, stated = cone_and_sheet()
    one = np.random.default_rng(4).normal(size=(500, 1))
    design = 1e3 * np.concatenate([one, one], 1)

    def p_value(size: float) -> float:
        of = evidence_of(design, design[:, 1] * size, columns)
        found = Around.of(of, stated).score(places_of(of, CONE, ()))
        assert found is not None
        assert found.amplitude[0] == pytest.approx(size, rel=1e-3)
        return found.p_value

    assert p_value(0.01) > 0.2
    assert p_value(0.1) < 1e-8


def test_correlated_neighbours_widen_the_errors_of_data_but_not_the_stated_ones():
    columns, stated = cone_and_sheet()
    one = np.random.default_rng(5).normal(size=(500, 1))
    design = 1e3 * np.concatenate([one, one], 1)
    plain, alike = (
        Around.of(evidence_of(design, design[:, 1] * 0.05, columns, f), stated).score(np.array([1]))
        for f in (1.0, 9.0)
    )
    assert plain is not None
    assert alike is not None
    # The data determine this to 1e-4; only the stated uncertainty of 0.01 counts.
    assert alike.covariance == pytest.approx(plain.covariance, rel=1e-2)


def test_scores_of_noise_are_uniform():
    random = np.random.default_rng(6)
    columns = (Column(INSTRUMENT, "cone"), *(Column("laser_tilt", a.name) for a in TILT.amplitudes))
    stated = Stated(("cone",), np.array([[1.0]]))
    design = random.normal(size=(300, 3))
    p_values = []
    for _ in range(300):
        noise = random.normal(size=300) + design[:, 0] * random.normal()
        found = Around.of(evidence_of(design, noise, columns), stated).score(np.array([1, 2]))
        assert found is not None
        p_values.append(found.p_value)
    assert stats.kstest(p_values, "uniform").pvalue > 1e-3


def test_deflated_evidence_counts_correlated_measurements_once():
    columns, stated = cone_and_sheet()
    random = np.random.default_rng(7)
    design, noise = random.normal(size=(50, 2)), random.normal(size=50)
    once = evidence_of(design, noise, columns)
    three_times = total([once, once, once]).deflated(3.0)
    sigma = np.array([np.inf, 1.0])
    assert estimate(three_times, stated, sigma).deviance == pytest.approx(
        estimate(once, stated, sigma).deviance
    )


@pytest.mark.parametrize(("hidden", "low", "high"), [(0.0, 1e-3, 1.0), (4.0, 0.0, 1e-6)])
def test_a_residual_is_recognised_as_noise_or_not(hidden, low, high):
    random = np.random.default_rng(9)
    columns = tuple(Column(m.name, a.name, s) for m, s in VOCABULARY for a in m.amplitudes)
    design = random.normal(size=(2000, len(columns)))
    strange = design[:, :40] @ random.normal(0, hidden / np.sqrt(2000), 40)
    of = evidence_of(design, random.normal(size=2000) + strange, columns)
    assert low <= joint_p(of, Stated((), np.zeros((0, 0))), np.zeros(0, np.int64)) <= high


def test_a_score_that_comes_from_few_cells_is_less_significant():
    random = np.random.default_rng(12)
    of = evidence_of(random.normal(size=(500, 1)), random.normal(size=500), (Column("a", ""),))
    of = replace(of, right=6.0 * np.sqrt(np.diag(of.information)))
    stated, block = Stated((), np.zeros((0, 0))), np.array([0])
    many, few = (Around.of(replace(of, degrees=np.array([d])), stated).score(block) for d in (np.inf, 10.0))
    assert many is not None
    assert few is not None
    assert many.statistic == few.statistic == pytest.approx(36.0)
    # The tails of F(1, 60) and F(1, 10) beyond 36.
    assert (many.p_value, few.p_value) == pytest.approx((1.22e-7, 1.33e-4), rel=0.02)
    both = replace(
        of, columns=(Column("a", ""), Column("a", "b")), information=np.eye(2), score_covariance=np.eye(2),
        right=np.array([6.0, 0.0]), degrees=np.array([10.0, np.inf]),
    )  # fmt: skip
    one_sure = Around.of(both, stated).score(np.array([0, 1]))
    assert one_sure is not None
    # The tail of F(2, 20) beyond 18.
    assert one_sure.p_value == pytest.approx(3.4e-5, rel=0.02)


def test_courses_of_one_law_give_the_equations_of_all_their_columns():
    random = np.random.default_rng(5)
    laws, m = equations(random), motion(random)
    factor = random.normal(size=(len(KINDS), FRAMES, 8))
    e = replace(laws, courses=InCourses(np.array([0, 1, 2, 3, 4, 4, 2, 4]), factor))
    part = Part(np.arange(FRAMES) > 2, (0,))
    of_parts = [FrameSums.of(e).reduced(m, p) for p in (Part(np.ones(FRAMES, bool)), part)]
    for told, full in zip(of_parts, (e.in_full(), e.in_full().of(part)), strict=True):
        known = eliminate_poses(full, m, FRAMES)
        assert told.information == pytest.approx(known.information, rel=1e-9, abs=1e-9)
        assert told.right == pytest.approx(known.right, rel=1e-9, abs=1e-9)
        assert told.pose_by_global == pytest.approx(known.pose_by_global, rel=1e-9, abs=1e-9)
