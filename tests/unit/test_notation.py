"""One notation for all papers, tables and messages."""

from __future__ import annotations

import pytest

from pipeline.pages import notation


@pytest.mark.parametrize(
    ("hours", "told"),
    [
        (7.0, "7:00"),
        (7.0167, "7:01"),
        (0.0, "12:00"),
        (11.999, "12:00"),
        (12.5, "12:30"),
        (9.992, "10:00"),
        (7.0083, "7:01"),
        (7 + 0.5 / 60, "7:01"),
        (7 + 0.4999 / 60, "7:01"),
        (7.7917, "7:48"),
        (8.825, "8:50"),
    ],
)
def test_a_clock_position_has_hours_and_minutes(hours, told):
    assert notation.clock(hours) == told


def test_an_extent_on_the_clock_runs_clockwise_even_past_twelve():
    assert notation.clock_extent(7.017, 7.183) == "7:01–7:11"
    assert notation.clock_extent(11.5, 0.5) == "11:30–12:30"
    assert notation.clock_extent(0.0, 12.0) == "all round"


def test_a_distance_is_that_of_the_peak_with_its_extent():
    assert notation.distance(412.34, 408.1, 416.0) == "412.3 mm (408.1–416.0 mm)"
    assert notation.distance(None, 408.1, 416.0) == "408.1–416.0 mm"


@pytest.mark.parametrize(
    ("value", "sigma", "told"),
    [(1.5846, 0.0283, "1.585 ± 0.028 mm"), (1.5846, 0.283, "1.58 ± 0.28 mm"), (80.04, 12.0, "80 ± 12 mm"),
     (1.5846, 0.0002, "1.585 ± < 0.001 mm"), (1.5846, None, "1.585 mm"), (float("nan"), 1.0, "not seen")],
)  # fmt: skip
def test_a_value_has_as_many_digits_as_its_sigma(value, sigma, told):
    assert notation.measured(value, sigma) == told


def test_a_depth_has_a_direction_instead_of_a_sign():
    assert notation.depth(-1.482, 0.05) == "1.482 ± 0.050 mm inward"
    assert notation.depth(1.585, 0.028) == "1.585 ± 0.028 mm deep"
    assert notation.depth(float("nan"), 0.1) == "depth not seen"


def test_one_sigma_is_in_brackets_with_or_without_a_unit():
    assert notation.plus_minus(0.0123, "mm") == "(± 0.012 mm)"
    assert notation.plus_minus(0.00062499, "") == "(± 0.00062)"
