"""``boresight diagnose``: what physics was left out, where it shows, and what bears it out."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console

from pipeline.api.job import (
    Job,
    probe_record,
    probe_source,
    recording_record,
    recording_source,
    result_of,
    value_source,
)
from pipeline.commands.diagnose_apply import Uncorrected, apply_correction, consequence
from pipeline.commands.diagnose_report import Shown, write_page
from pipeline.commands.working import Assignments, ConfigFile, worked
from pipeline.errors import InputError
from pipeline.files.codec import Json
from pipeline.files.disk import disk_errors_named, require_writable
from pipeline.files.provenance import MadeBy
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import ProbeSource, read_probe, read_with_source, write_probe
from pipeline.machine.configuration import Configuration, resolve
from pipeline.machine.exporter import Exporter
from pipeline.machine.plan import Source
from pipeline.machine.reproduce import RunRecord, check_inputs_unchanged, read_run_record
from pipeline.machine.stage import Stage
from pipeline.recording import open_recording
from pipeline.recording.base import Recording
from pipeline.recording.checks import check_probe_fits
from stages.catalogue import PIPELINE
from stages.diagnose.diagnose import Diagnosed, Noticed, diagnosis_stages
from stages.diagnose.drill.cases import ANSWER
from stages.diagnose.result import Diagnosis, to_json

# Stated parameters farther apart than so many σ are not one probe's.
_ANOTHER = 8.0


def diagnose(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="folder for the results")],
    field: Annotated[Path | None, typer.Argument(help="recording of an inspection")] = None,
    gauge: Annotated[
        Path | None, typer.Option(metavar="GAUGE", help="recording of the same probe's run through a gauge")
    ] = None,
    probe: Annotated[
        Path | None, typer.Option(metavar="FILE", help="stated probe, in place of the recording's own")
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option("--without", metavar="NAME", help="leave an effect out of the library; repeatable"),
    ] = None,
    apply: Annotated[
        bool, typer.Option("--apply", help="reconstruct the inspection with the corrected probe")
    ] = False,
    run: Annotated[
        Path | None,
        typer.Option("--run", metavar="RUN", help="run of FIELD whose results and parameters are taken over"),
    ] = None,
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Find what physics was left out, from an inspection and a gauge run of one probe; either may be missing.

    Writes diagnosis.json, diagnosis.html, arrays.npz, and probe.yaml with what was found put in; with --apply
    also the inspection reconstructed with that probe, in run.
    """
    record = read_run_record(run) if run is not None else None
    field = field or (record.recording if record is not None else None)
    if field is None and gauge is None:
        raise InputError("diagnose", "is given no recording", hint="give FIELD, or --gauge GAUGE, or both")
    if apply and (field is None or gauge is None):
        raise InputError("diagnose", "--apply needs an inspection and a gauge run", hint="give both")
    asked = _asked(field, gauge, probe or (record.probe if record is not None else None))
    if record is not None and asked.field is not None:
        now = {"recording": asked.field.content_key, "probe": probe_source(asked.probe).key}
        check_inputs_unchanged(record, now)
    stages = diagnosis_stages(asked.field is not None, asked.gauge is not None)
    assigned = [*(assignments or ())]
    assigned += [f"diagnosis.without={json.dumps(list(without))}"] if without else []
    configuration = _configuration(stages, config, assigned, record, run)
    require_writable(output)
    job = Job(
        "diagnose", asked.sources(), stages, EXPORTERS, configuration, output, asked.record(),
        tuple(path for path in (run, output / "run-stated") if path is not None), at_once=1,
    )  # fmt: skip
    console = Console(stderr=True)
    worked(job, console)
    done = result_of(job, Diagnosed)
    _show(done.found, output, console)
    if apply and asked.field is not None:
        same = run if _same_run(record, configuration) else None
        before = Uncorrected(asked.field, asked.file.path, configuration, same)
        change = apply_correction(done.found.effects, before, output, console)
        with disk_errors_named(output):
            write_page(done.found, Shown(done.simulated, change, done.image), output)
        console.print(consequence(change))


@dataclass(frozen=True)
class _Asked:
    """The recordings and the stated probe, and what was noticed of them."""

    field: Recording | None
    gauge: Recording | None
    probe: Probe
    file: ProbeSource
    noticed: str

    def sources(self) -> tuple[Source, ...]:
        roles = (("field", self.field), ("gauge", self.gauge))
        recordings = [recording_source(r, role) for role, r in roles if r is not None]
        noticed = Source(Noticed, Noticed(), "")
        if self.noticed:
            noticed = value_source(Noticed((self.noticed,)))
        return (*recordings, probe_source(self.probe), noticed)

    def record(self) -> Mapping[str, Json]:
        given = [(role, r) for role, r in (("field", self.field), ("gauge", self.gauge)) if r is not None]
        about: dict[str, Json] = {role: recording_record(r) for role, r in given}
        warnings: list[Json] = [w for _, r in given for w in r.warnings]
        return about | {"probe": probe_record(self.file), "reader_warnings": warnings}


def _asked(field: Path | None, gauge: Path | None, probe: Path | None) -> _Asked:
    recordings = [open_recording(path) if path is not None else None for path in (field, gauge)]
    stated, file = read_with_source(_probe_file(recordings, probe))
    foreign = _of_another_probe(recordings[1], stated) if field is not None and probe is None else ""
    if foreign:
        recordings[1] = None
    for recording in (r for r in recordings if r is not None):
        check_probe_fits(recording, stated)
    return _Asked(recordings[0], recordings[1], stated, file, foreign)


def _configuration(
    stages: Sequence[Stage], config: Path | None, assigned: Sequence[str],
    record: RunRecord | None, run: Path | None,
) -> Configuration:  # fmt: skip
    """Return the parameters of all stages; those of a run of the field stand for defaults."""
    every = (*PIPELINE, *stages)
    if record is None or run is None:
        return resolve(every, config, assigned)
    return resolve(every, config, assigned, record.configuration, run / "run.json")


def _same_run(record: RunRecord | None, configuration: Configuration) -> bool:
    """Return whether a run of the field was made with the very parameters of this call."""
    now = configuration.tree()
    return record is not None and all(now[s.name] == record.configuration.get(s.name) for s in PIPELINE)


def _probe_file(recordings: Sequence[Recording | None], probe: Path | None) -> Path:
    given = [r for r in recordings if r is not None]
    file = probe or next((r.probe_file for r in given if r.probe_file is not None), None)
    if file is None:
        raise InputError(given[0].path, "names no probe", hint="give one with --probe FILE")
    return file


def _of_another_probe(gauge: Recording | None, stated: Probe) -> str:
    """Return why a gauge run is not one of the stated probe; empty when it may be."""
    if gauge is None or gauge.probe_file is None:
        return ""
    own = read_probe(gauge.probe_file)
    if own.parameter_names != stated.parameter_names or own.camera.image_size != stated.camera.image_size:
        return f"The gauge run {gauge.name} is of another probe, with another camera: it was left out."
    sigma = np.sqrt(np.diag(own.covariance) + np.diag(stated.covariance))
    apart = np.abs(own.parameters - stated.parameters) > _ANOTHER * sigma + 1e-9
    if not apart.any():
        return ""
    names = ", ".join(
        f"{name} {a:.6g} against {b:.6g}"
        for name, a, b, far in zip(
            stated.parameter_names, own.parameters, stated.parameters, apart, strict=True
        )
        if far
    )
    return (
        f"The gauge run {gauge.name} is of another probe ({names}): it was left out and names nothing here."
    )


def write_diagnosis(done: Diagnosed, made_by: MadeBy, folder: Path) -> None:
    """Write the answer, its page, the corrected probe, and the residuals as arrays."""
    write_probe(done.probe, folder / "probe.yaml", made_by)
    write_page(done.found, Shown(done.simulated, None, done.image), folder)
    arrays = _arrays(done.found)
    if arrays:
        # Named as a stream: savez would else append .npz to a name of its own.
        with (folder / "arrays.npz").open("wb") as stream:
            np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
    document = to_json(done.found) | {"made_by": made_by.document()}
    (folder / ANSWER).write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", "utf-8")


EXPORTERS = (Exporter("diagnosis", write_diagnosis),)


def _arrays(found: Diagnosis) -> dict[str, NDArray[Any]]:
    """Return residuals over azimuth and frame, and over the unrolled wall, in mm, before and after."""
    out: dict[str, NDArray[Any]] = {}
    if found.ring_picture is not None:
        p = found.ring_picture
        out |= {"frame": p.frame, "azimuth_c_rad": p.azimuth_rad}
        out |= {"before_mm": p.before_mm, "after_mm": p.after_mm}
    if found.wall_picture is not None:
        w = found.wall_picture
        out |= {"wall_distance_mm": w.distance_mm, "wall_azimuth_p_rad": w.azimuth_rad}
        out |= {"wall_before_mm": w.before_mm, "wall_after_mm": w.after_mm}
    return out


def _show(found: Diagnosis, output: Path, console: Console) -> None:
    console.print(f"Verdict: {found.verdict} (chance that nothing is left out: {found.global_p:.2g})")
    for e in found.effects:
        console.print(f"  {e.name} ({e.probability:.1%}): {e.statement}")
    console.print(f"Report: {output / 'diagnosis.html'}")
