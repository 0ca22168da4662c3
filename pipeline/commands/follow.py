"""``boresight run --follow``: shows a recording on a live page while it is still written."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console

from pipeline.errors import Cancelled, InputError
from pipeline.files.disk import disk_errors_named
from pipeline.instrument.probe_file import read_probe
from pipeline.machine.run_folder import claimed, logged
from pipeline.machine.stage import Context
from pipeline.pages import page_template
from pipeline.recording import open_recording
from pipeline.recording.base import Recording
from pipeline.recording.growing import GrowingRecording
from pipeline.system.parallel import stop_wish
from stages.preview import PreliminarySection, preliminary_sections
from stages.rings import RingParameters


@dataclass(frozen=True)
class Snapshot:
    """The state of a growing recording.

    Attributes
    ----------
    recording : Recording or None
        None where it cannot be opened yet.
    problem : str
        Why it cannot be opened.
    complete : bool
        Whether it has not grown for ``quiet_s``: this is the last state.
    """

    recording: Recording | None
    problem: str
    complete: bool


def snapshots(place: Path, quiet_s: float, poll_s: float, wish: threading.Event) -> Iterator[Snapshot]:
    """Yield the recording each time it has grown, and once more when it no longer grows.

    Parameters
    ----------
    place : Path
        Folder or file of the recording.
    quiet_s : float
        A recording that has not grown for this time is complete.
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
    except OSError:  # removed since it was listed, or on a drive that is temporarily missing
        return 0


# Size of the chart, px, and points drawn in it: two for each pixel of its width.
_WIDTH, _HEIGHT, _SHOWN = 1000, 260, 2000


def write_live_page(name: str, sections: Sequence[PreliminarySection], state: str, folder: Path) -> None:
    """Replace ``live.html`` atomically; while the recording grows, the page reloads every two seconds.

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


def _chart(sections: Sequence[PreliminarySection]) -> dict[str, object] | None:
    """Return the diameter over time as points of a polyline, thinned to the screen's resolution."""
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


# Time between two looks at a growing recording, s.
_POLL_S = 0.5
# Enough for a circle, and fast.
_RINGS = RingParameters.model_validate({"azimuths": 360})
# Video codecs reorder frames: some that precede the last ones in the file may not be written yet.
_UNWRITTEN_FRAMES = 8


def follow(place: Path, output: Path, probe: Path | None, quiet_s: float, console: Console) -> None:
    """Show a growing recording on ``live.html`` until it no longer grows.

    Raises
    ------
    InputError
        When it cannot be opened although it no longer grows.
    Cancelled
        When the user stops.
    """
    console.print(f"Following {place}; live page: {(output / 'live.html').resolve()}", highlight=False)
    sections: list[PreliminarySection] = []
    with claimed(output) as folder, logged(folder) as logger, stop_wish() as wish:
        context = _context(logger, wish)
        for snapshot in snapshots(place, quiet_s, _POLL_S, wish):
            if sections and restarted(snapshot, sections[-1].frame):
                sections = []
            sections += new_sections(snapshot, probe, sections[-1].frame if sections else -1, context)
            write_live_page(place.name, sections, "complete" if snapshot.complete else "growing", output)
    if snapshot.recording is None:
        raise InputError(place, f"cannot be opened although it no longer grows: {snapshot.problem}")


def restarted(snapshot: Snapshot, shown: int) -> bool:
    """Return whether the recording lacks a frame that was shown before: the recorder was restarted."""
    return snapshot.recording is not None and snapshot.recording.frames.frame.max() < shown


def _context(logger: logging.Logger, wish: threading.Event) -> Context:
    """Return the context in which rings are measured: the user can stop it, and its numbers are logged."""

    def progress(done: int, total: int) -> None:
        if wish.is_set():
            raise Cancelled("stopped; the same command continues from here")

    def report(name: str, value: float | int | str, unit: str = "") -> None:
        logger.info("live: %s = %s %s", name, value, unit)

    return Context(progress, report, np.random.default_rng(0))


def new_sections(
    snapshot: Snapshot, probe: Path | None, after: int, context: Context
) -> tuple[PreliminarySection, ...]:
    """Return the sections after a frame; incomplete ones of a growing recording are left for later."""
    try:
        return _sections(snapshot, probe, after, context)
    except InputError:
        if snapshot.complete:
            raise
        return ()


def _sections(
    snapshot: Snapshot, probe: Path | None, after: int, context: Context
) -> tuple[PreliminarySection, ...]:
    recording = snapshot.recording
    file = probe or (recording.probe_file if recording is not None else None)
    if recording is None or file is None:
        return ()
    whole = math.inf if snapshot.complete else float(recording.frames.frame.max()) - _UNWRITTEN_FRAMES
    found = preliminary_sections(recording, read_probe(file), after, _RINGS, context)
    return tuple(s for s in found if s.frame <= whole)
