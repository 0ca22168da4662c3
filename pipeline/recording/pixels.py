"""Grey and colour planes of decoded frames, and the decoding of single compressed images."""

from __future__ import annotations

from typing import cast

import av
import cv2
import numpy as np
from av.video.reformatter import ColorRange, Colorspace

from pipeline.arrays import Float, Image
from pipeline.recording.base import Planes

# Luma weights (red, blue) of ITU-R BT.709 and BT.601; swscale takes 601 where a stream names none.
_BT709, _BT601 = (0.2126, 0.0722), (0.299, 0.114)


def pixels(frame: av.VideoFrame, planes: Planes) -> Image:
    """Return a frame's luma as coded (H, W), or its colours (H, W, 3) in OpenCV's order.

    Luma is not stretched: in a video of limited range, black is 16 and white 235.
    """
    if planes == "grey":
        return _luma(frame)
    if frame.format.name in ("yuv444p", "yuvj444p"):
        return _bgr_444(frame)
    return np.asarray(frame.to_ndarray(format="bgr24"), np.uint8)


def shown(frame: av.VideoFrame | None, planes: Planes) -> Image | None:
    """Return the `pixels` of a frame; None where there is no frame."""
    return None if frame is None else pixels(frame, planes)


def _luma(frame: av.VideoFrame) -> Image:
    """Return the luma plane without a copy where there is one of 8 bits."""
    name, bits = frame.format.name, frame.format.components[0].bits
    if name.startswith("gray"):
        return plane_of((frame if bits == 8 else frame.reformat(format="gray")).planes[0])
    if frame.format.is_rgb or frame.format.has_palette:
        return np.asarray(cv2.cvtColor(frame.to_ndarray(format="bgr24"), cv2.COLOR_BGR2GRAY), np.uint8)
    planar = name.startswith(("yuv", "nv")) and bits == 8
    return plane_of((frame if planar else frame.reformat(format="yuv420p")).planes[0])


def plane_of(plane: av.video.plane.VideoPlane) -> Image:
    """Return a view (H, W) of a plane of bytes, without its padding; keeps the frame's memory alive."""
    return np.frombuffer(memoryview(plane), np.uint8).reshape(plane.height, plane.line_size)[:, : plane.width]


def _bgr_444(frame: av.VideoFrame) -> Image:
    """Convert full-resolution chroma by one matrix, as swscale does, in a fifth of its time."""
    full = frame.color_range == ColorRange.JPEG or frame.format.name == "yuvj444p"
    weights = _BT709 if frame.colorspace == Colorspace.ITU709 else _BT601
    yuv = cv2.merge([plane_of(p) for p in frame.planes])
    return np.asarray(cv2.transform(yuv, _yuv_to_bgr(weights, full)), np.uint8)


def _yuv_to_bgr(weights: tuple[float, float], full: bool) -> Float:
    """Return the (3, 4) matrix from Y, U, V, 1 to B, G, R (ITU-R BT.601-7 and BT.709-6)."""
    red, blue = weights
    green = 1 - red - blue
    luma, chroma, black = (1.0, 1.0, 0.0) if full else (255 / 219, 255 / 224, 16.0)
    u, v = 2 * (1 - blue) * chroma, 2 * (1 - red) * chroma
    matrix = np.array([[luma, u, 0], [luma, -u * blue / green, -v * red / green], [luma, 0, v]])
    return np.column_stack([matrix, -matrix @ [black, 128, 128]])


_CODECS = {b"\x89PNG": "png", b"\xff\xd8\xff": "mjpeg", b"BM": "bmp", b"RIFF": "webp"}
EXPECTED = "PNG, JPEG, BMP or WebP images"


def decode_still(data: bytes, planes: Planes) -> Image | None:
    """Return a compressed image's grey or colour planes; None when it is damaged or of another format."""
    codec = next((name for lead, name in _CODECS.items() if data.startswith(lead)), None)
    if codec is None:
        return None
    context = cast(av.VideoCodecContext, av.CodecContext.create(codec, "r"))
    context.thread_count = 1
    context.options = {"err_detect": "crccheck+explode"}
    try:
        frames = context.decode(av.Packet(data)) or context.decode(None)
    except av.FFmpegError:
        return None
    return pixels(frames[0], planes) if frames and not frames[0].is_corrupt else None
