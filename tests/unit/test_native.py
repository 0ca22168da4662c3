"""Freed memory stays with the process until it is given back."""

import subprocess
import sys

import pytest

_FAULTS = """
import resource
import numpy as np
from pipeline.system.native import give_back_memory, keep_freed_memory

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    arrays = [np.ones(20 << 20, np.uint8) for _ in range(4)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

{first}
faults()
again = faults()
give_back_memory()
print(again, faults())
"""


def _faults(first: str) -> list[int]:
    """Return page faults of making 80 MiB of arrays anew, and again after memory was given back."""
    command = [sys.executable, "-c", _FAULTS.format(first=first)]
    return [int(n) for n in subprocess.run(command, capture_output=True, check=True).stdout.split()]


@pytest.mark.skipif(sys.platform != "linux", reason="options of the GNU C library")
def test_memory_that_was_freed_is_used_again_until_it_is_given_back() -> None:
    kept, given_back = _faults("keep_freed_memory()")
    assert kept < 1000 < given_back
    assert _faults("")[0] > 1000
