"""``boresight diagnose``: what physics was left out, where it shows, and what bears it out."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from pipeline.commands.diagnose_apply import apply_correction, consequence
from pipeline.commands.diagnose_files import write_files
from pipeline.commands.diagnose_image import image_of
from pipeline.commands.diagnose_report import Shown, write_page
from pipeline.commands.diagnose_resimulate import resimulate
from pipeline.errors import InputError
from pipeline.files.codec import digest
from pipeline.files.disk import disk_errors_named, require_writable, written_together
from pipeline.files.provenance import MadeBy
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe
from pipeline.machine.configuration import resolve
from pipeline.machine.stage import quiet_context
from pipeline.recording import open_recording
from pipeline.recording.base import Recording
from pipeline.recording.checks import check_probe_fits, refuse_changed
from stages.catalogue import PIPELINE
from stages.diagnose.diagnose import diagnose as diagnose_recordings
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
) -> None:
    """Find what physics was left out, from an inspection and a gauge run of one probe; either may be missing.

    Writes diagnosis.json, diagnosis.html, arrays.npz, and probe.yaml with what was found put in; with --apply
    also the inspection reconstructed with that probe, in run.
    """
    if field is None and gauge is None:
        raise InputError("diagnose", "is given no recording", hint="give FIELD, or --gauge GAUGE, or both")
    if apply and (field is None or gauge is None):
        raise InputError("diagnose", "--apply needs an inspection and a gauge run", hint="give both")
    recordings = [open_recording(path) if path is not None else None for path in (field, gauge)]
    file = _probe_file(recordings, probe)
    stated = read_probe(file)
    foreign = _of_another_probe(recordings[1], stated) if field is not None and probe is None else ""
    if foreign:
        recordings[1] = None
    for recording in (r for r in recordings if r is not None):
        check_probe_fits(recording, stated)
    require_writable(output)
    console = Console(stderr=True)
    with console.status("comparing the recordings with the stated instrument"):
        examination = diagnose_recordings(
            recordings[0], recordings[1], stated, quiet_context(), tuple(without or ())
        )
        simulated = resimulate(examination)
    for recording in (r for r in recordings if r is not None):
        refuse_changed(recording)
    found = examination.found
    if foreign:
        found = replace(found, shortcomings=(foreign, *found.shortcomings))
    made_by = _made_by(recordings, stated, tuple(without or ()))
    shown = Shown(simulated, None, image_of(examination))
    with written_together(output, last=ANSWER) as folder:
        write_files(examination, stated, made_by, folder)
        write_page(found, shown, folder)
        (folder / ANSWER).write_text(_answer(found, made_by), "utf-8")
    _show(found, output, console)
    if apply and recordings[0] is not None and recordings[1] is not None:
        configuration = resolve(PIPELINE, None, ())
        change = apply_correction(examination, recordings[0], file, configuration, output, console)
        with disk_errors_named(output):
            write_page(found, replace(shown, change=change), output)
        console.print(consequence(change))


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


def _made_by(recordings: Sequence[Recording | None], stated: Probe, without: Sequence[str]) -> MadeBy:
    given = zip(("field", "gauge"), recordings, strict=True)
    inputs = {name: r.content_key for name, r in given if r is not None} | {"probe": digest(stated)}
    return MadeBy("diagnose", inputs, {"without": list(without)})


def _answer(found: Diagnosis, made_by: MadeBy) -> str:
    document = to_json(found) | {"made_by": made_by.document()}
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _show(found: Diagnosis, output: Path, console: Console) -> None:
    console.print(f"Verdict: {found.verdict} (chance that nothing is left out: {found.global_p:.2g})")
    for e in found.effects:
        console.print(f"  {e.name} ({e.probability:.1%}): {e.statement}")
    console.print(f"Report: {output / 'diagnosis.html'}")
