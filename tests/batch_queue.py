"""A stand-in for a batch queue on this machine.

``sbatch`` and ``scancel`` that start and end real processes.
"""

from __future__ import annotations

import os
import signal
from pathlib import Path

_SUBMIT = """#!/bin/bash
cp "$1" "{folder}/job-$$.sh"  # a queue keeps the script, who submits it does not
setsid bash "{folder}/job-$$.sh" > "{folder}/job-$$.log" 2>&1 < /dev/null &
echo $! >> "{folder}/jobs"
echo "Submitted batch job $!"
"""
_CANCEL = """#!/bin/bash
for job in "$@"; do kill -KILL -- "-$job"; done
"""


def local_queue(folder: Path) -> Path:
    """Write the two commands into a folder and return it, to be put first in PATH."""
    for name, text in (("sbatch", _SUBMIT), ("scancel", _CANCEL)):
        (folder / name).write_text(text.format(folder=folder))
        (folder / name).chmod(0o755)
    return folder


def queued(folder: Path) -> list[int]:
    """Return the process groups of all jobs ever queued, in the order in which they were queued."""
    return [int(line) for line in (folder / "jobs").read_text().split()]


def kill_job(job: int) -> None:
    """Kill a job, as the failure of its node would."""
    os.killpg(job, signal.SIGKILL)
