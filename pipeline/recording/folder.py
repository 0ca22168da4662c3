"""A recording kept as a folder: recording.yaml, tables (frames, encoder, IMU) and a video or images."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError
from pipeline.files.disk import InputFile, content_key, input_file
from pipeline.files.json_yaml import Section, read_yaml
from pipeline.recording.base import Encoder, FrameTable, Imu, Recording
from pipeline.recording.checks import common_frames, encoder_warnings
from pipeline.recording.description import COMMON_KEYS, describe, inside, optional_file, required_file
from pipeline.recording.images import ImageSequence, is_pattern, open_images
from pipeline.recording.tables import read_encoder, read_frame_table, read_imu
from pipeline.recording.video import VideoSource, open_video

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
        When a file is missing or wrong; what can be mended is named in `Recording.warnings` instead.
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
    """Return what recording.yaml says; raises `InputError`."""
    section = read_yaml(file)
    section.refuse_unknown(_KEYS)
    return section


@dataclass(frozen=True)
class TableFiles:
    """The files of a recording's tables, and warnings where one that is named is not there."""

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
    """What was read from a recording folder; ``files`` as they were before."""

    table: FrameTable
    encoder: Encoder | None
    imu: Imu | None
    source: VideoSource | ImageSequence
    warnings: tuple[str, ...]
    files: tuple[InputFile, ...]


def assembled(section: Section, frames_file: Path, parts: FolderParts) -> Recording:
    """Return the recording that a description and what was read make; raises `InputError`."""
    described = describe(section)
    frames, mended = _match(frames_file, parts.table, parts.source)
    return Recording(
        name=described.name,
        kind=described.kind,
        path=section.file.parent,
        frames=frames,
        encoder=parts.encoder,
        pipe=described.pipe,
        frame_rate=section.number("frame_rate", above=0),
        source=parts.source,
        probe_file=described.probe_file,
        content_key=content_key(parts.files),
        warnings=(
            *described.warnings, *parts.warnings, *mended, *encoder_warnings(parts.encoder, frames)
        ),
        files=parts.files,
        listed=parts.table,
        inspection=described.inspection,
        imu=parts.imu,
    )  # fmt: skip


def _match(
    file: Path, table: FrameTable, source: VideoSource | ImageSequence
) -> tuple[FrameTable, tuple[str, ...]]:
    """Return the frames that table and images share, and what was mended."""
    gaps = _check_numbers(source, table)
    frames, cut = common_frames(table, source.count)
    if frames.frame.size == 0:
        raise InputError(
            file, f"starts at frame {table.frame[0]}, but there are only {source.count} images",
            hint="frames are numbered from 0 in the video",
        )  # fmt: skip
    return frames, (*gaps, *cut)


def _open_source(section: Section, table: FrameTable) -> tuple[VideoSource | ImageSequence, list[InputFile]]:
    """Return the source of images and the files it reads, as they were before."""
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
            hint="number both alike: a shift would give every frame the light of its neighbour",
        )  # fmt: skip
    missing = int(source.numbers[-1]) - first + 1 - source.numbers.size
    return (f"{missing} images are missing between the first and the last",) if missing else ()
