"""A recording that has changed since it was opened is refused by name; file times do not matter."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.errors import InputError
from pipeline.recording import open_recording
from pipeline.recording.checks import refuse_changed
from tests.made_recording import write_folder

LONG_AGO_NS = 10**17


def same_size_and_time(file: Path) -> None:
    """Flip a byte and restore the old times, as a careless copy or a forger would."""
    found, content = file.stat(), bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    os.utime(file, ns=(found.st_atime_ns, found.st_mtime_ns))


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-1])


def replaced(file: Path) -> None:
    other = file.with_suffix(".new")
    other.write_bytes(file.read_bytes()[::-1])
    other.replace(file)


@pytest.mark.parametrize("spoil", [same_size_and_time, cut, replaced, Path.unlink])
@pytest.mark.parametrize("name", ["recording.yaml", "frames.csv", "encoder.csv", "frames.mkv"])
def test_a_file_changed_after_opening_is_named(
    tmp_path: Path, name: str, spoil: Callable[[Path], None]
) -> None:
    folder = write_folder(tmp_path / "r")
    recording = open_recording(folder)
    refuse_changed(recording)
    spoil(folder / name)
    with pytest.raises(InputError, match=r"changed while|cannot be read any more") as refusal:
        refuse_changed(recording)
    assert refusal.value.file == folder / name
    assert refusal.value.expected
    assert "same command" in refusal.value.hint


def test_a_file_of_a_sequence_of_images_is_named(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "r", "frames/%06d.png")
    recording = open_recording(folder)
    (folder / "frames" / "000007.png").unlink()
    with pytest.raises(InputError, match=r"000007\.png: cannot be read any more"):
        refuse_changed(recording)


def touched_back(file: Path) -> None:
    os.utime(file, ns=(LONG_AGO_NS, LONG_AGO_NS))


def copied_over(file: Path) -> None:
    content = file.read_bytes()
    file.unlink()
    file.write_bytes(content)
    touched_back(file)


def linked(file: Path) -> None:
    os.link(file, file.with_name(f"{file.name}.link"))


@pytest.mark.parametrize("handle", [touched_back, copied_over, linked])
def test_the_same_bytes_are_accepted_whatever_their_times(
    tmp_path: Path, handle: Callable[[Path], None]
) -> None:
    folder = write_folder(tmp_path / "r")
    recording = open_recording(folder)
    for name in ("recording.yaml", "frames.csv", "encoder.csv", "frames.mkv"):
        handle(folder / name)
    refuse_changed(recording)
    assert open_recording(folder).content_key == recording.content_key


def test_a_missing_video_is_reported_by_name_where_it_is_read(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "r")
    recording = open_recording(folder)
    (folder / "frames.mkv").unlink()
    with pytest.raises(InputError, match=r"frames\.mkv: cannot be opened"):
        next(iter(recording.read([1], "grey")))
