"""A job: sources, stages and exporters, from opened inputs to a finished folder."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TypeVar

from rich.console import Console

from pipeline.errors import InputError
from pipeline.export.run_record import headline, write_run_record
from pipeline.files.codec import Json, digest
from pipeline.files.disk import content_key
from pipeline.files.provenance import MadeBy
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import ProbeSource, read_with_source
from pipeline.machine.configuration import Configuration
from pipeline.machine.display import Display, ProgressDisplay, print_warnings
from pipeline.machine.outcome import RunOutcome, warnings_of
from pipeline.machine.plan import Plan, Selection, Source, make_plan
from pipeline.machine.run_folder import Exporter, RunFolder, claimed, logged
from pipeline.machine.runner import Runner
from pipeline.machine.scratch import Scratch
from pipeline.machine.stage import Stage, of_role, plain
from pipeline.recording import open_recording
from pipeline.recording.base import Recording
from pipeline.recording.checks import check_probe_fits, refuse_changed
from pipeline.recording.decoded_once import decoded_once
from pipeline.system.parallel import stop_wish

Kind = TypeVar("Kind")


@dataclass(frozen=True)
class Job:
    """A computation and the folder of its results.

    Attributes
    ----------
    command : str
        Command of boresight, which run.json and the exported files state.
    sources : tuple of Source
    stages, exporters
    configuration : Configuration
    folder : Path
    about : mapping of str to JSON
        Entries of run.json on the sources in addition to their hashes.
    lent : tuple of Path
        Folders of other runs, whose results are used if they match the plan.
    at_once : int
        Largest number of stages that run at the same time.
    """

    command: str
    sources: tuple[Source, ...]
    stages: tuple[Stage, ...]
    exporters: tuple[Exporter, ...]
    configuration: Configuration
    folder: Path
    about: Mapping[str, Json] = field(default_factory=dict)
    lent: tuple[Path, ...] = ()
    at_once: int = 2

    def source(self, kind: type[Kind]) -> Kind:
        """Return the source of a class.

        Raises
        ------
        StopIteration
            When the job has none.
        """
        return next(s.value for s in self.sources if s.kind is kind)  # type: ignore[return-value]

    @property
    def recording(self) -> Recording:
        """The recording that the job processes."""
        return self.source(Recording)

    @cached_property
    def plan(self) -> Plan:
        """The plan of the stages; raises `PipelineError` when stages do not fit together.

        It is made once: keys depend on the program's text, which may change while a job is running.
        """
        return make_plan(self.stages, self.configuration, self.sources)


def recording_source(recording: Recording, role: str = "") -> Source:
    """Return a recording as a source, with a role if a job has several recordings."""
    kind = of_role(Recording, role)
    return Source(kind, recording, recording.content_key, partial(refuse_changed, recording))


def value_source(value: object) -> Source:
    """Return plain data as a source, its key made from its content."""
    return Source(type(value), value, digest(value))


def probe_source(probe: Probe) -> Source:
    """Return a probe as a source."""
    return Source(Probe, probe, digest(probe))


def recording_record(recording: Recording) -> dict[str, Json]:
    """Return the entries of run.json on a recording."""
    return {
        "name": recording.name,
        "kind": recording.kind,
        "path": str(recording.path.resolve()),
        "files_sha256": content_key(recording.files),
        "inspection": {name: text for name, text in asdict(recording.inspection).items() if text},
    }


def probe_record(probe: ProbeSource) -> dict[str, Json]:
    """Return the entries of run.json on a probe file."""
    return {
        "path": str(probe.path.resolve()),
        "calibrated_from": probe.calibrated_from,
        "made_by": probe.made_by,
    }


def recording_job(
    recording: Recording,
    probe: Probe,
    file: ProbeSource,
    stages: Sequence[Stage],
    exporters: Sequence[Exporter],
    configuration: Configuration,
    folder: Path,
    command: str = "run",
) -> Job:
    """Return the job of stages that work on one recording with one probe, read from ``file``."""
    about: dict[str, Json] = {
        "recording": recording_record(recording),
        "probe": probe_record(file),
        "reader_warnings": list(recording.warnings),
    }
    sources = (recording_source(recording), probe_source(probe))
    return Job(command, sources, tuple(stages), tuple(exporters), configuration, folder, about)


def open_job(
    recording: Path,
    folder: Path,
    probe: Path | None,
    stages: Sequence[Stage],
    exporters: Sequence[Exporter],
    configuration: Configuration,
    command: str = "run",
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
        noticed = "; ".join(("has no probe file", *opened.warnings))
        raise InputError(recording, noticed, expected="a probe file", hint="state one with --probe FILE")
    believed, source = read_with_source(file)
    check_probe_fits(opened, believed)
    return recording_job(opened, believed, source, stages, exporters, configuration, folder, command)


def result_of(job: Job, kind: type[Kind]) -> Kind:
    """Return the result of a stage of a finished job, from its store or a lent one.

    Raises
    ------
    InputError
        When it is missing, since somebody changed the folder meanwhile.
    """
    step = job.plan.maker(kind)
    for folder in (job.folder, *job.lent):
        store = RunFolder(folder).store
        stored = None if step is None else store.borrow(step.stage.name, step.key, plain(kind))
        if stored is not None:
            return stored.artefact  # type: ignore[no-any-return]
    raise InputError(
        job.folder, f"no longer holds {plain(kind).__name__}", hint="give the same command again"
    )


def run_job(job: Job, selection: Selection, display: Display) -> RunOutcome:
    """Run a job in its folder; raises as `Runner.run` and `run_folder.claimed`."""
    plan = job.plan
    selection.check(plan)
    made_by = MadeBy(job.command, plan.input_hashes(), job.configuration.tree())
    lent = [RunFolder(path).store for path in job.lent]
    with claimed(job.folder) as folder, logged(folder) as logger, stop_wish() as wish:
        record = partial(write_run_record, job.command, job.about, job.configuration, plan, job.folder)
        workers = len(os.sched_getaffinity(0))
        runner = Runner(
            _decoding_once(plan, folder), job.exporters, folder, record, headline, display, logger, wish,
            workers, made_by, lent, job.at_once,
        )  # fmt: skip
        return runner.run(selection)


def run_shown(job: Job, console: Console) -> RunOutcome:
    """Run a job and show its progress; then print its warnings that were not shown yet.

    Raises
    ------
    BoresightError
        In the same cases as `run_job`.
    """
    with ProgressDisplay(console) as display:
        outcome = run_job(job, Selection(), display)
    print_warnings((w for w in warnings_of(outcome.stages) if w not in display.warnings), console)
    return outcome


def _decoding_once(plan: Plan, folder: RunFolder) -> Plan:
    """Return the plan with recordings whose frames the stages share."""
    scratch = Scratch(folder.internal)
    sources = [
        replace(s, value=decoded_once(s.value, scratch)) if isinstance(s.value, Recording) else s
        for s in plan.sources
    ]
    return replace(plan, sources=tuple(sources))
