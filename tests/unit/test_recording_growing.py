"""Each look at a growing recording reads only what is new, and sees the same as a fresh reader."""

import shutil
from dataclasses import dataclass, fields
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.recording import open_recording
from pipeline.recording.base import Recording
from pipeline.recording.growing import GrowingRecording
from pipeline.recording.matroska_tail import matroska_tail
from pipeline.recording.video import VideoSource, open_video
from tests.bad_recordings import RATE, SAMPLE

TIMES, PIECES = 3, 18
GROWING = ("frames.csv", "encoder.csv", "frames.mkv")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample recording several times over, as one file: keyframes and clusters all along it."""
    folder = tmp_path_factory.mktemp("growing") / "whole"
    folder.mkdir()
    for name in ("recording.yaml", "probe.yaml"):
        shutil.copy(SAMPLE / name, folder / name)
    count = repeated_video(SAMPLE / "frames.mkv", folder / "frames.mkv")
    light = ("laser", "led")
    rows = [f"{k},{k / RATE:.6f},{light[k % 2]}\n" for k in range(count)]
    (folder / "frames.csv").write_text("frame,time_s,illumination\n" + "".join(rows))
    readings = [f"{t:.3f},{20 * t:.4f}\n" for t in np.arange(0, count / RATE, 0.05)]
    (folder / "encoder.csv").write_text("time_s,distance_mm\n" + "".join(readings))
    return folder


def repeated_video(source: Path, target: Path) -> int:
    """Copy a video's packets several times over, at one rate; return the resulting number of frames."""
    count, held_back = 0, 4
    with av.open(str(target), "w") as written:
        copy = None
        for time in range(TIMES):
            with av.open(str(source)) as read:
                stream = read.streams.video[0]
                copy = copy or written.add_stream_from_template(stream)
                packets = [p for p in read.demux(stream) if p.size]
                frame = 1 / RATE / float(stream.time_base)
                for packet in packets:
                    packet.pts = round(packet.pts + time * len(packets) * frame)
                    packet.dts, packet.stream = round((count - held_back) * frame), copy
                    written.mux(packet)
                    count += 1
    return count


def written(whole: Path, growing: Path, share: Fraction) -> None:
    """Write a share of every file of a growing recording, wherever that cuts them."""
    growing.mkdir(exist_ok=True)
    for name in ("recording.yaml", "probe.yaml"):
        shutil.copy(whole / name, growing / name)
    for name in GROWING:
        content = (whole / name).read_bytes()
        there = (growing / name).stat().st_size if (growing / name).exists() else 0
        with (growing / name).open("ab") as file:
            file.write(content[there : int(len(content) * share)])


def bytes_read() -> int:
    """Return the bytes that this process has read so far, from any file."""
    return int(Path("/proc/self/io").read_text().splitlines()[0].split()[1])


def newest(recording, after: int) -> dict[int, np.ndarray]:
    """Return the pictures behind a frame that are surely complete."""
    wanted = recording.frames.frame[(recording.frames.frame > after)][:-8]
    return {n: image.copy() for n, image in recording.read(wanted, "grey") if image is not None}


@dataclass(frozen=True)
class Look:
    """Results and cost of one look at the growing recording, and those of a reader that opens it anew."""

    recording: Recording
    fresh: VideoSource
    pictures: int
    read_bytes: int
    anew_bytes: int
    differ: tuple[int, ...]


@pytest.fixture(scope="module")
def looks(whole: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Look]]:
    """A recording that grew in steps, and the results of a look after each step."""
    folder = tmp_path_factory.mktemp("looks") / "r"
    growing, seen, out = GrowingRecording(folder), -1, []
    for piece in range(1, PIECES + 1):
        written(whole, folder, Fraction(piece, PIECES))
        before = bytes_read()
        recording = growing.look()
        pictures = newest(recording, seen)
        looked = bytes_read()
        fresh = open_video(folder / "frames.mkv")
        opened = bytes_read()
        differ = [
            n for n, image in fresh.read(np.array(sorted(pictures)), "grey")
            if not np.array_equal(pictures[n], image)
        ]  # fmt: skip
        out.append(Look(recording, fresh, len(pictures), looked - before, opened - looked, tuple(differ)))
        seen = max(pictures)
    return folder, out


def test_every_look_sees_what_a_fresh_reader_sees(looks: tuple[Path, list[Look]]) -> None:
    folder, every = looks
    for look in every:
        index, anew = look.recording.source.index, look.fresh.index
        # where a shown frame is not in the file yet, frames near it are not reliable yet
        for field in (f for f in fields(index) if f.name != "broken" or look is every[-1]):
            assert np.array_equal(getattr(index, field.name), getattr(anew, field.name)), field.name
        assert look.pictures > 0
        assert look.differ == ()
    recording, last = every[-1].recording, open_recording(folder)
    assert np.array_equal(recording.frames.frame, last.frames.frame)
    assert np.array_equal(recording.frames.illumination, last.frames.illumination)
    assert np.array_equal(recording.encoder.distance_mm, last.encoder.distance_mm)


def test_a_look_reads_only_what_is_new_however_long_the_recording_is(
    whole: Path, looks: tuple[Path, list[Look]]
) -> None:
    every = looks[1]
    cost = [look.read_bytes for look in every]
    new = sum((whole / name).stat().st_size for name in GROWING) / PIECES
    # new data is listed and decoded, each from the cluster before it on; a cluster holds a second
    cluster = RATE * (whole / "frames.mkv").stat().st_size / len(every[-1].recording.frames.frame)
    most = 2 * (new + 2 * cluster) + 200_000
    assert max(cost) < most
    assert np.mean(cost[-3:]) < 1.3 * np.mean(cost[2:5])
    # negative control: opened anew, a look reads everything
    assert every[-1].anew_bytes > 2 * max(cost)


def test_a_recorder_that_starts_again_is_read_from_its_start(whole: Path, tmp_path: Path) -> None:
    growing = GrowingRecording(tmp_path / "r")
    written(whole, tmp_path / "r", Fraction(1, 2))
    half = growing.look()
    for name in GROWING:
        (tmp_path / "r" / name).write_bytes(b"")
    written(whole, tmp_path / "r", Fraction(1, 6))
    sixth = growing.look()
    assert 0 < len(sixth.frames.frame) < len(half.frames.frame) / 2
    for name in GROWING:
        (tmp_path / "r" / name).unlink()
    written(whole, tmp_path / "r", Fraction(2, 3))
    assert len(growing.look().frames.frame) > len(half.frames.frame)


def test_an_incomplete_line_is_read_later(whole: Path, tmp_path: Path) -> None:
    growing = GrowingRecording(tmp_path / "r")
    written(whole, tmp_path / "r", Fraction(1, 2))
    table = tmp_path / "r" / "frames.csv"
    lines = (whole / "frames.csv").read_bytes().splitlines(keepends=True)[:20]
    table.write_bytes(b"".join(lines)[:-3])
    assert len(growing.look().frames.frame) == 18
    with table.open("ab") as file:
        file.write(b"er\n")
    assert len(growing.look().frames.frame) == 19


def test_what_cannot_be_opened_yet_is_reported_and_opened_later(whole: Path, tmp_path: Path) -> None:
    growing = GrowingRecording(tmp_path / "r")
    with pytest.raises(InputError, match="does not exist"):
        growing.look()
    written(whole, tmp_path / "r", Fraction(0))
    with pytest.raises(InputError, match="lists no frames yet"):
        growing.look()
    written(whole, tmp_path / "r", Fraction(1, 4))
    assert len(growing.look().frames.frame) > 10


def test_a_cluster_mark_inside_other_data_is_ignored(whole: Path, tmp_path: Path) -> None:
    tail = matroska_tail(whole / "frames.mkv")
    assert tail is not None
    last = tail.last_cluster(tail.head_bytes)
    assert last > tail.head_bytes
    spoiled = tmp_path / "spoiled.mkv"
    spoiled.write_bytes((whole / "frames.mkv").read_bytes() + b"\x1f\x43\xb6\x75\x8a\x00\x00\x1f\x43\xb6\x75")
    again = matroska_tail(spoiled)
    assert again is not None
    assert again.last_cluster(again.head_bytes) == last
    assert matroska_tail(whole / "frames.csv") is None
