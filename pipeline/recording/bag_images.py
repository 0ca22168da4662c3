"""Images of bag messages: ``sensor_msgs/Image`` and ``sensor_msgs/CompressedImage``."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from pipeline.arrays import Image
from pipeline.recording.base import Planes
from pipeline.recording.still import decode_still

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
