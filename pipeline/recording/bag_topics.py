"""Chooses a bag's topics of frames, light, encoder and IMU, and reads their messages."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Float, Image, Int
from pipeline.errors import InputError
from pipeline.files.json_yaml import Section
from pipeline.recording.bag_file import Bag
from pipeline.recording.base import Encoder, FrameTable, Illumination, Imu, Planes
from pipeline.recording.checks import refuse_backward
from pipeline.recording.images import decode_still
from pipeline.recording.tables import refuse_other_units

IMAGE_TOPICS = ("/camera/image_raw", "/camera/image_raw/compressed", "/camera/image/compressed")
ILLUMINATION_TOPIC, ILLUMINATION_TYPE = "/illumination", "std_msgs/msg/String"
ENCODER_TOPIC, ENCODER_TYPE = "/encoder/distance_mm", "std_msgs/msg/Float64"
IMU_TOPIC, IMU_TYPE = "/imu/data", "sensor_msgs/msg/Imu"
# The camera driver's stamps are used when they agree with the recorder's clock to within this time.
_SAME_CLOCK_NS = 5_000_000_000
_KINDS = tuple(k.value for k in Illumination)
COMPRESSED_TYPE = "sensor_msgs/msg/CompressedImage"
IMAGE_TYPES = ("sensor_msgs/msg/Image", COMPRESSED_TYPE)

# Encoding: channels, bytes a channel, conversion to grey and to OpenCV's colour order (None: as it is).
_ENCODINGS: dict[str, tuple[int, int, int | None, int | None]] = {
    "mono8": (1, 1, None, cv2.COLOR_GRAY2BGR),
    "8UC1": (1, 1, None, cv2.COLOR_GRAY2BGR),
    "mono16": (1, 2, None, cv2.COLOR_GRAY2BGR),
    "16UC1": (1, 2, None, cv2.COLOR_GRAY2BGR),
    "bgr8": (3, 1, cv2.COLOR_BGR2GRAY, None),
    "8UC3": (3, 1, cv2.COLOR_BGR2GRAY, None),
    "rgb8": (3, 1, cv2.COLOR_RGB2GRAY, cv2.COLOR_RGB2BGR),
    "bgra8": (4, 1, cv2.COLOR_BGRA2GRAY, cv2.COLOR_BGRA2BGR),
    "rgba8": (4, 1, cv2.COLOR_RGBA2GRAY, cv2.COLOR_RGBA2BGR),
    "bayer_rggb8": (1, 1, cv2.COLOR_BayerRGGB2GRAY, cv2.COLOR_BayerRGGB2BGR),
    "bayer_bggr8": (1, 1, cv2.COLOR_BayerBGGR2GRAY, cv2.COLOR_BayerBGGR2BGR),
    "bayer_gbrg8": (1, 1, cv2.COLOR_BayerGBRG2GRAY, cv2.COLOR_BayerGBRG2BGR),
    "bayer_grbg8": (1, 1, cv2.COLOR_BayerGRBG2GRAY, cv2.COLOR_BayerGRBG2BGR),
    "yuv422": (2, 1, cv2.COLOR_YUV2GRAY_UYVY, cv2.COLOR_YUV2BGR_UYVY),
    "uyvy": (2, 1, cv2.COLOR_YUV2GRAY_UYVY, cv2.COLOR_YUV2BGR_UYVY),
    "yuv422_yuy2": (2, 1, cv2.COLOR_YUV2GRAY_YUY2, cv2.COLOR_YUV2BGR_YUY2),
    "yuyv": (2, 1, cv2.COLOR_YUV2GRAY_YUY2, cv2.COLOR_YUV2BGR_YUY2),
}
ENCODINGS = tuple(_ENCODINGS)


def message_image(message: Any, message_type: str, planes: Planes) -> Image | None:
    """Return a decoded message's grey or colour planes; None when it is damaged or of unknown encoding."""
    if message_type == COMPRESSED_TYPE:
        return decode_still(message.data.tobytes(), planes)
    if message.encoding not in _ENCODINGS:
        return None
    _, _, to_grey, to_bgr = _ENCODINGS[message.encoding]
    coded = _rows(message)
    conversion = to_grey if planes == "grey" else to_bgr
    if coded is None or conversion is None:
        return coded
    return np.asarray(cv2.cvtColor(coded, conversion), np.uint8)


def _rows(message: Any) -> Image | None:
    """Return the message's bytes as (H, W) or (H, W, channels), padding left out, 16 bits cut to 8."""
    channels, size, _, _ = _ENCODINGS[message.encoding]
    height, width, step = int(message.height), int(message.width), int(message.step)
    used = width * channels * size
    if min(height, width) < 1 or step < used or message.data.size < height * step:
        return None
    rows = message.data[: height * step].reshape(height, step)[:, :used]
    if size == 2:
        rows = rows[:, 0::2] if message.is_bigendian else rows[:, 1::2]
    return np.ascontiguousarray(rows if channels == 1 else rows.reshape(height, width, channels))


@dataclass(frozen=True)
class Topics:
    """Topic and type of the images; topics of illumination, encoder and IMU, empty where there is none."""

    image: str
    image_type: str
    illumination: str
    encoder: str
    imu: str


def choose_topics(types: Mapping[str, str], section: Section, path: Path) -> Topics:
    """Return the topics to read: those that the YAML file names, else the usual ones.

    Raises
    ------
    InputError
        When a named topic is missing or has another type, or several could be the images.
    """
    named = section.section("topics") if section.has("topics") else Section(section.file, {}, "topics")
    named.refuse_unknown(("image", "illumination", "encoder", "imu"))
    image = _named(named, "image", types, IMAGE_TYPES) or _usual_image(types, path)
    illumination = _named(named, "illumination", types, (ILLUMINATION_TYPE,))
    encoder = _named(named, "encoder", types, (ENCODER_TYPE,))
    if not illumination and types.get(ILLUMINATION_TOPIC) == ILLUMINATION_TYPE:
        illumination = ILLUMINATION_TOPIC
    imu = _named(named, "imu", types, (IMU_TYPE,))
    if not encoder and types.get(ENCODER_TOPIC) == ENCODER_TYPE:
        encoder = ENCODER_TOPIC
    if not imu and types.get(IMU_TOPIC) == IMU_TYPE:
        imu = IMU_TOPIC
    return Topics(image, types[image], illumination, encoder, imu)


def frames_of(bag: Bag, topics: Topics, section: Section) -> tuple[Int, FrameTable, int]:
    """Return when the images were recorded (N,) in ns, the table of frames, and its time 0 in ns.

    Raises
    ------
    InputError
        When there are no images, their times run backwards, or their illumination is unknown.
    """
    recorded, stamped = [], []
    for time_ns, coded in bag.messages(topics.image):
        stamp = bag.decode(coded, topics.image_type).header.stamp
        recorded.append(time_ns)
        stamped.append(stamp.sec * 1_000_000_000 + stamp.nanosec)
    if not recorded:
        raise InputError(bag.files[0], "holds no image", place=f"topic {topics.image}")
    recorded_ns, stamped_ns = np.array(recorded, np.int64), np.array(stamped, np.int64)
    same_clock = bool(np.all(np.abs(stamped_ns - recorded_ns) < _SAME_CLOCK_NS))
    taken_ns = stamped_ns if same_clock else recorded_ns
    time_s = (taken_ns - taken_ns[0]) * 1e-9
    refuse_backward(bag.files[0], time_s, f"the time of {topics.image}", strictly=True)
    light = _lights(bag, topics, section, recorded_ns)
    return recorded_ns, FrameTable(np.arange(time_s.size), time_s, light), int(taken_ns[0])


def encoder_of(bag: Bag, topics: Topics, start_ns: int) -> Encoder | None:
    """Return the encoder's readings, with time from ``start_ns``; None if there is no such topic."""
    if not topics.encoder:
        return None
    rows = [(t - start_ns, bag.decode(c, ENCODER_TYPE).data) for t, c in bag.messages(topics.encoder)]
    if len(rows) < 2:
        raise InputError(
            bag.files[0], f"has {len(rows)} readings", place=f"topic {topics.encoder}", expected="at least 2"
        )
    time_s, distance_mm = np.array([r[0] for r in rows]) * 1e-9, np.array([r[1] for r in rows], float)
    wrong = np.flatnonzero(~np.isfinite(distance_mm))
    if wrong.size:
        place = f"topic {topics.encoder}, message {wrong[0] + 1}"
        raise InputError(bag.files[0], f"is {distance_mm[wrong[0]]}", place=place, expected="a finite number")
    return Encoder(time_s, distance_mm)


def imu_of(bag: Bag, topics: Topics, start_ns: int) -> Imu | None:
    """Return the IMU's readings, with time from ``start_ns``; None if there is no such topic.

    Times are the stamps of its driver if these agree with the recorder's clock, as for the images.

    Raises
    ------
    InputError
        When readings are too few, not finite, not in order of time or in other units than rad/s and m/s².
    """
    if not topics.imu:
        return None
    file, place = bag.files[0], f"topic {topics.imu}"
    recorded_ns, stamped_ns, values = _imu_messages(bag, topics.imu)
    if len(values) < 2:
        raise InputError(file, f"has {len(values)} readings", place=place, expected="at least 2")
    wrong = np.flatnonzero(~np.isfinite(values).all(1))
    if wrong.size:
        number = int(wrong[0]) + 1
        raise InputError(file, "is not finite", place=f"{place}, message {number}", expected="finite numbers")
    same_clock = bool(np.all(np.abs(stamped_ns - recorded_ns) < _SAME_CLOCK_NS))
    time_s = np.asarray(((stamped_ns if same_clock else recorded_ns) - start_ns) * 1e-9, float)
    refuse_backward(file, time_s, f"the time of {topics.imu}", strictly=True)
    imu = Imu(time_s, values[:, :3], values[:, 3:])
    refuse_other_units(file, imu)
    return imu


def _imu_messages(bag: Bag, topic: str) -> tuple[Int, Int, Float]:
    """Return when messages were recorded and stamped (M,), ns, and their rates and forces (M, 6)."""
    recorded, stamped, values = [], [], []
    for time_ns, coded in bag.messages(topic):
        message = bag.decode(coded, IMU_TYPE)
        stamp, rate, force = message.header.stamp, message.angular_velocity, message.linear_acceleration
        recorded.append(time_ns)
        stamped.append(stamp.sec * 1_000_000_000 + stamp.nanosec)
        values.append((rate.x, rate.y, rate.z, force.x, force.y, force.z))
    return np.array(recorded, np.int64), np.array(stamped, np.int64), np.array(values, float).reshape(-1, 6)


def _lights(bag: Bag, topics: Topics, section: Section, recorded_ns: Int) -> NDArray[np.str_]:
    """Return the illumination of each image: from its own message, the latest one, or a stated pattern."""
    if not topics.illumination:
        pattern = _pattern(section)
        return np.array([pattern[i % len(pattern)] for i in range(recorded_ns.size)], np.str_)
    place = f"topic {topics.illumination}"
    messages = list(bag.messages(topics.illumination))
    words = [bag.decode(coded, ILLUMINATION_TYPE).data for _, coded in messages]
    for i, word in enumerate(words):
        if word not in _KINDS:
            at = f"{place}, message {i + 1}"
            raise InputError(bag.files[0], f"is {word!r}", place=at, expected=f"one of {', '.join(_KINDS)}")
    if len(words) == recorded_ns.size:
        return np.array(words, np.str_)
    latest = np.searchsorted(np.array([t for t, _ in messages], np.int64), recorded_ns, "right") - 1
    if latest[0] < 0:
        raise InputError(
            bag.files[0], f"has {len(words)} messages, the first after the first image", place=place,
            expected=f"one for each of the {recorded_ns.size} images, or one before the first image",
        )  # fmt: skip
    return np.array(words, np.str_)[latest]


def _pattern(section: Section) -> list[str]:
    """Return the pattern of illumination that the YAML file states."""
    expected = f"a list of {', '.join(_KINDS)}, or a topic {ILLUMINATION_TOPIC} in the bag"
    value = section.require("illumination", expected)
    if not isinstance(value, list) or not value or any(v not in _KINDS for v in value):
        raise section.fail("illumination", f"is {value!r}", expected)
    return [str(v) for v in value]


def _named(named: Section, key: str, types: Mapping[str, str], wanted: Sequence[str]) -> str:
    """Return the topic that the YAML file names for a role, empty where it names none."""
    if not named.has(key):
        return ""
    topic = named.text(key)
    if types.get(topic) in wanted:
        return topic
    found = f"a {types[topic]}" if topic in types else "not in the bag"
    near = difflib.get_close_matches(topic, types, 1)
    hint = f"did you mean {near[0]}?" if near else f"the bag holds {', '.join(sorted(types)) or 'nothing'}"
    raise named.fail(key, f"{topic} is {found}", f"a topic of type {' or '.join(wanted)}", hint)


def _usual_image(types: Mapping[str, str], path: Path) -> str:
    """Return the usual image topic, or the only one that could be."""
    images = [topic for topic, kind in sorted(types.items()) if kind in IMAGE_TYPES]
    usual = [topic for topic in IMAGE_TOPICS if topic in images]
    if usual or len(images) == 1:
        return (usual or images)[0]
    raise InputError(
        path, f"has {len(images)} topics of images{': ' if images else ''}{', '.join(images)}",
        expected=f"{IMAGE_TOPICS[0]} or one topic of type {' or '.join(IMAGE_TYPES)}",
        hint="name it in the YAML file beside the bag: topics: {image: /name}",
    )  # fmt: skip
