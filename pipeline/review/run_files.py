"""A finished run as the review reads it from its folder."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pipeline.artefacts.findings import DefectKind, Defects, Sections
from pipeline.artefacts.measured import RingPoints, RingSamples, Trajectory, Wall, WallTexture
from pipeline.artefacts.model import Overlays
from pipeline.errors import InputError
from pipeline.files.codec import digest, is_digest_of
from pipeline.files.disk import FileStamp, content_key, stamp_of
from pipeline.files.json_yaml import parse_json, read_json
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe
from pipeline.machine.run_folder import RunFolder
from pipeline.recording import open_recording
from pipeline.recording.base import PipeFacts, Recording
from pipeline.recording.checks import CheckedFrames
from pipeline.review.decisions.replay import Finding, Measured

_Artefact = TypeVar("_Artefact")
# The stage that makes each result.
_MAKERS: dict[type, str] = {
    Overlays: "overlays", Trajectory: "motion", Wall: "accumulate", RingSamples: "rings",
    CheckedFrames: "premises", Sections: "sections", WallTexture: "texture", RingPoints: "triangulate",
    Defects: "defects",
}  # fmt: skip
# What a record holds since version 0.2: a review, a script or a diagnosis asks for any of it.
_RECORDED = ("probe", "input_sha256", "configuration", "stages", "metrics", "reader_warnings", "warnings")
_PEAK = ("peak_distance_mm", "peak_clock")  # runs of version 0.1 have none
_SIZES = tuple(name for name in Measured.__dataclass_fields__ if name not in _PEAK)
# What to do about a run that an older boresight made.
_AGAIN = "run it again: boresight run RECORDING -o RUN"
# What a signature binds: the results and the record of how they came about.
_BOUND = ("run.json", "defects.json", "radius_map.npz", "unrolled.png", "model.glb", "sections.csv")


@dataclass(frozen=True)
class RunFiles:
    """The folder of a completed run."""

    path: Path

    @property
    def version(self) -> str:
        """Hash of run.json, which changes whenever the run is computed again; its file time may not."""
        try:
            return hashlib.sha256(self.file("run.json").read_bytes()).hexdigest()
        except OSError:
            return ""

    def file(self, name: str) -> Path:
        """Return where a file of the run lies.

        Raises
        ------
        InputError
            When it is a link out of the folder: a run from elsewhere must not show or export other files.
        """
        file = self.path / name
        if not file.resolve().is_relative_to(self.path.resolve()):
            raise InputError(file, "is a link out of the run's folder", hint="copy the file into the run")
        return file

    def record(self) -> dict[str, Any]:
        """Return run.json.

        Raises
        ------
        InputError
            When it is missing, broken, of an older boresight, or the run is not completed.
        """
        record = self._json("run.json")
        if not isinstance(record, dict) or record.get("format") != 1:
            raise InputError(self.path / "run.json", "is not the record of a run", expected="format 1")
        if record.get("state") != "completed":
            state = record.get("state")
            raise InputError(self.path, f"the run is {state}, not completed", hint="finish it: boresight run")
        lacking = [part for part in _RECORDED if part not in record]
        if lacking:
            problem = f"was written by an older boresight: it lacks {', '.join(lacking)}"
            raise InputError(self.path / "run.json", problem, hint=_AGAIN)
        return record

    def artefact(self, kind: type[_Artefact]) -> _Artefact:
        """Return what a stage made.

        Raises
        ------
        InputError
            When it is not there any more.
        """
        found: _Artefact = _artefact(self, kind, self.version)  # type: ignore[arg-type]
        return found

    def stage_key(self, kind: type) -> str:
        """Return the key of the result of class ``kind``, empty when the run's record has none."""
        name = _MAKERS[kind]
        return next((str(s["key"]) for s in self.record()["stages"] if s["name"] == name), "")

    def recording(self) -> Recording:
        """Return the recording that the run was made from, with its frames as the pictures show them.

        Raises
        ------
        InputError
            When it is not where it was any more, cannot be opened, or has changed since.
        """
        path = Path(self.record()["recording"]["path"])
        opened = open_recording(path)
        record = self.record()
        # Of the files alone: a run may have been given other readings of the encoder beside them.
        made_from = record["recording"].get("files_sha256", record["input_sha256"]["recording"])
        _refuse_other(path, "recording", content_key(opened.files), made_from)
        if not self.stage_key(CheckedFrames):  # a run made before its premises were checked
            return opened
        return self.artefact(CheckedFrames).applied_to(opened)

    def pipe(self) -> PipeFacts | None:
        """Return what the recording says of the pipe, None when there is no `recording` any more."""
        try:
            return self.recording().pipe
        except InputError:
            return None

    def probe(self) -> Probe:
        """Return the probe as the run found it; raises as `recording`."""
        path = Path(self.record()["probe"]["path"])
        stated = read_probe(path)
        made_from = self.record()["input_sha256"]["probe"]
        if not is_digest_of(made_from, stated):  # a run may be older than some field of a probe
            _refuse_other(path, "probe", digest(stated), made_from)
        return stated.as_found_in(self.artefact(Trajectory))

    def defects_text(self) -> str:
        """Return defects.json as it stands."""
        file = self.file("defects.json")
        try:
            return file.read_text("utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(file, f"cannot be read: {error}") from error

    def unconfirmed(self) -> list[dict[str, Any]]:
        """Return what one ring alone shows, as the run wrote it; empty for a run that wrote none."""
        if not self.file("unconfirmed.json").is_file():
            return []
        measured_findings(self.file("unconfirmed.json").read_text("utf-8"), self.path / "unconfirmed.json")
        found: list[dict[str, Any]] = self._json("unconfirmed.json")  # type: ignore[assignment]
        return found

    def fingerprint(self) -> dict[str, str]:
        """Return the SHA-256 of every file that a signature binds."""
        present = (name for name in _BOUND if self.file(name).is_file())
        return {name: _hash_of(self.file(name)) for name in present}

    def _json(self, name: str) -> object:
        file = self.file(name)
        try:
            return read_json(file)
        except OSError as error:
            hint = "give the folder of a finished run"
            raise InputError(file, error.strerror or "cannot be read", hint=hint) from error
        except ValueError as error:
            raise InputError(file, f"is not JSON: {error}") from error


def _refuse_other(path: Path, role: str, found: str, made_from: str) -> None:
    if found != made_from:
        raise InputError(
            path, "has changed since the run was made",
            expected=f"the {role} that run.json names by its hash",
            hint=f"put the {role} back as it was, or run it again: boresight run",
        )  # fmt: skip


@lru_cache(maxsize=16)
def _artefact(files: RunFiles, kind: type, _version: str) -> Any:
    stage, key = _MAKERS[kind], files.stage_key(kind)
    found = RunFolder(files.path).store.look(stage, key, kind) if key else None
    if found is None:
        problem = f"holds no result of stage {stage} that this version of boresight can read"
        raise InputError(files.path, problem, hint=_AGAIN)
    return found


def measured_findings(defects: str, file: Path) -> tuple[Finding, ...]:
    """Return the findings that a defects.json lists, undecided.

    Raises
    ------
    InputError
        When it is not a list of defects.
    """
    try:
        listed = parse_json(defects)
        return tuple(_finding(entry) for entry in listed)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(file, f"is not a list of defects: {error!r}") from error


def _finding(entry: dict[str, Any]) -> Finding:
    outline = tuple((float(s), float(a)) for s, a in entry["outline"])
    if len(outline) < 3 or not np.isfinite(outline).all():
        raise ValueError(f"the outline of {entry['id']} is no polygon")
    size = Measured(
        **{name: _number(entry[name]) for name in _SIZES},
        **{name: _number(entry.get(name)) for name in _PEAK},
    )
    number = int(entry["id"])
    return Finding(str(number), DefectKind(entry["kind"]).value, outline, size, original=number)


def _number(value: object) -> float:
    return float("nan") if value is None else float(value)  # type: ignore[arg-type]


def _hash_of(file: Path) -> str:
    return _sha256(file, stamp_of(file))


@lru_cache(maxsize=64)
def _sha256(file: Path, _as_it_is: FileStamp) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
