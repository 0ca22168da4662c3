"""recording.yaml: what every kind of recording says of itself."""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass, fields
from pathlib import Path

from pipeline.errors import InputError
from pipeline.files.json_yaml import Section
from pipeline.recording.base import BoreSection, Fiducials, InspectionFacts, Marker, PipeFacts, PlannedPiece

COMMON_KEYS = ("name", "kind", "frame_rate", "probe", "pipe", "inspection")
_PIPE_KEYS = ("nominal_diameter_mm", "wall_thickness_mm", "bore", "bore_tolerance_mm", "fiducials", "plan")
_INSPECTION_KEYS = tuple(f.name for f in fields(InspectionFacts))
_FIDUCIAL_KEYS = ("dictionary", "size_mm", "columns_along", "rows_along", "markers")


def pipe_facts(section: Section) -> PipeFacts:
    """Return what a recording's ``pipe`` section says; raises `InputError` at the key at fault."""
    section.refuse_unknown(_PIPE_KEYS)
    has = section.has
    return PipeFacts(
        nominal_diameter_mm=section.number("nominal_diameter_mm", above=0),
        wall_thickness_mm=section.number("wall_thickness_mm", above=0) if has("wall_thickness_mm") else None,
        bore=tuple(map(_bore, section.sections("bore"))) if has("bore") else (),
        bore_tolerance_mm=section.number("bore_tolerance_mm", least=0) if has("bore_tolerance_mm") else 0.0,
        fiducials=_fiducials(section.section("fiducials")) if has("fiducials") else None,
        plan=tuple(map(_planned, section.sections("plan"))) if has("plan") else (),
    )


def _planned(section: Section) -> PlannedPiece:
    """Return a piece of the plan: ``length_mm`` of a straight length, or ``bend_deg`` and ``radius_mm``."""
    section.refuse_unknown(("length_mm", "bend_deg", "radius_mm"))
    if not section.has("bend_deg"):
        return PlannedPiece(section.number("length_mm", above=0))
    angle = section.number("bend_deg", above=0)
    radius = section.number("radius_mm", above=0) if section.has("radius_mm") else math.nan
    return PlannedPiece(radius * math.radians(angle), angle, radius)


def _bore(section: Section) -> BoreSection:
    section.refuse_unknown(("length_mm", "diameter_mm"))
    return BoreSection(section.number("length_mm", above=0), section.number("diameter_mm", above=0))


def _fiducials(section: Section) -> Fiducials:
    section.refuse_unknown(_FIDUCIAL_KEYS)
    return Fiducials(
        dictionary=section.text("dictionary"),
        size_mm=section.number("size_mm", above=0),
        columns_along=section.choice("columns_along", ("+azimuth", "-azimuth")),
        rows_along=section.choice("rows_along", ("+distance", "-distance")),
        markers=tuple(map(_marker, section.sections("markers"))),
    )


def _marker(section: Section) -> Marker:
    section.refuse_unknown(("id", "distance_mm", "azimuth_deg"))
    return Marker(
        section.integer("id", least=0), section.number("distance_mm"), section.number("azimuth_deg")
    )


def inspection_facts(section: Section) -> InspectionFacts:
    """Return what the ``inspection`` section says; raises `InputError` at the key at fault."""
    section.refuse_unknown(_INSPECTION_KEYS)
    stated = {key: section.text(key) for key in _INSPECTION_KEYS if section.has(key) and key != "date"}
    return InspectionFacts(**stated, date=_date(section) if section.has("date") else "")


def _date(section: Section) -> str:
    """Return a date as ISO 8601 has it; YAML reads an unquoted one as a date already."""
    value = section.require("date", "a date such as 2026-05-31")
    if isinstance(value, datetime.date):
        return value.isoformat()
    try:
        return datetime.date.fromisoformat(str(value)).isoformat()
    except ValueError as error:
        raise section.fail("date", f"is {value!r}", "a date such as 2026-05-31") from error


@dataclass(frozen=True)
class Description:
    """What recording.yaml says whatever holds the frames; ``frame_rate`` is None where it says none."""

    name: str
    kind: str
    frame_rate: float | None
    pipe: PipeFacts
    probe_file: Path | None
    warnings: tuple[str, ...]
    inspection: InspectionFacts


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
        inspection=inspection_facts(section.section("inspection"))
        if section.has("inspection")
        else InspectionFacts(),
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
