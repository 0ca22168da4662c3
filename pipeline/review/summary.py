"""All that the report tells, gathered by the runner."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.artefacts.findings import Defects, Sections
from pipeline.artefacts.measured import RingSamples, Trajectory, Wall, WallTexture
from pipeline.artefacts.model import Overlays
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Recording


@dataclass(frozen=True)
class ReportedNumber:
    """A number that a stage told through ``context.report``."""

    stage: str
    name: str
    value: float | int | str
    unit: str = ""


@dataclass(frozen=True)
class StageRecord:
    """How a stage ended: ``state`` is completed, reused, unusable, failed, skipped or cancelled."""

    name: str
    version: str
    state: str
    seconds: float
    key: str
    note: str = ""


@dataclass(frozen=True)
class RunSummary:
    """A run as the report shows it; an artefact that was not made is None.

    Attributes
    ----------
    recording, probe
    created : str
        When the run was made, ISO 8601, or empty.
    rings, trajectory, wall, texture, overlays, sections, defects
    numbers : tuple of ReportedNumber
        In the order of being reported. Names that begin with ``rejected`` account for what was not used.
    stages : tuple of StageRecord
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
    numbers: tuple[ReportedNumber, ...] = ()
    stages: tuple[StageRecord, ...] = ()
    versions: tuple[tuple[str, str], ...] = ()
    inputs: tuple[tuple[str, str], ...] = ()
