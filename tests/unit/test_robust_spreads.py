"""Medians of rows with missing values."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from pipeline.adjustment.robust import MAD_TO_SIGMA, robust_spreads, row_median


@pytest.mark.parametrize("shape", [(7,), (5, 1), (5, 2), (4, 9), (3, 4, 6), (0, 5), (2, 0, 3)])
@pytest.mark.parametrize("gone", [0.0, 0.4])
def test_the_median_of_rows_equals_that_of_numpy_for_any_shape(shape: tuple[int, ...], gone: float) -> None:
    """Of three axes the middle one was taken for the last."""
    random = np.random.default_rng(len(shape))
    rows = random.standard_normal(shape)
    rows[random.random(shape) < gone] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        expected = np.nanmedian(rows, -1)
    np.testing.assert_array_equal(row_median(rows), expected)


def test_rows_without_values_have_no_median() -> None:
    assert row_median(np.empty((3, 0))).shape == (3,)
    assert np.isnan(row_median(np.empty((3, 0)))).all()
    assert np.isnan(row_median(np.full((2, 4), np.nan))).all()


def test_infinite_values_count_as_missing() -> None:
    np.testing.assert_array_equal(row_median(np.array([[-np.inf, 1, 2, 4], [np.inf, 1, 2, 4]])), [2.0, 2.0])


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_spreads_along_each_axis_ignore_missing_values(axis: int) -> None:
    values = np.random.default_rng(3).standard_normal((4, 5, 6))
    values[1, 2, 3] = np.nan
    expected = MAD_TO_SIGMA * np.nanmedian(np.abs(values), axis)
    np.testing.assert_allclose(robust_spreads(values, axis), expected)
