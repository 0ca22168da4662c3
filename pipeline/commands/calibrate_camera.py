"""``boresight calibrate-camera``: a camera from pictures of a chessboard or ChArUco board."""

from __future__ import annotations

import difflib
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from pipeline.errors import InputError, UnusableError
from pipeline.files.disk import disk_errors_named, require_writable, written_together
from pipeline.files.provenance import MadeBy
from pipeline.instrument.camera.calibration import BoardView, CalibrationReport
from pipeline.instrument.camera.formats import WRITTEN, read_camera, write_camera
from pipeline.machine.stage import quiet_context
from pipeline.recording.input_file import content_key, input_file
from stages.calibrate.boards.calibrate import calibrate_boards
from stages.calibrate.boards.detect import LEAST_CORNERS, detect
from stages.calibrate.boards.fit import NAME
from stages.calibrate.boards.parameters import MODEL_NAMES, BoardCalibrationParameters
from stages.calibrate.boards.targets import Board, Charuco, Chessboard

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".webp")


class BoardKind(StrEnum):
    """Kinds of boards."""

    CHESSBOARD = "chessboard"
    CHARUCO = "charuco"


class ModelChoice(StrEnum):
    """Camera models, or all of them against each other."""

    BEST = "best"
    KANNALA_BRANDT = "kannala_brandt"
    SCARAMUZZA = "scaramuzza"
    UNIFIED = "unified"
    EQUIDISTANT = "equidistant"
    PINHOLE = "pinhole"


class BoardShape(StrEnum):
    """What the board is taken for."""

    BEST = "best"
    FLAT = "flat"
    BENT = "bent"
    SURVEYED = "surveyed"


def calibrate_camera(
    images: Annotated[list[Path], typer.Argument(help="pictures of the board, or folders of them")],
    columns: Annotated[
        int, typer.Option(min=3, max=100, help="chessboard: inner corners along a row; charuco: squares")
    ],
    rows: Annotated[
        int, typer.Option(min=3, max=100, help="chessboard: inner corners along a column; charuco: squares")
    ],
    square_mm: Annotated[float, typer.Option(min=0.01, help="edge of a square, mm")],
    board: Annotated[BoardKind, typer.Option(help="kind of board")] = BoardKind.CHESSBOARD,
    marker_mm: Annotated[float | None, typer.Option(min=0.01, help="charuco: edge of a marker, mm")] = None,
    dictionary: Annotated[str, typer.Option(help="charuco: OpenCV's marker dictionary")] = "DICT_5X5_100",
    model: Annotated[
        ModelChoice, typer.Option(help="camera model; best: the one that predicts held-out pictures best")
    ] = ModelChoice.BEST,
    board_shape: Annotated[
        BoardShape,
        typer.Option(
            help="take the board for flat, estimate its sag, or where each corner is; best: the better"
        ),
    ] = BoardShape.BEST,
    folds: Annotated[int, typer.Option(min=2, max=50, help="parts for held-out reprojection")] = 5,
    compare: Annotated[
        Path | None, typer.Option(help="camera file of any known format to compare the result with")
    ] = None,
    file_format: Annotated[
        str | None, typer.Option("--format", help=f"also write the camera as {', '.join(WRITTEN)}")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="folder for the results")] = Path(
        "camera-calibration"
    ),
) -> None:
    """Calibrate a camera from pictures of a chessboard or ChArUco board.

    Writes camera.yaml (the camera section of a probe.yaml), calibration.json and calibration.html.
    """
    target = describe_board(board, columns, rows, square_mm, marker_mm, dictionary)
    reference = None if compare is None else read_camera(compare)
    parameters = BoardCalibrationParameters(board_shape=board_shape.value, folds=folds)
    models = MODEL_NAMES if model is ModelChoice.BEST else [m for m in MODEL_NAMES if m == model.value]
    console = Console(stderr=True)
    files = list_images(images)
    pictures = [input_file(file) for file in files]
    require_writable(output)
    made_by = MadeBy(
        "calibrate-camera", {"pictures": content_key(pictures)}, parameters.model_dump(mode="json")
    )
    views, image_size, rejected = find_boards(files, target, console)
    with console.status("fitting"):
        report = calibrate_boards(views, image_size, models, reference, parameters, quiet_context())
    report = report.with_rejected(rejected)
    for picture in pictures:
        picture.refuse_changed()
    # matplotlib takes a second to load, for which a refusal need not wait
    from pipeline.commands.calibrate_camera_report import write_report

    with written_together(output, last="camera.yaml") as folder:
        write_camera(report.calibration.camera, folder / "camera.yaml", "boresight")
        write_report(report, "" if compare is None else compare.name, made_by, folder)
        if file_format is not None:
            write_camera(report.calibration.camera, folder / f"camera-{file_format}.txt", file_format)
    _show(report, output, console)


def describe_board(
    kind: BoardKind, columns: int, rows: int, square_mm: float, marker_mm: float | None, dictionary: str
) -> Board:
    """Return the board that the options describe.

    Raises
    ------
    InputError
        For a ChArUco board without marker size, with one that does not fit, or of an unknown dictionary.
    """
    if kind is BoardKind.CHESSBOARD:
        return Chessboard(columns, rows, square_mm)
    if marker_mm is None or not marker_mm < square_mm:
        problem = "is missing" if marker_mm is None else f"is {marker_mm:g} mm"
        raise InputError(
            "--marker-mm", problem, expected=f"an edge smaller than the square's {square_mm:g} mm"
        )
    known = [name for name in dir(cv2.aruco) if name.startswith("DICT_")]
    if dictionary not in known:
        near = difflib.get_close_matches(dictionary.upper(), known, 1)
        hint = f"did you mean {near[0]}?" if near else ""
        raise InputError(
            "--dictionary", f"OpenCV has no dictionary {dictionary!r}", expected=", ".join(known), hint=hint
        )
    board = Charuco(columns, rows, square_mm, marker_mm, dictionary)
    if not board.fits_dictionary():
        raise InputError(
            "--dictionary", f"{dictionary} has too few markers for a board of {columns} × {rows} squares"
        )
    return board


def list_images(paths: Sequence[Path]) -> list[Path]:
    """Return the image files named, and those in the folders named, in the order of their names.

    Raises
    ------
    InputError
        When a path does not exist, or there is no image at all.
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
    return list(dict.fromkeys(found))


def find_boards(
    files: Sequence[Path], board: Board, console: Console
) -> tuple[list[BoardView], tuple[int, int], list[tuple[str, str]]]:
    """Return the board views of pictures, the pictures' size, and the pictures without one, with reasons.

    Raises
    ------
    InputError
        When no file is a picture, or two pictures differ in size.
    UnusableError
        When the board is in none of them.
    """
    views: list[BoardView] = []
    rejected: list[tuple[str, str]] = []
    sizes: dict[tuple[int, int], Path] = {}
    with Progress(console=console, transient=True) as progress, ThreadPoolExecutor(_workers()) as pool:
        task = progress.add_task("looking for the board", total=len(files))
        for file, (size, view) in zip(files, pool.map(lambda f: _look(f, board), files), strict=True):
            progress.advance(task)
            if size is None:
                rejected.append((file.name, "not a picture that can be read"))
                continue
            sizes.setdefault(size, file)
            if view is None:
                rejected.append((file.name, f"fewer than {LEAST_CORNERS} corners of the board found"))
            else:
                views.append(view)
    return views, _only_size(sizes, files, views, board), rejected


def _look(file: Path, board: Board) -> tuple[tuple[int, int] | None, BoardView | None]:
    with disk_errors_named(file):
        image = cv2.imdecode(np.fromfile(file, np.uint8), cv2.IMREAD_COLOR) if file.stat().st_size else None
    if image is None:
        return None, None
    return (image.shape[1], image.shape[0]), detect(np.asarray(image, np.uint8), board, file.name)


def _only_size(
    sizes: dict[tuple[int, int], Path], files: Sequence[Path], views: Sequence[BoardView], board: Board
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
            NAME,
            f"no board of {board.columns} × {board.rows} was found in {len(files)} pictures",
            hint=f"check --columns and --rows: they count {counted}",
        )
    return next(iter(sizes))


def _workers() -> int:
    return max(os.cpu_count() or 1, 1)


def _show(report: CalibrationReport, output: Path, console: Console) -> None:
    table = Table(title="Camera models, best first")
    for heading in ("model", "parameters", "rms px", "held out px", ""):
        table.add_column(heading)
    for s in sorted(report.scores, key=lambda s: np.nan_to_num(s.held_out_rms_px, nan=np.inf)):
        numbers = (
            ("", "", "") if s.refusal else (str(s.parameters), f"{s.rms_px:.3f}", f"{s.held_out_rms_px:.3f}")
        )
        table.add_row(s.model, *numbers, s.refusal)
    console.print(table)
    for name, reason in report.rejected:
        console.print(f"not used: {name}: {reason}")
    used = len(report.calibration.names)
    console.print(f"{report.calibration.camera.model} from {used} pictures: {output / 'calibration.html'}")
