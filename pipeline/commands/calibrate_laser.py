"""``boresight calibrate-laser``: the laser plane from pictures of a board with the laser line across it."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from pipeline.adjustment.robust import root_mean_square
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
from pipeline.commands.calibrate_camera import BoardKind, describe_board
from pipeline.files.disk import input_file, require_writable
from pipeline.files.provenance import MadeBy
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.formats import read_camera
from pipeline.instrument.laser import LaserPlane, LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe, write_probe
from pipeline.machine.configuration import resolve
from pipeline.machine.run_folder import Exporter
from stages.calibrate.boards import BOARDS, CameraFile, Target, list_pictures
from stages.calibrate.laser import LASER_PLANE, LaserCalibration


def calibrate_laser(
    images: Annotated[list[Path], typer.Argument(help="pictures of the lit board and line, or folders")],
    camera: Annotated[Path, typer.Option(metavar="FILE", help="camera file of any known format")],
    columns: BoardColumns,
    rows: BoardRows,
    square_mm: SquareEdge,
    wavelength_nm: Annotated[
        float | None, typer.Option(min=380, max=750, help="wavelength of the laser, nm (default: 520)")
    ] = None,
    margin_squares: Annotated[
        float | None,
        typer.Option(
            min=0,
            max=50,
            help="how far the board stays flat beyond its outermost corners, squares (default: 1)",
        ),
    ] = None,
    board: Annotated[BoardKind, typer.Option(help="kind of board")] = BoardKind.CHESSBOARD,
    marker_mm: MarkerEdge = None,
    dictionary: MarkerDictionary = "DICT_5X5_100",
    probe: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="probe file: a copy with this camera and plane is written"),
    ] = None,
    output: ResultFolder = (Path("laser-calibration")),
    config: ConfigFile = None,
    assignments: Assignments = None,
) -> None:
    """Find the laser plane from pictures of a board with the laser line across it.

    Writes laser.json and, with --probe, the probe with the given camera and the plane found as its sheet.
    """
    given = (("wavelength_nm", wavelength_nm), ("margin_squares", margin_squares))
    chosen = [f"laser_plane.{name}={value}" for name, value in given if value is not None]
    configuration = resolve(STAGES, config, [*chosen, *(assignments or ())])
    target = Target(describe_board(board, columns, rows, square_mm, marker_mm, dictionary))
    camera_file = input_file(camera)
    known = CameraFile(read_camera(camera), camera.name)
    stated = StatedProbe(read_probe(probe) if probe is not None else None)
    of_camera = replace(value_source(known), refuse_changed=camera_file.refuse_changed)
    sources = (list_pictures(images).source(), of_camera, value_source(target), value_source(stated))
    require_writable(output)
    job = Job("calibrate-laser", sources, STAGES, EXPORTERS, configuration, output)
    console = Console(stderr=True)
    run_shown(job, console)
    _show(result_of(job, LaserCalibration), output, console)


@dataclass(frozen=True)
class StatedProbe:
    """The probe to be written with the new plane; None without one."""

    probe: Probe | None


def write_plane(
    result: LaserCalibration, known: CameraFile, stated: StatedProbe, made_by: MadeBy, folder: Path
) -> None:
    """Write laser.json, and probe.yaml where a probe was given."""
    document = description(result) | {"made_by": made_by.document()}
    (folder / "laser.json").write_text(json.dumps(document, indent=1) + "\n", "utf-8")
    if stated.probe is not None and known.camera is not None:
        refined = with_plane(stated.probe, known.camera, result.plane, result.wavelength_nm)
        write_probe(refined, folder / "probe.yaml", made_by)


STAGES = (BOARDS, LASER_PLANE)
EXPORTERS = (Exporter("laser", write_plane),)


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
    """Return the content of laser.json: mm and px, the plane n · x = d in C."""
    plane = result.plane
    pictures = [
        {
            "name": line.name,
            "points": len(line.xyz_c),
            "pose_rms_px": line.pose_rms_px,
            "mean_distance_mm": float(plane.distances(line.xyz_c).mean()),
            "rms_distance_mm": root_mean_square(plane.distances(line.xyz_c)),
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


def _show(result: LaserCalibration, output: Path, console: Console) -> None:
    table = Table(title="Laser line on the boards")
    for heading in ("picture", "points", "mean mm", "rms mm"):
        table.add_column(heading)
    for line in result.lines:
        distance = result.plane.distances(line.xyz_c)
        rms_mm = root_mean_square(distance)
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
