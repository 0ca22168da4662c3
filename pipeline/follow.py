"""A recording that is still being written: watched until it rests, shown meanwhile on a live page."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from pipeline.errors import Cancelled, InputError
from pipeline.files.disk import disk_errors_named
from pipeline.pages import page_template
from pipeline.recording import open_recording
from pipeline.recording.base import Recording
from pipeline.recording.growing import GrowingRecording


@dataclass(frozen=True)
class Snapshot:
    """The state of a growing recording.

    Attributes
    ----------
    recording : Recording or None
        None where it cannot be opened yet.
    problem : str
        Why it cannot.
    complete : bool
        Whether it has not grown for ``quiet_s``: this is the last state.
    """

    recording: Recording | None
    problem: str
    complete: bool


def snapshots(place: Path, quiet_s: float, poll_s: float, wish: threading.Event) -> Iterator[Snapshot]:
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
            yield _snapshot(growing, complete=False)
        elif time.monotonic() - grown_at >= quiet_s:
            yield _snapshot(growing, complete=True)
            return
        wish.wait(poll_s)


def _snapshot(growing: GrowingRecording, *, complete: bool) -> Snapshot:
    # A half-written line or packet is an error only at the end.
    try:
        return Snapshot(open_recording(growing.path) if complete else growing.look(), "", complete)
    except InputError as error:
        return Snapshot(None, str(error), complete)


def _size(place: Path) -> int:
    """Return the bytes of all files of a recording, 0 before there are any."""
    files = [place] if place.is_file() else [p for p in place.rglob("*") if p.is_file()]
    return sum(map(_bytes, files))


def _bytes(file: Path) -> int:
    try:
        return file.stat().st_size
    except OSError:  # gone since it was listed, or on a drive that is away for a while
        return 0


# Size of the chart, px, and points drawn in it: two a pixel.
_WIDTH, _HEIGHT, _SHOWN = 1000, 260, 2000


class Shown(Protocol):
    """What the page shows of a section."""

    @property
    def frame(self) -> int:
        """Number of the frame."""

    @property
    def time_s(self) -> float:
        """Time of the frame, s."""

    @property
    def distance_mm(self) -> float:
        """Reading of the encoder, mm; NaN without one."""

    @property
    def diameter_mm(self) -> float:
        """Diameter of the circle through the ring, mm."""

    @property
    def diameter_sigma_mm(self) -> float:
        """1 σ of the diameter, mm."""

    @property
    def seen(self) -> float:
        """Share of the ring with a usable line."""


def write_live_page(name: str, sections: Sequence[Shown], state: str, folder: Path) -> None:
    """Replace ``live.html`` at one stroke; it loads itself anew every two seconds while it is growing.

    Raises
    ------
    InputError
        When the disk is full or cannot be written.
    """
    text = page_template("follow").render(
        name=name, state=state, growing=state == "growing", last=sections[-1] if sections else None,
        count=len(sections), chart=_chart(sections), width=_WIDTH, height=_HEIGHT,
    )  # fmt: skip
    with disk_errors_named(folder):
        folder.mkdir(parents=True, exist_ok=True)
        temporary = folder / ".new-live.html"
        temporary.write_text(text, "utf-8")
        temporary.replace(folder / "live.html")


def _chart(sections: Sequence[Shown]) -> dict[str, object] | None:
    """Return the diameter over time as points of a polyline, thinned to what a screen shows."""
    thinned = sections[:: max(1, len(sections) // _SHOWN)]
    if len(thinned) < 2:
        return None
    times, diameters = [s.time_s for s in thinned], [s.diameter_mm for s in thinned]
    low, high = min(diameters), max(diameters)
    margin = max(0.05 * (high - low), 0.05)
    low, high = low - margin, high + margin
    across = _WIDTH / max(times[-1] - times[0], 1e-9)
    points = [
        f"{(t - times[0]) * across:.1f},{_HEIGHT * (high - d) / (high - low):.1f}"
        for t, d in zip(times, diameters, strict=True)
    ]
    return {
        "points": " ".join(points), "low": low, "high": high, "from": times[0], "to": times[-1],
    }  # fmt: skip
