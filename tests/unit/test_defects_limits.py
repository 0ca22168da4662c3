"""The limit of detection states size and depth of what is found, stretch by stretch, by the run's rings."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from pipeline.adjustment.shared_light import HeldOver
from pipeline.artefacts.findings import Defects, Detectable
from pipeline.export.report.detectable import limits
from pipeline.export.tables import write_defects
from stages.accumulate.grid import WIDTH_IN_RINGS
from stages.defects import DefectParameters, find_defects
from stages.defects.limits import LEAST_SIZE_MM, rings_needed, widest_spacing_mm
from stages.defects.report import report_limits, warn_of_sparse
from tests.quiet import quiet_context
from tests.synthetic_wall import bare_recording, grey_texture, smooth_noise, wall_of

AZIMUTH = -np.pi + np.arange(360) * np.pi / 180
RADIUS, SIGMA, LENGTH_MM, STEP_MM = 38.0, 0.03, 62.0, 0.5


def wall_with(ring_mm, relief=None, seed=1, length_mm=LENGTH_MM, kernel_mm=0.0):
    """Return a wall with rings only at some distances, interpolated between them as a map is, smoothed."""
    s = np.arange(0.0, length_mm, STEP_MM)
    noise = smooth_noise(np.random.default_rng(seed), (len(ring_mm), len(AZIMUTH)), SIGMA, 1.0)
    shown = RADIUS + noise + (0.0 if relief is None else relief(ring_mm))
    radius = np.stack([np.interp(s, ring_mm, column) for column in shown.T], -1)
    radius = gaussian_filter1d(radius, kernel_mm / STEP_MM, axis=0) if kernel_mm else radius
    wall, rings = wall_of(s, AZIMUTH, radius, SIGMA), wall_of(ring_mm, AZIMUTH, shown, SIGMA).cloud
    stated = np.full(len(s), max(kernel_mm, WIDTH_IN_RINGS * np.diff(ring_mm).min()))
    radius_map = replace(wall.radius_map, kernel_mm=stated)
    return replace(wall, cloud=rings, radius_map=radius_map)


def search(wall, warned=None):
    context = quiet_context() if warned is None else replace(quiet_context(), warn=warned.append)
    recording = bare_recording(2 * RADIUS, None)
    return find_defects(recording, wall, grey_texture(wall), DefectParameters(), context)


def bumps(size_mm, depth_mm, random, offset_mm):
    """Return the relief of a row of slim round bumps, each at a place of its own between the rings."""
    places = [
        (12.0 + 19 * k + random.uniform(0, offset_mm), a) for k in range(3) for a in (-2.4, -0.8, 0.8, 2.4)
    ]

    def relief(ring_mm):
        s, psi = np.meshgrid(ring_mm, AZIMUTH, indexing="ij")
        off = [(s - z) ** 2 + (RADIUS * (psi - a)) ** 2 for z, a in places]
        return -depth_mm * sum(np.exp(-9 * o / size_mm**2) for o in off)

    return places, relief


def share_found(size_mm, depth_mm, spacing_mm, kernel_mm=0.0):
    """Return which share of 12 bumps is found where rings are so far apart, and so smoothed."""
    places, relief = bumps(size_mm, depth_mm, np.random.default_rng(3), spacing_mm)
    told = search(wall_with(np.arange(0.0, LENGTH_MM, spacing_mm), relief, kernel_mm=kernel_mm)).items
    near = lambda d, z, hours: abs(d.peak_distance_mm - z) < 4 and abs(d.peak_clock - hours) < 0.5  # noqa: E731
    hours = [(z, (np.degrees(a) / 30 + 3) % 12) for z, a in places]
    return np.mean([any(near(d, z, h) for d in told) for z, h in hours])


@pytest.mark.parametrize("spacing_mm", [1.0, 2.5])
def test_what_lies_at_the_limit_is_found_and_what_is_half_as_large_or_deep_is_not(spacing_mm):
    (limit,) = search(wall_with(np.arange(0.0, LENGTH_MM, spacing_mm))).detectable
    assert share_found(limit.size_mm, limit.depth_mm, spacing_mm) >= 0.8
    assert share_found(limit.size_mm, 0.5 * limit.depth_mm, spacing_mm) < 0.4
    if limit.size_mm > LEAST_SIZE_MM:
        assert share_found(0.5 * limit.size_mm, limit.depth_mm, spacing_mm) < 0.4


def test_what_lies_at_the_limit_of_a_wall_that_was_smoothed_more_is_found() -> None:
    """The kernel was taken for the default one whatever `smoothing_mm` was: none of 12 was found."""
    (limit,) = search(wall_with(np.arange(0.0, LENGTH_MM, 1.0), kernel_mm=4.0)).detectable
    assert share_found(limit.size_mm, limit.depth_mm, 1.0, 4.0) >= 0.8
    assert share_found(limit.size_mm, 0.5 * limit.depth_mm, 1.0, 4.0) < 0.4


def test_where_rings_are_farther_apart_the_smallest_defect_is_larger_and_a_warning_says_where() -> None:
    """At 3 mm, "nine of ten of 3 mm × 3 mm" were found "if two rings cross them", which none did."""
    told: list[str] = []
    wall = wall_with(np.r_[np.arange(0.0, 40, 1.0), np.arange(40.0, LENGTH_MM, 3.0)])
    near, far = search(wall, told).detectable
    assert near.size_mm <= 4.0
    assert 6 < far.size_mm < 9
    assert far.ring_spacing_mm == pytest.approx(3.0)
    assert abs(near.to_mm - 40) < 12
    (warning,) = [w for w in told if "rings lie up to" in w]
    assert f"at {far.from_mm:.0f}–{far.to_mm:.0f} mm" in warning
    assert f"{widest_spacing_mm(5.0, 2) / 3:.2g} times as fast" in warning


def test_advised_speed_lets_as_many_rings_cross_a_defect_as_are_needed() -> None:
    """Beside "6 must cross a defect", a speed was advised at which two do."""
    held = HeldOver(0.8 ** np.arange(17))
    assert rings_needed(held) > 2
    told: list[str] = []
    sparse = Detectable(0.0, 90.0, 3.0, 20.0, 0.3, 8.0, 1.0, 1.0)
    warn_of_sparse((sparse,), 5.0, held, replace(quiet_context(), warn=told.append))
    assert f"rings {widest_spacing_mm(5.0, rings_needed(held)):.2g} mm apart" in told[0]


@pytest.mark.parametrize("length_mm", [4.0, 8.0])
def test_wall_shorter_than_the_largest_templates_is_searched(length_mm) -> None:
    """No place of it saw .4 of the largest template, whose scale was then a quantile of nothing: a crash."""
    (limit,) = search(wall_with(np.arange(0.0, length_mm, STEP_MM), length_mm=length_mm)).detectable
    assert 0.2 < limit.depth_mm < 0.5


def test_stretch_of_which_rings_measured_less_than_half_has_no_limit() -> None:
    """Nothing was measured there that the response of a filter could be computed of: a crash."""
    wall = wall_with(np.arange(0.0, 240.0, 1.0), length_mm=240.0)
    s, radius = wall.radius_map.distance_mm, wall.radius_map.radius_mm.copy()
    radius[(s > 60) & (s < 180), 160:] = np.nan
    warned: list[str] = []
    told = search(replace(wall, radius_map=replace(wall.radius_map, radius_mm=radius)), warned)
    assert sum("not even large defects" in w and "less than half of the wall" in w for w in warned) == 1
    assert np.isinf(told.limit_at(120.0).depth_mm)
    assert np.isfinite(told.limit_at(20.0).depth_mm)


def test_a_pipe_on_which_nothing_is_found_reports_no_size() -> None:
    numbers: list[float] = []
    context = replace(quiet_context(), report=lambda name, value, unit="": numbers.append(value))
    report_limits([Detectable(0.0, 50.0, 1.0, np.inf, np.inf, 3.0, 1.0, 0.5)], context)
    assert not numbers
    report_limits([Detectable(0.0, 50.0, 1.0, 4.0, 0.3, 3.0, 1.0, 0.5)], context)
    assert numbers == [4.0, 0.3]


def test_rings_at_one_place_have_no_limit() -> None:
    wall = wall_with(np.arange(0.0, LENGTH_MM, 1.0))
    cloud = wall_of(np.array([20.0]), AZIMUTH, np.full((1, len(AZIMUTH)), RADIUS), SIGMA).cloud
    assert search(replace(wall, cloud=cloud)).detectable == ()


def test_files_and_sentences_state_the_limit_at_each_place(tmp_path) -> None:
    _, relief = bumps(8.0, 0.8, np.random.default_rng(3), 1.0)
    pit = search(wall_with(np.arange(0.0, LENGTH_MM, 2.0), relief)).items[0]
    away = Detectable(pit.peak_distance_mm + 10, 900.0, 4.0, 12.0, np.inf, 3.0, 1.0, 0.5)
    here = Detectable(0.0, pit.peak_distance_mm + 10, 2.0, 5.0, 0.31, 3.0, 1.0, 1.0)
    write_defects(Defects((pit,), 0.1, (here, away)), tmp_path)
    (record,) = json.loads((tmp_path / "defects.json").read_text("utf-8"))
    assert {f.name for f in fields(pit)} < set(record)
    assert (record["detectable_size_mm"], record["detectable_depth_mm"]) == (5.0, 0.31)
    rows = (tmp_path / "detectable.csv").read_text("utf-8").splitlines()
    assert len(rows) == 3
    assert rows[2].split(",")[4] == ""
    first, second = limits((here, away))
    assert "5 mm × 5 mm are found from 0.31 mm deep on, smaller ones from 3 mm if the photo" in first
    assert "not even large defects" in second
