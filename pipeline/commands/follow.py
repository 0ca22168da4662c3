"""``boresight run --follow``: preliminary results of a recording while it is being written."""

from __future__ import annotations

import logging
import math
import threading
from pathlib import Path

import numpy as np
from rich.console import Console

from pipeline.errors import Cancelled, InputError
from pipeline.follow import Snapshot, snapshots, write_live_page
from pipeline.instrument.probe_file import read_probe
from pipeline.machine.run_folder import claimed, logged
from pipeline.machine.stage import Context
from pipeline.system.processes import stop_wish
from stages.preview import PreliminarySection, preliminary_sections
from stages.rings import RingParameters

# Time between two looks at a growing recording, s.
_POLL_S = 0.5
# Enough for a circle, and quick.
_RINGS = RingParameters.model_validate({"azimuths": 360})
# Video codecs reorder frames: some that precede the last ones in the file may not be written yet.
_UNWRITTEN_FRAMES = 8


def follow(place: Path, output: Path, probe: Path | None, quiet_s: float, console: Console) -> None:
    """Show a growing recording on ``live.html`` until it rests.

    Raises
    ------
    InputError
        When it cannot be opened even at rest.
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
        raise InputError(place, f"cannot be opened even at rest: {snapshot.problem}")


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

    return Context(logger, progress, report, np.random.default_rng(0))


def new_sections(
    snapshot: Snapshot, probe: Path | None, after: int, context: Context
) -> tuple[PreliminarySection, ...]:
    """Return the sections behind a frame; what cannot be read before the recording rests is tried again."""
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
