"""``boresight calibrate-camera``: a camera from pictures of a chessboard or ChArUco board."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from pipeline.api.job import Job, result_of, run_shown, value_source
from pipeline.commands import (
    Assignments,
    BoardColumns,
    BoardRows,
    ConfigFile,
    MarkerDictionary,
    MarkerEdge,
    ResultFolder,
    SquareEdge,
)
from pipeline.errors import InputError
from pipeline.files.disk import require_writable
from pipeline.files.provenance import MadeBy
from pipeline.instrument.camera.calibration import CalibrationReport
from pipeline.instrument.camera.formats import WRITTEN, read_camera, write_camera
from pipeline.machine.configuration import resolve
from pipeline.machine.run_folder import Exporter
from stages.calibrate.boards import BOARDS, CAMERA, CameraFile, Target, list_pictures
from stages.calibrate.boards.detect import Board, Charuco, Chessboard


class BoardKind(StrEnum):
    """Kinds of boards."""

    CHESSBOARD = "chessboard"
    CHARUCO = "charuco"


class ModelChoice(StrEnum):
    """Camera models, or a comparison of all of them."""

    BEST = "best"
    KANNALA_BRANDT = "kannala_brandt"
    SCARAMUZZA = "scaramuzza"
    UNIFIED = "unified"
    EQUIDISTANT = "equidistant"
    PINHOLE = "pinhole"


class BoardShape(StrEnum):
    """The shape that the board is assumed to have."""

    BEST = "best"
    FLAT = "flat"
    BENT = "bent"
    SURVEYED = "surveyed"


def calibrate_camera(
    images: Annotated[list[Path], typer.Argument(help="pictures of the board, or folders of them")],
    columns: BoardColumns,
    rows: BoardRows,
    square_mm: SquareEdge,
    board: Annotated[BoardKind, typer.Option(help="kind of board")] = BoardKind.CHESSBOARD,
    marker_mm: MarkerEdge = None,
    dictionary: MarkerDictionary = "DICT_5X5_100",
    model: Annotated[
        ModelChoice | None,
        typer.Option(help="camera model; best: the one that predicts held-out pictures best"),
    ] = None,
    board_shape: Annotated[
        BoardShape | None,
        typer.Option(
            help="take the board as flat, estimate its sag, or estimate every corner; "
            "best: the better of the last two"
        ),
    ] = None,
    folds: Annotated[int | None, typer.Option(min=2, max=50, help="parts for held-out reprojection")] = None,
    compare: Annotated[
        Path | None, typer.Option(help="camera file of any known format to compare the result with")
    ] = None,
    file_format: Annotated[
        str | None, typer.Option("--format", help=f"also write the camera as {', '.join(WRITTEN)}")
    ] = None,
    output: ResultFolder = Path("camera-calibration"),
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Calibrate a camera from pictures of a chessboard or ChArUco board.

    Writes camera.yaml (the camera section of a probe.yaml), calibration.json and calibration.html.
    """
    given = (("model", model), ("board_shape", board_shape), ("folds", folds))
    chosen = [f"camera.{name}={value}" for name, value in given if value is not None]
    configuration = resolve(STAGES, config, [*chosen, *(assignments or ())])
    target = Target(describe_board(board, columns, rows, square_mm, marker_mm, dictionary))
    reference = CameraFile() if compare is None else CameraFile(read_camera(compare), compare.name)
    wanted = WantedFormat(file_format or "")
    sources = (list_pictures(images).source(), *(value_source(v) for v in (target, reference, wanted)))
    require_writable(output)
    job = Job("calibrate-camera", sources, STAGES, EXPORTERS, configuration, output)
    console = Console(stderr=True)
    run_shown(job, console)
    _show(result_of(job, CalibrationReport), output, console)


@dataclass(frozen=True)
class WantedFormat:
    """The format in which the camera is written in addition to camera.yaml; empty for none."""

    name: str


def write_calibration(
    report: CalibrationReport, reference: CameraFile, wanted: WantedFormat, made_by: MadeBy, folder: Path
) -> None:
    """Write camera.yaml, calibration.json, calibration.html, and the camera in the format wanted."""
    # matplotlib takes a second to load, for which a refusal need not wait
    from pipeline.commands.calibrate_camera_report import write_report

    camera = report.calibration.camera
    write_camera(camera, folder / "camera.yaml", "boresight")
    write_report(report, reference.name, made_by, folder)
    if wanted.name:
        write_camera(camera, folder / f"camera-{wanted.name}.txt", wanted.name)


STAGES = (BOARDS, CAMERA)
EXPORTERS = (Exporter("camera", write_calibration),)


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
