"""Differences that are fixed to the wall, or to rows of single frames.

A region of the wall is darker or brighter than in its photo, or it shines: it gets brighter the more
obliquely it is seen, as wet or polished wall does, whose mirror reflection falls off steeply with the angle.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.stats import norm, t

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import RingSamples, Trajectory
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.texture.surface import WallSurface
from stages.twin.banding import banding
from stages.twin.cells import centred
from stages.twin.locate import FALSE_ALARM
from stages.twin.reference import FEWEST_FRAMES, SHOWN_PX, WALL_COLUMNS, BlockSamples, map_of
from stages.twin.scene import SHADING_MM

_SURE, _FEWEST_CELLS = 3.0, 2
"""σ, from frame to frame, by which other frames must confirm a region; and its fewest touching cells."""
_LEAST_ON_WALL = 0.05
"""Smallest reported relative change on the wall: at steps of the wall the photo itself errs by a few per
cent."""
_LEAST_SHINE, _LEAST_LEAN = 0.25, 0.03
"""Smallest relative brightening over one radius of the line that counts as gloss, and smallest spread of the
places, in radii of the line, over which it is measured. Chosen."""

_NEAREST_RAD = 0.2
"""Least polar angle at which wall is seen: nearer to the axis no block is all wall."""
_NOISY = 3.0
"""Largest of some hundred lengths of vectors of two normal errors, in medians of it: 2.8, rounded up."""
_PART, _PARTS = 50, 10
"""Rows of a part of the map, and about how many parts along it show its noise: 700 000 samples determine a
median to a thousandth. In a wall of 20 m all of it took 20 s for each region."""


def unnamed(
    samples: BlockSamples | None, surface: WallSurface, ring_step_mm: float, line_rad: float
) -> tuple[Mismatch, ...]:
    """Return what is fixed to the wall, or to rows of single frames.

    ``surface`` is the wall's shape from rings ``ring_step_mm`` apart; the line is seen at the polar angle
    ``line_rad``.
    """
    if samples is None:
        return ()
    return (*_regions_of_wall(samples, surface, ring_step_mm, line_rad), *banding(samples))


def ring_step_mm(rings: RingSamples, trajectory: Trajectory) -> float:
    """Return the median distance between rings, mm; 0 without two rings of known pose."""
    place = trajectory.T_pc[np.isin(trajectory.frame, rings.frame), :3, 3]
    return float(np.median(np.linalg.norm(np.diff(place, axis=0), axis=1))) if len(place) > 1 else 0.0


def _regions_of_wall(
    samples: BlockSamples, surface: WallSurface, ring_step_mm: float, line_rad: float
) -> tuple[Mismatch, ...]:
    """Return regions of the wall that differ from their photo, if other frames confirm them.

    Steep wall errs in brightness as its smoothed slope does, which is part of a region's σ.
    """
    shape = (int(samples.along.max()) + 1, WALL_COLUMNS)
    mean, sd = map_of(samples, "wall", shape)
    shine, shine_sd = _shine(samples, shape)
    cells = max(int(np.isfinite(mean).sum()), 1)
    tail = float(norm.isf(FALSE_ALARM / (4 * cells)))
    with np.errstate(invalid="ignore"):
        beyond = (np.abs(mean) > np.maximum(tail * sd, _LEAST_ON_WALL)) | (
            shine > np.maximum(tail * shine_sd, _LEAST_SHINE)
        )
    # Cells separated by a small gap belong together: noise splits a faint region.
    count, label = cv2.connectedComponents(cv2.dilate(beyond.astype(np.uint8), np.ones((5, 5), np.uint8)))
    label, together, found = label * beyond, touching(beyond), []
    for k in range(1, count):
        region = np.argwhere(label == k)
        if together[label == k].max() < _FEWEST_CELLS:
            continue
        use = label[samples.along, samples.around] == k
        size, sigma = min(
            (_gloss_of(*s) for s in ((samples, use), _beside_image(samples, use))), key=_sureness
        )
        shines = sigma > _SURE and size > _LEAST_SHINE
        value, spread = (shine, shine_sd) if shines else (mean, sd)
        error, steepest = slope_error(surface, samples, region, ring_step_mm)
        by_slope = _shine_of_slope(samples, use, line_rad, steepest) if shines else 1.0
        if _most(value, region) < tail * by_slope * error:
            continue
        if shines or samples.fixed_to(use) == "wall":
            gloss_sd = size / max(sigma, 1e-9) if shines else 0.0
            found.append(_on_wall(region, value, spread, cells, samples, use, gloss_sd))
    return tuple(found)


def _beside_image(samples: BlockSamples, use: Bool) -> tuple[BlockSamples, Bool]:
    """Return blocks minus what other wall shows at that place of the image, and which of ``use`` remain.

    What stays in the image brightens all wall that passes by. Places of the image where no other wall was
    seen cannot separate this from wall that shines.
    """
    cell, other = samples.orders["image"], ~use
    count = np.bincount(cell[other], minlength=cell.max() + 1)
    total = np.bincount(cell[other], samples.change[other], len(count))
    there = total / np.maximum(count, 1)
    return replace(samples, change=samples.change - there[cell]), use & (count[cell] >= FEWEST_FRAMES)


def _sureness(gloss: tuple[float, float]) -> float:
    return gloss[1]


def _most(values: Float, cells: Int) -> float:
    """Return the largest absolute value of a map in cells (N, 2)."""
    return float(np.nanmax(np.abs(values[tuple(cells.T)])))


def slope_error(
    surface: WallSurface, samples: BlockSamples, cells: Int, ring_step_mm: float
) -> tuple[float, float]:
    """Return the 1 σ of the slope of cells (N, 2) of the wall, and its steepest slope away from the camera.

    What a second smoothing of the slopes removes is an estimate of what the first one removed (J. W. Tukey's
    twicing, 1977); light at 45°, as from lamps near the ring, changes by as much as the slope. Along the pipe
    the map is also smoothed by its rings: linear interpolation between rings h apart is a running mean with a
    triangle, whose variance is h² / 6. Noise of the radius map is subtracted: its sign changes within a cell.
    """
    step = float(surface.distance_mm[1] - surface.distance_mm[0])
    around_mm = 2 * np.pi * surface.mean_radius_mm / surface.radius_mm.shape[1]
    first, last = (samples.first_mm + (f(cells[:, 0]) + 0.5) * samples.cell_mm for f in (np.min, np.max))
    along_mm = float(np.hypot(SHADING_MM, ring_step_mm / np.sqrt(6)))
    more = samples.cell_mm + 4 * along_mm
    rows = np.flatnonzero((surface.distance_mm > first - more) & (surface.distance_mm < last + more))
    if not len(rows):
        return 0.0, 0.0
    sigma = (along_mm / step, SHADING_MM / around_mm)
    lost = _smoothed_away(surface, rows, sigma)
    column = np.arange(lost.shape[1]) * WALL_COLUMNS // lost.shape[1] + WALL_COLUMNS // 2
    away = np.abs(column[:, None] % WALL_COLUMNS - cells[:, 1][None])
    near = (np.minimum(away, WALL_COLUMNS - away) <= 1).any(1)
    # Noise of the map from all along it: about a weld, it is the weld's.
    parts = np.array_split(np.arange(len(surface.distance_mm)), max(len(surface.distance_mm) // _PART, 1))
    some = [_smoothed_away(surface, part, sigma) for part in parts[:: max(len(parts) // _PARTS, 1)]]
    noise = _NOISY * float(np.median(np.concatenate(some)))
    error = float(np.sqrt(max(float(lost[:, near].max()) ** 2 - noise**2, 0.0)))
    return error, max(float(surface.along[np.ix_(rows, near)].max()), 0.0)


def _smoothed_away(surface: WallSurface, rows: Int, sigma: tuple[float, float]) -> Float:
    """Return what a second smoothing takes from the slopes (n, A) in consecutive rows of the map."""
    reach = int(np.ceil(4 * sigma[0]))  # where the filter's bell ends
    first = max(int(rows[0]) - reach, 0)
    wide = slice(first, int(rows[-1]) + reach + 1)
    lost = np.hypot(*(
        a[wide] - gaussian_filter(a[wide], sigma, mode=("nearest", "wrap"))
        for a in (surface.along, surface.around)
    ))  # fmt: skip
    return np.asarray(lost[rows - first])


def touching(beyond: Bool) -> Int:
    """Return for each marked cell of a map (H, W) the number of cells connected to it, itself included.

    Single cells of noise that are only close to each other do not form a region.
    """
    _, label = cv2.connectedComponents(beyond.astype(np.uint8))
    return np.asarray(np.bincount(label.ravel())[label] * beyond)


def _shine(samples: BlockSamples, shape: tuple[int, int]) -> tuple[Float, Float]:
    """Return by how much cells of a map brighten over a line's radius toward the border, and 1 σ."""
    cell, cells = samples.orders["wall"], shape[0] * shape[1]
    lean, change = centred(samples.away, cell), centred(samples.change, cell)
    count, square, cross = (
        np.bincount(cell, v, cells)[:cells] for v in (None, lean**2, lean * change)
    )  # fmt: skip
    known = (count >= FEWEST_FRAMES) & (square > _LEAST_LEAN**2 * count)
    slope = np.where(known, cross / np.maximum(square, 1e-12), np.nan)
    scale = np.sqrt(np.maximum(square, 1e-12))
    spread = spread_about_median((slope * scale)[known]) if known.any() else np.nan
    return slope.reshape(shape), (spread / scale).reshape(shape)


def _gloss_of(samples: BlockSamples, use: Bool) -> tuple[float, float]:
    """Return by how much blocks in ``use`` (N,) brighten toward the border, and its significance, σ.

    A constant brightness of each cell is fitted first. σ is 0 where halves of the frames contradict each
    other, or with too few frames.
    """
    cell, frame = samples.orders["wall"][use], samples.frame[use]
    lean, change = centred(samples.away[use], cell), centred(samples.change[use], cell)
    cross, own = (np.bincount(frame, lean * v) for v in (change, lean))
    frames = np.flatnonzero(own > 0)
    if len(frames) < FEWEST_FRAMES:
        return 0.0, 0.0
    cross, own = cross[frames], own[frames]
    slope = float(cross.sum() / own.sum())
    sd = float(np.sqrt(((cross - slope * own) ** 2).sum() * len(frames) / (len(frames) - 1)) / own.sum())
    halves = [cross[k::2].sum() / own[k::2].sum() for k in (0, 1)]
    sigma = slope / max(sd, 1e-12)
    sure = min(halves) > slope / 2 and t.sf(sigma, len(frames) - 1) < FALSE_ALARM
    return slope, sigma if sure else 0.0


def _shine_of_slope(samples: BlockSamples, use: Bool, line_rad: float, steepest: float) -> float:
    """Return by how much blocks in ``use`` (N,) seem to brighten over a line's radius, per error of a slope.

    Lamps next to the camera light wall that leans away from them by the slope s, seen at θ, in proportion to
    sin θ − s cos θ. An error e of s changes that by e cos θ: relatively much far ahead and on wall that leans
    away, hardly beside the lamps. As in an equidistant lens, θ is proportional to the distance from the
    image's middle.
    """
    cell, theta = samples.orders["wall"][use], np.maximum(samples.away[use] * line_rad, _NEAREST_RAD)
    light = np.maximum(np.sin(theta) - steepest * np.cos(theta), np.sin(_NEAREST_RAD))
    lean, change = centred(samples.away[use], cell), centred(np.cos(theta) / light, cell)
    return abs(float(lean @ change)) / max(float(lean @ lean), 1e-12)


def _on_wall(
    cells: Int, mean: Float, sd: Float, known: int, samples: BlockSamples, use: Bool, gloss_sd: float = 0.0
) -> Mismatch:
    """Return a region of the wall; with ``gloss_sd``, one that shines, where ``mean`` is its shine."""
    cell_mm = samples.cell_mm
    value, spread = (a[tuple(cells.T)] for a in (mean, sd))
    most = int(np.nanargmax(np.abs(value)))
    chance = min(1.0, 4 * known * float(norm.sf(abs(value[most]) / max(float(spread[most]), 1e-9))))
    distance = samples.first_mm + (cells[:, 0].mean() + 0.5) * cell_mm
    azimuth = float(np.degrees(_middle_angle(2 * np.pi * (cells[:, 1] + 0.5) / WALL_COLUMNS)))
    extent = cell_mm * float(np.sqrt(len(cells)))
    place = (
        NamedFigure("distance_mm", distance, cell_mm / 2, "mm"),
        NamedFigure("azimuth_deg", azimuth, 180 / WALL_COLUMNS, "deg"),
        NamedFigure("extent_mm", extent, cell_mm, "mm"),
    )
    at, nan = f"At {distance:.0f} mm, azimuth {azimuth:.0f}°,", float("nan")
    look = samples.look(use, SHOWN_PX)
    if gloss_sd:
        size = NamedFigure("shine", float(np.nanmean(value)), gloss_sd, "relative")
        return Mismatch(
            "", "intensity", "wall", place, (size,), chance, nan, nan,
            f"{at} the wall is brighter the more obliquely it is seen, as wet or polished wall is. It has no "
            "name, because noise of a dim picture can look the same. Record next: the same place with more "
            "light, or dried.",
            look,
        )  # fmt: skip
    way = "brighter" if value[most] > 0 else "darker"
    size = NamedFigure("change", float(value[most]), float(spread[most]), "relative")
    return Mismatch(
        "", "intensity", "wall", place, (size,), chance, nan, nan,
        f"{at} the wall is {100 * abs(value[most]):.0f} % {way} "
        "than its photo: it shines differently from each side, its photo was made through dirt on the window "
        "or in a glint, or the radius map is wrong there.",
        look,
    )  # fmt: skip


def _middle_angle(angle_rad: Float) -> float:
    """Return the mean direction of angles."""
    return float(np.arctan2(np.sin(angle_rad).mean(), np.cos(angle_rad).mean()))
