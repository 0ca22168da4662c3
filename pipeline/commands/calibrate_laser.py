"""``boresight calibrate-laser``: the laser plane from pictures of a board with the laser line across it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from pipeline.commands.calibrate_camera import BoardKind, describe_board, find_boards, list_images
from pipeline.errors import InputError
from pipeline.files.disk import disk_errors_named, require_writable, written_together
from pipeline.files.provenance import MadeBy
from pipeline.instrument.camera.base import Camera
from pipeline.instrument.camera.calibration import BoardView
from pipeline.instrument.camera.formats import read_camera
from pipeline.instrument.laser import LaserPlane, LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe, write_probe
from pipeline.machine.stage import quiet_context
from pipeline.recording.input_file import content_key, input_file
from stages.calibrate.laser.calibrate import LaserCalibration, LaserPicture, calibrate_laser_plane
from stages.calibrate.laser.parameters import LaserPlaneParameters


def calibrate_laser(
    images: Annotated[list[Path], typer.Argument(help="pictures of the lit board and line, or folders")],
    camera: Annotated[Path, typer.Option(metavar="FILE", help="camera file of any known format")],
    columns: Annotated[
        int, typer.Option(min=3, max=100, help="chessboard: inner corners along a row; charuco: squares")
    ],
    rows: Annotated[
        int, typer.Option(min=3, max=100, help="chessboard: inner corners along a column; charuco: squares")
    ],
    square_mm: Annotated[float, typer.Option(min=0.01, help="edge of a square, mm")],
    wavelength_nm: Annotated[
        float, typer.Option(min=380, max=750, help="wavelength of the laser, nm")
    ] = 520.0,
    margin_squares: Annotated[
        float, typer.Option(min=0, max=50, help="how far the plane goes on beyond the outermost corners")
    ] = 1.0,
    board: Annotated[BoardKind, typer.Option(help="kind of board")] = BoardKind.CHESSBOARD,
    marker_mm: Annotated[float | None, typer.Option(min=0.01, help="charuco: edge of a marker, mm")] = None,
    dictionary: Annotated[str, typer.Option(help="charuco: OpenCV's marker dictionary")] = "DICT_5X5_100",
    probe: Annotated[
        Path | None, typer.Option(metavar="FILE", help="probe file to write again with camera and plane")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="folder for the results")] = (
        Path("laser-calibration")
    ),
) -> None:
    """Find the laser plane from pictures of a board with the laser line across it.

    Writes laser.json and, with --probe, the probe with the given camera and the plane found as its sheet.
    """
    target = describe_board(board, columns, rows, square_mm, marker_mm, dictionary)
    camera_file = input_file(camera)
    model = read_camera(camera)
    stated = None if probe is None else read_probe(probe)
    parameters = LaserPlaneParameters(wavelength_nm=wavelength_nm, margin_squares=margin_squares)
    console = Console(stderr=True)
    files = list_images(images)
    pictures = [input_file(file) for file in files]
    require_writable(output)
    views, image_size, without_board = find_boards(files, target, console)
    _refuse_other_size(image_size, model, camera)
    with console.status("measuring lines"):
        result = calibrate_laser_plane(_pictures(files, views), model, parameters, quiet_context())
    result = replace(result, rejected=(*without_board, *result.rejected))
    refined = None if stated is None else with_plane(stated, model, result.plane, wavelength_nm)
    for file in (*pictures, camera_file):
        file.refuse_changed()
    inputs = {"pictures": content_key(pictures), "camera": content_key((camera_file,))}
    made_by = MadeBy("calibrate-laser", inputs, parameters.model_dump(mode="json"))
    document = description(result) | {"made_by": made_by.document()}
    with written_together(output, last="laser.json") as folder:
        (folder / "laser.json").write_text(json.dumps(document, indent=1) + "\n", "utf-8")
        if refined is not None:
            write_probe(refined, folder / "probe.yaml", made_by)
    _show(result, output, console)


def with_plane(stated: Probe, camera: Camera, plane: LaserPlane, wavelength_nm: float) -> Probe:
    """Return the probe with another camera, taken as exact, and a plane as its sheet.

    Raises
    ------
    UnusableError
        When the plane is none that surrounds the axis of a ring probe.
    """
    sheet = plane.sheet(stated.laser.line_sigma_mm, wavelength_nm)
    names = (*camera.parameter_names, *LaserSheet.PARAMETER_NAMES)
    place = [names.index(n) for n in ("baseline_mm", "tilt_x", "tilt_y")]
    covariance = np.zeros((len(names), len(names)))
    covariance[np.ix_(place, place)] = plane.sheet_covariance()
    return replace(stated, camera=camera, laser=sheet, covariance=covariance)


def description(result: LaserCalibration) -> dict[str, object]:
    """Return the calibration as it stands in laser.json: mm and px, the plane n · x = d in C."""
    plane = result.plane
    pictures = [
        {
            "name": line.name,
            "points": len(line.xyz_c),
            "pose_rms_px": line.pose_rms_px,
            "mean_distance_mm": float(plane.distances(line.xyz_c).mean()),
            "rms_distance_mm": float(np.sqrt(np.mean(plane.distances(line.xyz_c) ** 2))),
        }
        for line in result.lines
    ]
    return {
        "normal_c": plane.normal_c.tolist(),
        "distance_mm": plane.distance_mm,
        "covariance": plane.covariance.tolist(),
        "rms_mm": plane.rms_mm,
        "points": plane.points,
        "pictures": pictures,
        "rejected": [{"name": name, "reason": reason} for name, reason in result.rejected],
    }


def _refuse_other_size(image_size: tuple[int, int], camera: Camera, file: Path) -> None:
    if image_size != camera.image_size:
        raise InputError(
            file,
            f"is a camera of {camera.image_size[0]} × {camera.image_size[1]} px",
            expected=f"one of {image_size[0]} × {image_size[1]} px, as the pictures are",
        )


def _pictures(files: Sequence[Path], views: Sequence[BoardView]) -> list[LaserPicture]:
    by_name = {file.name: file for file in files}
    if len(by_name) < len(files):
        raise InputError(files[0].parent, "two pictures have the same name", hint="rename one of them")
    return [LaserPicture(_read(by_name[view.name]), view) for view in views]


def _read(file: Path) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    with disk_errors_named(file):
        return np.asarray(cv2.imdecode(np.fromfile(file, np.uint8), cv2.IMREAD_COLOR), np.uint8)


def _show(result: LaserCalibration, output: Path, console: Console) -> None:
    table = Table(title="Laser line on the boards")
    for heading in ("picture", "points", "mean mm", "rms mm"):
        table.add_column(heading)
    for line in result.lines:
        distance = result.plane.distances(line.xyz_c)
        rms_mm = float(np.sqrt(np.mean(distance**2)))
        table.add_row(line.name, str(len(distance)), f"{distance.mean():+.3f}", f"{rms_mm:.3f}")
    console.print(table)
    for name, reason in result.rejected:
        console.print(f"not used: {name}: {reason}", highlight=False)
    plane = result.plane
    n, sigma_deg = plane.normal_c, np.rad2deg(plane.tilt_sigma_rad)
    console.print(
        f"n = ({n[0]:.4f}, {n[1]:.4f}, {n[2]:.4f}), d = {plane.distance_mm:.3f} mm, "
        f"rms {plane.rms_mm:.3f} mm, direction to {sigma_deg:.3f}° (1 σ)\nPlane: {output / 'laser.json'}",
        highlight=False,
    )
