"""The sample run computed again gives the same bytes, and a changed result is reported."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from tests.shared_data import PROJECT_ROOT


def test_the_sample_run_is_reproduced_and_a_changed_result_is_reported(sample: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shutil.copytree(sample, run)
    defects = run / "defects.csv"
    defects.write_text(defects.read_text("utf-8") + "\n", "utf-8")
    command = [sys.executable, "-m", "pipeline.cli", "reproduce", str(run)]
    told = subprocess.run(command, cwd=PROJECT_ROOT, capture_output=True, text=True)
    assert told.returncode == 2
    different = [line.split() for line in told.stdout.splitlines()[:-1]]
    assert [line[0] for line in different] == ["defects.csv"], told.stdout
    assert "1 changed after the run" in told.stdout
    assert "the libraries are those of the run" in told.stderr
