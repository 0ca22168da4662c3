"""Pictures of a board: which files they are, and the corners found in them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError, UnusableError
from pipeline.files.disk import disk_errors_named
from pipeline.instrument.camera.calibration import BoardView
from pipeline.machine.plan import Source
from pipeline.machine.stage import Context, Parameters
from pipeline.recording.input_file import InputFile, content_key, input_file
from stages.calibrate.boards.detect import LEAST_CORNERS, Board, Charuco, detect, shows_whole
from stages.calibrate.boards.kinds import pattern_seen

Image = NDArray[np.uint8]
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".webp")
_NAME = "boards"
_FIRST = 3
"""Pictures looked at for another pattern than the one stated; three in about 5 s."""


@dataclass(frozen=True)
class Pictures:
    """Picture files as they were when the command started."""

    files: tuple[InputFile, ...]

    def source(self) -> Source:
        """Return the pictures as a source of a job; their names stand in the results and count too."""
        names = "\0".join(file.path.name for file in self.files)
        key = hashlib.sha256(f"{content_key(self.files)} {names}".encode()).hexdigest()
        return Source(Pictures, self, key, self.refuse_changed)

    def refuse_changed(self) -> None:
        """Raise `InputError` when a file is no longer what it was."""
        for file in self.files:
            file.refuse_changed()


@dataclass(frozen=True)
class Target:
    """The board that the pictures show."""

    board: Board


@dataclass(frozen=True)
class FoundBoards:
    """What was found in the pictures.

    Attributes
    ----------
    views : tuple of BoardView
        Of the pictures with a board.
    image_size : (int, int)
        Width and height of every picture, px.
    rejected : tuple of (str, str)
        Names of the pictures without a board, with the reason.
    """

    views: tuple[BoardView, ...]
    image_size: tuple[int, int]
    rejected: tuple[tuple[str, str], ...]


def list_pictures(paths: Sequence[Path]) -> Pictures:
    """Return the picture files named, and those in the folders named, in the order of their names.

    Raises
    ------
    InputError
        When a path does not exist, or there is no picture at all.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            found += sorted(p for p in path.iterdir() if p.suffix.lower() in SUFFIXES)
        elif path.is_file():
            found.append(path)
        else:
            raise InputError(path, "does not exist", expected="a picture or a folder of pictures")
    if not found:
        raise InputError(
            paths[0], "holds no picture", expected=f"files named {', '.join('*' + s for s in SUFFIXES)}"
        )
    return Pictures(tuple(input_file(file) for file in dict.fromkeys(found)))


def find_boards(
    pictures: Pictures, target: Target, *, parameters: Parameters, context: Context
) -> FoundBoards:
    """Find the board in every picture.

    Raises
    ------
    InputError
        When no file is a picture, or two pictures differ in size.
    UnusableError
        When the board is in none of them.
    """
    files, board = [file.path for file in pictures.files], target.board
    refuse_another_pattern(files, board)
    views: list[BoardView] = []
    rejected: list[tuple[str, str]] = []
    sizes: dict[tuple[int, int], Path] = {}
    with ThreadPoolExecutor(context.workers) as pool:
        looks = pool.map(lambda file: _look(file, board), files)
        for done, (file, (size, view)) in enumerate(zip(files, looks, strict=True), start=1):
            context.progress(done, len(files))
            if size is None:
                rejected.append((file.name, "not a picture that can be read"))
                continue
            sizes.setdefault(size, file)
            if view is None:
                rejected.append((file.name, f"fewer than {LEAST_CORNERS} corners of the board found"))
            else:
                views.append(view)
    context.report("rejected: pictures without the board", len(rejected), "pictures")
    return FoundBoards(tuple(views), _only_size(sizes, files, views, board), tuple(rejected))


def refuse_another_pattern(files: Sequence[Path], board: Board) -> None:
    """Raise `UnusableError` where the first pictures show another pattern than the board that was stated.

    A whole search takes seconds a picture; this one looks at the first pictures, until one shows the board.
    """
    for file in files[:_FIRST]:
        image = read_picture(file)
        if image is None or shows_whole(image, board):
            return
        seen = pattern_seen(image, board)
        if seen is not None:
            pattern, hint = seen
            stated = f"{board.columns} × {board.rows}"
            raise UnusableError(_NAME, f"{file.name} shows {pattern}, not the board of {stated}", hint=hint)


def read_picture(file: Path) -> Image | None:
    """Return a picture (H, W, 3), BGR; None where the file is none.

    Raises
    ------
    InputError
        When the file cannot be read.
    """
    with disk_errors_named(file):
        image = cv2.imdecode(np.fromfile(file, np.uint8), cv2.IMREAD_COLOR) if file.stat().st_size else None
    return None if image is None else np.asarray(image, np.uint8)


def _look(file: Path, board: Board) -> tuple[tuple[int, int] | None, BoardView | None]:
    image = read_picture(file)
    if image is None:
        return None, None
    return (image.shape[1], image.shape[0]), detect(image, board, file.name)


def _only_size(
    sizes: dict[tuple[int, int], Path], files: Sequence[Path], views: Iterable[BoardView], board: Board
) -> tuple[int, int]:
    if not sizes:
        raise InputError(files[0], "is not a picture that can be read, and no other file is")
    if len(sizes) > 1:
        (first, one), (second, other) = list(sizes.items())[:2]
        raise InputError(
            other,
            f"is {second[0]} × {second[1]} px, while {one.name} is {first[0]} × {first[1]} px",
            expected="pictures of one camera in one resolution",
        )
    if not views:
        counted = "squares" if isinstance(board, Charuco) else "inner corners, one fewer than squares"
        raise UnusableError(
            _NAME,
            f"no board of {board.columns} × {board.rows} was found in {len(files)} pictures",
            hint=f"check --columns and --rows: they count {counted}",
        )
    return next(iter(sizes))
