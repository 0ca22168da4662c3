"""A review opens although its recording, probe, files or disk have changed, and says what is missing."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.errors import InputError
from pipeline.review.documents import run_document
from pipeline.review.frames import UnseenError, finder_of
from pipeline.review.quality import quality_document
from pipeline.review.review import open_review
from pipeline.review.run_files import RunFiles
from tests.bad_recordings import SAMPLE
from tests.faults import on_small_disk


@pytest.fixture
def files(sample: Path, tmp_path: Path) -> RunFiles:
    """A run with a recording of its own, which the test may spoil."""
    run, recording = tmp_path / "run", tmp_path / "recording"
    shutil.copytree(sample, run)
    shutil.copytree(SAMPLE, recording)
    record = json.loads((run / "run.json").read_text("utf-8"))
    record["recording"]["path"], record["probe"]["path"] = str(recording), str(recording / "probe.yaml")
    (run / "run.json").write_text(json.dumps(record))
    return RunFiles(run)


def recording_of(files: RunFiles) -> Path:
    return Path(files.record()["recording"]["path"])


def lost(recording: Path) -> None:
    shutil.rmtree(recording)


def cut_off(recording: Path) -> None:
    video = recording / "frames.mkv"
    video.write_bytes(video.read_bytes()[: video.stat().st_size // 2])


def other_lights(recording: Path) -> None:
    table = recording / "frames.csv"
    lines = table.read_text().splitlines(keepends=True)
    table.write_text("".join(lines[:-1]))


def other_probe(recording: Path) -> None:
    probe = recording / "probe.yaml"
    probe.write_text(probe.read_text().replace("23.4594", "23.0"))


def test_frames_are_shown_while_nothing_has_changed(files: RunFiles) -> None:
    """Without this test the refusals below would prove nothing."""
    assert run_document(files)["has_recording"]
    assert finder_of(files).picture(0).startswith(b"\xff\xd8")


@pytest.mark.parametrize("spoil", [lost, cut_off, other_lights, other_probe])
def test_a_review_opens_but_shows_no_frames_of_another_recording(
    files: RunFiles, spoil: Callable[[Path], None]
) -> None:
    spoil(recording_of(files))
    told = run_document(files)
    assert told["has_recording"] is (spoil is other_probe)
    assert told["defects"]
    open_review(files).state()
    with pytest.raises(UnseenError, match=r"has changed since the run was made|does not exist"):
        finder_of(files)
    rows = {r["name"]: r["value"] for r in quality_document(files, open_review(files).wall())["facts"]}
    assert ("probe file" in rows) is (spoil in (lost, other_probe))


@pytest.mark.parametrize("spoil", [lost, cut_off, other_lights])
def test_frames_of_a_recording_that_changes_during_the_review_are_not_shown(
    files: RunFiles, spoil: Callable[[Path], None]
) -> None:
    finder = finder_of(files)
    spoil(recording_of(files))
    with pytest.raises(UnseenError, match=r"was changed|cannot be read any more|cannot be opened"):
        finder.picture(0)


def test_a_file_changed_with_its_old_file_time_makes_the_signature_invalid(files: RunFiles) -> None:
    """Size and file time stay the same, as if somebody wanted to hide the change."""
    review = open_review(files)
    review.sign("Ada", "", "", review.state().revision)
    assert review.seal(review.state()).signed
    table = files.path / "sections.csv"
    dated, content = table.stat(), table.read_bytes()
    table.write_bytes(content.replace(b"1", b"2", 1))
    os.utime(table, ns=(dated.st_atime_ns, dated.st_mtime_ns))
    assert not review.seal(review.state()).signed
    table.write_bytes(content)
    os.utime(table, (10**8, 10**8))
    assert review.seal(review.state()).signed, "the content counts, not the time of writing"


def test_when_the_clock_is_set_back_between_decisions_none_is_lost(
    files: RunFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pipeline.review import decisions as actions
    from pipeline.review.decisions import ledger

    review = open_review(files)
    for k, at in enumerate(("2026-11-21T10:00:00+00:00", "1999-01-01T00:00:00+00:00")):
        monkeypatch.setattr(ledger, "_now", lambda at=at: at)
        action = actions.Accept(finding="1") if k else actions.Reject(finding="1", reason="shadow")
        review.act(action, "Ada", k)
    state = review.state()
    assert state.revision == 2
    assert next(f for f in state.findings if f.id == "1").status == "accepted", (
        "the order counts, not the time"
    )


def test_a_broken_diagnosis_beside_the_run_is_reported(files: RunFiles) -> None:
    (files.path / "diagnosis.json").write_text('{"verdict": "nam')
    assert run_document(files)["diagnosis"]["verdict"] == "unreadable"


_FILLING = """
from pipeline.errors import InputError
from pipeline.review.decisions import Comment
from pipeline.review.decisions.ledger import Ledger
ledger = Ledger(disk / "review" / "decisions.sqlite")
ledger.prepare()
ledger.keep_basis("b", "[]")
kept, refused = 0, 0
remark = Comment(finding="1", text="x" * 3000)
(disk / "filler").write_bytes(b"x" * ((16 << 20) - 300_000))
for _ in range(200):
    try:
        ledger.append(remark, "Ada", "b", kept)
        kept += 1
    except InputError as error:
        assert "disk is full" in str(error) or "cannot be written" in str(error), error
        assert "earlier decisions are kept" in error.hint
        refused += 1
        break
assert refused and kept
assert len(ledger.entries()) == kept
(disk / "filler").unlink()
ledger.append(remark, "Ada", "b", kept)
assert len(ledger.entries()) == kept + 1
print(kept)
"""


def test_on_a_full_disk_decisions_are_refused_with_a_message(tmp_path: Path) -> None:
    assert int(on_small_disk(tmp_path, _FILLING)) > 3


def test_a_review_where_nothing_may_be_written_says_so(files: RunFiles) -> None:
    (files.path / "review").write_text("a file in the folder's place")
    with pytest.raises(InputError, match="cannot be written") as refusal:
        open_review(files)
    assert "permissions" in refusal.value.hint
