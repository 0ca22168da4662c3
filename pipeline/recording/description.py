"""recording.yaml: what every kind of recording says of itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError
from pipeline.files.yaml_file import Section
from pipeline.recording.base import PipeFacts
from pipeline.recording.facts import pipe_facts

COMMON_KEYS = ("name", "kind", "frame_rate", "probe", "pipe")


@dataclass(frozen=True)
class Description:
    """What recording.yaml says whatever holds the frames; ``frame_rate`` is None where it says none."""

    name: str
    kind: str
    frame_rate: float | None
    pipe: PipeFacts
    probe_file: Path | None
    warnings: tuple[str, ...]


def describe(section: Section) -> Description:
    """Return the keys that all recordings share; raises `InputError` at the key at fault."""
    probe_file, warnings = optional_file(section, "probe")
    return Description(
        name=section.text("name"),
        kind=section.choice("kind", ("inspection", "gauge")),
        frame_rate=section.number("frame_rate", above=0) if section.has("frame_rate") else None,
        pipe=pipe_facts(section.section("pipe")),
        probe_file=probe_file,
        warnings=warnings,
    )


def inside(section: Section, key: str) -> Path:
    """Return the path that a key names; it must lie in the folder of the YAML file."""
    named = Path(section.text(key))
    if named.is_absolute() or ".." in named.parts:
        raise section.fail(key, f"is {str(named)!r}", "a file inside the recording's folder")
    return section.file.parent / named


def required_file(section: Section, key: str) -> Path:
    """Return the file that a key names; raises `InputError` when it is not there."""
    file = inside(section, key)
    if not file.is_file():
        raise InputError(
            file, f"is missing, yet {section.file.name} names it as {key}",
            hint="copy the whole folder of the recording",
        )  # fmt: skip
    return file


def optional_file(section: Section, key: str) -> tuple[Path | None, tuple[str, ...]]:
    """Return a file that a recording can do without, or None and a warning when it is named but absent."""
    if not section.has(key):
        return None, ()
    file = inside(section, key)
    if not file.is_file():
        return None, (f"{section.text(key)} is named as {key} but is not there: going on without",)
    return file, ()
