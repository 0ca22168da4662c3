"""``boresight run --follow``: what can be told of a recording while it is being written."""

from __future__ import annotations

import math
from pathlib import Path

from rich.console import Console

from pipeline.errors import InputError
from pipeline.follow import Glimpse, glimpses, write_live_page
from pipeline.instrument.probe_file import read_probe
from pipeline.machine.run_folder import claimed
from pipeline.machine.stage import quiet_context
from pipeline.system.stopping import stop_wish
from stages.preview import PreliminarySection, preliminary_sections
from stages.rings import RingParameters

# Time between two looks at a growing recording, s.
_POLL_S = 0.5
# Enough for a circle, and quick.
_RINGS = RingParameters.model_validate({"azimuths": 360})
# The writer may still owe frames that are shown before the last ones in the file.
_NOT_YET_WHOLE = 8


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
    with claimed(output), stop_wish() as wish:
        for glimpse in glimpses(place, quiet_s, _POLL_S, wish):
            if sections and begun_anew(glimpse, sections[-1].frame):
                sections = []
            sections += new_sections(glimpse, probe, sections[-1].frame if sections else -1)
            write_live_page(place.name, sections, "complete" if glimpse.resting else "growing", output)
    if glimpse.recording is None:
        raise InputError(place, f"cannot be opened even at rest: {glimpse.problem}")


def begun_anew(glimpse: Glimpse, shown: int) -> bool:
    """Tell whether the recording no longer has a frame that was shown: the recorder started again."""
    return glimpse.recording is not None and glimpse.recording.frames.frame.max() < shown


def new_sections(glimpse: Glimpse, probe: Path | None, after: int) -> tuple[PreliminarySection, ...]:
    """Return the sections behind a frame; what cannot be read before the recording rests is tried again."""
    try:
        return _sections(glimpse, probe, after)
    except InputError:
        if glimpse.resting:
            raise
        return ()


def _sections(glimpse: Glimpse, probe: Path | None, after: int) -> tuple[PreliminarySection, ...]:
    recording = glimpse.recording
    file = probe or (recording.probe_file if recording is not None else None)
    if recording is None or file is None:
        return ()
    whole = math.inf if glimpse.resting else float(recording.frames.frame.max()) - _NOT_YET_WHOLE
    found = preliminary_sections(recording, read_probe(file), after, _RINGS, quiet_context())
    return tuple(s for s in found if s.frame <= whole)
