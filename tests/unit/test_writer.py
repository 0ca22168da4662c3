"""Files are written while stages go on: once, in order, and a failure is raised with its name."""

import logging
import threading
from pathlib import Path

import pytest

from pipeline.machine.run_folder import Exporter, Writer, claimed

GATE = threading.Event()
LOGGER = logging.getLogger("test")


def write_first(text: str, folder: Path) -> None:
    assert GATE.wait(20), "nobody continued while this was written"
    (folder / "first.txt").write_text(text)


def write_second(text: str, number: int, folder: Path) -> None:
    assert (folder.parent.parent / "first.txt").exists()
    (folder / "second.txt").write_text(f"{text} {number}")


def write_none(text: str, folder: Path) -> None:
    raise RuntimeError("out of ink")


def test_the_caller_continues_while_files_are_written_in_order(tmp_path: Path) -> None:
    artefacts: dict[type, object] = {str: "words", int: 7}
    GATE.clear()
    with claimed(tmp_path) as folder, Writer(folder, LOGGER) as writer:
        writer.offer(Exporter("first.txt", write_first), "key", artefacts)
        writer.offer(Exporter("second.txt", write_second), "key", artefacts)
        artefacts[str] = "other words"
        writer.offer(Exporter("first.txt", write_first), "key", artefacts)
        assert not (tmp_path / "first.txt").exists()
        GATE.set()
    assert (tmp_path / "first.txt").read_text() == "words"
    assert (tmp_path / "second.txt").read_text() == "words 7"


def test_a_failure_is_raised_and_named_at_the_end_at_the_latest(tmp_path: Path) -> None:
    with claimed(tmp_path) as folder:
        writer = Writer(folder, LOGGER)
        with pytest.raises(RuntimeError, match="out of ink"), writer:
            writer.offer(Exporter("nothing.txt", write_none), "key", {str: ""})
    assert writer.failed == "writing nothing.txt"
    assert not (tmp_path / "nothing.txt").exists()
