"""Triangulation: points are exact; their noise and their derivatives by the instrument are right."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from stages.triangulate import (
    TRIANGULATE,
    TriangulateParameters,
    off_the_ring,
    outside_the_pipe,
    triangulate_rings,
)
from tests.exact_rings import seen_above_water
from tests.quiet import quiet_context

CAMERA = KannalaBrandt((1600, 1200), (366.1, 365.8), (796.9, 591.8), (-0.0118, 0.0008, -0.0008, 0.0))
SHEET = LaserSheet(23.4, 0.008, -0.006, 0.002, 0.05, -0.03, (1e-4, -2e-4, 0.0, 1e-4, 0.0, 0.0))
SIGMA = np.r_[0.06, 0.06, 0.06, 0.06, 2e-4, 2e-4, 1e-4, 0, 0.008, 1e-4, 1e-4, 2e-4, 0.01, 0.01, np.zeros(6)]
PROBE = Probe(CAMERA, SHEET, np.diag(SIGMA**2))
AZIMUTH = np.linspace(-np.pi, np.pi, 72, endpoint=False)


def samples(radius, sigma=0.1):
    shape = radius.shape
    return RingSamples(
        np.arange(shape[0]), AZIMUTH, CAMERA.centre_px, radius.astype(np.float32),
        np.full(shape, sigma, np.float32), np.ones(shape, np.float32), np.full(shape, 80, np.float32),
        np.zeros(shape, np.uint8),
    )  # fmt: skip


def rings(frames=20):
    """Return rings of several sizes, off the middle."""
    random = np.random.default_rng(0)
    size, off, phase = (random.uniform(*span, (frames, 1)) for span in ((280, 430), (0, 10), (-3, 3)))
    return samples(size + off * np.cos(AZIMUTH - phase))


def triangulated(ring, probe=PROBE):
    return triangulate_rings(ring, probe, TriangulateParameters(), quiet_context())


def test_points_lie_on_the_sheet_and_project_back_to_their_samples():
    ring = rings()
    points = triangulated(ring)
    xyz = points.xyz_c.astype(float)
    rho, psi = np.hypot(xyz[..., 0], xyz[..., 1]), np.arctan2(xyz[..., 1], xyz[..., 0])
    assert np.allclose(xyz[..., 2], SHEET.height(psi) + rho * SHEET.slope(psi), atol=2e-5)
    assert np.allclose(CAMERA.project(xyz).uv, ring.pixels(), atol=1e-3)


def test_untilted_sheet_is_a_plane_parallel_to_the_image():
    flat, ray = SHEET.untilted().intersect, CAMERA.unproject(rings().pixels()).ray
    assert np.allclose(flat(ray), ray * (SHEET.baseline_mm / ray[..., 2:]), atol=1e-4)
    assert np.abs(flat(ray) - triangulated(rings()).xyz_c).max() > 0.1


def test_the_stated_noise_vector_is_one_sigma_of_radius():
    ring = rings()
    points = triangulated(ring)
    moved = [triangulated(replace(ring, radius_px=ring.radius_px + np.float32(s))).xyz_c for s in (-0.5, 0.5)]
    slope = (moved[1].astype(float) - moved[0]) / 1.0
    assert np.allclose(points.noise_direction, 0.1 * slope, rtol=0.01, atol=1e-4)


def test_the_calibration_covariance_agrees_with_drawn_probes():
    ring = samples(np.full((1, AZIMUTH.size), 400.0))
    random = np.random.default_rng(1)
    by_parameters = PROBE.triangulate_jacobian(ring.pixels()[0])[1]
    covariance = by_parameters @ PROBE.covariance @ np.swapaxes(by_parameters, 1, 2)
    drawn = []
    for _ in range(3000):
        p = random.normal(size=SIGMA.size) * SIGMA
        probe = replace(
            PROBE, camera=CAMERA.with_parameters(CAMERA.parameters + p[:8]),
            laser=SHEET.with_parameters(SHEET.parameters + p[8:]),
        )  # fmt: skip
        drawn.append(probe.triangulate(ring.pixels()[0]))
    spread = np.std(drawn, axis=0)
    stated = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    assert np.allclose(stated, spread, rtol=0.08, atol=2e-4)
    offset = np.array(drawn) - np.mean(drawn, axis=0)
    mixed = np.mean(offset[..., 0] * offset[..., 1], axis=0)
    assert np.allclose(covariance[:, 0, 1], mixed, atol=0.05 * stated.max() ** 2)


def test_invalid_samples_and_rays_that_miss_the_sheet_are_nan():
    ring = rings()
    validity = ring.validity.copy()
    validity[3, 5] = RingValidity.GHOST
    radius = ring.radius_px.copy()
    radius[4, 6] = 620.0
    points = triangulated(replace(ring, validity=validity, radius_px=radius))
    gone = np.isnan(points.xyz_c).all(-1)
    assert sorted(zip(*np.nonzero(gone), strict=True)) == [(3, 5), (4, 6)]
    assert np.isnan(points.noise_direction[3, 5]).all()


def test_counts_are_reported():
    told = {}
    context = replace(quiet_context(), report=lambda name, value, unit="": told.update({name: value}))
    triangulate_rings(rings(3), PROBE, TriangulateParameters(), context)
    assert told["points triangulated"] == 3 * AZIMUTH.size
    assert told["median point noise"] == pytest.approx(0.03, rel=0.5)


def test_the_stage_is_connected_by_type():
    assert list(TRIANGULATE.inputs()) == ["recording", "rings", "probe"]


WIDE = np.linspace(-np.pi, np.pi, 1440, endpoint=False)


def ring_of(*bumps, frames=3):
    """Return a ring of radius 25 mm about a point 6 mm off the axis.

    ``bumps`` are (sector, width, departure).
    """
    rho = np.tile(6 * np.cos(WIDE) + np.sqrt(25**2 - (6 * np.sin(WIDE)) ** 2), (frames, 1))
    for at, width, departure in bumps:
        rho[:, np.arange(at, at + width) % 1440] *= 1 + departure
    return rho


@pytest.mark.parametrize(
    ("bump", "rejected"),
    [
        ((593, 1, 2.4), 1),
        ((593, 4, 0.25), 4),
        ((1438, 4, 1.0), 4),
        ((10, 1, -0.4), 1),
        ((593, 1, 0.15), 0),
        ((593, 5, 1.0), 0),
        ((593, 200, 0.5), 0),
        ((593, 720, -0.3), 0),
    ],
    ids=["edge", "narrow", "seam", "inward", "pit", "branch", "opening", "step"],
)
def test_only_narrow_samples_far_off_are_rejected(bump, rejected):
    """They are in every ring, like edges of texture: the previous ring does not confirm them."""
    off = off_the_ring(ring_of(bump).astype(np.float32), 0.2)
    assert off.sum(1).tolist() == [rejected] * 3
    assert not off_the_ring(ring_of(bump).astype(np.float32), 100).any()


def test_single_samples_are_compared_with_the_nearest_ones():
    rho = ring_of((593, 1, 2.4), (640, 1, 0.05)).astype(np.float32)
    rho[:, 560:590] = rho[:, 600:636] = np.nan
    rho[1] = np.nan
    rho[1, :8] = 25
    off = off_the_ring(rho, 0.2)
    assert np.argwhere(off).tolist() == [[0, 593], [2, 593]]


def test_a_sample_far_off_is_counted_and_all_its_values_are_removed():
    ring, told = rings(3), {}
    good = triangulated(ring)
    context = replace(quiet_context(), report=lambda name, value, unit="": told.update({name: value}))
    spoilt = ring.radius_px.copy()
    spoilt[1, 7] *= 1.25
    points = triangulate_rings(
        replace(ring, radius_px=spoilt), PROBE, TriangulateParameters.model_validate({}), context
    )
    assert told["rejected: far off the ring beside them"] == 1
    assert told["points triangulated"] == ring.valid.sum() - 1
    for name in ("xyz_c", "noise_direction"):
        found, before = getattr(points, name), getattr(good, name)
        assert np.isnan(found[1, 7]).all()
        kept = np.isfinite(found)
        assert kept.sum() == np.isfinite(before).sum() - before.shape[-1]
        assert np.array_equal(found[kept], before[kept])


WATER_MM = 9.0


def half_filled(rings, above_water=0):
    """Return points (rings, A, 3) of a half-filled pipe; the first ``above_water`` rings see no water."""
    wet = seen_above_water(WIDE, 50.0, -2.0, WATER_MM)
    dry = seen_above_water(WIDE, 50.0, -2.0, 99.0)
    xy = np.stack([dry if k < above_water else wet for k in range(rings)])
    xy = xy + 0.1 * np.random.default_rng(1).standard_normal(xy.shape)
    return np.concatenate([xy, np.full((*xy.shape[:2], 1), 23.0)], -1).astype(np.float32)


def test_the_reflection_in_water_is_not_wall():
    points = half_filled(6)
    mirrored = outside_the_pipe(points)
    below = points[..., 1] > WATER_MM
    assert not np.any(mirrored & ~below)
    kept = below & ~mirrored
    assert np.degrees(2 * np.pi / 1440) * kept.sum(1).max() < 4
    off = np.hypot(points[..., 0], points[..., 1] + 2) - 50
    assert off[kept].max() < 1


def test_a_ring_whose_fitted_circle_follows_the_reflected_line_is_rejected():
    points = half_filled(6)
    points[2, :, :2] *= 1.4
    assert outside_the_pipe(points)[2].all()


@pytest.mark.parametrize(
    "points",
    [
        half_filled(6, above_water=4),
        np.stack([np.cos(WIDE) * 55, np.sin(WIDE) * 45, 0 * WIDE], -1)[None].repeat(4, 0),
        np.stack([np.cos(WIDE) * 50, np.minimum(np.sin(WIDE) * 50, 30), 0 * WIDE], -1)[None].repeat(4, 0),
    ],
    ids=["a chamber on part of the way", "oval by a fifth", "filled with mud to 30 mm"],
)
def test_wall_that_is_not_round_is_kept(points):
    assert not outside_the_pipe(points).any()
