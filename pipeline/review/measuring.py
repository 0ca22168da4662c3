"""Measuring on a run's wall: outlines, readings of the page's tools with 1 σ, and doubts about findings."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import cv2
import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.findings import DefectKind, clock_of_azimuth
from pipeline.artefacts.measured import Wall
from pipeline.artefacts.wall_map import WallMap, cells_within
from pipeline.errors import BoresightError
from pipeline.pages import notation
from pipeline.review.decisions.replay import Finding, Measured, Outline
from pipeline.review.run_files import RunFiles, measured_findings

# Width of the wall around an outline to which its depth refers; σ from which a direction is sure; fewest
# cells of that wall for its median.
_AROUND_MM = 6.0
_SURE_SIGMA = 2.0
_LEAST_AROUND = 20
# Depth is the extreme of the mean over this length, so that one noisy cell is no depth.
_MEAN_MM = 1.0


@dataclass(frozen=True)
class OutlineGauge:
    """Measures outlines on a wall."""

    wall: WallMap

    def measure(self, outline: Outline) -> Measured:
        """Return the outline's extent and its extreme depth relative to the wall within 6 mm around it."""
        point = np.asarray(outline, float)
        rows, columns, inside, around = self._cells(point)
        radius = np.where(inside | around, self.wall.radius_mm[np.ix_(rows, columns)], np.nan)
        random = self.wall.sigma_random_mm[np.ix_(rows, columns)]
        depth, sigma, peak = self._depth(radius, random, inside, around)
        sigma = float(np.hypot(sigma, self.wall.displaced_in(rows).max(initial=0.0)))
        (first, last), (a0, a1) = np.sort(point[:, 0])[[0, -1]], np.sort(point[:, 1])[[0, -1]]
        middle = float(np.nanmedian(self.wall.radius_mm[rows]))
        clock = clock_of_azimuth(np.array([a0, a1]))
        there = (float("nan"), float("nan")) if peak is None else self._place(rows[peak[0]], columns[peak[1]])
        return Measured(
            float(first), float(last), float(clock[0]), float(clock[1]),
            float(last - first), float(min(a1 - a0, 2 * np.pi) * middle), depth, sigma, *there,
        )  # fmt: skip

    def _place(self, row: int, column: int) -> tuple[float, float]:
        """Return distance (mm) and clock position (h) of a cell."""
        return float(self.wall.distance_mm[row]), float(clock_of_azimuth(self.wall.azimuth_rad[column]))

    def _cells(self, point: Float) -> tuple[Int, Int, Bool, Bool]:
        """Return rows and columns around the outline, and which of their cells are in it or around it."""
        wall = self.wall
        rows = wall.rows(point[:, 0].min() - _AROUND_MM, point[:, 0].max() + _AROUND_MM)
        radius = float(np.nanmedian(wall.radius_mm[rows]))
        margin = _AROUND_MM / radius
        first = int(np.floor((point[:, 1].min() - margin - wall.azimuth_rad[0]) / wall.step_rad))
        last = int(np.ceil((point[:, 1].max() + margin - wall.azimuth_rad[0]) / wall.step_rad))
        count = min(last - first + 1, len(wall.azimuth_rad))
        at_row = (point[:, 0] - wall.distance_mm[rows[0]]) / wall.step_mm
        at_column = (point[:, 1] - wall.azimuth_rad[0]) / wall.step_rad - first
        inside = cells_within(np.stack([at_column, at_row], -1), (len(rows), count))
        reach = np.array([_AROUND_MM / (radius * wall.step_rad), _AROUND_MM / wall.step_mm])
        size = tuple(int(2 * np.ceil(r) + 1) for r in reach)
        grown = cv2.dilate(inside.astype(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, size))
        columns = (first + np.arange(count)) % len(wall.azimuth_rad)
        return rows, columns, inside, grown.astype(bool) & ~inside

    def _depth(
        self, radius: Float, sigma: Float32, inside: Bool, around: Bool
    ) -> tuple[float, float, tuple[int, int] | None]:
        """Return the extreme of the smoothed radius within, minus the median around, its 1 σ and its cell."""
        known = around & np.isfinite(radius)
        seen = inside & np.isfinite(radius)
        if known.sum() < _LEAST_AROUND or not seen.any():
            return float("nan"), float("nan"), None
        away = np.where(np.isfinite(radius), radius - float(np.median(radius[known])), 0.0)
        weight = np.isfinite(radius).astype(float)
        step = np.array([self.wall.step_mm, self.wall.step_rad * float(np.median(radius[known]))])
        cells = tuple(int(max(round(_MEAN_MM / s), 1)) for s in step[::-1])
        mean = cv2.blur(away, cells) / np.maximum(cv2.blur(weight, cells), 1e-9)
        peak = np.unravel_index(int(np.argmax(np.where(seen, np.abs(mean), -1.0))), mean.shape)
        extreme = float(mean[peak])
        noise = float(np.median(sigma[seen & np.isfinite(sigma)])) / np.sqrt(cells[0] * cells[1])
        spread = robust_spread(away[known])
        sigma_mm = float(np.hypot(noise, spread / np.sqrt(cells[0] * cells[1])))
        return extreme, sigma_mm, (int(peak[0]), int(peak[1]))


Tool = Literal["point", "distance", "area", "depth", "diameter"]
_STEPS_PER_CELL = 2
_NEEDED: dict[Tool, int] = {"point": 1, "distance": 2, "area": 3, "depth": 3, "diameter": 1}


class NotSeenError(BoresightError):
    """A measurement crosses wall that was not seen."""


@dataclass(frozen=True)
class Reading:
    """One number with its name, unit and 1 σ."""

    name: str
    value: float
    sigma: float
    unit: str


def readings(wall: WallMap, tool: Tool, points: Outline) -> tuple[Reading, ...]:
    """Return the readings of a tool at points (distance mm, azimuth rad).

    Raises
    ------
    NotSeenError
        Where the wall was not seen, or points are too few.
    """
    if len(points) < _NEEDED[tool]:
        raise NotSeenError(f"{tool} needs {_NEEDED[tool]} points")
    found = {"point": _point, "distance": _distance, "area": _area, "depth": _depth, "diameter": _diameter}
    result = found[tool](wall, points)
    if not all(np.isfinite(r.value) for r in result):
        raise NotSeenError("the wall was not seen there")
    return result


def _point(wall: WallMap, points: Outline) -> tuple[Reading, ...]:
    s, a = points[0]
    radius, sigma, _ = wall.radius_at(s, a)
    return (
        Reading("radius", radius, sigma, "mm"),
        Reading("distance", s, float(wall.step_mm / np.sqrt(12)), "mm"),
        Reading(
            "clock", float(clock_of_azimuth(a)), float(np.degrees(wall.step_rad) / 30 / np.sqrt(12)), "h"
        ),
    )


def _distance(wall: WallMap, points: Outline) -> tuple[Reading, ...]:
    """Return the distance along the wall between the points, over its relief, and through the bore."""
    (s0, a0), (s1, a1) = points[0], points[1]
    xyz, sigma = _line(wall, (s0, a0), (s1, a1))
    along = np.linalg.norm(np.diff(xyz, axis=0), axis=1).sum()
    chord = xyz[-1] - xyz[0]
    straight = float(np.linalg.norm(chord))
    unit = chord / max(straight, 1e-12)
    outward = np.array([[np.cos(a), np.sin(a), 0.0] for a in (a0, a1)])
    by_radius = np.array([-unit @ outward[0] * sigma[0], unit @ outward[1] * sigma[-1]])
    place = wall.step_mm / np.sqrt(6)
    return (
        Reading("along the wall", float(along), float(np.hypot(place, np.mean(sigma) * abs(a1 - a0))), "mm"),
        Reading("straight", straight, float(np.hypot(place, np.linalg.norm(by_radius))), "mm"),
    )


def _line(wall: WallMap, start: tuple[float, float], end: tuple[float, float]) -> tuple[Float, Float]:
    """Return points (N, 3) of the wall on the straight line of the flat view, and their σ (N,)."""
    cells = max(abs(end[0] - start[0]) / wall.step_mm, abs(end[1] - start[1]) / wall.step_rad, 1)
    t = np.linspace(0, 1, int(cells * _STEPS_PER_CELL) + 2)
    s, a = (start[i] + t * (end[i] - start[i]) for i in (0, 1))
    radius, sigma, _ = np.array([wall.radius_at(*at) for at in zip(s, a, strict=True)]).T
    return np.stack([radius * np.cos(a), radius * np.sin(a), s], -1), sigma


def _area(wall: WallMap, points: Outline) -> tuple[Reading, ...]:
    """Return the area of the polygon on the wall, as if it were smooth: cells times the local radius."""
    point = np.asarray(points, float)
    rows = wall.rows(point[:, 0].min(), point[:, 0].max())
    radius = float(np.nanmedian(wall.radius_mm[rows]))
    sigma = float(np.nanmedian(wall.sigma_mm[rows]))
    flat = np.stack([point[:, 0], point[:, 1] * radius], -1).astype(np.float32)
    area = float(cv2.contourArea(flat))
    edge = float(cv2.arcLength(flat, closed=True))
    placed = edge * wall.step_mm / np.sqrt(12 * max(edge / wall.step_mm, 1))
    return (Reading("area", area, float(np.hypot(area * sigma / radius, placed)), "mm²"),)


def _depth(wall: WallMap, points: Outline) -> tuple[Reading, ...]:
    size = OutlineGauge(wall).measure(points)
    return (Reading("depth", size.depth_mm, size.depth_sigma_mm, "mm"),)


def _diameter(wall: WallMap, points: Outline) -> tuple[Reading, ...]:
    """Return the diameter through the axis at the point's azimuth, and the mean of the section."""
    s, a = points[0]
    (r0, sigma0, _), (r1, sigma1, _) = wall.radius_at(s, a), wall.radius_at(s, a + np.pi)
    row = wall.row(s)
    local = float(wall.displaced_in(np.array([row]))[0])
    section, sigma = wall.radius_mm[row], wall.sigma_mm[row]
    common, shared0, shared1 = np.sqrt(
        np.maximum(np.array([np.nanmedian(sigma), sigma0, sigma1]) ** 2 - local**2, 0.0)
    ).tolist()
    return (
        # The calibration's error, which both ends share, adds up and does not average out.
        Reading("diameter", r0 + r1, float(np.hypot(shared0 + shared1, np.sqrt(2) * local)), "mm"),
        Reading("mean diameter", 2 * float(np.nanmean(section)), 2 * common, "mm"),
    )


def cautions(files: RunFiles, finding: Finding) -> tuple[str, ...]:
    """Return warnings for an inspector about relying on a finding in its current state."""
    return tuple(c for c in (contradiction(finding), _read_again(files, finding)) if c)


def contradiction(finding: Finding) -> str:
    """Return a sentence if kind and measured depth differ in direction by more than 2 σ, else nothing."""
    size, is_loss = finding.size, DefectKind(finding.kind).is_metal_loss
    into_wall = size.depth_mm if is_loss else -size.depth_mm
    if not into_wall < -_SURE_SIGMA * size.depth_sigma_mm:
        return ""
    way = "goes into the wall" if is_loss else "stands into the bore"
    read = notation.depth(size.depth_mm, size.depth_sigma_mm)
    return f"A {finding.kind} {way}, but this outline measures {read}. Check its kind and its outline."


def _read_again(files: RunFiles, finding: Finding) -> str:
    """Return why a measured finding's depth changed when its outline was drawn again."""
    if not finding.edited:
        return ""
    run = _as_measured(files, files.version).get(finding.original or 0)
    if run is None or run.outline == finding.outline:
        return ""
    same = OutlineGauge(files.artefact(Wall).radius_map).measure(run.outline)
    return (
        "The depth was measured again because the outline was drawn again. "
        f"The run found {_depth_text(run.size)}, from single ring points relative to the fitted pipe. "
        "The review measures the map of the wall: the extreme of its means over 1 mm, relative to the wall "
        f"within 6 mm around the outline. In this way, the run's outline gives {_depth_text(same)}, the new "
        f"one {_depth_text(finding.size)}."
    )


def _depth_text(size: Measured) -> str:
    return notation.depth(size.depth_mm, size.depth_sigma_mm)


@lru_cache(maxsize=4)
def _as_measured(files: RunFiles, _version: str) -> dict[int, Finding]:
    found = measured_findings(files.defects_text(), files.path / "defects.json")
    return {f.original: f for f in found if f.original is not None}
