"""Kinds of hard footage: pictures repeated, exchanged, lost or coded badly, and changes of other files.

`FROZEN` lists frames that all show the picture before them, `FILTERED` noise filters, `EXCHANGED` pictures
shown in place of others, `LOST` the pictures that remain when some are lost without a note in the table of
frames, `CODED` codecs. Functions of `REWRITTEN` change other files of the recording, those of `DAMAGED` the
video's bytes.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
import yaml
from numpy.typing import NDArray

from tests.benchmarks.hard_kinds import PAINTED, Image, Paint

Frame = TypeVar("Frame")


def held_still(frames: range) -> Paint:
    """Return a change that shows the picture before ``frames`` in all of them."""
    shown: list[Image] = []

    def paint(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
        if k not in frames:
            shown[:] = [image]
        return shown[0]

    return paint


def filtered(keep: float, edges: float) -> Paint:
    """Return a noise filter that mixes in a share of the previous picture in the same light.

    Where a pixel differs by ``edges`` grey levels or more, the share is smaller.
    """
    shown: dict[bool, Image] = {}

    def paint(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
        if laser in shown:
            change = shown[laser] - image
            image = image + keep * np.exp(-((change / edges) ** 2)) * change
        shown[laser] = image
        return image

    return paint


def half_size_probe(folder: Path, random: np.random.Generator) -> None:
    """State the camera of pictures of half the size."""
    probe = yaml.safe_load((folder / "probe.yaml").read_text("utf-8"))
    camera = probe["camera"]
    camera["image_size"] = [n // 2 for n in camera["image_size"]]
    camera["focal_px"] = [f / 2 for f in camera["focal_px"]]
    camera["centre_px"] = [(c + 0.5) / 2 - 0.5 for c in camera["centre_px"]]
    (folder / "probe.yaml").chmod(0o644)
    (folder / "probe.yaml").write_text(yaml.safe_dump(probe), "utf-8")


def late_stamps(folder: Path, random: np.random.Generator) -> None:
    """Replace times by times of arrival.

    Late by an exponential part of a period, mean 0.2, never out of order.
    """
    head, *rows = (folder / "frames.csv").read_text("utf-8").splitlines()
    cells = [row.split(",") for row in rows]
    times = np.array([float(c[1]) for c in cells])
    times = np.maximum.accumulate(
        times + random.exponential(0.2 / 30, len(times)) + 1e-6 * np.arange(len(times))
    )
    lines = [f"{c[0]},{t:.6f},{c[2]}" for c, t in zip(cells, times, strict=True)]
    (folder / "frames.csv").write_text("\n".join([head, *lines]) + "\n", "utf-8")


def damaged_stream(video: bytes, random: np.random.Generator) -> bytes:
    """Change twenty bytes in the second third of the video, as a bad copy would."""
    out = bytearray(video)
    for at in random.integers(len(out) // 3, 2 * len(out) // 3, 20):
        out[at] ^= 0x55
    return bytes(out)


def exchanged(frames: Iterable[Frame], taken: Mapping[int, int]) -> Iterator[Frame]:
    """Yield frames, each in the place of the one that is ``taken`` for it."""
    held: dict[int, Frame] = {}
    place = 0
    for number, frame in enumerate(frames):
        held[number] = frame
        while (source := taken.get(place, place)) in held:
            yield held.pop(source)
            place += 1


def clock_jump(folder: Path, random: np.random.Generator) -> None:
    """Set the camera's clock 5 s ahead at frame 70; the encoder's clock goes on."""
    head, *rows = (folder / "frames.csv").read_text("utf-8").splitlines()
    cells = [row.split(",") for row in rows]
    lines = [f"{c[0]},{float(c[1]) + 5 * (int(c[0]) >= 70):.6f},{c[2]}" for c in cells]
    (folder / "frames.csv").write_text("\n".join([head, *lines]) + "\n", "utf-8")


def kept_pictures(lost: int, together: bool, count: int, random: np.random.Generator) -> NDArray[np.int_]:
    """Return the remaining pictures of ``count`` when some are lost, in a row or at random."""
    inner = np.arange(10, count - 10 - lost)
    gone = random.choice(inner) + np.arange(lost) if together else random.choice(inner, lost, replace=False)
    return np.setdiff1d(np.arange(count), gone)


def forget_lost(folder: Path, kept: NDArray[np.int_]) -> None:
    """Give the remaining pictures the first rows of the table, and their own true poses."""
    table = folder / "frames.csv"
    table.write_text("\n".join(table.read_text("utf-8").splitlines()[: len(kept) + 1]) + "\n", "utf-8")
    truth = json.loads((folder / "truth.json").read_text("utf-8"))
    truth["camera_pose_in_pipe"] = [truth["camera_pose_in_pipe"][k] for k in kept]
    (folder / "truth.json").write_text(json.dumps(truth), "utf-8")


def labels_swapped(folder: Path, random: np.random.Generator) -> None:
    """Exchange laser and led in the table from some frame in the middle third on."""
    _relabel(folder, lambda count: np.arange(count) >= random.integers(count // 3, 2 * count // 3))


def labels_wrong(folder: Path, random: np.random.Generator) -> None:
    """Make one label in ten, at random, the other one."""
    _relabel(
        folder, lambda count: np.isin(np.arange(count), random.choice(count, count // 10, replace=False))
    )


def _relabel(folder: Path, wrong_of: Callable[[int], NDArray[np.bool_]]) -> None:
    """Exchange laser and led in the rows of the table for which ``wrong_of`` their number is true."""
    with (folder / "frames.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    if {row["illumination"] for row in rows} != {"laser", "led"}:
        raise SystemExit("labels can be exchanged only where laser and led alternate")
    for row, wrong in zip(rows, wrong_of(len(rows)), strict=True):
        if wrong:
            row["illumination"] = "led" if row["illumination"] == "laser" else "laser"
    with (folder / "frames.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


# Frames whose pictures are all replaced by the one before the first of them.
FROZEN = {"frozen-picture": range(90, 99), "frozen-second": range(60, 90)}
# Noise filters: one that averages two pictures, and one that preserves edges.
FILTERED = {"pictures-mixed": partial(filtered, 0.5, 1e4), "noise-filtered": partial(filtered, 0.75, 32.0)}
REWRITTEN = {
    "half-size": half_size_probe, "late-stamps": late_stamps, "clock-jump": clock_jump,
    "labels-swapped": labels_swapped, "labels-wrong": labels_wrong,
}  # fmt: skip
LOST = {
    "lost-1": partial(kept_pictures, 1, True),
    "lost-5": partial(kept_pictures, 5, False),
    "lost-5-together": partial(kept_pictures, 5, True),
}
DAMAGED = {"damaged-stream": damaged_stream}
# Stored as HEVC, from careful to fast presets, which differ in what is kept from picture to picture; and as
# MPEG-2
# at a lower rate than its coarsest steps allow (6.6 Mbit/s for open-1), so that blocks show.
_HEVC = {
    f"hevc-{crf}-{preset}": {"crf": str(crf), "preset": preset, "x265-params": "log-level=none"}
    for crf, preset in (
        (30, "medium"),
        (30, "fast"),
        (30, "veryfast"),
        (30, "superfast"),
        (30, "ultrafast"),
        (32, "fast"),
        (34, "veryfast"),
    )
}
CODED = {name: ("libx265", options) for name, options in _HEVC.items()} | {
    "mpeg-2": ("mpeg2video", {"b": "1M"}),
    "vp9": ("libvpx-vp9", {"b": "500k", "deadline": "realtime", "cpu-used": "6"}),
}
# Pictures that are exchanged: laser for led, and led for led.
_PAIRS = {
    "neighbours-exchanged": [(k, k + 1) for k in (20, 41, 60, 77, 98, 112)],
    "lit-exchanged": [(k, k + 2) for k in (41, 77, 113)],
}
EXCHANGED = {n: {a: b for p in pairs for a, b in (p, p[::-1])} for n, pairs in _PAIRS.items()}
KINDS = sorted({*PAINTED, *FROZEN, *FILTERED, *EXCHANGED, *LOST, *REWRITTEN, *DAMAGED, *CODED})
