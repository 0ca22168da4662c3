"""Memory that is freed is used again."""

from __future__ import annotations

import sys

import pytest

from pipeline.system.parallel import call_isolated

_MIB = 1 << 20


def _new_pages(kept: bool) -> int:
    """Return how many pages the system had to clear while 56 MiB are made and dropped again and again."""
    import resource

    import numpy as np

    from pipeline.system.native import keep_freed_memory

    def faults() -> int:
        return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

    def make_and_drop() -> None:
        [np.ones(7 * _MIB // 2, np.uint8) for _ in range(16)].clear()

    if kept:
        keep_freed_memory()
    make_and_drop()
    before = faults()
    for _ in range(10):
        make_and_drop()
    return faults() - before


@pytest.mark.skipif(sys.platform != "linux", reason="of the GNU C library")
def test_arrays_are_made_in_memory_that_was_freed_before() -> None:
    by_itself, kept = (call_isolated(60, _new_pages, kept) for kept in (False, True))
    assert kept < by_itself / 10
