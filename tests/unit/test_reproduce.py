"""A run computed again is compared file by file with the original."""

from __future__ import annotations

import json
import tempfile
from dataclasses import asdict
from pathlib import Path

import pytest

from pipeline.commands.reproduce import Agreement, compare_runs, reproduce
from pipeline.errors import InputError
from pipeline.export.run_record import check_inputs_unchanged, read_run_record
from pipeline.files.disk import record_of
from pipeline.machine.run_folder import Exporter, RunFolder

RECORD = {
    "recording": {"path": "recording"},
    "probe": {"path": "probe.yaml"},
    "input_sha256": {"recording": "a", "probe": "b"},
    "configuration": {"rings": {"azimuths": 1440}},
    "state": "completed",
}


def _write(folder: Path) -> None:
    raise NotImplementedError


FINDINGS = Exporter("findings", _write)


def published(folder: Path, **files: str) -> RunFolder:
    run = RunFolder(folder)
    (run.internal / "exports").mkdir(parents=True)
    for name, text in files.items():
        (folder / name).write_text(text)
    receipt = {"key": "k", "files": {n: asdict(record_of(folder / n)) for n in files}}
    (run.internal / "exports" / "findings.json").write_text(json.dumps(receipt))
    return run


def test_every_kind_of_difference_is_reported(tmp_path: Path) -> None:
    run = published(tmp_path / "run", same="1", differs="1", edited="1", lost="1")
    again = published(tmp_path / "again", same="1", differs="2", edited="1", made="1")
    (run.path / "edited").write_text("2")
    assert {c.file: c.agreement for c in compare_runs(run, again, [FINDINGS])} == {
        "same": Agreement.SAME,
        "differs": Agreement.DIFFERENT,
        "edited": Agreement.CHANGED,
        "lost": Agreement.MISSING,
        "made": Agreement.NEW,
    }


def test_the_record_is_read_back_as_written(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text(json.dumps(RECORD))
    record = read_run_record(tmp_path)
    assert record.recording == Path("recording")
    assert record.configuration["rings"]["azimuths"] == 1440
    check_inputs_unchanged(record, {"recording": "a", "probe": "b"})


@pytest.mark.parametrize("changed", ["recording", "probe"])
def test_other_inputs_are_refused(tmp_path: Path, changed: str) -> None:
    (tmp_path / "run.json").write_text(json.dumps(RECORD))
    record = read_run_record(tmp_path)
    with pytest.raises(InputError, match=f"the {changed} differs from the one of the run"):
        check_inputs_unchanged(record, {"recording": "a", "probe": "b"} | {changed: "c"})


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"state": "completed", "recording": 1}', "\0"])
def test_a_missing_record_is_reported(tmp_path: Path, text: str) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(InputError, match="is not the record of a run"):
        read_run_record(tmp_path)


def test_a_missing_folder_is_reported(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        read_run_record(tmp_path / "nowhere")


def test_an_unfinished_run_is_reported(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text(json.dumps(RECORD | {"state": "failed"}))
    with pytest.raises(InputError, match="the run is failed"):
        read_run_record(tmp_path)


def test_a_run_is_not_computed_again_into_its_own_folder(tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    (run / "run.json").write_text(json.dumps({"format": 1, **RECORD}))
    (tmp_path / "same").symlink_to(run)
    for output in (run, tmp_path / "run" / ".." / "run", tmp_path / "same"):
        with pytest.raises(InputError, match="is the run itself"):
            reproduce(run, output)


def test_lack_of_room_for_compared_files_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = tmp_path / "run"
    run.mkdir()
    (run / "run.json").write_text(json.dumps({"format": 1, **RECORD}))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "gone"))
    with pytest.raises(InputError, match="temporary folder: cannot be written") as refusal:
        reproduce(run)
    assert "TMPDIR" in refusal.value.hint
