"""Inputs of a diagnosis: a gauge run of another probe is left out, and the same pictures are no gauge run."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.api.diagnosis.inputs import open_inputs
from pipeline.errors import InputError
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


def test_a_gauge_run_of_the_same_probe_is_kept_without_a_message(tmp_path: Path) -> None:
    other = Path(shutil.copytree(SAMPLE, tmp_path / "gauge"))
    # Another video: its header names another program.
    video = (other / "frames.mkv").read_bytes()
    assert b"Lavf" in video
    (other / "frames.mkv").write_bytes(video.replace(b"Lavf", b"Lavg"))
    inputs = open_inputs(SAMPLE, other, None)
    assert inputs.gauge is not None
    assert inputs.record()["reader_warnings"] == []


def test_the_inspection_is_refused_as_its_own_gauge_run(tmp_path: Path) -> None:
    """It was diagnosed, and each effect that it showed was confirmed by itself."""
    other = Path(shutil.copytree(SAMPLE, tmp_path / "gauge"))
    text = (other / "recording.yaml").read_text()
    (other / "recording.yaml").write_text(text.replace("inspection", "gauge"))
    for gauge in (SAMPLE, other):
        with pytest.raises(InputError, match=r"frames.mkv: has the same pictures as the inspection"):
            open_inputs(SAMPLE, gauge, None)


@pytest.mark.parametrize("shorter", ["inspection", "gauge"])
def test_shared_pictures_are_found_beside_larger_tables_and_in_a_part_of_a_run(
    shorter: str, tmp_path: Path
) -> None:
    """The largest file was a table, or a picture of the longer run that the shorter one lacks."""
    image = np.random.default_rng(0).integers(0, 255, (1200, 1600), np.uint8)
    rows = np.arange(1200)[:, None]
    for name in ("inspection", "gauge"):
        folder = Path(shutil.copytree(SAMPLE, tmp_path / name, ignore=shutil.ignore_patterns("*.mkv")))
        text = (folder / "recording.yaml").read_text()
        (folder / "recording.yaml").write_text(text.replace("frames.mkv", "f%d.png"))
        for k in range(2 if name == shorter else 4):
            cv2.imwrite(str(folder / f"f{k}.png"), np.where(rows < 10 * k, image, 0))
    with (tmp_path / "gauge" / "encoder.csv").open("a") as table:
        table.write("\n" * 200_000)
    with pytest.raises(InputError, match="has the same pictures as the inspection"):
        open_inputs(tmp_path / "inspection", tmp_path / "gauge", None)
