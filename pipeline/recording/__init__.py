"""Recordings: readers that recognise their own files and deliver frames by need."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import InputError
from pipeline.recording.bag import (
    open_mcap_recording,
    open_ros,
    recognise_mcap,
    recognise_ros1,
    recognise_ros2,
)
from pipeline.recording.base import Recording
from pipeline.recording.folder import open_folder
from pipeline.recording.folder import recognise as recognise_folder

_READERS = (
    ("recording folder", recognise_folder, open_folder),
    ("ROS 1 bag", recognise_ros1, open_ros),
    ("ROS 2 bag", recognise_ros2, open_ros),
    ("MCAP file", recognise_mcap, open_mcap_recording),
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
