"""The same view of a recorded frame and of the model: from one place, with one lens and one light."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from pipeline.arrays import Bool, Byte, Float, Float32, Image
from pipeline.artefacts.measured import WallTexture
from pipeline.errors import InputError
from pipeline.geometry.axis import PipeAxis, from_pipe, to_pipe
from pipeline.geometry.rigid import inverse, transform
from pipeline.recording.base import Illumination
from pipeline.review.frames import FrameFinder, UnseenError, finder_of
from pipeline.review.run_files import RunFiles

# The lamps' light is read in cells of the image about 4.5° high and 15° wide: lamps change it slowly, and
# each cell still averages some hundred pixels of a frame.
_POLAR, _AROUND = 20, 24
_LEAST_POLAR_RAD, _MOST_POLAR_RAD = 0.25, 1.75
# Rays for each cell around; lit frames that are averaged.
_CELL_POINTS = 5
_NEIGHBOURS = 4
# Grey levels of photo and frame that count: above rounding, below clipping.
_DARK, _BRIGHT = 3, 250
# Half as wide again as what the photo leaves out beside the laser's line, since brightness is smoothed here.
_LASER_BAND_MM = 1.5
# A row of the image that is darker than this share of the brightest lies beyond the lens.
_BEYOND_LENS = 0.1
_SMOOTHING_PX = 3.0
_LARGEST_PX = 2048


@dataclass(frozen=True)
class Stand:
    """Where a frame's camera stood, turned to a spot of the wall, and how bright its lamps made the photo.

    Attributes
    ----------
    frame : int
    eye_p, target_p, up_p : (3,)
        Place, spot looked at, and what is up in the picture, in P.
    R_pc : (3, 3)
        Columns are the camera's x, y and optical axis in P.
    polar_rad : (2,)
        Angles to the optical axis of the first and last row of `light`; the lens shows nothing beyond.
    light : (T, A)
        Recorded grey level divided by that of the evenly lit photo. Rows are angles to the optical axis;
        columns are azimuths about it, evenly spaced, the first half a cell after −π.
    """

    frame: int
    eye_p: Float
    target_p: Float
    up_p: Float
    R_pc: Float
    polar_rad: tuple[float, float]
    light: Float


def stand_of(finder: FrameFinder, photo: WallTexture, frame: int, distance: float, azimuth: float) -> Stand:
    """Return where a frame's camera stood, turned to a place of the wall.

    The light comes from the lit frames next to it: of the frame itself nothing is used but its place.

    Raises
    ------
    UnseenError
        When the frame has no pose, or no lit frame stands near it.
    """
    T_pc = _pose(finder, frame)
    target_p = from_pipe(
        finder.trajectory.axis, np.array(distance), np.array(azimuth), np.array(finder.radius_mm)
    )
    up_p = _up(finder.trajectory.axis, distance)
    polar = np.linspace(_LEAST_POLAR_RAD, _MOST_POLAR_RAD, _POLAR)
    light = _light(finder, photo, frame, polar)
    last = _last_row(light)
    return Stand(
        frame, T_pc[:3, 3], target_p, up_p, T_pc[:3, :3], (float(polar[0]), float(polar[last])),
        light[: last + 1],
    )  # fmt: skip


@lru_cache(maxsize=8)
def _stand_in(files: RunFiles, _version: str, frame: int, distance: float, azimuth: float) -> Stand:
    return stand_of(finder_of(files), files.artefact(WallTexture), frame, distance, azimuth)


def stand_in(files: RunFiles, frame: int, distance: float, azimuth: float) -> Stand:
    """Return the stand of a frame of a run, kept since the page asks for it twice; raises as `stand_of`."""
    return _stand_in(files, files.version, frame, distance, azimuth)


def seen_png(finder: FrameFinder, stand: Stand, fov_rad: float, width: int, height: int) -> bytes:
    """Return `seen_from` as PNG; raises as that."""
    encoded, png = cv2.imencode(".png", seen_from(finder, stand, fov_rad, width, height))
    if not encoded:
        raise UnseenError(f"frame {stand.frame} cannot be encoded")
    return png.tobytes()


def seen_from(finder: FrameFinder, stand: Stand, fov_rad: float, width: int, height: int) -> Byte:
    """Return a frame (H, W, 4) BGRA as a pinhole camera at its stand sees it; alpha 0 beyond its lens.

    Parameters
    ----------
    finder, stand
    fov_rad : float
        Across the picture's height.
    width, height : int

    Raises
    ------
    UnseenError
        When the frame cannot be decoded.
    InputError
        When the picture is to be empty or huge.
    """
    if not (1 <= width <= _LARGEST_PX and 1 <= height <= _LARGEST_PX and 0 < fov_rad < np.pi):
        raise InputError(
            "request", f"a picture of {width} × {height}", expected=f"up to {_LARGEST_PX} each way"
        )
    ray_c = _pinhole(stand, fov_rad, width, height) @ stand.R_pc
    polar = np.arctan2(np.hypot(ray_c[..., 0], ray_c[..., 1]), ray_c[..., 2]).ravel()
    uv, valid = finder.probe.camera.project(ray_c.reshape(-1, 3))
    shown = valid & (polar <= stand.polar_rad[1])
    u, v = _on_image(uv, shown, (height, width))
    image = cv2.cvtColor(finder.image(stand.frame), cv2.COLOR_BGR2BGRA)
    return np.asarray(cv2.remap(image, u, v, cv2.INTER_LINEAR, borderValue=(0, 0, 0, 0)), np.uint8)


def _pinhole(stand: Stand, fov_rad: float, width: int, height: int) -> Float:
    """Return the rays (H, W, 3) in P of a pinhole camera that looks at the spot."""
    forward = stand.target_p - stand.eye_p
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, stand.up_p)
    right /= np.linalg.norm(right)
    half = np.tan(fov_rad / 2)
    y = half * (2 * (np.arange(height) + 0.5) / height - 1)
    x = half * (2 * (np.arange(width) + 0.5) / width - 1) * width / height
    return np.asarray(forward + x[:, None] * right + y[:, None, None] * np.cross(forward, right))


def _light(finder: FrameFinder, photo: WallTexture, frame: int, polar_rad: Float) -> Float:
    """Return recorded over photographed brightness (T, A) in cells of the image."""
    around = np.arange(_AROUND * _CELL_POINTS)
    phi = -np.pi + (around + 0.5) * 2 * np.pi / len(around)
    recorded, photographed = np.zeros((2, len(polar_rad), _AROUND))
    for number, image in _lit_beside(finder, frame):
        point_p = _wall_seen(finder, _pose(finder, number), polar_rad, phi)
        grey, is_seen = _greys(finder, number, image, point_p)
        wall, is_known = _photographed(photo, finder.trajectory.axis, point_p)
        use = is_seen & is_known & (grey < _BRIGHT) & (wall > _DARK)
        for total, value in ((recorded, grey), (photographed, wall)):
            total += np.where(use, value, 0).reshape(len(polar_rad), _AROUND, -1).sum(-1)
    if not photographed.any():
        raise UnseenError("no lit frame stands near this one, so that its light is not known")
    return _filled(
        np.divide(recorded, photographed, out=np.full_like(recorded, np.nan), where=photographed > 0)
    )


def _last_row(light: Float) -> int:
    """Return the last row that lies within the lens, looked for from the brightest on."""
    mean = light.mean(1)
    brightest = int(mean.argmax())
    dark = np.flatnonzero(mean[brightest:] < _BEYOND_LENS * mean[brightest])
    return brightest + int(dark[0]) - 1 if len(dark) else len(mean) - 1


def _lit_beside(finder: FrameFinder, frame: int) -> Iterator[tuple[int, Image]]:
    """Yield the lit frames nearest in time to a frame, without itself, with their pictures."""
    table, posed = finder.recording.frames, finder.trajectory.frame
    is_lit = np.isin(table.illumination, [Illumination.LED, Illumination.BOTH])
    lit = np.setdiff1d(np.intersect1d(table.frame[is_lit], posed), [frame])
    near = np.sort(lit[np.argsort(np.abs(lit - frame), kind="stable")[:_NEIGHBOURS]])
    for number, image in finder.recording.read(near.tolist(), "bgr"):
        if image is not None:
            yield int(number), image


def _wall_seen(finder: FrameFinder, T_pc: Float, polar_rad: Float, phi_rad: Float) -> Float:
    """Return where rays (T, A) of a camera meet the round pipe (T, A, 3) in P, by fixed-point steps."""
    polar, phi = np.meshgrid(polar_rad, phi_rad, indexing="ij")
    ray_c = np.stack([np.sin(polar) * np.cos(phi), np.sin(polar) * np.sin(phi), np.cos(polar)], -1)
    ray_p, eye = ray_c @ T_pc[:3, :3].T, T_pc[:3, 3]
    far = finder.radius_mm / np.sin(polar)
    for _ in range(4):
        radius = to_pipe(finder.trajectory.axis, eye + far[..., None] * ray_p)[2]
        far = far * finder.radius_mm / radius
    return np.asarray(eye + far[..., None] * ray_p)


def _greys(finder: FrameFinder, frame: int, image: Image, point_p: Float) -> tuple[Float, Bool]:
    """Return the grey levels of a frame at points (..., 3) in P, and whether the lamps alone light them."""
    point_c = transform(inverse(_pose(finder, frame)), point_p.reshape(-1, 3))
    uv, valid = finder.probe.camera.project(point_c)
    table = finder.recording.frames
    if table.illumination[np.searchsorted(table.frame, frame)] == Illumination.BOTH:
        valid &= np.abs(finder.off_sheet(point_c)) > _LASER_BAND_MM
    grey = cv2.GaussianBlur(image.mean(2, dtype=np.float32), (0, 0), _SMOOTHING_PX)
    u, v = _on_image(uv, valid, point_p.shape[:-1])
    found = np.asarray(cv2.remap(grey, u, v, cv2.INTER_LINEAR, borderValue=(-1,)), float)
    return found, found >= 0


def _on_image(uv: Float, shown: Bool, shape: tuple[int, ...]) -> tuple[Float32, Float32]:
    """Return columns and rows (*shape) of an image for `cv2.remap`, far outside where nothing is shown."""
    at = np.where(shown[:, None], uv, -1e4).astype(np.float32)
    return at[:, 0].reshape(shape), at[:, 1].reshape(shape)


def _photographed(photo: WallTexture, axis: PipeAxis, point_p: Float) -> tuple[Float, Bool]:
    """Return the grey levels of the wall's photo at points (..., 3) in P, and whether there is a photo."""
    distance, azimuth, _ = to_pipe(axis, point_p)
    row = np.rint((distance - photo.distance_from_mm) / photo.mm_per_px).astype(int)
    column = np.rint((azimuth - photo.azimuth_from_rad) / photo.rad_per_px).astype(int) % photo.bgra.shape[1]
    is_inside = (row >= 0) & (row < photo.bgra.shape[0])
    texel = photo.bgra[np.clip(row, 0, photo.bgra.shape[0] - 1), column]
    return texel[..., :3].mean(-1), is_inside & (texel[..., 3] > 0)


def _filled(light: Float) -> Float:
    """Return the table, unknown cells filled with the mean of their row, or of the nearest known row."""
    known = np.isfinite(light)
    there = np.flatnonzero(known.sum(1))
    mean = np.nanmean(light[there], 1)
    row = mean[np.abs(np.arange(len(light))[:, None] - there).argmin(1)]
    return np.asarray(np.where(known, light, row[:, None]))


def _pose(finder: FrameFinder, frame: int) -> Float:
    at = np.flatnonzero(finder.trajectory.frame == frame)
    if not len(at):
        raise UnseenError(f"frame {frame} has no pose")
    return np.asarray(finder.trajectory.T_pc[at[0]])


def _up(axis: PipeAxis, distance: float) -> Float:
    """Return the direction of 12 o'clock in P."""
    middle, top = from_pipe(axis, np.array(distance), np.array(-np.pi / 2), np.array([0.0, 1.0]))
    return np.asarray(top - middle)
