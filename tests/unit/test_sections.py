"""Sections compared with analytic ovals and with the scatter of repeated draws."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import UnusableError
from stages.sections import SectionParameters, measure_sections
from tests.quiet import quiet_context
from tests.synthetic_wall import bare_recording, smooth_noise, wall_of

PARAMETERS = SectionParameters()
AZIMUTH = -np.pi + np.arange(360) * np.pi / 180
DISTANCE = np.arange(0, 30, 0.5)


def measure(radius, sigma_random=0.02, sigma=0.08):
    wall = wall_of(DISTANCE, AZIMUTH, radius, sigma_random, sigma)
    return measure_sections(bare_recording(100.0), wall, PARAMETERS, quiet_context())


def test_every_ovality_definition_on_a_known_oval():
    radius = np.tile(50 + 0.25 * np.cos(2 * (AZIMUTH - 0.4)), (len(DISTANCE), 1))
    sections = measure(radius)
    assert np.allclose(sections.mean_diameter_mm, 100, atol=1e-3)
    assert np.allclose(sections.max_diameter_mm, 100.5, atol=1e-3)
    assert np.allclose(sections.min_diameter_mm, 99.5, atol=1e-3)
    assert np.allclose(sections.ovality_nominal, 0.01, atol=2e-5)
    assert np.allclose(sections.ovality_mean, 0.01, atol=2e-5)
    assert np.allclose(sections.ovality_astm_f1216, 0.005, atol=2e-5)
    assert np.allclose(sections.ovality_harmonic_mm, 0.25, atol=1e-3)
    assert np.allclose(sections.major_axis_rad, 0.4, atol=np.pi / 360)


def test_the_centre_is_subtracted_before_diameters_are_read():
    direction = np.stack([np.cos(AZIMUTH), np.sin(AZIMUTH)], -1)
    along = direction @ np.array([0.6, -0.8])
    offset = 2.0
    radius = offset * along + np.sqrt(50**2 - offset**2 * (1 - along**2))
    sections = measure(np.tile(radius, (len(DISTANCE), 1)))
    assert np.allclose(sections.centre_x_mm, 1.2, atol=1e-3)
    assert np.allclose(sections.centre_y_mm, -1.6, atol=1e-3)
    assert np.all(sections.max_diameter_mm - sections.min_diameter_mm < 0.003)


def test_what_displaces_the_picture_from_place_to_place_averages_out_in_the_mean_diameter():
    """It counted as common to all places: ±.26 mm where run.json said ±.03."""
    wall = wall_of(DISTANCE, AZIMUTH, np.full((len(DISTANCE), 360), 50.0), 0.01, np.hypot(0.0166, 0.13))
    displaced = np.full(len(DISTANCE), 0.13)
    local = replace(wall, radius_map=replace(wall.radius_map, displaced_mm=displaced))
    sections = measure_sections(bare_recording(100.0), local, PARAMETERS, quiet_context())
    common = 2 * np.sqrt(0.0166**2 - 0.01**2)
    assert np.allclose(sections.mean_diameter_sigma_mm, common, rtol=0.02)
    assert np.allclose(sections.max_diameter_sigma_mm, np.hypot(common, np.sqrt(2) * 0.13), rtol=0.02)
    assert np.allclose(sections.ovality_nominal_sigma, 2 * 0.13 / 100, rtol=0.05)
    assert np.allclose(sections.ovality_harmonic_sigma_mm, 0.13 / 2, rtol=0.05)


def test_the_random_part_is_the_scatter_and_the_calibration_part_stays():
    rng = np.random.default_rng(3)
    oval = 50 + 0.2 * np.cos(2 * AZIMUTH)
    drawn = [
        measure(oval + smooth_noise(rng, (len(DISTANCE), 360), 0.03, 2.0), 0.03, 0.03) for _ in range(12)
    ]
    for value, sigma in (
        ("mean_diameter_mm", "mean_diameter_sigma_mm"),
        ("ovality_mean", "ovality_mean_sigma"),
        ("ovality_harmonic_mm", "ovality_harmonic_sigma_mm"),
        ("centre_x_mm", "centre_sigma_mm"),
    ):
        scatter = np.std([getattr(s, value) for s in drawn])
        stated = np.sqrt(np.mean([getattr(s, sigma) ** 2 for s in drawn]))
        # 72 correlated stations: their standard deviation itself is known to about 12 %
        assert 0.65 < stated / scatter < 1.6, value
    calibrated = measure(np.tile(oval, (len(DISTANCE), 1)), 0.02, 0.08)
    assert np.all(calibrated.mean_diameter_sigma_mm > 2 * np.sqrt(0.08**2 - 0.02**2) - 1e-9)
    assert np.all(calibrated.ovality_mean_sigma < 1e-3)


def test_unmeasured_stations_stay_empty_and_are_counted():
    radius = np.full((len(DISTANCE), 360), 50.0)
    radius[20:40, 80:] = np.nan
    sections = measure(radius)
    missing = np.isnan(sections.mean_diameter_mm)
    assert missing.sum() == 2
    assert np.all(sections.coverage[missing] < 0.3)


def test_an_empty_wall_is_refused():
    with pytest.raises(UnusableError, match="no measured radius"):
        measure(np.full((len(DISTANCE), 360), np.nan))


@pytest.mark.parametrize("gap_deg", [0, 60, 120])
def test_an_unmeasured_arc_makes_a_section_less_sure_but_not_wild(gap_deg):
    rng = np.random.default_rng(7)
    oval = 50 + 0.25 * np.cos(2 * (AZIMUTH - 0.4)) + 3 * np.cos(AZIMUTH)
    off = []
    for _ in range(8):
        radius = oval + smooth_noise(rng, (len(DISTANCE), 360), 0.03, 2.0)
        radius[:, :gap_deg] = np.nan
        sections = measure(radius, 0.03, 0.03)
        off.append((sections.max_diameter_mm - 100.5) / sections.max_diameter_sigma_mm)
    off = np.array(off)
    assert np.isfinite(off).all()
    # an eccentricity of 3 mm itself adds 0.09 mm of mean diameter at second order
    assert np.sqrt(np.mean((off - off.mean()) ** 2)) < 2.5
    assert np.abs(sections.mean_diameter_mm - 100).max() < 0.3
