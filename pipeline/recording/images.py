"""Frames kept as numbered image files, such as ``frames/%06d.png``."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from pipeline.arrays import Image, Int
from pipeline.errors import InputError
from pipeline.recording.base import Planes, ascending, decoded_ahead
from pipeline.recording.pixels import EXPECTED, decode_still

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
    """Tell whether the name of a video is a pattern of image files."""
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
        raise InputError(folder / pattern, "there is no such image", expected=EXPECTED)
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
