"""What a frame sees: rays, poses within the exposure, and wall.

Which tiles contain the laser line; its light.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation

from pipeline.arrays import Bool, Float, Float32
from pipeline.simulator.kernel import kernel
from pipeline.simulator.raycast import azimuth_of, first_hit, normal_at
from pipeline.simulator.rays import RayTable, part_ray_at, ray_at
from pipeline.simulator.sheet import ProfileTable, SheetTable, density_at, sheet_at
from pipeline.simulator.surface import Surface, Texture, albedo_at, sheen_at

# Side of the tiles that are tested for the line before any of their pixels is.
TILE_PX = 8
# Precision of a hit where only tiles are selected.
_TILE_CLOSE_MM = 1e-3
# Distance at which light is stated (see `TrueLaser.power_mm`): about the radius of a 4 inch pipe.
REFERENCE_MM = 50.0
# Largest distance of a hit from the wall, mm: a thousandth of a pixel's extent along a line.
_LINE_CLOSE_MM = 2e-5

Speckle = tuple[float, float, int]


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
    """A sheet of light, the profile across it, and the sheet's motion during a frame, mm."""

    sheet: SheetTable
    profile: ProfileTable
    wobble_mm: float


def line_of(sheet: SheetTable, profile: ProfileTable, surface: Surface) -> Line:
    """Return a sheet with its profile, and its motion at the widest wall, mm."""
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
    """Return the tiles within whose corners the height above the sheet comes into the profile's reach."""
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
            # light is emitted only a little backward: rays far behind cannot see the line
            if not (c_ray[5] > -0.5):
                continue
            to_wall(view, i * TILE_PX, k, c_ray, w_ray)
            if not first_hit(view.surface, w_ray, view.distance_mm, _TILE_CLOSE_MM, work.o, work.R, hit):
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


def add_line(
    view: View, line: Line, colour: Float, speckle: Speckle, tiles: Bool, samples: int, v_from: int,
    v_to: int, image: Float32,
) -> None:  # fmt: skip
    """Add a line's light to rows v_from … v_to of an image (H, W, 3), in the tiles that it may touch.

    ``speckle`` is (contrast, grain in mm, seed).
    """
    _add_rows(view, line, colour, speckle, tiles, samples, v_from, v_to, new_work(), np.empty(3), image)


@kernel
def _add_rows(
    view: View, line: Line, colour: Float, speckle: Speckle, tiles: Bool, samples: int, v_from: int,
    v_to: int, work: Work, total: Float, image: Float32,
) -> None:  # fmt: skip
    times = view.pose.shape[1]
    share = 1.0 / (samples * samples * times)
    for v in range(v_from, v_to):
        for u in range(image.shape[1]):
            if not tiles[v // TILE_PX, u // TILE_PX]:
                continue
            if not _near_line(view, line, u, v, times, work):
                continue
            total[:] = 0.0
            for n in range(samples * samples):
                part_ray_at(view.rays, u, v, n, samples, work.c_ray)
                for k in range(times):
                    _line_light(view, line, speckle, v, k, samples, work, total)
            for c in range(3):
                image[v, u, c] += share * colour[c] * total[c]


@kernel
def _near_line(view: View, line: Line, u: int, v: int, times: int, work: Work) -> bool:
    """Return whether some part of a pixel may see the line at some moment, judged by the pixel's middle."""
    c_ray, w_ray, hit, o, R, normal = work.c_ray, work.w_ray, work.hit, work.o, work.R, work.normal
    ray_at(view.rays, u, v, c_ray)
    if not (c_ray[5] > -0.5):
        return False
    for k in range(times):
        to_wall(view, v, k, c_ray, w_ray)
        if not first_hit(view.surface, w_ray, view.distance_mm, _LINE_CLOSE_MM, o, R, hit):
            continue
        x, y, z = c_ray[0] + hit[0] * c_ray[3], c_ray[1] + hit[0] * c_ray[4], c_ray[2] + hit[0] * c_ray[5]
        height, slope, _ = sheet_at(line.sheet, 0.5, azimuth_of(y, x))
        above = z - height - np.sqrt(x * x + y * y) * slope
        normal_at(view.surface, hit, R, normal)
        facing = abs(w_ray[3] * normal[0] + w_ray[4] * normal[1] + w_ray[5] * normal[2])
        room = 1.5 * hit[0] / (view.px_per_rad * max(facing, 0.02)) + line.wobble_mm
        high = line.profile.low + line.profile.step * (line.profile.density.shape[0] - 1)
        if above > line.profile.low - room and above < high + room:
            return True
    return False


@kernel
def _line_light(
    view: View, line: Line, speckle: Speckle, row: int, k: int, samples: int, work: Work, total: Float
) -> None:
    c_ray, w_ray, hit, o, R, normal = work.c_ray, work.w_ray, work.hit, work.o, work.R, work.normal
    albedo, way = work.albedo, work.way
    if not (c_ray[5] > -0.5):
        return
    to_wall(view, row, k, c_ray, w_ray)
    if not first_hit(view.surface, w_ray, view.distance_mm, _LINE_CLOSE_MM, o, R, hit):
        return
    x, y, z = c_ray[0] + hit[0] * c_ray[3], c_ray[1] + hit[0] * c_ray[4], c_ray[2] + hit[0] * c_ray[5]
    q = np.sqrt(x * x + y * y)
    moment = view.moment[min(row, view.moment.shape[0] - 1), k]
    height, slope, weight = sheet_at(line.sheet, moment, azimuth_of(y, x))
    steep = np.sqrt(1.0 + slope * slope)
    density = density_at(line.profile, (z - height - q * slope) / steep)
    if density <= 0.0:
        return
    normal_at(view.surface, hit, R, normal)
    T = view.pose[min(row, view.pose.shape[0] - 1), k]
    for a in range(3):
        way[a] = (T[a, 0] * x / q + T[a, 1] * y / q + T[a, 2] * slope) / steep
    square = -(normal[0] * way[0] + normal[1] * way[1] + normal[2] * way[2])
    if square <= 0.0:
        return
    foot = hit[0] / (view.px_per_rad * samples)
    albedo_at(view.texture, hit[1], hit[2], foot, albedo)
    light = weight * density * square * REFERENCE_MM / q * _sheen(view.texture, normal, way, w_ray)
    if speckle[0] > 0.0:
        light *= _speckle(speckle, hit)
    for c in range(3):
        total[c] += light * albedo[c]


@kernel
def _sheen(texture: Texture, normal: Float, way: Float, ray: Float) -> float:
    """Return the ratio of light that a partly glossy and a matt wall send to the camera."""
    a, b, c = -way[0] - ray[3], -way[1] - ray[4], -way[2] - ray[5]
    across = max(a * normal[0] + b * normal[1] + c * normal[2], 0.0)
    return float(sheen_at(texture, across * across / (a * a + b * b + c * c + 1e-24)))


@kernel
def _speckle(speckle: Speckle, hit: Float) -> float:
    """Return the factor, mean 1, of the speckle cell that a hit lies in."""
    contrast, grain, seed = speckle
    i = np.uint64(np.int64(np.floor(hit[1] / grain)))
    j = np.uint64(np.int64(np.floor(hit[2] * hit[3] / grain)))
    h = hashed(i * np.uint64(0x9E3779B97F4A7C15) + j * np.uint64(0xC2B2AE3D27D4EB4F) + np.uint64(seed))
    uniform = (np.float64(h >> np.uint64(11)) + 0.5) / 9007199254740992.0
    return float(1.0 - contrast - contrast * np.log(uniform))


@kernel
def hashed(x: np.uint64) -> np.uint64:
    """Return 64 well mixed bits of 64 bits (finaliser of splitmix64, Steele et al. 2014)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))
