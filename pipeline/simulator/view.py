"""Inputs of a frame's kernels: rays, poses within the exposure, wall, light; which tiles hold the line."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation

from pipeline.arrays import Bool, Float
from pipeline.simulator.kernel import kernel
from pipeline.simulator.raycast import azimuth_of, first_hit
from pipeline.simulator.rays import RayTable, ray_at
from pipeline.simulator.sheet import ProfileTable, SheetTable, sheet_at
from pipeline.simulator.surface import Surface, Texture

# Side of the tiles that are tested for the line before any of their pixels is.
TILE_PX = 8
# Precision of a hit where only tiles are chosen.
_CLOSE_MM = 1e-3


class View(NamedTuple):
    """Camera and wall at one frame.

    Attributes
    ----------
    rays : RayTable
    surface : Surface
    texture : Texture
    pose : (rows or 1, T, 3, 4)
        Camera in the surface's frame W at T moments within each row's exposure; one row of poses where all
        rows see the same.
    moment : (rows or 1, T)
        When that is, 0 to 1 of the frame's span from the first row's opening to the last row's closing.
    distance_mm : float
        Of the camera, to start the search for hits.
    px_per_rad : float
        Near the axis, for the footprint of a pixel on the wall.
    clear_mm : (blocks, SECTORS)
        Largest radius that is surely in plain view of camera and LEDs: see `clear_mm` in `calm`.
    """

    rays: RayTable
    surface: Surface
    texture: Texture
    pose: Float
    moment: Float
    distance_mm: float
    px_per_rad: float
    clear_mm: Float


class Work(NamedTuple):
    """Work arrays of one ray: (6,) in C and in W, its hit, section frame, normal and vectors."""

    c_ray: Float
    w_ray: Float
    hit: Float
    o: Float
    R: Float
    normal: Float
    albedo: Float
    way: Float
    at: Float


def new_work() -> Work:
    """Return room for one ray."""
    ray, vector = (np.empty(6), np.empty(6)), (np.empty(3), np.empty(3), np.empty(3), np.empty(3))
    return Work(*ray, np.empty(6), np.empty(3), np.empty((3, 3)), *vector)


class Line(NamedTuple):
    """A sheet of light, the profile across it, and how far the sheet moves during a frame, mm."""

    sheet: SheetTable
    profile: ProfileTable
    wobble_mm: float


def line_of(sheet: SheetTable, profile: ProfileTable, surface: Surface) -> Line:
    """Return a sheet with its profile, and how far it moves at the widest wall."""
    moved = np.ptp(sheet.height, axis=0) + surface.most_mm * np.ptp(sheet.slope, axis=0)
    return Line(sheet, profile, float(moved.max()))


def line_tiles(view: View, lines: tuple[Line, ...], size: tuple[int, int]) -> Bool:
    """Return which tiles (rows, columns) of the picture a line may touch."""
    rows, columns = -(-size[1] // TILE_PX), -(-size[0] // TILE_PX)
    touched = np.zeros((rows, columns), bool)
    for line in lines:
        low = line.profile.low - line.wobble_mm
        high = line.profile.low + line.profile.step * (len(line.profile.density) - 1) + line.wobble_mm
        for k in range(view.pose.shape[1]):
            height = np.full((rows + 1, columns + 1), np.nan)
            _write_heights(view, line.sheet, k, new_work(), height)
            touched |= _crossed(height, low, high)
    return np.asarray(binary_dilation(touched, np.ones((3, 3), bool)))


def _crossed(height: Float, low: float, high: float) -> Bool:
    """Return the tiles between whose corners the height above the sheet comes into the profile's reach."""
    corner = np.stack([height[:-1, :-1], height[:-1, 1:], height[1:, :-1], height[1:, 1:]])
    finite = np.isfinite(corner)
    least = np.where(finite, corner, np.inf).min(0)
    most = np.where(finite, corner, -np.inf).max(0)
    room = np.clip(0.75 * np.where(finite.any(0), most - least, 0.0), 0.0, None)
    return np.asarray(finite.any(0) & (least - room < high) & (most + room > low))


@kernel
def _write_heights(view: View, sheet: SheetTable, k: int, work: Work, out: Float) -> None:
    """Write the wall's height above the sheet (rows, columns) at the tiles' corners where there is a wall."""
    c_ray, w_ray, hit = work.c_ray, work.w_ray, work.hit
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            ray_at(view.rays, j * TILE_PX - 0.5, i * TILE_PX - 0.5, c_ray)
            # light goes a little backward at most: rays far behind cannot see the line
            if not (c_ray[5] > -0.5):
                continue
            to_wall(view, i * TILE_PX, k, c_ray, w_ray)
            if not first_hit(view.surface, w_ray, view.distance_mm, _CLOSE_MM, work.o, work.R, hit):
                continue
            x, y = c_ray[0] + hit[0] * c_ray[3], c_ray[1] + hit[0] * c_ray[4]
            z = c_ray[2] + hit[0] * c_ray[5]
            height, slope, _ = sheet_at(sheet, 0.5, azimuth_of(y, x))
            out[i, j] = z - height - np.sqrt(x * x + y * y) * slope


@kernel
def to_wall(view: View, row: int, k: int, c_ray: Float, w_ray: Float) -> None:
    """Write a ray of C, seen in a row at moment k of its exposure, in W."""
    T = view.pose[min(row, view.pose.shape[0] - 1), k]
    for a in range(3):
        w_ray[a] = T[a, 0] * c_ray[0] + T[a, 1] * c_ray[1] + T[a, 2] * c_ray[2] + T[a, 3]
        w_ray[3 + a] = T[a, 0] * c_ray[3] + T[a, 1] * c_ray[4] + T[a, 2] * c_ray[5]
