"""report.html: gathers what the report page tells from the results of a completed run."""

from __future__ import annotations

from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from pipeline.artefacts.findings import Defects, Sections
from pipeline.artefacts.measured import RingSamples, Trajectory, Wall, WallTexture
from pipeline.artefacts.model import Overlays
from pipeline.files.codec import digest
from pipeline.files.provenance import program_version
from pipeline.instrument.probe import Probe
from pipeline.machine.outcome import Results, StageOutcome
from pipeline.recording.base import Recording
from pipeline.review.report import write_report
from pipeline.review.summary import ReportedNumber, RunSummary, StageRecord

_STANDS_ON = ("numpy", "scipy", "opencv-contrib-python-headless", "av")


def write_report_page(results: Results, recording: Recording, probe: Probe, folder: Path) -> None:
    """Write ``report.html`` from the results of a completed run."""
    write_report(_summary(results, recording, probe), folder)


def _summary(results: Results, recording: Recording, probe: Probe) -> RunSummary:
    stages = results.outcome.stages
    return RunSummary(
        recording=recording,
        probe=probe,
        created=datetime.now(UTC).isoformat(timespec="minutes"),
        rings=results.of(RingSamples),
        trajectory=results.of(Trajectory),
        wall=results.of(Wall),
        texture=results.of(WallTexture),
        overlays=results.of(Overlays),
        sections=results.of(Sections),
        defects=results.of(Defects),
        numbers=tuple(ReportedNumber(s.name, n.name, n.value, n.unit) for s in stages for n in s.numbers),
        stages=tuple(_record(s) for s in stages),
        versions=(("boresight", program_version()), *((p, version(p)) for p in _STANDS_ON)),
        inputs=(("recording", recording.content_key), ("probe", digest(probe))),
    )


def _record(stage: StageOutcome) -> StageRecord:
    return StageRecord(stage.name, stage.version, stage.state.value, stage.seconds, stage.key, stage.problem)
