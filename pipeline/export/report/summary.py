"""All that the report tells of a run."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.artefacts.findings import Defects, Sections
from pipeline.artefacts.measured import RingSamples, Trajectory, Wall, WallTexture
from pipeline.artefacts.model import Overlays
from pipeline.instrument.probe import Probe
from pipeline.machine.outcome import Number, StageOutcome
from pipeline.recording.base import Recording


@dataclass(frozen=True)
class RunSummary:
    """A run as the report shows it; an artefact that was not made is None.

    Attributes
    ----------
    recording, probe
    created : str
        When the run was made, ISO 8601, or empty.
    rings, trajectory, wall, texture, overlays, sections, defects
    stages : tuple of StageOutcome
        How each ended, and the numbers it reported. Names of numbers that begin with ``rejected`` account for
        what was not used.
    versions : tuple of (str, str)
        Name and version of the program and of what it stands on.
    inputs : tuple of (str, str)
        File and hash of what went in.
    """

    recording: Recording
    probe: Probe
    created: str
    rings: RingSamples | None = None
    trajectory: Trajectory | None = None
    wall: Wall | None = None
    texture: WallTexture | None = None
    overlays: Overlays | None = None
    sections: Sections | None = None
    defects: Defects | None = None
    stages: tuple[StageOutcome, ...] = ()
    versions: tuple[tuple[str, str], ...] = ()
    inputs: tuple[tuple[str, str], ...] = ()

    @property
    def numbers(self) -> tuple[tuple[str, Number], ...]:
        """All numbers that stages reported, each with its stage's name."""
        return tuple((stage.name, number) for stage in self.stages for number in stage.numbers)
