"""Every result states its inputs and the program that made it, and a run does so for its probe."""

import json
from dataclasses import replace
from pathlib import Path

from pipeline.api.job import run_job
from pipeline.files.disk import files_sha256
from pipeline.files.provenance import MadeBy
from pipeline.instrument.probe_file import read_with_source, write_probe
from pipeline.machine.display import SilentDisplay
from pipeline.machine.plan import Selection
from tests.toys import toy_job, toy_probe

MADE_BY = MadeBy("diagnose", {"gauge": "ab" * 32}, {"without": ["laser_tilt"]})


def written(folder: Path, made_by: MadeBy | None) -> Path:
    file = folder / "probe.yaml"
    write_probe(replace(toy_probe(), calibrated_from="gauge-7"), file, made_by)
    return file


def test_a_run_names_what_made_its_probe(tmp_path):
    _, source = read_with_source(written(tmp_path, MADE_BY))
    run_job(toy_job(tmp_path / "run", probe=source), Selection(), SilentDisplay())
    record = json.loads((tmp_path / "run" / "run.json").read_text())
    assert record["probe"]["calibrated_from"] == "gauge-7"
    assert record["probe"]["made_by"]["command"] == "diagnose"
    assert record["probe"]["made_by"]["input_sha256"] == {"gauge": "ab" * 32}
    assert record["probe"]["made_by"]["settings"] == {"without": ["laser_tilt"]}
    assert set(record["libraries"]) == set(record["probe"]["made_by"]["libraries"])


def test_a_data_sheet_has_no_record_of_origin(tmp_path):
    assert read_with_source(written(tmp_path, None))[1].made_by is None


def test_dates_added_by_hand_do_not_break_the_record(tmp_path):
    file = written(tmp_path, None)
    file.write_text(file.read_text() + "made_by: {command: by hand, day: 2026-11-21}\n")
    assert read_with_source(file)[1].made_by == {"command": "by hand", "day": "2026-11-21"}


def test_the_hash_depends_on_content_and_order(tmp_path):
    a, b = tmp_path / "a", tmp_path / "b"
    a.write_bytes(b"1")
    b.write_bytes(b"2")
    assert files_sha256([a, b]) != files_sha256([b, a])
    before = files_sha256([a])
    a.touch()
    assert files_sha256([a]) == before
    a.write_bytes(b"3")
    assert files_sha256([a]) != before
