"""The run of the sample recording, made with the command line."""

import subprocess
import sys
from pathlib import Path

from tests.shared_data import PROJECT_ROOT


def run_sample(folder: Path) -> str:
    """Run the sample, or run it again; return the output."""
    command = [sys.executable, "-m", "pipeline.cli", "run", "data/sample", "-o", str(folder)]
    told = subprocess.run(command, cwd=PROJECT_ROOT, capture_output=True, text=True)
    assert told.returncode == 0, told.stderr
    return told.stdout


def rerun_sample(folder: Path, *settings: str) -> subprocess.Popen[bytes]:
    """Start the run again with other parameters."""
    command = [sys.executable, "-m", "pipeline.cli", "run", "data/sample", "-o", str(folder)]
    given = [part for setting in settings for part in ("--set", setting)]
    return subprocess.Popen([*command, *given], cwd=PROJECT_ROOT, stdout=subprocess.DEVNULL)
