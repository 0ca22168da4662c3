"""Faults from below: a disk that is really full, permissions really gone, a world that changes meanwhile."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from pipeline.machine.display import SilentDisplay
from tests.shared_data import PROJECT_ROOT

_PR_CAPBSET_DROP = 24
_CAP_DAC_OVERRIDE, _CAP_DAC_READ_SEARCH = 1, 2


class MeddlingDisplay(SilentDisplay):
    """Does something to the world at the moment a stage starts; shows nothing."""

    def __init__(self, deeds: Mapping[str, Callable[[], object]]) -> None:
        self._deeds = deeds

    def started(self, stage: str) -> None:
        """Do what is to be done at this stage."""
        self._deeds.get(stage, lambda: None)()


# A disk of its own in a namespace of its own: it is gone with the process.
_ON_DISK = """
import subprocess, sys
sys.path.insert(0, {root!r})
from pathlib import Path
disk = Path({disk!r})
def resize(kib):
    subprocess.run(["mount", "-o", f"remount,size={{kib}}k", str(disk)], check=True)
subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16m", "boresight-test", str(disk)], check=True)
{script}
"""


def on_small_disk(folder: Path, script: str) -> str:
    """Run Python text with ``disk``, folder of a real small disk, and ``resize(kib)``; return what it prints.

    The test is skipped where the system lets no user mount one.
    """
    disk = folder / "disk"
    disk.mkdir()
    isolated = ["unshare", "--user", "--map-root-user", "--mount"]
    try:
        allowed = subprocess.run([*isolated, "mount", "-t", "tmpfs", "none", disk], capture_output=True)
    except FileNotFoundError:
        pytest.skip("unshare is not there")
    if allowed.returncode:
        pytest.skip(f"no disk may be mounted: {allowed.stderr.decode(errors='replace')}")
    text = _ON_DISK.format(root=str(PROJECT_ROOT), disk=str(disk), script=script)
    told = subprocess.run(
        [*isolated, sys.executable, "-c", text], cwd=PROJECT_ROOT, capture_output=True, text=True
    )
    assert told.returncode == 0, told.stderr
    return told.stdout


def obeying_permissions() -> None:
    """Give up root's right to pass over permissions, for good; to be called in a child before it starts."""
    system = ctypes.CDLL(None)
    for capability in (_CAP_DAC_OVERRIDE, _CAP_DAC_READ_SEARCH):
        system.prctl(_PR_CAPBSET_DROP, capability, 0, 0, 0)
