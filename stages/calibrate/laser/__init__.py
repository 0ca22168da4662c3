"""Calibrates the laser plane from boards with the laser line across them: board pose, line, plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float, Image
from pipeline.errors import InputError, UnusableError
from pipeline.geometry.rigid import transform
from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.calibration import BoardView, rms
from pipeline.instrument.laser import NAME, LaserPlane
from pipeline.machine.stage import Context, Stage
from stages.calibrate.boards import CameraFile, FoundBoards, Pictures
from stages.calibrate.boards.bundle import POSES_ONLY, Corners, Estimate, pose_covariances, solve
from stages.calibrate.boards.pictures import read_picture
from stages.calibrate.boards.start import pose
from stages.calibrate.laser.line import LaserPlaneParameters, measure_line, patch_around
from stages.calibrate.laser.plane import BoardErrors, fit_plane_robustly
from stages.rings.mixture import excess_weights
from stages.rings.picture import Mixture

__all__ = ["LASER_PLANE", "LaserCalibration"]


@dataclass(frozen=True)
class LaserPicture:
    """A colour picture (H, W, 3), BGR, of a board crossed by the laser line, and the board found in it."""

    image: Image
    view: BoardView


@dataclass(frozen=True)
class BoardLine:
    """The laser line on one board.

    Attributes
    ----------
    name : str
        Name of the picture.
    T_cb : (4, 4)
        Transform from board to camera, mm.
    pose_covariance : (6, 6)
        Covariance of its rotation vector, rad, and translation, mm, in C, from the scatter of the corners.
    pose_rms_px : float
        Root mean square distance of the board's corners from their projection.
    xyz_c : (N, 3)
        Points of the line, mm in C; N is 0 where no line is seen.
    """

    name: str
    T_cb: Float
    pose_covariance: Float
    pose_rms_px: float
    xyz_c: Float


@dataclass(frozen=True)
class LaserCalibration:
    """A laser plane, the lines it was fitted to, the pictures not used with reasons, and the wavelength."""

    plane: LaserPlane
    lines: tuple[BoardLine, ...]
    rejected: tuple[tuple[str, str], ...]
    wavelength_nm: float = 520.0


def calibrate_laser(
    pictures: Pictures,
    found: FoundBoards,
    camera: CameraFile,
    *,
    parameters: LaserPlaneParameters,
    context: Context,
) -> LaserCalibration:
    """Find the laser plane in pictures of boards: see `calibrate_laser_plane`.

    Raises
    ------
    InputError
        When the camera's images have another size than the pictures, or two pictures have the same name.
    """
    known = camera.camera
    if known is None or found.image_size != known.image_size:
        stated = "no camera" if known is None else f"a camera of {_size(known.image_size)} px"
        raise InputError(
            camera.name, f"is {stated}", expected=f"one of {_size(found.image_size)} px, as the pictures are"
        )
    result = calibrate_laser_plane(_lit_boards(pictures, found), known, parameters, context)
    return replace(result, rejected=(*found.rejected, *result.rejected))


def _size(size: tuple[int, int]) -> str:
    return f"{size[0]} × {size[1]}"


def _lit_boards(pictures: Pictures, found: FoundBoards) -> list[LaserPicture]:
    files = [file.path for file in pictures.files]
    by_name = {file.name: file for file in files}
    if len(by_name) < len(files):
        raise InputError(files[0].parent, "two pictures have the same name", hint="rename one of them")
    read = ((view, read_picture(by_name[view.name])) for view in found.views)
    return [LaserPicture(image, view) for view, image in read if image is not None]


def calibrate_laser_plane(
    pictures: Sequence[LaserPicture], camera: Camera, parameters: LaserPlaneParameters, context: Context
) -> LaserCalibration:
    """Return the laser plane through the lines on boards in several poses.

    Raises
    ------
    UnusableError
        When too few pictures show a line, or their lines do not span a plane.
    """
    lines, rejected = [], []
    for done, picture in enumerate(pictures, start=1):
        line = line_on_board(picture, camera, parameters)
        problem = _problem(line, parameters)
        lines += [] if problem else [line]
        rejected += [(line.name, problem)] if problem else []
        context.progress(done, len(pictures))
    context.report("rejected: pictures without a usable laser line", len(rejected), "pictures")
    _refuse_too_few(lines, rejected, parameters)
    group = np.repeat(np.arange(len(lines)), [len(line.xyz_c) for line in lines])
    xyz_c = np.concatenate([line.xyz_c for line in lines])
    _refuse_one_line(xyz_c, parameters)
    arms = np.concatenate([line.xyz_c - line.T_cb[:3, 3] for line in lines])
    boards = BoardErrors(arms, np.stack([line.pose_covariance for line in lines]))
    plane = fit_plane_robustly(xyz_c, group, boards)
    _refuse_undetermined(plane, parameters)
    return LaserCalibration(plane, tuple(lines), tuple(rejected), parameters.wavelength_nm)


def line_on_board(picture: LaserPicture, camera: Camera, parameters: LaserPlaneParameters) -> BoardLine:
    """Return the laser line where it crosses the board of one picture."""
    view = picture.view
    corners = Corners.of([view])
    first = Estimate(camera, pose(view, camera)[None], np.zeros(3))
    posed = solve(first, corners, POSES_ONLY, parameters.huber_px)
    T_cb, square_mm = posed.T_cb[0], _square_mm(view)
    patch = patch_around(view.xyz_b, view.uv, T_cb, parameters.margin_squares * square_mm)
    excess = Mixture(picture.image, excess_weights(parameters.wavelength_nm)).everywhere()
    xy_b = measure_line(excess, camera, patch, parameters)
    xyz_b = np.concatenate([xy_b, np.zeros((len(xy_b), 1))], 1)
    spread = pose_covariances(posed, corners, parameters.huber_px)[0]
    return BoardLine(view.name, T_cb, spread, rms(posed.residuals(corners)), transform(T_cb, xyz_b))


def _square_mm(view: BoardView) -> float:
    """Return the edge of a square: the shortest step between corners along x."""
    step = np.diff(np.unique(view.xyz_b[:, 0]))
    return float(step.min())


def _problem(line: BoardLine, parameters: LaserPlaneParameters) -> str:
    """Return why a line cannot be used, or nothing."""
    if not line.pose_rms_px <= parameters.largest_pose_rms_px:
        return f"the camera explains the board's corners only to {line.pose_rms_px:.2f} px"
    if len(line.xyz_c) < parameters.least_points:
        return f"the laser line is seen at {len(line.xyz_c)} places on the board"
    return ""


def _refuse_too_few(
    lines: Sequence[BoardLine], rejected: Sequence[tuple[str, str]], parameters: LaserPlaneParameters
) -> None:
    if len(lines) < parameters.least_pictures:
        reasons = "; ".join(f"{name}: {problem}" for name, problem in rejected)
        raise UnusableError(
            NAME,
            f"{len(lines)} pictures show the laser line on a board" + (f" ({reasons})" if reasons else ""),
            limit=f"at least {parameters.least_pictures}",
            hint="check the laser's wavelength and the margin; light the board so that line and squares show",
        )


def _refuse_one_line(xyz_c: Float, parameters: LaserPlaneParameters) -> None:
    """Raise when the lines nearly coincide: the plane of a board that was not moved contains them, too."""
    along, across = np.linalg.svd(xyz_c - xyz_c.mean(0), compute_uv=False)[:2] / np.sqrt(len(xyz_c))
    if not across >= parameters.least_spread * along:
        raise UnusableError(
            NAME,
            f"the laser lines nearly coincide: spread {across:.2f} mm across, {along:.1f} mm along",
            limit=f"across at least {parameters.least_spread:g} of along",
            hint="hold the board at different distances and tilts",
        )


def _refuse_undetermined(plane: LaserPlane, parameters: LaserPlaneParameters) -> None:
    sigma_deg = float(np.rad2deg(plane.tilt_sigma_rad))
    if not sigma_deg <= parameters.largest_tilt_sigma_deg:
        raise UnusableError(
            NAME,
            f"the lines leave the laser plane's direction uncertain by {sigma_deg:.2f}° (1 σ)",
            limit=f"{parameters.largest_tilt_sigma_deg:g}°",
            hint="hold the board at different distances and tilts, so that the lines are not all parallel "
            "and close together",
        )


LASER_PLANE = Stage(
    "laser_plane", "2", LaserPlaneParameters, calibrate_laser, "laser lines on boards to the laser's plane"
)
