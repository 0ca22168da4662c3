"""Faults of the system: a full disk, missing permissions, and files that change while a stage runs."""

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
    """A display that shows nothing, and calls a function at the moment a stage starts."""

    def __init__(self, deeds: Mapping[str, Callable[[], object]]) -> None:
        self._deeds = deeds

    def started(self, stage: str) -> None:
        """Call the function if this is its stage."""
        self._deeds.get(stage, lambda: None)()


# A real file system in a private namespace: it disappears with the process.
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
    """Run Python text with ``disk``, a folder of a small real disk, and ``resize(kib)``.

    Return what it prints. The test is skipped on systems that let no user mount a file system.
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
    """Give up root's right to ignore file permissions; to be called in a child process before it starts."""
    system = ctypes.CDLL(None)
    for capability in (_CAP_DAC_OVERRIDE, _CAP_DAC_READ_SEARCH):
        system.prctl(_PR_CAPBSET_DROP, capability, 0, 0, 0)
