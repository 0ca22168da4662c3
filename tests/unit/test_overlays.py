"""Error colours: reference pipe, ranges, levels, and unmeasured wall."""

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipeline.errors import UnusableError
from stages.overlays import OverlayParameters, draw_overlays, fitted_pipe, overlays_of
from tests.quiet import quiet_context
from tests.unit.small_wall import PIT, RADIUS, small_wall


def test_the_fitted_pipe_is_the_oval_without_the_pit() -> None:
    radius_map = small_wall(noise_mm=0.02).radius_map
    want = RADIUS + 0.3 * np.cos(2 * (radius_map.azimuth_rad - 0.4))
    assert np.abs(fitted_pipe(radius_map) - want).max() < 0.01


def test_the_fitted_pipe_bridges_unmeasured_wall() -> None:
    radius_map = small_wall(hole=(slice(None), slice(40, 80))).radius_map
    want = RADIUS + 0.3 * np.cos(2 * (radius_map.azimuth_rad - 0.4))
    assert np.abs(fitted_pipe(radius_map) - want).max() < 0.01


def test_values_can_be_read_back_from_levels() -> None:
    radius_map = small_wall().radius_map
    shown = overlays_of(radius_map, 2 * RADIUS, OverlayParameters(shown_quantile=1.0)).deviation
    value = shown.low_mm + (shown.level.astype(float) - 1) / 254 * (shown.high_mm - shown.low_mm)
    want = radius_map.radius_mm - fitted_pipe(radius_map)
    assert np.abs(value - want).max() <= 0.51 * (shown.high_mm - shown.low_mm) / 254
    assert shown.low_mm == -shown.high_mm
    assert shown.high_mm == pytest.approx(PIT[2], abs=0.03)
    assert shown.beyond == 0


def test_values_beyond_the_range_are_counted_and_shown_in_the_end_colour() -> None:
    radius_map = small_wall().radius_map
    shown = overlays_of(radius_map, 2 * RADIUS, OverlayParameters(shown_quantile=0.99)).deviation
    assert 0.005 < shown.beyond <= 0.0101
    assert np.mean(shown.level == 255) == pytest.approx(shown.beyond, abs=0.002)


def test_unmeasured_wall_is_grey_and_transparent() -> None:
    hole = (slice(60, 72), slice(100, 130))
    overlays = overlays_of(small_wall(hole=hole).radius_map, 2 * RADIUS, OverlayParameters())
    for overlay in overlays.pictures:
        assert np.all(overlay.level[hole] == 0)
        assert np.count_nonzero(overlay.level == 0) == 12 * 30
        assert np.all(overlay.bgra[hole] == [128, 128, 128, 0])


@pytest.mark.parametrize("name", ["cividis", "viridis"])
def test_the_lightness_of_sequential_colours_grows(name: str) -> None:
    parameters = OverlayParameters.model_validate({"growing_colours": name})
    palette = overlays_of(small_wall().radius_map, 2 * RADIUS, parameters).uncertainty.palette_bgr[1:]
    luminance = (palette / 255.0) ** 2.2 @ [0.0722, 0.7152, 0.2126]
    assert np.all(np.diff(luminance) > -0.003)


@pytest.mark.parametrize("name", ["RdBu_r", "PuOr_r", "BrBG"])
def test_signed_colours_are_lightest_at_zero(name: str) -> None:
    parameters = OverlayParameters.model_validate({"signed_colours": name})
    palette = overlays_of(small_wall().radius_map, 2 * RADIUS, parameters).deviation.palette_bgr[1:]
    luminance = (palette / 255.0) ** 2.2 @ [0.0722, 0.7152, 0.2126]
    assert abs(int(np.argmax(luminance)) - 127) < 4


def test_a_wall_without_measurements_is_refused() -> None:
    wall = small_wall()
    none = dataclasses.replace(wall.radius_map, radius_mm=np.full_like(wall.radius_map.radius_mm, np.nan))
    recording = cast(Any, SimpleNamespace(pipe=SimpleNamespace(nominal_diameter_mm=50.0)))
    with pytest.raises(UnusableError, match="no cell"):
        draw_overlays(
            recording, dataclasses.replace(wall, radius_map=none), OverlayParameters(), quiet_context()
        )
