"""The wall accumulated from rings of a known wall and a known motion equals that wall, within σ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.artefacts.measured import RingSamples, RingValidity, Trajectory, Wall
from pipeline.errors import UnusableError
from pipeline.geometry.axis import straight_axis
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from pipeline.instrument.probe import Probe
from stages.accumulate import AccumulateParameters, accumulate_wall, stretch, survey
from stages.accumulate.grid import _regress
from stages.triangulate import TriangulateParameters, triangulate_rings
from tests.drawn_run import BASELINE, RADIUS, rings_on_wall, round_wall, small_probe
from tests.quiet import quiet_context

RINGS, STEP = 40, 0.5
SIGMA_PX = 0.05
PARAMETERS = AccumulateParameters(azimuth_samples=180)
PIT = (BASELINE + 10.0, 0.8, 0.6, 4.0)  # distance mm, azimuth rad, depth mm, 1 σ mm


def motion(count: int = RINGS) -> Trajectory:
    k = np.arange(count)
    turn = np.stack([0.01 * np.sin(0.2 * k), 0.01 * np.cos(0.15 * k), 0.01 * k], -1)
    origin = np.stack([0.8 * np.sin(0.1 * k), 0.5 * np.cos(0.1 * k), STEP * k], -1)
    T_pc = from_parts(rotation_from_vector(turn), origin)
    axis = straight_axis(-50.0, STEP * count + 100)
    return Trajectory(k, k / 30, T_pc, np.zeros((count, 6, 6)), axis, RADIUS, 1.0, 0.0, 0.0, ())


def exact_probe() -> Probe:
    return replace(small_probe(), covariance=np.zeros((20, 20)))


def drawn_rings(radius_at=round_wall, sigma_px: float = SIGMA_PX, seed: int = 0) -> RingSamples:
    run = motion()
    random = np.random.default_rng(seed)
    return rings_on_wall(exact_probe(), run.T_pc, run.frame, random, radius_at, sigma_px, 360)


def accumulated(rings: RingSamples, probe: Probe | None = None, **parameters: float) -> Wall:
    probe = probe or exact_probe()
    points = triangulate_rings(rings, probe, TriangulateParameters(), quiet_context())
    chosen = AccumulateParameters(**{**PARAMETERS.model_dump(), **parameters})
    return accumulate_wall(probe, rings, points, motion(), chosen, quiet_context())


def oval(s: Float, psi: Float) -> Float:
    return RADIUS + 0.4 * np.cos(2 * (psi - 0.5))


def pitted(s: Float, psi: Float) -> Float:
    at, around, depth, width = PIT
    turn = (psi - around + np.pi) % (2 * np.pi) - np.pi
    return RADIUS + depth * np.exp(-((s - at) ** 2 + (RADIUS * turn) ** 2) / (2 * width**2))


@pytest.mark.parametrize("shape", [round_wall, oval, pitted])
def test_the_wall_is_reconstructed_within_sigma(shape) -> None:
    got = accumulated(drawn_rings(shape)).radius_map
    wanted = shape(*np.meshgrid(got.distance_mm, got.azimuth_rad, indexing="ij"))
    inner = slice(4, -4)
    error, sigma = (got.radius_mm - wanted)[inner], got.sigma_mm[inner]
    assert np.mean(np.abs(error) < 1.96 * sigma) > 0.93
    assert abs(error.mean()) < 0.01
    assert np.median(sigma) < 0.04


@pytest.mark.parametrize("smoothing_mm", [0.3, 1.5, 4.0])
def test_the_map_states_the_kernel_that_flattens_what_is_short(smoothing_mm: float) -> None:
    """The limit of detection took the kernel for the default one, and was too low where it was wider."""
    at, _, depth, width = PIT
    ridge = lambda s, psi: RADIUS + depth * np.exp(-0.5 * ((s - at) / width) ** 2) + 0 * psi  # noqa: E731
    got = accumulated(drawn_rings(ridge, 0.005), smoothing_mm=smoothing_mm).radius_map
    top = float(np.median(got.radius_mm[got.row(at)])) - RADIUS
    (kernel,) = np.unique(got.kernel_in())
    assert top == pytest.approx(depth * width / np.hypot(width, kernel), rel=0.05)


def test_sigma_equals_the_noise() -> None:
    got = accumulated(drawn_rings()).radius_map
    error = (got.radius_mm - RADIUS)[4:-4]
    assert 0.8 < np.median(got.sigma_random_mm[4:-4]) / error.std() < 1.4


def test_sigma_equals_the_noise_at_each_place() -> None:
    """With grease on a quarter of the window, one σ for the whole wall covered half of the errors there."""
    rings = drawn_rings()
    greasy = np.abs(rings.azimuth_rad - 1.0) < np.pi / 4
    more = greasy * 4 * SIGMA_PX * np.random.default_rng(1).normal(size=rings.radius_px.shape)
    got = accumulated(replace(rings, radius_px=rings.radius_px + more.astype(np.float32)))
    error = np.abs(got.radius_map.radius_mm - RADIUS)[4:-4]
    inside = error < 1.96 * got.radius_map.sigma_random_mm[4:-4]
    away = np.abs(got.radius_map.azimuth_rad - 1.0)
    assert 0.9 < inside[:, away < 0.6].mean() < 0.99
    assert 0.9 < inside[:, (away > 1.2)].mean() < 0.995


def test_cloud_lies_on_the_wall_with_unit_normals_toward_the_axis() -> None:
    cloud = accumulated(drawn_rings(oval)).cloud
    np.testing.assert_allclose(np.linalg.norm(cloud.normal_p, axis=1), 1, atol=1e-5)
    outward = cloud.xyz_p * [1, 1, 0] / np.hypot(cloud.xyz_p[:, 0], cloud.xyz_p[:, 1])[:, None]
    assert np.all(np.sum(outward * cloud.normal_p, 1) < -0.9)
    error = cloud.radius_mm - oval(cloud.distance_mm, cloud.azimuth_rad)
    assert 0.7 < np.std(error) / np.median(cloud.sigma_mm) < 1.3
    np.testing.assert_allclose(np.hypot(*cloud.xyz_p[:, :2].T), cloud.radius_mm, atol=0.01)


def test_normals_follow_the_slope_of_a_cone() -> None:
    cone = accumulated(drawn_rings(lambda s, psi: RADIUS + 0.05 * (s - BASELINE), 0.005)).cloud
    inner = (cone.distance_mm > BASELINE + 4) & (cone.distance_mm < BASELINE + STEP * RINGS - 4)
    assert np.median(cone.normal_p[inner, 2]) == pytest.approx(0.05, abs=0.01)


def test_wide_gaps_stay_unmeasured_and_all_else_is_covered() -> None:
    rings = drawn_rings()
    validity = rings.validity.copy()
    validity[15:25] = RingValidity.NO_LINE
    validity[:, 100:120] = RingValidity.GLINT
    got = accumulated(replace(rings, validity=validity), largest_gap_mm=2.0).radius_map
    seen = np.isfinite(got.radius_mm)
    gap = (got.distance_mm > BASELINE + 8.0) & (got.distance_mm < BASELINE + 11.0)
    assert not seen[gap].any()
    assert np.all(np.isfinite(got.sigma_mm) == seen)
    assert not np.any(got.count[~seen])
    unlit = ~seen[~gap]
    assert 0.02 < unlit.mean() < 0.3
    assert not unlit[:, 90:].any() or not unlit.all(0).all()


def test_a_gap_narrower_than_allowed_is_bridged() -> None:
    rings = drawn_rings()
    validity = rings.validity.copy()
    validity[18:21] = RingValidity.NO_LINE
    got = accumulated(replace(rings, validity=validity), largest_gap_mm=4.0).radius_map
    assert np.isfinite(got.radius_mm[2:-2]).all()


def test_the_uncertainty_of_calibration_is_added_and_does_not_average_out() -> None:
    wall = accumulated(drawn_rings(), small_probe()).radius_map
    # σ of the baseline, 5 µm, moves r = l tan θ by r / l times as much.
    added = np.sqrt(wall.sigma_mm**2 - wall.sigma_random_mm**2)[4:-4]
    assert np.median(added) > 0.005 * RADIUS / BASELINE * 0.9


def test_rings_that_a_pose_error_puts_off_centre_are_centred() -> None:
    """A pose error across the pipe that many rings share must not become a shape of the wall."""
    rings, run, probe = drawn_rings(), motion(), exact_probe()
    moved = run.T_pc.copy()
    moved[:, 0, 3] += 0.1
    points = triangulate_rings(rings, probe, TriangulateParameters(), quiet_context())
    got = accumulate_wall(probe, rings, points, replace(run, T_pc=moved), PARAMETERS, quiet_context())
    error = (got.radius_map.radius_mm - RADIUS)[4:-4]
    assert abs(np.mean(error * np.cos(got.radius_map.azimuth_rad))) < 0.005


def test_without_a_valid_sample_the_run_is_refused() -> None:
    rings = drawn_rings()
    none = replace(rings, validity=np.full_like(rings.validity, RingValidity.NO_LINE))
    with pytest.raises(UnusableError, match="no valid ring sample"):
        accumulated(none)


def plain_line(d: Float, radius: Float, variance: Float, width: float) -> tuple[float, float]:
    """Return value at 0 and 1 σ of the weighted regression line, by the normal equations."""
    kernel = np.exp(-0.5 * (d / width) ** 2)
    design = np.stack([np.ones_like(d), d], -1)
    weight = kernel / variance
    inverse = np.linalg.inv((design * weight[:, None]).T @ design)
    share = inverse @ (design * weight[:, None]).T
    fit = share @ radius
    misfit = np.sum(weight * (radius - design @ fit) ** 2)
    freedom = kernel.sum() - 2 * np.sum(kernel**2) / kernel.sum()
    excess = max(1.0, misfit / freedom) if freedom > 0.2 else 1.0
    return fit[0], float(np.sqrt(np.sum(share[0] ** 2 * variance) * excess))


def test_regression_agrees_with_the_plain_formula() -> None:
    random = np.random.default_rng(0)
    rings, width, gap = 60, 0.7, 2.0
    distance = np.sort(random.uniform(0, 20, (3, rings)), 1)
    radius, variance = random.standard_normal((3, rings)), random.uniform(0.5, 2, (3, rings))
    misalignment, count = random.standard_normal((3, rings)), random.integers(1, 4, (3, rings))
    rows = np.arange(2.0, 18.0, 0.5)
    out = [np.full((len(rows), 3), np.nan, np.float32) for _ in range(3)]
    total = np.zeros((len(rows), 3), np.int64)
    _regress(
        distance, radius, variance, misalignment, count, rows, width, gap, out[0], out[1], total, out[2]
    )  # fmt: skip
    checked = 0
    for i, s in enumerate(rows):
        for a in range(3):
            d = distance[a] - s
            near = np.abs(d) <= max(3 * width, gap)
            if np.isnan(out[0][i, a]):
                assert d[d > 0].min() - d[d <= 0].max() > gap
                continue
            wanted = plain_line(d[near], radius[a, near], variance[a, near], width)
            np.testing.assert_allclose((out[0][i, a], out[1][i, a]), wanted, rtol=1e-4, atol=1e-5)
            assert total[i, a] == count[a, np.abs(d) <= 3 * width].sum()
            checked += 1
    assert checked > 80


def test_a_wall_made_in_stretches_equals_the_wall_made_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    rings = drawn_rings(pitted)
    whole = accumulated(rings)
    monkeypatch.setattr(stretch, "_ROWS", 9)
    monkeypatch.setattr(survey, "_AT_ONCE", 7)
    cut = accumulated(rings)
    # The width of the kernel and the size of the noise are estimated per stretch, and differ a little.
    np.testing.assert_allclose(cut.radius_map.radius_mm, whole.radius_map.radius_mm, atol=0.006)
    ratio = cut.radius_map.sigma_random_mm / whole.radius_map.sigma_random_mm
    assert np.nanpercentile(np.abs(np.log(ratio)), 95) < 0.5
    for name in ("xyz_p", "radius_mm", "distance_mm", "azimuth_rad", "frame"):
        np.testing.assert_array_equal(getattr(cut.cloud, name), getattr(whole.cloud, name))
    assert np.median(np.sum(cut.cloud.normal_p * whole.cloud.normal_p, 1)) > 0.9999
    assert not np.array_equal(cut.radius_map.sigma_random_mm, whole.radius_map.sigma_random_mm), (
        "control: other stretches give another wall"
    )


def test_impossible_radii_end_the_run() -> None:
    """The motion's pipe is three times as wide as the rings show."""
    probe, rings = exact_probe(), drawn_rings()
    points = triangulate_rings(rings, probe, TriangulateParameters(), quiet_context())
    wide = replace(motion(), radius_mm=3 * motion().radius_mm)
    with pytest.raises(UnusableError, match="100 % of the wall lies more than 50 % off"):
        accumulate_wall(probe, rings, points, wide, PARAMETERS, quiet_context())
