"""What all tests share: limits of time that a slow machine does not break."""

import os
import time

import pytest

from tests.patience import patience


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Let a test take longer on a slow machine before it is called hung."""
    limit = patience(float(config.getini("timeout")))
    for item in items:
        item.add_marker(pytest.mark.timeout(limit))


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup() -> None:
    """Skip, and so count, what would start after the moment TESTS_UNTIL (s since 1970), if that is given."""
    until = os.environ.get("TESTS_UNTIL")
    if until and time.time() > float(until):
        pytest.skip("not run: the time given to all tests (TESTS_UNTIL) is used up")
