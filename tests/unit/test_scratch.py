"""Temporary arrays on the disk: they are read back as written.

A full disk is reported before memory is mapped.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.machine.scratch import Scratch
from tests.disk_limit import file_size_limit
from tests.faults import on_small_disk


def test_large_arrays_start_at_zero_and_leave_no_file(tmp_path: Path) -> None:
    large = Scratch(tmp_path).zeros((1 << 12, 1 << 11), np.float64)
    assert isinstance(large.base, np.memmap)
    assert not large.any()
    large[7, 9] = 3.0
    assert large.sum() == 3.0
    assert list(tmp_path.iterdir()) == []


def test_records_are_read_in_stretches_and_as_a_whole(tmp_path: Path) -> None:
    spool = Scratch(tmp_path).spool(np.int64, (2,))
    given = np.arange(600).reshape(-1, 2)
    for k in range(0, 300, 100):
        spool.append(given[k : k + 100])
        np.testing.assert_array_equal(spool.part(k, k + 50), given[k : k + 50])
    np.testing.assert_array_equal(spool.array(), given)


def test_a_full_disk_is_reported_when_records_are_written(tmp_path: Path) -> None:
    spool = Scratch(tmp_path).spool(np.float64)
    with file_size_limit(1 << 16), pytest.raises(InputError, match=r"cannot be written(?s:.*)same command"):
        spool.append(np.zeros(1 << 14))


_MAPPED = """
import numpy as np
from pipeline.errors import InputError
from pipeline.machine.scratch import Scratch
try:
    Scratch(disk).zeros((1 << 23,), np.float64)[:] = 1.0
except InputError as error:
    print(error)
"""


def test_a_mapped_array_on_a_full_disk_is_reported_and_does_not_kill_the_program(tmp_path: Path) -> None:
    """64 MiB on a disk of 16: mapped from a sparse file, the first write there would be a SIGBUS."""
    assert "cannot be written: No space left on device" in on_small_disk(tmp_path, _MAPPED)


def test_a_removed_run_folder_is_not_made_again(tmp_path: Path) -> None:
    gone = tmp_path / "run" / ".boresight"
    with pytest.raises(InputError, match="cannot be written: No such file or directory"):
        Scratch(gone).spool(np.int64)
    assert not gone.parent.exists()
