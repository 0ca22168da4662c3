"""Live diameters: their σ agrees with drawn probes and rings, whole ones and incomplete ones."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from stages.preview import section_of
from stages.triangulate import TriangulateParameters, triangulate_rings
from tests.quiet import quiet_context

CAMERA = KannalaBrandt((1600, 1200), (366.1, 365.8), (796.9, 591.8), (-0.0118, 0.0008, -0.0008, 0.0))
SIGMA = np.r_[0.3, 0.3, 0.3, 0.3, 2e-4, 2e-4, 1e-4, 0, 0.04, 1e-3, 1e-3, 2e-3, np.zeros(8)]
PROBE = Probe(CAMERA, LaserSheet(23.4), np.diag(SIGMA**2))
AZIMUTH = np.linspace(-np.pi, np.pi, 360, endpoint=False)
RADIUS = 50.0


def measured(true: Probe, seed: int, share: float, believed: Probe = PROBE) -> tuple[float, float]:
    """Return error and 1 σ of the diameter by an assumed probe in an oval pipe seen by ``true``."""
    random = np.random.default_rng(seed)
    radius = RADIUS * (1 + 0.002 * np.cos(2 * AZIMUTH - random.uniform(0, 6)))
    height = true.laser.height(AZIMUTH) + radius * true.laser.slope(AZIMUTH)
    uv = true.camera.project(np.stack([radius * np.cos(AZIMUTH), radius * np.sin(AZIMUTH), height], -1)).uv
    noise = np.convolve(np.tile(random.normal(0, 0.15, 360), 2), np.ones(4) / 2, "same")[180:540]
    off = uv - CAMERA.centre_px
    seen = np.unwrap(np.arctan2(off[:, 1], off[:, 0]))
    px = np.interp(AZIMUTH, seen, np.hypot(*off.T), period=2 * np.pi) + noise
    alike = np.ones((1, 360), np.float32)
    invalid = (np.arange(360) >= share * 360)[None].astype(np.uint8)
    rings = RingSamples(
        np.array([0]), AZIMUTH, CAMERA.centre_px, px[None].astype(np.float32), 0.15 * alike, alike,
        80 * alike, invalid,
    )  # fmt: skip
    points = triangulate_rings(rings, believed, TriangulateParameters(), quiet_context())
    found = section_of(0, 0.0, 0.0, points.xyz_c[0].astype(float), rings.pixels()[0], believed)
    return found.diameter_mm - 2 * RADIUS, found.diameter_sigma_mm


@pytest.mark.parametrize("share", [1.0, 0.75])
def test_the_sigma_of_a_live_diameter_is_right(share: float) -> None:
    errors, known = [], []
    for seed in range(80):
        drawn = np.random.default_rng(1000 + seed).normal(size=20) * SIGMA
        true = PROBE.with_parameters(PROBE.parameters + drawn, PROBE.covariance)
        errors.append(measured(true, seed, share))
        known.append(measured(PROBE, seed, share)[0])
    z = np.array([error / sigma for error, sigma in errors])
    assert 0.75 < np.sqrt(np.mean(z**2)) < 1.25
    assert share < 1 or np.std([e for e, _ in errors]) > 5 * np.std(known), "the probe decides, not the noise"


def test_sigma_is_the_noise_of_a_whole_ring_where_the_probe_is_known() -> None:
    exact = replace(PROBE, covariance=np.zeros((20, 20)))
    z = np.array([np.divide(*measured(PROBE, seed, 1.0, exact)) for seed in range(80)])
    assert 0.75 < np.std(z) < 1.3
    assert abs(z.mean()) < 1
