"""A recording stored as a folder: recording.yaml, which every kind has, tables, and a video or images."""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass, fields
from pathlib import Path

from pipeline.errors import InputError
from pipeline.files.disk import InputFile, content_key, input_file
from pipeline.files.json_yaml import Section, read_yaml
from pipeline.recording.base import (
    BoreSection,
    Encoder,
    Fiducials,
    FrameTable,
    Imu,
    InspectionFacts,
    Marker,
    PipeFacts,
    PlannedPiece,
    Recording,
)
from pipeline.recording.checks import common_frames
from pipeline.recording.encoder_checks import checked_encoder
from pipeline.recording.images import ImageSequence, is_pattern, open_images
from pipeline.recording.rounded_stamps import without_rounding
from pipeline.recording.tables import read_encoder, read_frame_table, read_imu
from pipeline.recording.video import VideoSource, open_video

COMMON_KEYS = ("name", "kind", "frame_rate", "probe", "pipe", "inspection")
_PIPE_KEYS = ("nominal_diameter_mm", "wall_thickness_mm", "bore", "bore_tolerance_mm", "fiducials", "plan")
_INSPECTION_KEYS = tuple(f.name for f in fields(InspectionFacts))
_FIDUCIAL_KEYS = ("dictionary", "size_mm", "columns_along", "rows_along", "markers")


def pipe_facts(section: Section) -> PipeFacts:
    """Return the facts of a recording's ``pipe`` section; raises `InputError` with the wrong key."""
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
    """Return the facts of the ``inspection`` section; raises `InputError` with the wrong key."""
    section.refuse_unknown(_INSPECTION_KEYS)
    stated = {key: section.text(key) for key in _INSPECTION_KEYS if section.has(key) and key != "date"}
    return InspectionFacts(**stated, date=_date(section) if section.has("date") else "")


def _date(section: Section) -> str:
    """Return a date in ISO 8601 format; YAML converts an unquoted one to a date."""
    value = section.require("date", "a date such as 2026-05-31")
    if isinstance(value, datetime.date):
        return value.isoformat()
    try:
        return datetime.date.fromisoformat(str(value)).isoformat()
    except ValueError as error:
        raise section.fail("date", f"is {value!r}", "a date such as 2026-05-31") from error


@dataclass(frozen=True)
class Description:
    """The entries of recording.yaml that all storages of frames share; ``frame_rate`` may be None."""

    name: str
    kind: str
    frame_rate: float | None
    pipe: PipeFacts
    probe_file: Path | None
    warnings: tuple[str, ...]
    inspection: InspectionFacts


def describe(section: Section) -> Description:
    """Return the keys that all recordings share; raises `InputError` with the wrong key."""
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
    """Return the file that a key names; raises `InputError` when it does not exist."""
    file = inside(section, key)
    if not file.is_file():
        raise InputError(
            file, f"is missing, but {section.file.name} names it as {key}",
            hint="copy the whole folder of the recording",
        )  # fmt: skip
    return file


def optional_file(section: Section, key: str) -> tuple[Path | None, tuple[str, ...]]:
    """Return an optional file of a recording, or None and a warning when it is named but missing."""
    if not section.has(key):
        return None, ()
    file = inside(section, key)
    if not file.is_file():
        return None, (f"{section.text(key)} is named as {key} but does not exist",)
    return file, ()


DESCRIPTION = "recording.yaml"
_KEYS = (*COMMON_KEYS, "video", "frames", "encoder", "imu")


def recognise(path: Path) -> str | None:
    """Return why ``path`` is not a recording folder, or None when it is one."""
    if not path.is_dir():
        return "it is not a folder"
    if (path / "metadata.yaml").is_file() and not (path / "frames.csv").is_file():
        return "it is a bag: there is a metadata.yaml in it"
    return None if (path / DESCRIPTION).is_file() else f"there is no {DESCRIPTION} in it"


def open_folder(path: Path) -> Recording:
    """Open a recording folder.

    Raises
    ------
    InputError
        When a file is missing or wrong; correctable errors are named in `Recording.warnings` instead.
    """
    description = input_file(path / DESCRIPTION)
    section = described_in(description.path)
    named = table_files(section)
    tables = [input_file(f) for f in (named.frames, named.encoder, named.imu) if f is not None]
    table = read_frame_table(named.frames)
    encoder = read_encoder(named.encoder) if named.encoder else None
    imu = read_imu(named.imu) if named.imu else None
    source, image_files = _open_source(section, table)
    files = (description, *tables, *image_files)
    parts = FolderParts(table, encoder, imu, source, named.warnings, files)
    return assembled(section, named.frames, parts)


def described_in(file: Path) -> Section:
    """Return the content of recording.yaml; raises `InputError`."""
    section = read_yaml(file)
    section.refuse_unknown(_KEYS)
    return section


@dataclass(frozen=True)
class TableFiles:
    """The files of a recording's tables, and warnings of named files that do not exist."""

    frames: Path
    encoder: Path | None
    imu: Path | None
    warnings: tuple[str, ...]


def table_files(section: Section) -> TableFiles:
    """Return the files of the tables that recording.yaml names; raises `InputError` without frames."""
    (encoder, no_encoder), (imu, no_imu) = (optional_file(section, key) for key in ("encoder", "imu"))
    return TableFiles(required_file(section, "frames"), encoder, imu, (*no_encoder, *no_imu))


@dataclass(frozen=True)
class FolderParts:
    """The content of a recording folder; ``files`` are its files in their state before reading."""

    table: FrameTable
    encoder: Encoder | None
    imu: Imu | None
    source: VideoSource | ImageSequence
    warnings: tuple[str, ...]
    files: tuple[InputFile, ...]


def assembled(section: Section, frames_file: Path, parts: FolderParts) -> Recording:
    """Return the recording from a description and the content of its files; raises `InputError`."""
    described = describe(section)
    rate = section.number("frame_rate", above=0)
    table, rounded = without_rounding(frames_file, parts.table, rate)
    frames, mended = _match(frames_file, table, parts.source)
    encoder, noticed = checked_encoder(parts.encoder, frames)
    return Recording(
        name=described.name,
        kind=described.kind,
        path=section.file.parent,
        frames=frames,
        encoder=encoder,
        pipe=described.pipe,
        frame_rate=rate,
        source=parts.source,
        probe_file=described.probe_file,
        content_key=content_key(parts.files),
        warnings=(*described.warnings, *parts.warnings, *rounded, *mended, *noticed),
        files=parts.files,
        listed=table,
        inspection=described.inspection,
        imu=parts.imu,
        predicted=isinstance(parts.source, VideoSource) and parts.source.index.predicted,
    )  # fmt: skip


def _match(
    file: Path, table: FrameTable, source: VideoSource | ImageSequence
) -> tuple[FrameTable, tuple[str, ...]]:
    """Return the frames that table and images share, and the warnings."""
    gaps = _check_numbers(source, table)
    frames, cut = common_frames(table, source.count)
    if frames.frame.size == 0:
        raise InputError(
            file, f"starts at frame {table.frame[0]}, but there are only {source.count} images",
            hint="frames are numbered from 0 in the video",
        )  # fmt: skip
    return frames, (*gaps, *cut)


def _open_source(section: Section, table: FrameTable) -> tuple[VideoSource | ImageSequence, list[InputFile]]:
    """Return the source of images and its files in their state before reading."""
    if is_pattern(section.text("video")):
        inside(section, "video")
        images = open_images(section.file.parent, section.text("video"))
        return images, [input_file(f) for f in images.files]
    video = input_file(required_file(section, "video"))
    return open_video(video.path).numbered_by(table), [video]


def _check_numbers(source: VideoSource | ImageSequence, table: FrameTable) -> tuple[str, ...]:
    """Refuse images numbered from another start than the table; return a warning for gaps."""
    first, listed = int(source.numbers[0]), int(table.frame[0])
    if isinstance(source, ImageSequence) and first != listed:
        raise InputError(
            source.file(first), f"is the first image, but the table of frames starts at {listed}",
            hint="number both in the same way: a shift would give every frame the light of its neighbour",
        )  # fmt: skip
    missing = int(source.numbers[-1]) - first + 1 - source.numbers.size
    return (f"{missing} images are missing between the first and the last",) if missing else ()
