"""A run computed again from what its record names, and compared file by file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from pipeline.errors import InputError
from pipeline.files.json_yaml import read_json
from pipeline.machine.run_folder import Exporter, RunFolder, published_files

_RECORD = "run.json"
# Files that hold the time at which they were made; what they show stands in the other files.
_DATED = frozenset({"report.html"})


class Agreement(StrEnum):
    """How a file of the run stands to the one computed again."""

    SAME = "same"
    DIFFERENT = "different"
    CHANGED = "changed after the run"
    MISSING = "not made again"
    NEW = "only made now"


@dataclass(frozen=True)
class Compared:
    """A file of the run folder and what the comparison says of it."""

    file: str
    agreement: Agreement


@dataclass(frozen=True)
class RunRecord:
    """What a run's record says of how it came about.

    Attributes
    ----------
    recording, probe : Path
    input_sha256 : mapping of str to str
        Of ``recording`` and ``probe``.
    configuration : mapping of str to mapping
        Parameters by stage.
    libraries : mapping of str to str
        Versions; empty in records of older programs.
    """

    recording: Path
    probe: Path
    input_sha256: Mapping[str, str]
    configuration: Mapping[str, Mapping[str, Any]]
    libraries: Mapping[str, str]


def read_run_record(run: Path) -> RunRecord:
    """Return the record of a completed run.

    Raises
    ------
    InputError
        When there is none, it is damaged, or the run did not complete.
    """
    file = run / _RECORD
    try:
        tree: dict[str, Any] = read_json(file)
        record = RunRecord(
            Path(tree["recording"]["path"]), Path(tree["probe"]["path"]), dict(tree["input_sha256"]),
            dict(tree["configuration"]), dict(tree.get("libraries", {})),
        )  # fmt: skip
        state = tree["state"]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            file, "is not the record of a run", expected="run.json of boresight run", hint="name a run folder"
        ) from error
    if state != "completed":
        raise InputError(file, f"the run is {state}", expected="a completed run", hint="complete it first")
    return record


def check_inputs_unchanged(record: RunRecord, now: Mapping[str, str]) -> None:
    """Refuse to compare results of other inputs.

    Raises
    ------
    InputError
        When the recording or the probe is not what the run was made from.
    """
    places = {"recording": record.recording, "probe": record.probe}
    for name, place in places.items():
        stated = record.input_sha256.get(name, "no hash in run.json")
        if now[name] != stated:
            raise InputError(
                place,
                f"the {name} is not what the run was made from",
                expected=stated,
                hint="restore it: a run of other inputs gives other results",
            )


def compare_runs(run: RunFolder, again: RunFolder, exporters: Sequence[Exporter]) -> tuple[Compared, ...]:
    """Return every published file of both folders but the dated report, with how they stand to each other."""
    before = {n: r for e in exporters for n, r in published_files(e, run).items()}
    after = {n: r for e in exporters for n, r in published_files(e, again).items()}
    out = []
    for name in sorted((before.keys() | after.keys()) - _DATED):
        if name not in before:
            state = Agreement.NEW
        elif not before[name].matches(run.path / name):
            state = Agreement.CHANGED
        elif name not in after:
            state = Agreement.MISSING
        else:
            state = Agreement.SAME if before[name] == after[name] else Agreement.DIFFERENT
        out.append(Compared(name, state))
    return tuple(out)
