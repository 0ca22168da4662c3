"""A short cut of the sample recording, and changes that spoil it."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

from pipeline.arrays import Image
from tests.shared_data import PROJECT_ROOT

SAMPLE = PROJECT_ROOT / "data" / "sample"
FRAMES, RATE, SIZE = 24, 30, (1600, 1200)
Spoil = Callable[[Path], object]


def cut_sample(folder: Path, frames: int = FRAMES) -> Path:
    """Write the first frames of the sample recording into a new folder; the video's packets are copied."""
    folder.mkdir(parents=True)
    for name in ("recording.yaml", "probe.yaml"):
        shutil.copy(SAMPLE / name, folder / name)
    rows = (SAMPLE / "frames.csv").read_text().splitlines(keepends=True)[: frames + 1]
    (folder / "frames.csv").write_text("".join(rows))
    header, *readings = (SAMPLE / "encoder.csv").read_text().splitlines(keepends=True)
    kept = [r for r in readings if float(r.split(",")[0]) <= frames / RATE]
    (folder / "encoder.csv").write_text(header + "".join(kept))
    _copy_packets(SAMPLE / "frames.mkv", folder / "frames.mkv", frames)
    return folder


def _copy_packets(source: Path, target: Path, count: int) -> None:
    with av.open(str(source)) as read, av.open(str(target), "w") as written:
        stream = read.streams.video[0]
        copy = written.add_stream_from_template(stream)
        packets = (p for p in read.demux(stream) if p.size)
        for _, packet in zip(range(count), packets, strict=False):
            packet.stream = copy
            written.mux(packet)


def replaced(file: str, pattern: str, text: str) -> Spoil:
    """Return a change that replaces the first match of ``pattern`` in a text file by ``text``."""

    def spoil(folder: Path) -> None:
        before = (folder / file).read_text()
        after = re.sub(pattern, text, before, count=1, flags=re.MULTILINE)
        assert after != before
        (folder / file).write_text(after)

    return spoil


def rewritten(file: str, change: Callable[[list[str]], list[str]]) -> Spoil:
    """Return a change that rewrites all lines of a text file but the first."""

    def spoil(folder: Path) -> None:
        header, *lines = (folder / file).read_text().splitlines(keepends=True)
        (folder / file).write_text("".join([header, *change(lines)]))

    return spoil


def truncated(share: float) -> Spoil:
    """Return a change that cuts the video file off after ``share`` of its bytes."""

    def spoil(folder: Path) -> None:
        content = (folder / "frames.mkv").read_bytes()
        (folder / "frames.mkv").write_bytes(content[: int(share * len(content))])

    return spoil


def noised(start: float, length: int) -> Spoil:
    """Return a change that overwrites ``length`` bytes of the video, from a share of it on, with noise."""

    def spoil(folder: Path) -> None:
        content = bytearray((folder / "frames.mkv").read_bytes())
        at = int(start * len(content))
        content[at : at + length] = np.random.default_rng(1).bytes(length)
        (folder / "frames.mkv").write_bytes(content)

    return spoil


def repainted(paint: Callable[[int, Image], Image]) -> Spoil:
    """Return a change that replaces every picture by ``paint(frame, bgr)`` and encodes the video again."""

    def spoil(folder: Path) -> None:
        file, new = folder / "frames.mkv", folder / "new.mkv"
        with av.open(str(file)) as read, av.open(str(new), "w") as written:
            stream = written.add_stream("libx264", rate=RATE, options={"preset": "ultrafast", "crf": "12"})
            stream.pix_fmt, stream.width, stream.height = "yuv444p", *SIZE
            for number, frame in enumerate(read.decode(video=0)):
                picture = np.ascontiguousarray(paint(number, frame.to_ndarray(format="bgr24")))
                made = av.VideoFrame.from_ndarray(picture, format="bgr24")
                made.pts, made.time_base = number, Fraction(1, RATE)
                written.mux(stream.encode(made))
            written.mux(stream.encode())
        new.replace(file)

    return spoil


def is_laser(frame: int) -> bool:
    """Return whether the laser is on in a frame of the sample, whose laser and LED frames alternate."""
    return frame % 2 == 0


def noise(frame: int, picture: Image) -> Image:
    """Return a picture of noise, as if no wall were in view."""
    return np.random.default_rng(frame).normal(60, 12, picture.shape).clip(0, 255).astype(np.uint8)


def without(file: str) -> Spoil:
    return lambda folder: (folder / file).unlink()


def emptied(file: str) -> Spoil:
    return lambda folder: (folder / file).write_text("")


def black(_: int, picture: np.ndarray) -> np.ndarray:
    return np.zeros_like(picture)


def lights_swapped(lines: list[str]) -> list[str]:
    other = {"laser": "led", "led": "laser"}
    return [",".join([*line.split(",")[:2], other[line.split(",")[2].strip()] + "\n"]) for line in lines]


def spoilt(good: Path, folder: Path, spoil: Spoil) -> Path:
    """Copy a recording into ``folder``, spoil the copy, and return its path."""
    copy = folder / "recording"
    shutil.copytree(good, copy)
    spoil(copy)
    return copy
