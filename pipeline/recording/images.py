"""Pictures: grey and colour planes of decoded frames, compressed images, and frames in numbered files.

Numbered image files are named by a pattern such as ``frames/%06d.png``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import cast

import av
import cv2
import numpy as np
from av.video.reformatter import ColorRange, Colorspace

from pipeline.arrays import Float, Image, Int
from pipeline.errors import InputError
from pipeline.recording.base import Planes, ascending, decoded_ahead

# Luma weights (red, blue) of ITU-R BT.709 and BT.601; swscale takes 601 where a stream names none.
_BT709, _BT601 = (0.2126, 0.0722), (0.299, 0.114)
# Luma of black and of white in limited range (ITU-R BT.601 and BT.709), and of white in full range.
_LIMITED_BLACK, _LIMITED_WHITE, WHITE = 16, 235, 255
# Planar formats of 8 bits whose chroma has the resolution of their luma.
FULL_CHROMA = ("yuv444p", "yuvj444p")


def pixels(frame: av.VideoFrame, planes: Planes) -> Image:
    """Return a frame's luma as coded (H, W), or its colours (H, W, 3) in OpenCV's order.

    Luma is not stretched: in a video of limited range, black is 16 and white 235.
    """
    if planes == "grey":
        return _luma(frame)
    if frame.format.name in FULL_CHROMA:
        content = [plane_of(p) for p in frame.planes]
        return bgr_444(content, frame.format.name, int(frame.color_range), int(frame.colorspace))
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


def luma_of_white(luma: Image, bgr: Image) -> int:
    """Return the luma of white from one frame read both ways: 235 in limited range, else 255."""
    return _LIMITED_WHITE if _black(luma, bgr) > _LIMITED_BLACK / 2 else WHITE


def _black(luma: Image, bgr: Image) -> float:
    """Return the luma of black: luma is that and a sum of colours, with the weights of the video's standard.

    They are fitted, so that it does not matter which standard that is. Colours at an end of their range may
    have been clipped and are left out.
    """
    inside = np.all((bgr > 0) & (bgr < WHITE), axis=-1)
    known = np.column_stack([bgr[inside], np.ones(int(inside.sum()))])
    return float(np.linalg.lstsq(known, luma[inside].astype(float), rcond=None)[0][-1])


def plane_of(plane: av.video.plane.VideoPlane) -> Image:
    """Return a view (H, W) of a plane of bytes, without its padding; keeps the frame's memory alive."""
    return np.frombuffer(memoryview(plane), np.uint8).reshape(plane.height, plane.line_size)[:, : plane.width]


def bgr_444(planes: Sequence[Image], pixel_format: str, color_range: int, colorspace: int) -> Image:
    """Convert full-resolution chroma by one matrix, as swscale does, in a fifth of its time."""
    full = _is_full(pixel_format, color_range)
    weights = _BT709 if colorspace == Colorspace.ITU709 else _BT601
    return np.asarray(cv2.transform(cv2.merge(list(planes)), _yuv_to_bgr(weights, full)), np.uint8)


@dataclass(frozen=True)
class SplitImage:
    """A picture as ``luma`` (H, W), black 0, and as colours of half its size, ``small`` (H / 2, W / 2, 3)."""

    luma: Image
    small: Image

    @staticmethod
    def of(image: Image) -> SplitImage:
        """Split a picture (H, W, 3)."""
        return SplitImage(np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8), halved(image))

    @staticmethod
    def of_planes(
        planes: Sequence[Image], pixel_format: str, color_range: int, colorspace: int
    ) -> SplitImage:
        """Split planes of full-resolution chroma, or of halved chroma, without computing full colours."""
        parts = [halved(p) if p.shape == planes[0].shape else p for p in planes]
        small = bgr_444(parts, pixel_format, color_range, colorspace)
        return SplitImage(in_full_range(planes[0], pixel_format, color_range), small)


def in_full_range(luma: Image, pixel_format: str, color_range: int) -> Image:
    """Return a luma plane (H, W) with black 0 and white 255."""
    if _is_full(pixel_format, color_range):
        return luma
    stretched = np.clip((np.arange(256) - 16) * (255 / 219) + 0.5, 0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(luma, stretched), np.uint8)


def split(frame: av.VideoFrame | None) -> SplitImage | None:
    """Return a frame as luma and colours of half its size; None where there is no frame."""
    if frame is None:
        return None
    if frame.format.name in FULL_CHROMA and frame.colorspace != Colorspace.ITU709:
        content = [plane_of(p) for p in frame.planes]
        return SplitImage.of_planes(content, frame.format.name, int(frame.color_range), int(frame.colorspace))
    return SplitImage.of(pixels(frame, "bgr"))


def halved(image: Image) -> Image:
    """Return a picture (H, W) or (H, W, 3) of half its size, four pixels to one."""
    size = (image.shape[1] // 2, image.shape[0] // 2)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def _is_full(pixel_format: str, color_range: int) -> bool:
    return color_range == ColorRange.JPEG or pixel_format == "yuvj444p"


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


_FIELD = re.compile(r"%(0\d)?d")


@dataclass(frozen=True)
class ImageSequence:
    """Frames as image files; frame n is the file whose name holds the number n.

    Attributes
    ----------
    folder, pattern
        ``pattern`` is relative to ``folder`` and holds one ``%d`` or ``%06d``.
    numbers : (N,) int
        The numbers for which there is a file.
    image_size : (int, int)
        Width and height of the first image, px; images of another size count as damaged.
    """

    folder: Path
    pattern: str
    numbers: Int
    image_size: tuple[int, int]

    @property
    def count(self) -> int:
        """One more than the highest number."""
        return int(self.numbers[-1]) + 1

    @property
    def files(self) -> list[Path]:
        """All image files, by number."""
        return [self.file(n) for n in self.numbers.tolist()]

    def file(self, number: int) -> Path:
        """Return the file of a frame."""
        return self.folder / (self.pattern % number)

    def read(self, frames: Sequence[int] | Int, planes: Planes) -> Iterator[tuple[int, Image | None]]:
        """See `FrameSource.read`; a few images are decoded ahead."""
        wanted = ((n, n) for n in ascending(frames).tolist())
        return decoded_ahead(wanted, partial(self._decode, planes=planes))

    def _decode(self, number: int, planes: Planes) -> Image | None:
        try:
            image = decode_still(self.file(number).read_bytes(), planes)
        except OSError:
            return None
        fits = image is not None and image.shape[1::-1] == self.image_size
        return image if fits else None


def is_pattern(name: str) -> bool:
    """Return whether the name of a video is a pattern of image files."""
    return "%" in name


def open_images(folder: Path, pattern: str) -> ImageSequence:
    """Open a sequence of images.

    Raises
    ------
    InputError
        When the pattern is wrong, no file fits it, or the first cannot be decoded.
    """
    numbers = _numbers(folder, pattern)
    if not numbers:
        raise InputError(folder / pattern, "fits no image", expected=EXPECTED)
    first = folder / (pattern % numbers[0])
    image = decode_still(first.read_bytes(), "grey")
    if image is None:
        raise InputError(first, "cannot be decoded", expected=EXPECTED)
    return ImageSequence(folder, pattern, np.array(numbers, np.int64), (image.shape[1], image.shape[0]))


def _numbers(folder: Path, pattern: str) -> list[int]:
    """Return the numbers of the files that fit a pattern, ascending."""
    name = Path(pattern).name
    fields = list(_FIELD.finditer(name))
    if len(fields) != 1 or "%" in _FIELD.sub("", name) or "%" in str(Path(pattern).parent):
        raise InputError(folder / pattern, "is not a pattern", expected="one %d or %06d in the file's name")
    before, after = name[: fields[0].start()], name[fields[0].end() :]
    fits = re.compile(re.escape(before) + r"(\d{1,9})" + re.escape(after))
    found = (folder / pattern).parent
    matches = filter(None, (fits.fullmatch(f.name) for f in found.iterdir())) if found.is_dir() else ()
    numbers = {int(match[1]) for match in matches}
    return sorted(n for n in numbers if (folder / (pattern % n)).is_file())
