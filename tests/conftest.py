"""Setup common to all tests.

Time limits that allow for slow machines, thread counts, and the order of files.
"""

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
    """Limit linear algebra to one thread, as a run does: see `pipeline.machine.runner`.

    With one thread per core in each of two processes, threads wait for each other, and a small Cholesky
    factorisation takes up to a hundred times as long.
    """
    with one_library_thread():
        yield


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Lengthen the time limits of tests on a slow machine, and run the slow files first.

    If a slow file ran last, one process would work while the others had nothing to do.
    """
    limit = patience(float(config.getini("timeout")))
    for item in items:
        item.add_marker(pytest.mark.timeout(limit))
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup() -> None:
    """Skip tests that would start after the time TESTS_UNTIL (s since 1970), if it is set.

    They count as skipped.
    """
    until = os.environ.get("TESTS_UNTIL")
    if until and time.time() > float(until):
        pytest.skip("not run: the time given to all tests (TESTS_UNTIL) is used up")
