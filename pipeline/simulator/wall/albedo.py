"""The wall's reflectance: texture or a photograph, stains, traces of defects and welds, and ArUco markers.

Markers are painted with columns along +azimuth and rows along +distance, in a white zone.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from pipeline.arrays import Byte, Float, Float32, Int
from pipeline.errors import InputError
from pipeline.recording.base import Marker
from pipeline.simulator.wall.description import (
    Fiducials,
    Photograph,
    Pipe,
    Surface,
    Tint,
    Weld,
    imprint,
    reach_mm,
)
from pipeline.simulator.wall.grid import Grid, Seeds, above_share, field, window, wrapped
from pipeline.simulator.wall.shape import (
    bore_radius,
    branch_cover,
    coarse_field,
    rust_field,
    step_distances,
    weld_across,
    weld_rows,
)

# Exponent that decodes a photograph: close to sRGB's.
_SRGB_GAMMA = 2.2
# Reflectances that a painted surface can have: soot to fresh white paint.
_DARKEST, _BRIGHTEST = 0.01, 0.95


def lay_photograph(grid: Grid, photograph: Photograph, folder: Path) -> Float32:
    """Return the albedo (S, A, 3), red, green, blue, of a picture laid on the wall.

    Rows of the picture run along the distance. It is scaled by at most half a tile so that a whole, even
    number of tiles, every other one mirrored, closes around the wall without a seam.

    Raises
    ------
    InputError
        When the picture cannot be read.
    """
    picture = _linear(folder / photograph.file)
    picture *= photograph.mean_albedo / max(float(picture.mean()), 1e-6)
    tile_mm = picture.shape[1] * photograph.mm_per_px
    tiles = max(2 * round(np.pi * grid.radius_mm / tile_mm), 2)
    u = (grid.azimuth_rad + np.pi) / (2 * np.pi) * tiles * picture.shape[1]
    v = (grid.distance_mm - grid.distance_mm[0]) / photograph.mm_per_px
    x, y = np.meshgrid(
        _mirrored(u, picture.shape[1]).astype(np.float32), _mirrored(v, picture.shape[0]).astype(np.float32)
    )
    laid = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(np.clip(laid, _DARKEST, _BRIGHTEST), np.float32)


def _linear(file: Path) -> Float32:
    """Return a picture (H, W, 3) as linear red, green, blue from 0 to 1."""
    picture = cv2.imread(str(file), cv2.IMREAD_COLOR) if file.is_file() else None
    if picture is None:
        raise InputError(
            file, "cannot be read as a picture", expected="a JPEG or PNG file", hint="check pipe.photograph"
        )
    return np.asarray((picture[..., ::-1].astype(np.float32) / 255) ** _SRGB_GAMMA, np.float32)


def _mirrored(pixel: Float, size: int) -> Float:
    """Return positions folded back and forth into a picture, as centres from 0 to size − 1."""
    folded = np.mod(pixel, 2 * size)
    return np.asarray(np.minimum(folded, 2 * size - folded) - 0.5)


# Reflectances in red, green, blue of what covers a wall: chosen by eye for a plausible picture.
_RUST: Tint = (0.40, 0.19, 0.09)
_LIME: Tint = (0.66, 0.64, 0.58)
_BLOT: Tint = (0.11, 0.11, 0.12)
_HOLE: Tint = (0.02, 0.02, 0.02)
_HEAT: Tint = (0.20, 0.17, 0.19)
_BEAD: Tint = (0.50, 0.50, 0.49)
# Finest texture in one frame over the bore's radius (shared notes, "Scales": 0.085 to 0.133 mm at 50.8 mm).
FINEST_OVER_RADIUS = 0.0022


def paint(grid: Grid, pipe: Pipe, seeds: Seeds) -> Float32:
    """Return the albedo (S, A, 3), linear reflectance in red, green, blue, without fiducials."""
    return stain(bare_wall(grid, pipe.surface, seeds), grid, pipe, seeds)


def stain(albedo: Float32, grid: Grid, pipe: Pipe, seeds: Seeds) -> Float32:
    """Return the albedo (S, A, 3) with rust, lime, streaks and the marks of welds, defects and branches."""
    _stain_surface(albedo, grid, pipe.surface, seeds)
    for k, weld in enumerate(pipe.welds):
        _stain_weld(albedo, grid, weld, seeds.of("weld", k))
    for k, defect in enumerate(pipe.defects):
        part = window(grid, defect.distance_mm, np.radians(defect.azimuth_deg), *reach_mm(defect))
        marked = imprint(defect, seeds.of("defect", k), part.along_mm, part.around_mm)
        _cover_window(albedo, part.place, marked.cover, marked.colour)
    for branch in pipe.branches:
        part = window(grid, branch.distance_mm, np.radians(branch.azimuth_deg), *[branch.diameter_mm] * 2)
        cover = branch_cover(branch, part.along_mm, part.around_mm)
        _cover_window(albedo, part.place, cover, _HOLE)
    return np.clip(albedo, _DARKEST, _BRIGHTEST, out=albedo)


def bare_wall(grid: Grid, surface: Surface, seeds: Seeds) -> Float32:
    """Return the mottled wall (S, A, 3) without stains: the same relative texture in all colours."""
    grey = grain(grid, surface, seeds)
    if surface.mottle > 0:
        longest = surface.mottle_longest_mm
        grey += surface.mottle * field(grid, seeds.of("mottle"), longest_mm=longest, slope=0.7)
    # the logarithm of the texture is Gaussian, so that reflectance cannot become negative
    shade = surface.albedo * np.exp(grey - grey.var() / 2)
    return np.asarray(shade[..., None] * np.array(surface.tint, np.float32), np.float32)


def grain(grid: Grid, surface: Surface, seeds: Seeds) -> Float32:
    """Return the finest texture (S, A), relative: at the resolution of a frame, and twice as coarse."""
    if surface.grain == 0:
        return np.zeros(grid.shape, np.float32)
    wave = surface.grain_mm or 4 * FINEST_OVER_RADIUS * grid.radius_mm
    fine = field(grid, seeds.of("grain"), longest_mm=3 * wave, shortest_mm=wave / 2, slope=0.0)
    return np.asarray(surface.grain * fine, np.float32)


def _stain_surface(albedo: Float32, grid: Grid, surface: Surface, seeds: Seeds) -> None:
    texture = albedo[..., 1] / surface.albedo
    if surface.rust > 0:
        place = rust_field(grid, surface.rust_patch_mm, seeds)
        _cover(albedo, above_share(place, surface.rust, 0.5), _RUST, texture)
    if surface.lime > 0:
        place = coarse_field(grid, seeds.of("lime"), surface.rust_patch_mm / 2)
        _cover(albedo, 0.8 * above_share(place, surface.lime, 0.4), _LIME, texture)
    if surface.spots > 0:
        place = field(grid, seeds.of("spots"), longest_mm=surface.mottle_longest_mm / 2, slope=0.8)
        _cover(albedo, above_share(place, surface.spots, 0.05), _BLOT, texture)
    if surface.streaks > 0:
        lines = field(grid, seeds.of("streaks"), longest_mm=8.0, shortest_mm=0.5, slope=0.6, stretch=12.0)
        albedo *= (1 - surface.streaks * np.clip(lines, 0, 1.5) / 1.5)[..., None]
    if surface.seam_deg is not None:
        off = wrapped(grid.azimuth_rad - np.radians(surface.seam_deg)) * grid.radius_mm
        albedo *= (1 - 0.6 * np.exp(-((off / 0.5) ** 2))).astype(np.float32)[None, :, None]


def _stain_weld(albedo: Float32, grid: Grid, weld: Weld, random: np.random.Generator) -> None:
    half = weld.width_mm / 2
    rows = weld_rows(grid, weld, 2 * half + 3 * weld.heat_mm)
    if rows.size == 0:
        return
    across, _ = weld_across(grid, weld, random, rows)
    part, off = albedo[rows], half * np.abs(across)
    heat = 0.7 * np.exp(-((np.maximum(off - half, 0) / max(weld.heat_mm, 0.1)) ** 2))
    texture = part[..., 1] / max(float(part[..., 1].mean()), 1e-6)
    _cover(part, heat, _HEAT, texture)
    _cover(part, np.clip((half - off) / 0.3, 0, 1), _BEAD, texture)
    albedo[rows] = part


def _cover(albedo: Float32, share: Float | Float32, colour: Tint, texture: Float32) -> None:
    """Cover a share of every cell with a colour that has the wall's texture."""
    share = np.asarray(share, np.float32)
    for channel, value in enumerate(colour):
        albedo[..., channel] += share * (np.float32(value) * texture - albedo[..., channel])


def _cover_window(albedo: Float32, place: tuple[Int, ...], share: Float, colour: Tint) -> None:
    part = albedo[place]
    if part.size == 0:
        return
    texture = part[..., 1] / max(float(part[..., 1].mean()), 1e-6)
    _cover(part, share, colour, texture)
    albedo[place] = part


# Reflectances of matt black and white paint.
_BLACK, _WHITE = 0.055, 0.68
# Samples per cell and side: painted edges are within an eighth of a cell of their place.
_SAMPLES = 4


def markers_of(fiducials: Fiducials) -> tuple[Marker, ...]:
    """Return all markers in the order of their numbers, azimuths from −180 to 180 deg."""
    places = [
        (ring.distance_mm, round((ring.azimuth_deg + 360 * k / ring.count + 180) % 360 - 180, 4))
        for ring in fiducials.rings
        for k in range(ring.count)
    ]
    return tuple(Marker(k, s, psi) for k, (s, psi) in enumerate(places))


def require_room(pipe: Pipe, fiducials: Fiducials) -> None:
    """Refuse markers that the dictionary lacks, that overlap, or that lie over a step.

    Raises
    ------
    InputError
    """
    markers, reach = markers_of(fiducials), fiducials.size_mm * (0.5 + fiducials.quiet)
    known = _dictionary(fiducials.dictionary).bytesList.shape[0]
    if len(markers) > known:
        raise _refused(f"has {len(markers)} markers, and {fiducials.dictionary} only {known}")
    for edge in step_distances(pipe):
        for ring in fiducials.rings:
            if abs(ring.distance_mm - edge) < reach + pipe.chamfer_mm:
                raise _refused(
                    f"has a ring of markers at {ring.distance_mm:g} mm over the step at {edge:g} mm"
                )
    for a in fiducials.rings:
        arc = 2 * np.pi * float(bore_radius(np.array(a.distance_mm), pipe)) / a.count
        if arc < 2 * reach:
            raise _refused(f"has {a.count} markers at {a.distance_mm:g} mm, which overlap")
        if any(b is not a and abs(b.distance_mm - a.distance_mm) < 2 * reach for b in fiducials.rings):
            raise _refused(f"has rings of markers that overlap at {a.distance_mm:g} mm")


def paint_fiducials(albedo: Float32, grid: Grid, pipe: Pipe, fiducials: Fiducials) -> None:
    """Paint all markers onto the albedo (S, A, 3); each cell gets the mean over its area."""
    for marker in markers_of(fiducials):
        radius = float(bore_radius(np.array(marker.distance_mm), pipe))
        reach = fiducials.size_mm * (0.5 + fiducials.quiet)
        half_width = (reach + 1) * grid.radius_mm / radius
        part = window(grid, marker.distance_mm, np.radians(marker.azimuth_deg), reach + 1, half_width)
        # the window's arc is measured at the nominal radius, the marker's size at the bore's own
        around = part.around_mm * radius / grid.radius_mm
        steps = grid.step_mm, grid.arc_step_mm * radius / grid.radius_mm
        cover, paint = _marker_cells(fiducials, marker.id, part.along_mm, around, steps)
        here = albedo[part.place]
        albedo[part.place] = here + cover[..., None] * (paint[..., None] - here)


def _marker_cells(
    fiducials: Fiducials, number: int, along: Float, around: Float, steps: tuple[float, float]
) -> tuple[Float32, Float32]:
    """Return the painted share of every cell (n, m) and the mean reflectance of the paint there."""
    pattern = _pattern(fiducials.dictionary, number)
    size, reach = fiducials.size_mm, fiducials.size_mm * (0.5 + fiducials.quiet)
    cover, light = np.zeros((2, along.shape[0], around.shape[1]))
    for offset in (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5:
        row = np.floor((along + offset * steps[0]) / size * len(pattern) + len(pattern) / 2).astype(int)
        for other in (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5:
            u, v = along + offset * steps[0], around + other * steps[1]
            column = np.floor(v / size * len(pattern) + len(pattern) / 2).astype(int)
            inside = (np.abs(u) <= reach) & (np.abs(v) <= reach)
            black_square = (row >= 0) & (row < len(pattern)) & (column >= 0) & (column < len(pattern))
            bit = pattern[np.clip(row, 0, len(pattern) - 1), np.clip(column, 0, len(pattern) - 1)]
            cover += inside
            light += inside * np.where(black_square & (bit == 0), _BLACK, _WHITE)
    paint = np.where(cover > 0, light / np.maximum(cover, 1), _WHITE)
    return np.asarray(cover / _SAMPLES**2, np.float32), np.asarray(paint, np.float32)


def _pattern(dictionary: str, number: int) -> Byte:
    """Return the bits (n, n) of a marker with its black border, 0 black."""
    known = _dictionary(dictionary)
    cells = known.markerSize + 2
    return np.asarray(cv2.aruco.generateImageMarker(known, number, cells, borderBits=1) > 0, np.uint8)


def _dictionary(name: str) -> cv2.aruco.Dictionary:
    if not name.startswith("DICT_") or not hasattr(cv2.aruco, name):
        raise _refused(f"names a dictionary {name!r} that OpenCV does not have")
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


def _refused(problem: str) -> InputError:
    return InputError("scene", problem, place="pipe.fiducials")
