"""A long recording made of a short one, driven forward, backward, forward and so on without a jump.

usage: python -m tests.long_recording RECORDING FOLDER [PASSES]; it writes about 0.25 MB a frame

Pictures of a backward pass are those of the forward one in reverse order. Time goes on, and the encoder's
readings are mirrored about each turn. The truth is repeated in the same way, so that every pass can be
scored.
"""

from __future__ import annotations

import csv
import json
import shutil
import sys
from collections.abc import Iterator
from fractions import Fraction
from itertools import islice
from pathlib import Path

import av
import numpy as np

from pipeline.arrays import Int

_CHUNK = 60
_CRF = "12"
_SAME = ("recording.yaml", "probe.yaml", "truth_wall.npz", "truth_albedo.jpg")


def to_and_fro(frames: int, passes: int) -> Int:
    """Return the frame of the short recording for each frame of the long one.

    At a turn a frame is shown once.
    """
    there = np.arange(frames)
    back = there[::-1]
    return np.concatenate([there, *([back[1:], there[1:]][k % 2] for k in range(passes - 1))])


def write_long(source: Path, target: Path, passes: int) -> None:
    """Write the long recording into a new folder; encoding again hardly changes its pictures."""
    target.mkdir(parents=True)
    for name in _SAME:
        if (source / name).exists():
            shutil.copyfile(source / name, target / name)
    table = list(csv.DictReader((source / "frames.csv").read_text().splitlines()))
    shown = to_and_fro(len(table), passes)
    time_s = np.array([float(row["time_s"]) for row in table])
    steps = np.abs(np.diff(time_s[shown]))
    at = time_s[0] + np.concatenate([[0.0], np.cumsum(steps)])
    lines = [
        f"{i},{t:.6f},{table[k]['illumination']}" for i, (k, t) in enumerate(zip(shown, at, strict=True))
    ]
    (target / "frames.csv").write_text("\n".join(["frame,time_s,illumination", *lines]) + "\n")
    _write_encoder(source, target, float(time_s[0]), float(time_s[-1]), passes)
    _write_truth(source, target, shown)
    _write_video(source / "frames.mkv", target / "frames.mkv", len(table), passes)


def _write_encoder(source: Path, target: Path, first_s: float, last_s: float, passes: int) -> None:
    """Mirror the readings between first and last frame about each turn."""
    if not (source / "encoder.csv").exists():
        return
    own = np.loadtxt(source / "encoder.csv", delimiter=",", skiprows=1)
    inside = own[(own[:, 0] >= first_s) & (own[:, 0] <= last_s)]
    there = inside - [first_s, 0.0]
    back = np.stack([last_s - inside[::-1, 0], inside[::-1, 1]], -1)
    span = last_s - first_s
    rows = [(there, back)[k % 2] + np.array([first_s + k * span, 0.0]) for k in range(passes)]
    after = own[own[:, 0] > last_s] if passes % 2 else own[:0]
    rows = [own[own[:, 0] < first_s], *rows, after + np.array([(passes - 1) * span, 0.0])]
    lines = [f"{t:.4f},{d:.3f}" for t, d in np.concatenate(rows)]
    (target / "encoder.csv").write_text("\n".join(["time_s,distance_mm", *lines]) + "\n")


def _write_truth(source: Path, target: Path, shown: Int) -> None:
    if (source / "truth.json").exists():
        truth = json.loads((source / "truth.json").read_text())
        truth["camera_pose_in_pipe"] = [truth["camera_pose_in_pipe"][k] for k in shown]
        (target / "truth.json").write_text(json.dumps(truth))


def _write_video(source: Path, target: Path, frames: int, passes: int) -> None:
    with av.open(str(source)) as video, av.open(str(target), "w") as out:
        like = video.streams.video[0]
        stream = out.add_stream("libx264", rate=Fraction(like.average_rate or 30))
        stream.width, stream.height, stream.pix_fmt = like.width, like.height, like.pix_fmt
        stream.options = {"crf": _CRF, "preset": "veryfast"}
        for number, picture in enumerate(_pictures(source, frames, passes)):
            picture.pts, picture.time_base = number, 1 / stream.codec_context.framerate
            picture.pict_type = av.video.frame.PictureType.NONE
            out.mux(stream.encode(picture))
        out.mux(stream.encode())


def _pictures(source: Path, frames: int, passes: int) -> Iterator[av.VideoFrame]:
    yield from _decoded(source, 0, frames)
    for k in range(passes - 1):
        if k % 2:
            yield from _decoded(source, 1, frames)
            continue
        for last in range(frames - 1, 0, -_CHUNK):
            yield from list(_decoded(source, max(last - _CHUNK, 0), last))[::-1]


def _decoded(source: Path, first: int, last: int) -> Iterator[av.VideoFrame]:
    with av.open(str(source)) as video:
        video.streams.video[0].thread_type = "AUTO"
        yield from islice(video.decode(video=0), first, last)


if __name__ == "__main__":
    write_long(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 5)
