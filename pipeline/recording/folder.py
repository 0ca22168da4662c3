"""A recording kept as a folder: recording.yaml, frames.csv, encoder.csv and a video."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.recording.base import Encoder, FrameTable, Recording
from pipeline.recording.facts import pipe_facts
from pipeline.recording.tables import read_encoder, read_frame_table
from pipeline.recording.video import open_video
from pipeline.yaml_file import Section, read_yaml

DESCRIPTION = "recording.yaml"
_KEYS = ("name", "kind", "video", "frames", "frame_rate", "encoder", "probe", "pipe")


def recognise(path: Path) -> str | None:
    """Return why ``path`` is not a recording folder, or None when it is one."""
    if not path.is_dir():
        return "it is not a folder"
    return None if (path / DESCRIPTION).is_file() else f"there is no {DESCRIPTION} in it"


def open_folder(path: Path) -> Recording:
    """Open a recording folder.

    Raises
    ------
    InputError
        When a file is missing or wrong; what can be mended is named in `Recording.warnings` instead.
    """
    description = read_yaml(path / DESCRIPTION)
    description.refuse_unknown(_KEYS)
    video_file = _inside(description, "video")
    frames_file = _inside(description, "frames")
    source = open_video(video_file)
    frames, warnings = common_frames(read_frame_table(frames_file), source.count)
    encoder_file, absent = _optional(description, "encoder")
    encoder = read_encoder(encoder_file) if encoder_file else None
    probe_file, unstated = _optional(description, "probe")
    files = [description.file, video_file, frames_file, *([encoder_file] if encoder_file else [])]
    return Recording(
        name=description.text("name"),
        kind=description.choice("kind", ("inspection", "gauge")),
        path=path,
        frames=frames,
        encoder=encoder,
        pipe=pipe_facts(description.section("pipe")),
        frame_rate=description.number("frame_rate", above=0),
        source=source,
        probe_file=probe_file,
        content_key=content_key(files),
        warnings=(*warnings, *absent, *unstated, *encoder_warnings(encoder, frames)),
    )


def common_frames(table: FrameTable, count: int) -> tuple[FrameTable, tuple[str, ...]]:
    """Return the part of a table that ``count`` video frames cover, and what was noticed."""
    listed = int(table.frame[-1]) + 1
    if listed == count:
        return table, ()
    keep = table.frame < count
    kept = replace(
        table, frame=table.frame[keep], time_s=table.time_s[keep], illumination=table.illumination[keep]
    )
    return kept, (
        f"the video has {count} frames, the table of frames lists {listed}: "
        f"the {min(count, listed)} in common are used",
    )


def encoder_warnings(encoder: Encoder | None, frames: FrameTable) -> tuple[str, ...]:
    """Return what is suspicious about an encoder: it covers only part of the run, pauses, or jumps."""
    if encoder is None:
        return ()
    frame_period = float(np.median(np.diff(frames.time_s))) if frames.time_s.size > 1 else 0.0
    step_s = np.diff(encoder.time_s)
    slack = 2 * max(frame_period, float(np.median(step_s)))
    step_mm = np.abs(np.diff(encoder.distance_mm))
    usual_mm = float(np.quantile(step_mm, 0.99))
    jumps = np.flatnonzero((step_mm > 10 * usual_mm) & (step_mm > 1.0))
    found = []
    if encoder.time_s[0] > frames.time_s[0] + slack:
        found.append(f"the encoder begins {encoder.time_s[0] - frames.time_s[0]:.2f} s after the first frame")
    if encoder.time_s[-1] < frames.time_s[-1] - slack:
        found.append(f"the encoder ends {frames.time_s[-1] - encoder.time_s[-1]:.2f} s before the last frame")
    if np.any(step_s > 10 * slack):
        found.append(f"the encoder is silent for up to {step_s.max():.2f} s")
    if jumps.size:
        at = ", ".join(f"{encoder.time_s[j]:.2f} s" for j in jumps[:5])
        found.append(f"the encoder jumps by up to {step_mm.max():.1f} mm at {at} ({jumps.size} in all)")
    return tuple(found)


def content_key(files: list[Path]) -> str:
    """Return the SHA-256 of files' bytes, in order, each led by its length."""
    digest = hashlib.sha256()
    for file in files:
        digest.update(f"{file.stat().st_size}:".encode())
        with file.open("rb") as opened:
            digest.update(hashlib.file_digest(opened, "sha256").digest())
    return digest.hexdigest()


def _inside(description: Section, key: str) -> Path:
    """Return the path of a file named by a key; it must lie in the recording's folder."""
    named = Path(description.text(key))
    folder = description.file.parent
    if named.is_absolute() or ".." in named.parts:
        raise description.fail(key, f"is {str(named)!r}", "a file inside the recording's folder")
    if not (folder / named).exists():
        raise InputError(
            folder / named, f"is missing, yet {DESCRIPTION} names it as {key}",
            hint="copy the whole folder of the recording",
        )  # fmt: skip
    return folder / named


def _optional(description: Section, key: str) -> tuple[Path | None, tuple[str, ...]]:
    """Return a file that a recording can do without, or None and a warning when it is named but absent."""
    if not description.has(key):
        return None, ()
    named = description.text(key)
    if not (description.file.parent / named).exists():
        return None, (f"{named} is named as {key} but is not there: going on without",)
    return _inside(description, key), ()
