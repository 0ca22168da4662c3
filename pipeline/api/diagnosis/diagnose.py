"""Finds left-out physics from a script, in the same way as `boresight diagnose`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.api.diagnosis.apply import GeometryChange, Uncorrected, apply_correction, consequence
from pipeline.api.diagnosis.inputs import DiagnosisInputs, open_inputs
from pipeline.api.job import Job, probe_source, result_of, run_job
from pipeline.drill.answer import Answer, read_answer
from pipeline.drill.cases import ANSWER
from pipeline.errors import InputError
from pipeline.export.run_record import RunRecord, check_inputs_unchanged, read_run_record
from pipeline.files.disk import disk_errors_named, require_writable
from pipeline.files.installed import PARAMETERS, file_or_shipped
from pipeline.files.provenance import MadeBy
from pipeline.instrument.probe_file import write_probe
from pipeline.machine.configuration import Configuration, resolve
from pipeline.machine.display import Display, SilentDisplay
from pipeline.machine.plan import Selection
from pipeline.machine.run_folder import Exporter
from pipeline.machine.stage import Stage
from pipeline.review.run_files import RunFiles
from stages.catalogue import PIPELINE
from stages.diagnose.as_json import to_json
from stages.diagnose.diagnose import Diagnosed, diagnosis_stages
from stages.diagnose.result import Diagnosis


@dataclass(frozen=True)
class DiagnosisFolder:
    """The folder of a diagnosis.

    Attributes
    ----------
    path : Path
        Folder with diagnosis.json, diagnosis.html, arrays.npz and probe.yaml.
    answer : Answer
        Content of diagnosis.json: verdict, effects with probability and size (value and 1 σ), the class of
        effects that cannot be distinguished, and what to record next.
    consequence : str
        Consequence of the correction for the inspection; empty if it was not applied.
    """

    path: Path
    answer: Answer
    consequence: str = ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the readers of the recordings and of the stages, from run.json."""
        record = RunFiles(self.path).record()
        return (*record["reader_warnings"], *record["warnings"])


def open_diagnosis(folder: Path | str) -> DiagnosisFolder:
    """Open a folder that `diagnose` wrote.

    Raises
    ------
    InputError
        When the folder holds no diagnosis.json, or a broken one.
    """
    path = Path(folder)
    return DiagnosisFolder(path, read_answer(path / ANSWER))


def diagnose(
    field: Path | str | None = None,
    *,
    output: Path | str,
    gauge: Path | str | None = None,
    probe: Path | str | None = None,
    run: Path | str | None = None,
    without: Sequence[str] = (),
    apply: bool = False,
    config: Path | str | None = None,
    settings: Sequence[str] = (),
    display: Display | None = None,
) -> DiagnosisFolder:
    """Find left-out physics from an inspection and a gauge run of one probe; either may be missing.

    Results that the folder or ``run`` already holds for the same inputs, parameters and program are used
    again.

    Parameters
    ----------
    field : path, optional
        The recording of the inspection: a folder, or a bag; with ``run`` it may be left out.
    output : path
        Folder for diagnosis.json, diagnosis.html, arrays.npz, probe.yaml (corrected for the effects found)
        and run.json, which holds the warnings.
    gauge : path, optional
        The recording of the same probe's run through a gauge.
    probe : path, optional
        File of the stated probe; by default the one of ``run``, or the one that a recording names.
    run : path, optional
        A run of ``field``, whose results and parameters are used.
    without : sequence of str
        Effects to leave out of the library.
    apply : bool
        Whether to reconstruct the inspection with the corrected probe, into ``run`` below ``output``.
    config : path or str, optional
        A file of parameters, or the name of a shipped one (`shipped_names`).
    settings : sequence of str
        Single parameters, each ``stage.name=value``; they override those of ``config``.
    display : Display, optional
        Receives the progress of the stages; by default nothing is shown.

    Returns
    -------
    DiagnosisFolder
        The folder, which `open_diagnosis` opens again.

    Raises
    ------
    InputError
        When a recording, the probe, a parameter or the folder cannot be used, ``run`` has other inputs, or
        ``apply`` lacks one of the recordings.
    UnusableError
        When a recording is well formed, but a stage cannot measure what it needs.
    Cancelled
        When the user stopped it with Ctrl-C; the same call continues from there.
    """
    lent = None if run is None else Path(run)
    record = None if lent is None else read_run_record(lent)
    inputs = _inputs(field, gauge, probe, record)
    if apply and (inputs.field is None or gauge is None):
        raise InputError("diagnose", "--apply needs an inspection and a gauge run", hint="state both")
    stages = diagnosis_stages(inputs.field is not None, inputs.gauge is not None)
    assigned = [*settings, *([f"diagnosis.without={json.dumps(list(without))}"] if without else [])]
    configuration = _configuration(stages, config, assigned, record, lent)
    folder, shown = Path(output), display or SilentDisplay()
    require_writable(folder)
    job = Job(
        "diagnose", inputs.sources(), stages, EXPORTERS, configuration, folder, inputs.record(),
        tuple(path for path in (lent, folder / "run-stated") if path is not None), at_once=1,
    )  # fmt: skip
    run_job(job, Selection(), shown)
    if not apply or inputs.field is None:
        return open_diagnosis(folder)
    same = lent if _same_run(record, configuration) else None
    before = Uncorrected(inputs.field, inputs.file.path, configuration, same)
    change = _apply(result_of(job, Diagnosed), before, folder, shown)
    return replace(open_diagnosis(folder), consequence=consequence(change))


def _inputs(
    field: Path | str | None, gauge: Path | str | None, probe: Path | str | None, record: RunRecord | None
) -> DiagnosisInputs:
    """Open the inputs; a missing inspection or probe is taken from the run's record."""
    if record is not None:
        field, probe = field or record.recording, probe or record.probe
    given = [None if path is None else Path(path) for path in (field, gauge, probe)]
    inputs = open_inputs(*given)
    if record is not None and inputs.field is not None:
        now = {"recording": inputs.field.content_key, "probe": probe_source(inputs.probe).key}
        check_inputs_unchanged(record, now)
    return inputs


def _apply(done: Diagnosed, before: Uncorrected, folder: Path, display: Display) -> GeometryChange:
    # matplotlib takes a second to load, for which a refusal need not wait
    from pipeline.api.diagnosis.report import Shown, write_page

    change = apply_correction(done.found.effects, before, folder, display)
    with disk_errors_named(folder):
        write_page(done.found, Shown(change, done.image), folder)
    return change


def _configuration(
    stages: Sequence[Stage], config: Path | str | None, assigned: Sequence[str],
    record: RunRecord | None, run: Path | None,
) -> Configuration:  # fmt: skip
    """Return the parameters of all stages; those of a run of the field replace the defaults."""
    every = (*PIPELINE, *stages)
    file = None if config is None else file_or_shipped(Path(config), PARAMETERS)
    if record is None or run is None:
        return resolve(every, file, assigned)
    return resolve(every, file, assigned, record.configuration, run / "run.json")


def _same_run(record: RunRecord | None, configuration: Configuration) -> bool:
    """Return whether a run of the field was made with the same parameters as this call."""
    now = configuration.tree()
    return record is not None and all(now[s.name] == record.configuration.get(s.name) for s in PIPELINE)


def write_diagnosis(done: Diagnosed, made_by: MadeBy, folder: Path) -> None:
    """Write the answer, its page, the corrected probe, and the residuals as arrays."""
    # matplotlib takes a second to load, for which a refusal need not wait
    from pipeline.api.diagnosis.report import Shown, write_page

    write_probe(done.probe, folder / "probe.yaml", made_by)
    write_page(done.found, Shown(None, done.image), folder)
    arrays = _arrays(done.found)
    if arrays:
        # Passed as a stream: savez would append .npz to a file name.
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
    if found.reading_picture is not None:
        r = found.reading_picture
        out |= {"reading_time_s": r.time_s, "reading_before_mm": r.before_mm, "reading_after_mm": r.after_mm}
    if found.wall_picture is not None:
        w = found.wall_picture
        out |= {"wall_distance_mm": w.distance_mm, "wall_azimuth_p_rad": w.azimuth_rad}
        out |= {"wall_before_mm": w.before_mm, "wall_after_mm": w.after_mm}
    return out
