"""The recordings and the stated probe of a diagnosis, opened and checked against each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.api.job import probe_record, probe_source, recording_record, recording_source, value_source
from pipeline.errors import InputError
from pipeline.files.codec import Json
from pipeline.files.disk import InputFile
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import ProbeSource, read_probe, read_with_source
from pipeline.machine.plan import Source
from pipeline.recording import open_recording
from pipeline.recording.base import Recording
from pipeline.recording.checks import check_probe_fits
from stages.diagnose.diagnose import Noticed

# Stated parameters farther apart than so many σ do not belong to one probe.
_ANOTHER = 8.0


@dataclass(frozen=True)
class DiagnosisInputs:
    """The recordings and the stated probe, and a notice about them (empty without one)."""

    field: Recording | None
    gauge: Recording | None
    probe: Probe
    file: ProbeSource
    noticed: str

    def sources(self) -> tuple[Source, ...]:
        """Return recordings, probe and notice as the sources of a job."""
        roles = (("field", self.field), ("gauge", self.gauge))
        recordings = [recording_source(r, role) for role, r in roles if r is not None]
        noticed = Source(Noticed, Noticed(), "")
        if self.noticed:
            noticed = value_source(Noticed((self.noticed,)))
        return (*recordings, probe_source(self.probe), noticed)

    def record(self) -> Mapping[str, Json]:
        """Return the entries of run.json on the recordings and the probe."""
        given = [(role, r) for role, r in (("field", self.field), ("gauge", self.gauge)) if r is not None]
        about: dict[str, Json] = {role: recording_record(r) for role, r in given}
        warnings: list[Json] = [w for _, r in given for w in r.warnings]
        warnings += [self.noticed] if self.noticed else []
        return about | {"probe": probe_record(self.file), "reader_warnings": warnings}


def open_inputs(field: Path | None, gauge: Path | None, probe: Path | None) -> DiagnosisInputs:
    """Open the recordings, of which one may be missing, and the stated probe.

    Raises
    ------
    InputError
        When there is no recording, both have the same pictures, or a recording or the probe cannot be used.
    """
    if field is None and gauge is None:
        raise InputError("diagnose", "has no recording", hint="state FIELD, or --gauge GAUGE, or both")
    recordings = [open_recording(path) if path is not None else None for path in (field, gauge)]
    stated, file = read_with_source(_probe_file(recordings, probe))
    foreign = _of_another_probe(recordings[1], stated) if field is not None and probe is None else ""
    if foreign:
        recordings[1] = None
    for recording in (r for r in recordings if r is not None):
        check_probe_fits(recording, stated)
    _refuse_same_pictures(*recordings)
    return DiagnosisInputs(recordings[0], recordings[1], stated, file, foreign)


def _refuse_same_pictures(field: Recording | None, gauge: Recording | None) -> None:
    """Raise `InputError` when both recordings have the same pictures, whatever their other files say.

    Two recordings confirm each other: the same pictures given twice would confirm themselves.
    """
    if field is None or gauge is None:
        return
    own, other = _pictures(gauge), _pictures(field)
    # Small pictures, such as dark ones, may be alike by chance.
    largest = [max(files, key=lambda file: file.stamp.bytes).sha256 for files in (own, other)]
    same = [file for file in own if file.sha256 in {f.sha256 for f in other} & set(largest)]
    if same:
        raise InputError(
            gauge.path, f"has the same pictures as the inspection {field.path}", place=same[0].path.name,
            expected="a second recording: the same probe's run through a gauge",
            hint="state another recording; a gauge run alone is diagnosed with --gauge, without FIELD",
        )  # fmt: skip


def _pictures(recording: Recording) -> list[InputFile]:
    """Return the files of a recording that hold pictures: an IMU's table may be larger than each of them."""
    return [file for file in recording.files if file.path.suffix not in (".yaml", ".csv")]


def _probe_file(recordings: Sequence[Recording | None], probe: Path | None) -> Path:
    given = [r for r in recordings if r is not None]
    file = probe or next((r.probe_file for r in given if r.probe_file is not None), None)
    if file is None:
        raise InputError(given[0].path, "names no probe", hint="state one with --probe FILE")
    return file


def _of_another_probe(gauge: Recording | None, stated: Probe) -> str:
    """Return why a gauge run does not belong to the stated probe; empty when it may."""
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
    return f"The gauge run {gauge.name} is of another probe ({names}): it was left out and not used here."
