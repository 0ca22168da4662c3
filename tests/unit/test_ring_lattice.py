"""Errors of the line that repeat with the rows of the picture are recognised by their period and removed."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from stages.rings import RingParameters, extract_rings
from stages.rings.lattice import lattices_of, take_out
from tests.quiet import quiet_context
from tests.ring_images import exposed, memory_recording, off_centre, ring_light

SIZE, CENTRE, AZIMUTHS = (640, 480), (318.7, 241.3), 720
FRAMES, RINGS = 16, 64
PROBE = Probe(KannalaBrandt(SIZE, (140.0, 140.0), CENTRE), LaserSheet(22.0), np.zeros((20, 20)))
AZIMUTH = -np.pi + np.arange(AZIMUTHS) * 2 * np.pi / AZIMUTHS
ALONG_ROWS = np.abs(np.sin(AZIMUTH)) > 0.9


def extracted(enlarged: float) -> tuple[float, list[str]]:
    """Return the rms error where rings run along rows, px, and the warnings.

    Pictures are reduced by a factor and enlarged to their size again.
    """
    images, true, said = {}, [], list[str]()
    for k in range(FRAMES):
        ring = off_centre(165.0, 7.0, 0.7 + 0.2 * k)
        seen = exposed(ring_light(SIZE, CENTRE, ring, 0.8, 150.0), np.random.default_rng(k))
        small = cv2.resize(seen, None, fx=1 / enlarged, fy=1 / enlarged, interpolation=cv2.INTER_AREA)
        images[k] = np.asarray(cv2.resize(small, SIZE, interpolation=cv2.INTER_CUBIC), np.uint8)
        true.append(ring(AZIMUTH))
    recording = memory_recording(images, ["laser"] * FRAMES, SIZE)
    context = replace(quiet_context(), warn=said.append)
    samples = extract_rings(recording, PROBE, RingParameters(azimuths=AZIMUTHS), context)
    error = np.where(samples.valid, samples.radius_px - np.array(true), np.nan)[:, ALONG_ROWS]
    return float(np.sqrt(np.nanmean(error**2))), [w for w in said if "repeats every" in w]


def test_enlarged_pictures_are_reported_and_their_periodic_error_removed() -> None:
    """After a careless export the line followed its coarse pixels.

    Two false findings of .98, and a false seam.
    """
    error, said = extracted(2.5)
    assert len(said) == 1
    assert "every 2.5 px" in said[0] or "every 5 px" in said[0]
    assert error < 0.12  # 0.225 px without correction


def test_unscaled_pictures_have_no_such_error() -> None:
    error, said = extracted(1.0)
    assert not said
    assert error < 0.05


@pytest.mark.parametrize("step_px", [0.2, 0.02, 0.0])
def test_sigma_includes_what_cannot_be_removed_where_every_second_row_is_interpolated(step_px: float) -> None:
    """Errors of half a row remained, with a σ of a fifth of that: six false findings, at .95 to .98.

    Means over rings, which share the error where the probe hardly sways, erred by up to 2.7 σ.
    """
    images, true = {}, []
    for k in range(FRAMES):
        ring = off_centre(165.0, 7.0, 0.7 + step_px * k)
        light = ring_light(SIZE, CENTRE, ring, 0.8, 150.0)
        seen = exposed(light, np.random.default_rng(k)).astype(float)
        seen[1:-1:2] = (seen[:-2:2] + seen[2::2]) / 2
        images[k] = np.asarray(seen, np.uint8)
        true.append(ring(AZIMUTH))
    recording = memory_recording(images, ["laser"] * FRAMES, SIZE)
    samples = extract_rings(recording, PROBE, RingParameters(azimuths=AZIMUTHS), quiet_context())
    use = samples.valid & ALONG_ROWS
    error, sigma = (np.where(use, v, np.nan) for v in (samples.radius_px - np.array(true), samples.sigma_px))
    off = (error / sigma)[use]
    assert np.mean(np.abs(off) < 1.96) > 0.9
    assert 0.5 < np.sqrt(np.mean(off**2)) < 1.2
    assert samples.shared_px is not None
    seen = use.sum(0) > FRAMES / 2
    averaged = np.sqrt(np.nansum(sigma[:, seen] ** 2, 0)) / use[:, seen].sum(0)
    off = np.nanmean(error[:, seen], 0) / np.hypot(averaged, samples.shared_px[seen])
    assert np.mean(np.abs(off) < 1.96) > 0.9
    assert 0.2 < np.sqrt(np.mean(off**2)) < 1.2


def drawn(
    period_px: float, size_px: float, sway_px: float = 12.0, rough_px: float = 0.1, seed: int = 2
) -> RingSamples:
    """Return rings of a swaying probe, attracted to blocks of rows, with noise that neighbours share.

    A probe that does not sway sees the same wall in all its rings, like one that stands.
    """
    random = np.random.default_rng(seed)
    way = np.stack([np.sin(0.3 * np.arange(RINGS)), np.cos(0.2 * np.arange(RINGS))], -1)
    radius = 200 + sway_px * way @ np.stack([np.cos(AZIMUTH), np.sin(AZIMUTH)])
    fine = random.normal(0, rough_px, radius.shape if sway_px else AZIMUTHS)
    radius += fine + np.roll(fine, 1, -1) + np.roll(fine, 2, -1)
    radius += 1.0 * np.exp(-0.5 * ((AZIMUTH - 1.5) / 0.05) ** 2)  # a groove where the line runs along rows
    row = CENTRE[1] + radius * np.sin(AZIMUTH)
    radius += size_px * np.sin(2 * np.pi * row / period_px) * np.sin(AZIMUTH) * ALONG_ROWS
    alike = np.full(radius.shape, 0.1, np.float32)
    return RingSamples(
        np.arange(RINGS), AZIMUTH, np.array(CENTRE), radius.astype(np.float32), alike, alike, alike,
        np.zeros(radius.shape, np.uint8),
    )  # fmt: skip


@pytest.mark.parametrize("period_px", [2.5, 8.0, 16.0])
def test_blocks_of_rows_are_found_and_a_groove_is_not_changed(period_px: float) -> None:
    spoilt, sound = drawn(period_px, 0.3), drawn(period_px, 0.0)
    lattices = lattices_of(spoilt)
    assert [each.axis for each in lattices] == [1]
    assert lattices[0].period_px == pytest.approx(period_px, rel=0.03)
    take_out(lattices, spoilt)
    error = spoilt.radius_px - sound.radius_px
    assert np.sqrt(np.mean(error[:, ALONG_ROWS] ** 2)) < 0.1  # 0.2 px without correction
    groove = np.abs(AZIMUTH - 1.5) < 0.05
    assert np.mean(error[:, groove]) == pytest.approx(0.0, abs=0.05)


def test_noise_and_a_groove_are_no_periodic_error() -> None:
    assert lattices_of(drawn(8.0, 0.0)) == ()


@pytest.mark.parametrize("half_deg", [2.0, 4.0, 12.0])
@pytest.mark.parametrize("seed", range(5))
def test_an_arc_of_a_ring_confirms_no_periodic_error(half_deg: float, seed: int) -> None:
    samples = drawn(8.0, 0.0, 0.0, 0.1, seed)
    samples.validity[:, np.abs(AZIMUTH - np.pi / 2) > np.radians(half_deg)] = 1
    assert lattices_of(samples) == ()


@pytest.mark.parametrize("rough_px", [0.02, 0.1])
@pytest.mark.parametrize("seed", range(5))
def test_a_wall_that_all_rings_see_the_same_is_no_periodic_error(rough_px: float, seed: int) -> None:
    """A groove in a smooth pipe, or roughness where a probe stands, is partly periodic by chance."""
    assert lattices_of(drawn(8.0, 0.0, 0.0, rough_px, seed)) == ()
