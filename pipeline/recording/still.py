"""Single compressed images: PNG, JPEG, BMP and WebP."""

from __future__ import annotations

from typing import cast

import av

from pipeline.arrays import Image
from pipeline.recording.base import Planes
from pipeline.recording.pixels import pixels

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
