"""What all tests share: limits of time that a slow machine does not break, threads, and which files begin."""

import os
import time
from collections.abc import Iterator

import numpy  # noqa: F401  NumPy and SciPy each bring a BLAS of their own, whose threads are limited below
import pytest
import scipy.linalg  # noqa: F401

from pipeline.system.parallel import one_library_thread
from tests.patience import patience


@pytest.fixture(scope="session", autouse=True)
def blas_as_in_a_run() -> Iterator[None]:
    """Give linear algebra one thread, as a run gives it: see `pipeline.machine.runner`.

    With a thread for each core in each of two processes, threads wait for each other: a small Cholesky
    factorisation then takes up to a hundred times as long.
    """
    with one_library_thread():
        yield


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Let a test take longer on a slow machine before it is called hung; begin with the slow files.

    A slow file that comes last keeps one process at work while the other has nothing to do.
    """
    limit = patience(float(config.getini("timeout")))
    for item in items:
        item.add_marker(pytest.mark.timeout(limit))
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup() -> None:
    """Skip, and so count, what would start after the moment TESTS_UNTIL (s since 1970), if that is given."""
    until = os.environ.get("TESTS_UNTIL")
    if until and time.time() > float(until):
        pytest.skip("not run: the time given to all tests (TESTS_UNTIL) is used up")
