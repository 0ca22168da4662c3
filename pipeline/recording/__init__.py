"""Recordings: readers that recognise their own files and deliver frames by need."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import InputError
from pipeline.recording.base import Recording
from pipeline.recording.folder import open_folder
from pipeline.recording.folder import recognise as recognise_folder

_READERS = (("recording folder", recognise_folder, open_folder),)


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
    raise InputError(path, "is not a recording; tried " + "; ".join(refusals))
