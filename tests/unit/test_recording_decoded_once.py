"""Frames that stages share: their pixels equal those of the video, and they are decoded once."""

import errno
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.machine.scratch import Scratch
from pipeline.recording import open_recording
from pipeline.recording.base import FrameTable, Illumination, Recording
from pipeline.recording.decoded_once import DecodedOnce, decoded_once, read_luma, read_split
from pipeline.recording.video import VideoSource, open_video
from tests.made_recording import COUNT, write_folder, write_video

FORMATS = (
    ("mkv", "libx264", "yuv444p"), ("mp4", "libx264", "yuv420p"), ("avi", "mjpeg", "yuvj420p"),
    ("mkv", "ffv1", "bgr0"), ("avi", "ffv1", "gray"), ("mkv", "libx264", "yuv420p10le"),
)  # fmt: skip


def _shared(folder: Path, video: VideoSource, lasers: Sequence[int] = ()) -> DecodedOnce:
    recording = open_recording(write_folder(folder / "recording"))
    light = [Illumination.LASER.value if n in lasers else Illumination.LED.value for n in range(COUNT)]
    table = FrameTable(np.arange(COUNT), np.arange(COUNT) / 30, np.array(light))
    shared = decoded_once(replace(recording, frames=table, source=video), Scratch(folder)).source
    assert isinstance(shared, DecodedOnce)
    return shared


def _count_decoded(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list to which every frame decoded from now on is added."""
    decoded, of_video = [], VideoSource.decoded

    def counted(self: VideoSource, wanted: np.ndarray) -> object:
        decoded.extend(wanted.tolist())
        return of_video(self, wanted)

    monkeypatch.setattr(VideoSource, "decoded", counted)
    return decoded


@pytest.mark.parametrize("made", FORMATS)
def test_luma_and_small_colours_equal_those_of_the_whole_picture(
    tmp_path: Path, made: tuple[str, str, str]
) -> None:
    ext, codec, pixel_format = made
    write_video(tmp_path / f"v.{ext}", codec, pixel_format, {"g": "4"} if codec == "libx264" else {})
    video = open_video(tmp_path / f"v.{ext}")
    shared = _shared(tmp_path, video)
    recording = replace(open_recording(tmp_path / "recording"), source=shared)
    first, again = (list(read_split(recording, range(COUNT + 1))) for _ in range(2))
    for (n, one), (m, other), (_, bgr) in zip(first, again, video.read(range(COUNT + 1), "bgr"), strict=True):
        assert n == m
        if bgr is None:
            assert one is None
            assert other is None
            continue
        np.testing.assert_array_equal(one.luma, other.luma)
        np.testing.assert_array_equal(one.small, other.small)
        assert np.abs(one.luma - bgr @ [0.114, 0.587, 0.299]).mean() < 1.0
        small = cv2.resize(bgr, one.small.shape[1::-1], interpolation=cv2.INTER_AREA)
        assert np.abs(one.small - small.astype(float)).mean() < 1.0


@pytest.mark.parametrize("made", FORMATS)
def test_luma_alone_equals_that_of_the_split_picture(tmp_path: Path, made: tuple[str, str, str]) -> None:
    ext, codec, pixel_format = made
    write_video(tmp_path / f"v.{ext}", codec, pixel_format, {"g": "4"} if codec == "libx264" else {})
    source = _shared(tmp_path, open_video(tmp_path / f"v.{ext}"))
    recording = replace(open_recording(tmp_path / "recording"), source=source)
    first, again = (list(read_luma(recording, range(COUNT))) for _ in range(2))
    for (n, one), (_, other), (m, split) in zip(
        first, again, read_split(recording, range(COUNT)), strict=True
    ):
        assert n == m
        np.testing.assert_array_equal(one, split.luma)
        np.testing.assert_array_equal(other, split.luma)


@pytest.mark.parametrize("made", FORMATS)
def test_pixels_equal_those_of_the_video_however_often_they_are_read(
    tmp_path: Path, made: tuple[str, str, str]
) -> None:
    ext, codec, pixel_format = made
    write_video(tmp_path / f"v.{ext}", codec, pixel_format, {"g": "4"} if codec == "libx264" else {})
    video = open_video(tmp_path / f"v.{ext}")
    shared = _shared(tmp_path, video, lasers=range(0, COUNT, 2))
    for planes in ("grey", "bgr", "grey", "bgr"):
        for (n, got), (m, want) in zip(
            shared.read(range(COUNT + 1), planes), video.read(range(COUNT + 1), planes), strict=True
        ):
            assert n == m
            np.testing.assert_array_equal(got, want, f"{planes} {n}", strict=True)


def test_a_frame_is_decoded_once_and_its_whole_colours_when_they_are_requested(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_video(tmp_path / "v.mkv", "libx264", "yuv444p", {"g": "4"})
    shared = _shared(tmp_path, open_video(tmp_path / "v.mkv"), lasers=(0, 2))
    decoded = _count_decoded(monkeypatch)
    list(shared.read(range(COUNT), "grey"))
    list(shared.read_split(range(1, COUNT, 2)))
    list(shared.read(range(COUNT), "grey"))
    assert decoded == list(range(COUNT))
    list(shared.read([0], "bgr"))
    assert decoded == [*range(COUNT), 0]
    for _ in range(2):
        list(shared.read([1], "bgr"))
    assert decoded == [*range(COUNT), 0, 1]


def test_a_full_disk_costs_only_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_video(tmp_path / "v.mkv", "libx264", "yuv444p", {"g": "4"})
    video = open_video(tmp_path / "v.mkv")
    shared, want = _shared(tmp_path, video), dict(video.read(range(COUNT), "grey"))

    def refused(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "pwritev", refused)
    decoded = _count_decoded(monkeypatch)
    for _ in range(2):
        for number, image in shared.read(range(COUNT), "grey"):
            np.testing.assert_array_equal(image, want[number])
    assert len(decoded) == 2 * COUNT


def test_image_files_are_read_directly(tmp_path: Path) -> None:
    recording: Recording = replace(open_recording(write_folder(tmp_path / "r")), source=object())  # type: ignore[arg-type]
    assert decoded_once(recording, Scratch(tmp_path)) is recording
