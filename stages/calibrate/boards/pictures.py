"""Pictures of a board: their files, the board's corners in them, and refusal of another pattern."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from pipeline.arrays import Image
from pipeline.errors import InputError, UnusableError
from pipeline.files.disk import InputFile, content_key, disk_errors_named, input_file
from pipeline.instrument.camera.calibration import BoardView
from pipeline.machine.plan import Source
from pipeline.machine.stage import Context, Parameters
from stages.calibrate.boards.detect import (
    LEAST_CORNERS,
    Board,
    Charuco,
    detect,
    grey_of,
    largest_grid,
    shows_whole,
)

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".webp")
_NAME = "boards"
_FIRST = 3
"""Pictures searched for another pattern than the stated one; three take about 5 s."""


@dataclass(frozen=True)
class Pictures:
    """Picture files as they were when the command started."""

    files: tuple[InputFile, ...]

    def source(self) -> Source:
        """Return the pictures as a source of a job; their names count in the key, since results name them."""
        names = "\0".join(file.path.name for file in self.files)
        key = hashlib.sha256(f"{content_key(self.files)} {names}".encode()).hexdigest()
        return Source(Pictures, self, key, self.refuse_changed)

    def refuse_changed(self) -> None:
        """Raise `InputError` when a file has changed."""
        for file in self.files:
            file.refuse_changed()


@dataclass(frozen=True)
class Target:
    """The board that the pictures show."""

    board: Board


@dataclass(frozen=True)
class FoundBoards:
    """The boards found in the pictures.

    Attributes
    ----------
    views : tuple of BoardView
        Corners in each picture with a board.
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


_LEAST_MARKERS = 4
"""Fewest markers of one dictionary that count as a pattern: the detector sees single ones in noise."""
_TAGS = ("DICT_APRILTAG_36h11", "DICT_APRILTAG_25h9", "DICT_APRILTAG_16h5")
_MARKERS = ("DICT_4X4_1000", "DICT_5X5_1000", "DICT_6X6_1000", "DICT_7X7_1000", "DICT_ARUCO_ORIGINAL")
_LEAST_SIDE = 5
"""Fewest inner corners a side of a chessboard of another size: the detector sees 4 × 4 in noise."""
_CIRCLES = {
    "a grid of circles": cv2.CALIB_CB_SYMMETRIC_GRID,
    "a staggered grid of circles": cv2.CALIB_CB_ASYMMETRIC_GRID,
}
_UNSUPPORTED = "boresight calibrates from chessboards and ChArUco boards; print one of these"


def pattern_seen(image: Image, stated: Board) -> tuple[str, str] | None:
    """Return which other pattern a picture shows, and what to do; None where none is recognised.

    ``image`` is (H, W) grey or (H, W, 3) BGR. AprilTags, ArUco markers and circle grids take a tenth of a
    second in 2 megapixels, a chessboard of another size half a second.
    """
    grey = grey_of(image)
    return _of_markers(grey, stated) or _of_circles(grey, stated) or _of_squares(grey, stated)


def _of_markers(grey: Image, stated: Board) -> tuple[str, str] | None:
    counts = {name: _markers(grey, name) for name in (*_TAGS, *_MARKERS)}
    name = max(counts, key=lambda n: counts[n])
    if counts[name] < _LEAST_MARKERS:
        return None
    seen = f"{counts[name]} markers of {name}"
    if name in _TAGS:
        return f"{seen}, as on an AprilGrid", _UNSUPPORTED
    if isinstance(stated, Charuco):
        return seen, f"check --dictionary, --columns and --rows: {stated.dictionary} was stated"
    return f"{seen}, as on a ChArUco board", "state --board charuco, --marker-mm and --dictionary"


def _markers(grey: Image, dictionary: str) -> int:
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    ids = cv2.aruco.ArucoDetector(known).detectMarkers(grey)[1]
    return 0 if ids is None else len(np.unique(ids))


def _of_circles(grey: Image, stated: Board) -> tuple[str, str] | None:
    for name, flags in _CIRCLES.items():
        if cv2.findCirclesGrid(grey, (stated.columns, stated.rows), flags=flags)[0]:
            return f"{name}, {stated.columns} × {stated.rows}", _UNSUPPORTED
    return None


def _of_squares(grey: Image, stated: Board) -> tuple[str, str] | None:
    corners = largest_grid(grey)
    if corners is None:
        return None
    short, long = sorted(corners.shape[:2])
    if short < _LEAST_SIDE:
        return None
    seen = f"a chessboard of {long} × {short} inner corners"
    if isinstance(stated, Charuco):
        return seen, "state --board chessboard, and --columns and --rows as inner corners"
    least, most = sorted((stated.rows, stated.columns))
    hint = "check --columns and --rows: they count inner corners, one fewer than squares"
    return None if short <= least and long <= most else (seen, hint)


def refuse_another_pattern(files: Sequence[Path], board: Board) -> None:
    """Raise `UnusableError` where the first pictures show another pattern than the board that was stated.

    A full search takes seconds per picture, so only the first `_FIRST` pictures are examined, until one of
    them shows the board.
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
    """Return a picture (H, W, 3), BGR; None where the file is not a picture.

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
