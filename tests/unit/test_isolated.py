"""Calls in a separate process: values, errors, crashes and endless runs."""

import os
import time

import numpy as np
import pytest

from pipeline.system.parallel import CrashError, TimeLimitError, call_isolated


def doubled(values: np.ndarray) -> np.ndarray:
    print("chatter on the standard output")
    return 2 * values


def refusing() -> None:
    raise ValueError("not like this")


def dying() -> None:
    os.abort()


def endless() -> None:
    time.sleep(600)


def test_the_value_is_returned_in_spite_of_other_output() -> None:
    np.testing.assert_array_equal(call_isolated(60, doubled, np.arange(5)), 2 * np.arange(5))


def test_an_error_is_raised_in_the_caller() -> None:
    with pytest.raises(ValueError, match="not like this"):
        call_isolated(60, refusing)


def test_a_crash_is_reported() -> None:
    with pytest.raises(CrashError, match="dying ended with status"):
        call_isolated(60, dying)


def test_endless_run_is_ended() -> None:
    with pytest.raises(TimeLimitError, match="endless took longer than 2 s"):
        call_isolated(2, endless)
