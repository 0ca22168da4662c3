"""ArUco markers painted on a bore: columns along +azimuth, rows along +distance, a white zone around."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.arrays import Byte, Float, Float32
from pipeline.errors import InputError
from pipeline.recording.base import Marker
from pipeline.simulator.wall.description import Fiducials, Pipe
from pipeline.simulator.wall.grid import Grid, window
from pipeline.simulator.wall.shape import bore_radius, step_distances

# Reflectances of matt black and white paint.
_BLACK, _WHITE = 0.055, 0.68
# Samples a cell and side: painted edges lie within an eighth of a cell of where they should.
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
    """Paint all markers onto the albedo (S, A, 3), each cell as the mean over its area."""
    for marker in markers_of(fiducials):
        radius = float(bore_radius(np.array(marker.distance_mm), pipe))
        reach = fiducials.size_mm * (0.5 + fiducials.quiet)
        half_width = (reach + 1) * grid.radius_mm / radius
        part = window(grid, marker.distance_mm, np.radians(marker.azimuth_deg), reach + 1, half_width)
        # the window's arc is by the nominal radius, the marker's size by the bore's own
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
