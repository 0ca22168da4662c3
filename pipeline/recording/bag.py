"""Recordings stored as ROS 1 bags, ROS 2 bags (sqlite3 or MCAP storage) or MCAP files.

Topics, by default:

``/camera/image_raw``
    ``sensor_msgs/Image``; or ``/camera/image_raw/compressed`` or ``/camera/image/compressed``,
    ``sensor_msgs/CompressedImage``; else the only topic of these types.
``/illumination``
    ``std_msgs/String``: ``laser``, ``led`` or ``both``; one for each image, else each holds until the next.
``/encoder/distance_mm``
    ``std_msgs/Float64``, timed by when it was recorded.
``/imu/data``
    ``sensor_msgs/Imu``; its covariances are not used, since probe.yaml states the errors of an IMU.

Further facts are in a YAML file beside the bag: ``run.recording.yaml`` for ``run.bag``, ``run.mcap``
or the folder ``run``, else ``recording.yaml`` in the same folder (for a ROS 2 bag: inside it). Its keys are
those of a recording folder without ``video``, ``frames`` and ``encoder``; ``frame_rate`` may be left out;
``topics`` may name ``image``, ``illumination``, ``encoder`` and ``imu``; without an illumination topic, the
key ``illumination`` lists the pattern that repeats, such as ``[laser, led]``. ``probe`` is relative to that
file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from pipeline.arrays import Image, Int
from pipeline.errors import InputError
from pipeline.files.disk import content_key, input_file
from pipeline.files.json_yaml import read_yaml
from pipeline.recording.bag_file import BAG_ERRORS, Bag, RosBag, bag_files, open_mcap
from pipeline.recording.bag_topics import (
    ENCODINGS,
    Topics,
    choose_topics,
    encoder_of,
    frames_of,
    imu_of,
    message_image,
)
from pipeline.recording.base import FrameTable, Planes, Recording, ascending, complete, decoded_ahead
from pipeline.recording.encoder_checks import checked_encoder
from pipeline.recording.folder import COMMON_KEYS, describe

_KEYS = (*COMMON_KEYS, "topics", "illumination")


@dataclass(frozen=True)
class BagSource:
    """Images of a bag; frame n is the n-th message on the image topic.

    Attributes
    ----------
    bag, topic, message_type
    recorded_ns : (N,) int
        When each message was recorded, ascending.
    image_size : (int, int)
        Width and height of the first image, px; images of another size count as damaged.
    """

    bag: Bag
    topic: str
    message_type: str
    recorded_ns: Int
    image_size: tuple[int, int]

    def read(self, frames: Sequence[int] | Int, planes: Planes) -> Iterator[tuple[int, Image | None]]:
        """See `FrameSource.read`; a few images are decoded ahead."""
        wanted = ascending(frames)
        there = wanted[wanted < self.recorded_ns.size]
        decoded = decoded_ahead(self._coded(there), partial(self._decode, planes=planes))
        return complete(wanted, decoded)

    def _coded(self, wanted: Int) -> Iterator[tuple[int, bytes]]:
        """Yield the coded messages wanted, up to where the bag is damaged."""
        if wanted.size == 0:
            return
        start_ns = int(self.recorded_ns[wanted[0]])
        number = int(np.searchsorted(self.recorded_ns, start_ns))
        chosen = set(wanted.tolist())
        messages = self.bag.messages(self.topic, start_ns)
        while number <= wanted[-1]:
            try:
                _, coded = next(messages)
            except (StopIteration, *BAG_ERRORS):
                return
            if number in chosen:
                yield number, coded
            number += 1

    def _decode(self, coded: bytes, planes: Planes) -> Image | None:
        try:
            image = message_image(self.bag.decode(coded, self.message_type), self.message_type, planes)
        except BAG_ERRORS:
            return None
        fits = image is not None and image.shape[1::-1] == self.image_size
        return image if fits else None


def open_ros(path: Path) -> Recording:
    """Open a ROS 1 or ROS 2 bag; see the module for what it must hold.

    Raises
    ------
    InputError
        When it is damaged, or topics or the YAML file beside it lack required facts.
    """
    return _open(path, RosBag)


def open_mcap_recording(path: Path) -> Recording:
    """Open an MCAP file; as `open_ros`."""
    return _open(path, open_mcap)


def _open(path: Path, opener: Callable[[Path], Bag]) -> Recording:
    description = input_file(_sidecar(path))
    section = read_yaml(description.path)
    section.refuse_unknown(_KEYS)
    described = describe(section)
    try:
        files = (description, *map(input_file, bag_files(path)))
        bag = opener(path)
        topics = choose_topics(bag.topics(), section, path)
        recorded_ns, frames, start_ns = frames_of(bag, topics, section)
        encoder, imu = encoder_of(bag, topics, start_ns), imu_of(bag, topics, start_ns)
        source = _source(bag, topics, recorded_ns)
    except BAG_ERRORS as error:
        hint = "repair it with the tools of its format, or copy it again"
        raise InputError(path, f"cannot be read as a bag: {error}", hint=hint) from error
    encoder, noticed = checked_encoder(encoder, frames)
    warnings = (*described.warnings, *noticed)
    return Recording(
        described.name, described.kind, path, frames, encoder, described.pipe,
        described.frame_rate or _rate(frames), source, described.probe_file, content_key(files), warnings,
        files, inspection=described.inspection, imu=imu,
    )  # fmt: skip


def _sidecar(path: Path) -> Path:
    """Return the YAML file that describes a bag."""
    shared = (path if path.is_dir() else path.parent) / "recording.yaml"
    own = path.parent / f"{path.name if path.is_dir() else path.stem}.recording.yaml"
    for file in (own, shared):
        if file.is_file():
            return file
    raise InputError(
        path, "has no description beside it", expected=f"{own.name} or {shared.name}",
        hint="write its kind, probe and pipe there, as in a recording folder",
    )  # fmt: skip


def _source(bag: Bag, topics: Topics, recorded_ns: Int) -> BagSource:
    """Return the source, its image size taken from the first image that can be decoded."""
    for _, coded in bag.messages(topics.image):
        image = message_image(bag.decode(coded, topics.image_type), topics.image_type, "grey")
        if image is not None:
            return BagSource(
                bag, topics.image, topics.image_type, recorded_ns, (image.shape[1], image.shape[0])
            )
    raise ValueError(f"no image of {topics.image} can be decoded; known encodings: {', '.join(ENCODINGS)}")


def _rate(frames: FrameTable) -> float:
    """Return the usual frame rate, 1/s; 30 if there is only one frame."""
    return 1 / float(np.median(np.diff(frames.time_s))) if frames.time_s.size > 1 else 30.0
