"""Waiting for a recording to grow, and for its end."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import Cancelled, InputError
from pipeline.recording import open_recording
from pipeline.recording.base import Recording
from pipeline.recording.growing import GrowingRecording


@dataclass(frozen=True)
class Glimpse:
    """A growing recording as it stands.

    Attributes
    ----------
    recording : Recording or None
        None where it cannot be opened yet.
    problem : str
        Why it cannot.
    resting : bool
        Whether it has not grown for as long as was asked: the last glimpse.
    """

    recording: Recording | None
    problem: str
    resting: bool


def glimpses(place: Path, quiet_s: float, poll_s: float, wish: threading.Event) -> Iterator[Glimpse]:
    """Yield the recording each time it has grown, and once more when it rests.

    Parameters
    ----------
    place : Path
        Folder or file of the recording.
    quiet_s : float
        A recording that has not grown for so long is at its end.
    poll_s : float
        Time between two looks.

    Raises
    ------
    Cancelled
        When ``wish`` is set.
    """
    growing, size, grown_at = GrowingRecording(place), -1, time.monotonic()
    while True:
        if wish.is_set():
            raise Cancelled
        now = _size(place)
        if now != size:
            size, grown_at = now, time.monotonic()
            yield _glimpse(growing, resting=False)
        elif time.monotonic() - grown_at >= quiet_s:
            yield _glimpse(growing, resting=True)
            return
        wish.wait(poll_s)


def _glimpse(growing: GrowingRecording, *, resting: bool) -> Glimpse:
    # A line or a packet that is half there is no fault before the end.
    try:
        return Glimpse(open_recording(growing.path) if resting else growing.look(), "", resting)
    except InputError as error:
        return Glimpse(None, str(error), resting)


def _size(place: Path) -> int:
    """Return the bytes of all files of a recording, 0 before there are any."""
    files = [place] if place.is_file() else [p for p in place.rglob("*") if p.is_file()]
    return sum(map(_bytes, files))


def _bytes(file: Path) -> int:
    try:
        return file.stat().st_size
    except OSError:  # gone since it was listed, or on a drive that is away for a while
        return 0
