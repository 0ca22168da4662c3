"""Inputs of a diagnosis: a gauge run of another probe is left out, and the user is warned."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from pipeline.api.diagnosis.inputs import open_inputs
from tests.shared_data import PROJECT_ROOT

SAMPLE = PROJECT_ROOT / "data" / "sample"


def copied(folder: Path, baseline_mm: float) -> Path:
    """Return a copy of the sample recording whose probe states another baseline."""
    shutil.copytree(SAMPLE, folder)
    probe = folder / "probe.yaml"
    text, count = re.subn(r"(?<=baseline_mm: )[\d.]+", str(baseline_mm), probe.read_text(), count=1)
    assert count == 1
    probe.write_text(text)
    return folder


def test_a_gauge_run_of_another_probe_is_left_out_with_a_warning(tmp_path: Path) -> None:
    """It was only on the page: the terminal said "consistent", as though the gauge run confirmed that."""
    inputs = open_inputs(SAMPLE, copied(tmp_path / "gauge", 99.0), None)
    assert inputs.gauge is None
    said = str(inputs.record()["reader_warnings"])
    assert "of another probe" in said
    assert "baseline_mm 99 against" in said


def test_a_gauge_run_of_the_same_probe_is_kept_without_a_message() -> None:
    inputs = open_inputs(SAMPLE, SAMPLE, None)
    assert inputs.gauge is not None
    assert inputs.record()["reader_warnings"] == []
