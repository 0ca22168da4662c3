"""Recordings: readers that recognise their own files and deliver frames on demand."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import InputError
from pipeline.recording.base import Recording
from pipeline.recording.folder import open_folder
from pipeline.recording.folder import recognise as recognise_folder


def _open_ros(path: Path) -> Recording:
    """Open a ROS bag; its reader is slow to import and needed for bags only."""
    from pipeline.recording.bag import open_ros

    return open_ros(path)


def _open_mcap(path: Path) -> Recording:
    from pipeline.recording.bag import open_mcap_recording

    return open_mcap_recording(path)


def recognise_ros1(path: Path) -> str | None:
    """Return why ``path`` is not a ROS 1 bag, or None when it is one."""
    return _refusal_by_start(path, b"#ROSBAG V")


def recognise_mcap(path: Path) -> str | None:
    """Return why ``path`` is not an MCAP file, or None when it is one."""
    return _refusal_by_start(path, b"\x89MCAP0\r\n")


def recognise_ros2(path: Path) -> str | None:
    """Return why ``path`` is not a ROS 2 bag, or None when it is one."""
    if not path.is_dir():
        return "it is not a folder"
    return None if (path / "metadata.yaml").is_file() else "there is no metadata.yaml in it"


def _refusal_by_start(path: Path, start: bytes) -> str | None:
    if not path.is_file():
        return "it is not a file"
    with path.open("rb") as opened:
        return None if opened.read(len(start)) == start else "its first bytes are not those of one"


_READERS = (
    ("recording folder", recognise_folder, open_folder),
    ("ROS 1 bag", recognise_ros1, _open_ros),
    ("ROS 2 bag", recognise_ros2, _open_ros),
    ("MCAP file", recognise_mcap, _open_mcap),
)


def open_recording(path: Path) -> Recording:
    """Open a recording with the reader that recognises it.

    Raises
    ------
    InputError
        When no reader recognises it, saying what was tried and why each refused; or from that reader.
    """
    if not path.exists():
        raise InputError(path, "does not exist", expected="a recording")
    refusals = []
    for name, recognise, open_it in _READERS:
        refusal = recognise(path)
        if refusal is None:
            return open_it(path)
        refusals.append(f"{name}: {refusal}")
    raise InputError(
        path,
        "is not a recording. Tried: " + "; ".join(refusals),
        expected="a folder with recording.yaml, a ROS 1 or ROS 2 bag, or an MCAP file",
    )
