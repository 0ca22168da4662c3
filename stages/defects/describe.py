"""Describe a measured region as a `Defect`: its kind by a few named features, its place and a description."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from pipeline.arrays import Byte, Float, Int
from pipeline.artefacts.findings import (
    Defect,
    DefectKind,
    clock_of_azimuth,
    en13508_suggestion,
    pacp_suggestion,
    pof_class,
)
from pipeline.artefacts.measured import PointCloud
from pipeline.pages import notation
from stages.defects.corroborate import Witnesses
from stages.defects.depth import Depth
from stages.defects.grow import millimetre_mean
from stages.defects.photo import darkness
from stages.defects.portraits import Features, probabilities
from stages.defects.relief import Relief
from stages.defects.segment import Region
from stages.defects.surface import Surface, cells_of

# A defect with a smaller elongation is described as nearly round (chosen).
_NEARLY_ROUND = 1.25
# Another kind is mentioned in the description from this probability on (chosen).
_WORTH_TELLING = 0.05
_SMALL_MM2 = 60.0  # on a smaller area a quartic surface follows every roughness
_UNKNOWN_ROUGHNESS = 0.08, 0.08  # roughness over depth and its 1 σ, where it cannot be measured
# Coefficients of a quartic surface.
_QUARTIC = 15
# A line longer than 30 mm that departs from a straight one by less than 0.4 mm RMS may be a joint or a seam.
# Chosen: short cracks are as straight, but joints are longer.
_STRAIGHT_MM, _LONG_MM = 0.4, 30.0
_CRACK_OR = "a crack, or a scratch, the edge of a stain or a shadow"
_ROUND = " It goes all round: it may be the gap of a joint or the hollow root of a weld."


def features_of(relief: Relief, region: Region, depth: Depth) -> Features:
    """Return the features of a region's shape by which its kind is judged."""
    cell = relief.cell_mm
    length, width = region.mask.shape[0] * cell[0], region.mask.shape[1] * cell[1]
    i, j = np.nonzero(region.mask)
    place = np.stack([i * cell[0], j * cell[1]], -1)
    spread = np.cov(place.T) + np.diag(np.square(cell) / 12) if len(i) > 1 else np.diag(np.square(cell))
    values, vectors = np.linalg.eigh(spread)
    # the variance that averaging over 1 mm adds to a width is subtracted
    slim = float(np.sqrt(max(16 * values[0] - 1.0, cell[1] ** 2)))
    elongation = float(np.sqrt(values[1] / max(values[0] - 1.0 / 16, values[0] / 4)))
    direction = float(np.arccos(min(1.0, abs(vectors[0, 1]))))
    return Features(length, width, slim, elongation, *_roughness(relief, region, depth), direction)


def _roughness(relief: Relief, region: Region, depth: Depth) -> tuple[float, float]:
    """Return roughness over depth, and its 1 σ from the scatter of the noise's mean square on this area."""
    surface = region.cut(millimetre_mean(relief.local_mm, relief.cell_mm))
    i, j = np.nonzero(region.mask & np.isfinite(surface))
    area_mm2 = len(i) * relief.cell_mm[0] * relief.cell_mm[1]
    if area_mm2 < _SMALL_MM2:
        return _UNKNOWN_ROUGHNESS
    x, y = (2 * (k - k.min()) / max(1, np.ptp(k)) - 1 for k in (i, j))
    basis = np.stack([x**m * y**n for m in range(5) for n in range(5 - m)], -1)
    values = surface[i, j]
    rest = values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0]
    noise = float(np.sqrt(np.mean(region.cut(relief.noise_mm)[i, j] ** 2))) / 2
    excess = max(0.0, float(np.mean(rest**2)) - noise**2)
    free = max(area_mm2 - _QUARTIC, 1.0)
    deep = max(abs(depth.depth_mm), 1e-6)
    return float(np.sqrt(excess)) / deep, noise * float((2 / free) ** 0.25) / deep


@dataclass(frozen=True)
class Scene:
    """What all defects of a run are described with: evidence, wall thickness and smallest depth, mm."""

    seen_by: Witnesses
    wall_thickness_mm: float | None
    min_depth_mm: float


def describe(region: Region, depth: Depth, surface: Surface, scene: Scene) -> Defect:
    """Return the defect of a region; the caller sets its number and its probability, here 0 and 1."""
    relief = surface.relief
    depth = depth.as_written()
    features = features_of(relief, region, depth)
    likely = probabilities(features, region, relief.radius_mm)
    kind, share = next(iter(likely.items()))
    clock_from, clock_to = _clock(relief, region)
    peak_distance, peak_clock = _peak(relief, region, depth)
    first = float(relief.distance_mm[region.row] - relief.cell_mm[0] / 2)
    loss = kind.is_metal_loss and scene.wall_thickness_mm
    return Defect(
        id=0,
        kind=str(kind),
        distance_from_mm=first,
        distance_to_mm=first + features.length_mm,
        clock_from=clock_from,
        clock_to=clock_to,
        peak_distance_mm=peak_distance,
        peak_clock=peak_clock,
        length_mm=features.length_mm,
        width_mm=features.width_mm,
        depth_mm=depth.depth_mm,
        depth_sigma_mm=depth.sigma_mm,
        wall_loss_percent=100 * depth.depth_mm / loss if loss else float("nan"),
        probability=1.0,
        confidence=share,
        frames=_frames(surface.near, relief, region),
        outline=_outline(relief, region),
        pof_class=(
            pof_class(features.length_mm, features.width_mm, scene.wall_thickness_mm)
            if kind.is_metal_loss
            else ""
        ),
        pacp_suggestion=pacp_suggestion(kind, features.direction_rad),
        en13508_suggestion=en13508_suggestion(kind),
        statement=_statement(features, likely, depth, darkness(scene.seen_by.texture, relief, region))
        + (_ROUND if kind.is_metal_loss and _goes_round(relief, region) else ""),
    )


def describe_line(region: Region, depth: Depth, surface: Surface, scene: Scene) -> Defect:
    """Return a dark line that only the photo shows as an unconfirmed crack, with the depth from the rings.

    Its probability is NaN: the probability that the line is a crack is unknown.
    """
    shown = describe(region, depth, surface, scene)
    direction = features_of(surface.relief, region, depth).direction_rad
    length = float(np.hypot(shown.length_mm, shown.width_mm))
    straight = length > _LONG_MM and _across_mm(surface.relief, region) < _STRAIGHT_MM
    causes = "the edge of a joint, a seam, a water line, a scratch or a crack" if straight else _CRACK_OR
    rings = notation.depth(shown.depth_mm, shown.depth_sigma_mm)
    return replace(
        shown,
        kind=str(DefectKind.CRACK),
        wall_loss_percent=float("nan"),
        probability=float("nan"),
        confidence=float("nan"),
        pof_class="",
        pacp_suggestion="" if straight else pacp_suggestion(DefectKind.CRACK, direction),
        en13508_suggestion="" if straight else en13508_suggestion(DefectKind.CRACK),
        statement=f"{'Straight dark' if straight else 'Dark'} line in the photo, about {length:.0f} mm long. "
        f"It may be {causes}. Rings, which resolve no width below 1 mm, show {rings}. Not confirmed. Only "
        "the photo shows it.",
    )


def _across_mm(relief: Relief, region: Region) -> float:
    """Return by how much the cells of a line scatter about a straight line, RMS, mm."""
    place = np.argwhere(region.mask) * relief.cell_mm
    return float(np.sqrt(max(np.linalg.eigvalsh(np.cov(place.T))[0], 0.0))) if len(place) > 1 else 0.0


def _goes_round(relief: Relief, region: Region) -> bool:
    """Return whether a region covers every azimuth."""
    return region.all_round or region.mask.shape[1] >= len(relief.azimuth_rad)


def _azimuths(relief: Relief, region: Region) -> tuple[float, float]:
    """Return the region's first and last edge, rad, the last not less than the first."""
    step = float(relief.azimuth_rad[1] - relief.azimuth_rad[0])
    first = float(relief.azimuth_rad[0]) + (region.column - 0.5) * step
    return first, first + region.mask.shape[1] * step


def _clock(relief: Relief, region: Region) -> tuple[float, float]:
    if _goes_round(relief, region):
        return 0.0, 12.0
    hours = clock_of_azimuth(np.array(_azimuths(relief, region)))
    return float(hours[0]), float(hours[1])


def _peak(relief: Relief, region: Region, depth: Depth) -> tuple[float, float]:
    """Return distance (mm) and clock position (h) of the cell whose deviation is extreme."""
    row, column = depth.peak
    azimuth = relief.azimuth_rad[(region.column + column) % len(relief.azimuth_rad)]
    return float(relief.distance_mm[region.row + row]), float(clock_of_azimuth(azimuth))


def _frames(points: PointCloud, relief: Relief, region: Region) -> Int:
    return np.asarray(np.unique(points.frame[cells_of(points, relief, region)[2]]), np.int64)


def _outline(relief: Relief, region: Region) -> Float:
    """Return the region's outer contour (V, 2) of (distance mm, azimuth rad)."""
    first, last = _azimuths(relief, region)
    top = float(relief.distance_mm[region.row] - relief.cell_mm[0] / 2)
    bottom = top + region.mask.shape[0] * relief.cell_mm[0]
    if region.all_round:
        return np.array([[top, first], [top, last], [bottom, last], [bottom, first]])
    # gaps between the parts of one defect are bridged, so that one polygon encloses all of them
    mask, bridge = np.pad(region.mask.astype(np.uint8), 1), 3
    while cv2.connectedComponents(mask)[0] > 2:
        closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((bridge, bridge), np.uint8))
        mask, bridge = np.asarray(closed, np.uint8), bridge + 2
    polygon = _polygon(mask)
    scale = (bottom - top) / region.mask.shape[0], (last - first) / region.mask.shape[1]
    return np.stack([top + (polygon[:, 1] - 0.5) * scale[0], first + (polygon[:, 0] - 0.5) * scale[1]], -1)


def _polygon(mask: Byte) -> Float:
    """Return the outer contour (V, 2) of a mask as (column, row), which encloses an area."""
    polygon = cv2.approxPolyDP(_contour(mask), 0.7, True)
    if cv2.contourArea(polygon) > 0:
        return np.asarray(polygon[:, 0], float)
    # The contour through the centres of cells in one row has no area: take it through a grid twice as fine.
    return (_contour(np.repeat(np.repeat(mask, 2, 0), 2, 1))[:, 0] - 0.5) / 2


def _contour(mask: Byte) -> Int:
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(max(contours, key=len))


def _form(elongation: float) -> str:
    """Return the elongation in words."""
    return "nearly round" if elongation < _NEARLY_ROUND else f"{elongation:.1f} times as long as wide"


def _a(kind: DefectKind) -> str:
    """Return a kind with its article; corrosion takes none."""
    return kind.value if kind is DefectKind.CORROSION else f"a {kind}"


def _statement(features: Features, likely: dict[DefectKind, float], depth: Depth, darkness: float) -> str:
    """Return the description: what it is, how large, and why it was classed so."""
    kinds = list(likely)
    words = f"{kinds[0].capitalize()}, {notation.depth(depth.depth_mm, depth.sigma_mm)}"
    if kinds[0] is DefectKind.WELD:
        return f"{words}, {features.length_mm:.0f} mm along the pipe. Classed as weld: it goes all round."
    words += (
        f", {features.length_mm:.1f} mm along × {features.width_mm:.1f} mm around. Classed as {kinds[0]}: "
        f"{features.slim_mm:.1f} mm across, {_form(features.elongation)}, roughness of its surface "
        f"{100 * features.roughness:.0f} % of its depth."
    )
    if len(kinds) > 1 and likely[kinds[1]] >= _WORTH_TELLING:
        words += f" It may also be {_a(kinds[1])}: probability {100 * likely[kinds[1]]:.0f} %."
    # A tenth (chosen): a smaller difference is not worth a sentence.
    if abs(darkness) > 0.1:
        words += (
            f" The photo is {100 * abs(darkness):.0f} % {'darker' if darkness > 0 else 'brighter'} there."
        )
    return words
