"""One run of the pipeline over one recording, from opened inputs to a finished run folder."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from pipeline.artefacts.headline import headline
from pipeline.errors import InputError
from pipeline.export.run_record import write_run_record
from pipeline.files.codec import digest
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import ProbeSource, read_with_source
from pipeline.machine.configuration import Configuration
from pipeline.machine.display import Display
from pipeline.machine.exporter import Exporter
from pipeline.machine.outcome import RunOutcome
from pipeline.machine.plan import Plan, Selection, Source, make_plan
from pipeline.machine.run_folder import claimed, logged
from pipeline.machine.runner import Runner
from pipeline.machine.stage import Stage
from pipeline.recording import open_recording
from pipeline.recording.base import Recording
from pipeline.recording.checks import check_probe_fits, refuse_changed
from pipeline.system.stopping import stop_wish


@dataclass(frozen=True)
class Job:
    """What is to be run, and where its results go."""

    recording: Recording
    probe: Probe
    probe_source: ProbeSource
    stages: tuple[Stage, ...]
    exporters: tuple[Exporter, ...]
    configuration: Configuration
    folder: Path

    def plan(self) -> Plan:
        """Return the wired plan; raises `PipelineError` when stages do not fit together."""
        sources = (
            Source(
                Recording,
                self.recording,
                self.recording.content_key,
                partial(refuse_changed, self.recording),
            ),
            Source(Probe, self.probe, digest(self.probe)),
        )
        return make_plan(self.stages, self.configuration, sources)


def open_job(
    recording: Path,
    folder: Path,
    probe: Path | None,
    stages: Sequence[Stage],
    exporters: Sequence[Exporter],
    configuration: Configuration,
) -> Job:
    """Open the inputs of a job; ``probe`` None means the probe that the recording names.

    Raises
    ------
    InputError
        When the recording or the probe cannot be used.
    """
    opened = open_recording(recording)
    file = probe or opened.probe_file
    if file is None:
        noticed = "; ".join(("names no probe that is there", *opened.warnings))
        raise InputError(recording, noticed, expected="a probe file", hint="give one with --probe FILE")
    believed, source = read_with_source(file)
    check_probe_fits(opened, believed)
    return Job(opened, believed, source, tuple(stages), tuple(exporters), configuration, folder)


def run_job(job: Job, selection: Selection, display: Display) -> RunOutcome:
    """Run a job in its folder; raises as `Runner.run` and `run_folder.claimed`."""
    plan = job.plan()
    selection.check(plan)
    with claimed(job.folder) as folder, logged(folder) as logger, stop_wish() as wish:
        record = partial(_record, job, plan)
        workers = len(os.sched_getaffinity(0))
        runner = Runner(plan, job.exporters, folder, record, headline, display, logger, wish, workers)
        return runner.run(selection)


def _record(job: Job, plan: Plan, outcome: RunOutcome) -> None:
    write_run_record(job.recording, job.probe_source, job.configuration, plan, outcome, job.folder)
