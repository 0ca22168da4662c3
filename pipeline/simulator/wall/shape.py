"""The wall's radius: bore, steps, taper, ovality, joints; roughness, rust, welds, defects and branches."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from pipeline.arrays import Float, Float32, Int
from pipeline.simulator.wall.description import Bend, Branch, Joint, Pipe, Weld, imprint, reach_mm
from pipeline.simulator.wall.grid import Grid, Seeds, above_share, field, grid_over, window


def base_radius(grid: Grid, pipe: Pipe) -> Float:
    """Return the radius (S, A), mm, of the pipe as made: bore, taper, ovality and joints."""
    s, psi = grid.distance_mm[:, None], grid.azimuth_rad[None]
    oval = pipe.ovality.amplitude_mm * np.cos(2 * (psi - np.radians(pipe.ovality.direction_deg)))
    along = bore_radius(grid.distance_mm, pipe) + pipe.taper * grid.distance_mm
    radius = along[:, None] + oval
    for joint in pipe.joints:
        radius = radius + _joint(s, psi, joint)
    return np.asarray(radius)


def bore_radius(distance_mm: Float, pipe: Pipe) -> Float:
    """Return the radius (...) of the stepped bore; its steps fall linearly over the chamfer's length."""
    if not pipe.bore:
        return np.full(np.shape(distance_mm), pipe.diameter_mm / 2)
    edges = np.cumsum([b.length_mm for b in pipe.bore])[:-1]
    radius = np.full(np.shape(distance_mm), pipe.bore[0].diameter_mm / 2)
    for edge, before, after in zip(edges, pipe.bore[:-1], pipe.bore[1:], strict=True):
        share = np.clip((distance_mm - edge) / pipe.chamfer_mm + 0.5, 0, 1)
        radius = radius + share * (after.diameter_mm - before.diameter_mm) / 2
    return np.asarray(radius)


def step_distances(pipe: Pipe) -> Float:
    """Return the distances of the bore's steps and of the joints, where the radius jumps."""
    edges = np.cumsum([b.length_mm for b in pipe.bore])[:-1] if pipe.bore else np.zeros(0)
    return np.concatenate([edges, [j.distance_mm for j in pipe.joints]])


def axis_curvature(distance_mm: Float, bends: Sequence[Bend]) -> Float:
    """Return the axis' curvature (..., 2), 1/mm, along x and y of its section."""
    curvature = np.zeros((*np.shape(distance_mm), 2))
    for bend in bends:
        inside = (distance_mm >= bend.distance_mm) & (distance_mm < bend.distance_mm + bend.length_mm)
        psi = np.radians(bend.direction_deg)
        curvature += inside[..., None] * bend.curvature_per_mm * np.array([np.cos(psi), np.sin(psi)])
    return curvature


def _joint(s: Float, psi: Float, joint: Joint) -> Float:
    """Return the change of the radius by a joint: a groove, and an offset of the second pipe."""
    inside = np.abs(s - joint.distance_mm) - joint.gap_mm / 2
    groove = joint.depth_mm * np.clip(0.5 - inside / joint.chamfer_mm, 0, 1) if joint.gap_mm > 0 else 0.0
    beyond = np.clip((s - joint.distance_mm) / joint.chamfer_mm + 0.5, 0, 1)
    shift = joint.offset_mm * np.cos(psi - np.radians(joint.direction_deg))
    return np.asarray(groove + beyond * shift)


# Longest wave of the slow error of form: about a diameter. Chosen, not measured.
_FORM_LONGEST_MM = 80.0
# Length over which the edge of a branch falls.
_BRANCH_CHAMFER_MM = 0.6
# OpenCV interpolates pictures of less than 32767 rows.
_MOST_ROWS = 32_000


def add_relief(radius_mm: Float, grid: Grid, pipe: Pipe, seeds: Seeds) -> Float:
    """Return the radius (S, A), mm, with all deviations from the pipe as made."""
    radius = radius_mm + _surface_relief(grid, pipe, seeds)
    for k, weld in enumerate(pipe.welds):
        rows = weld_rows(grid, weld, weld.width_mm)
        radius[rows] += weld_relief(grid, weld, seeds.of("weld", k), rows)
    for k, defect in enumerate(pipe.defects):
        part = window(grid, defect.distance_mm, np.radians(defect.azimuth_deg), *reach_mm(defect))
        marked = imprint(defect, seeds.of("defect", k), part.along_mm, part.around_mm)
        radius[part.place] += marked.depth_mm
    for branch in pipe.branches:
        part = window(grid, branch.distance_mm, np.radians(branch.azimuth_deg), *[branch.diameter_mm] * 2)
        radius[part.place] += branch.depth_mm * branch_cover(branch, part.along_mm, part.around_mm)
    return radius


def rust_field(grid: Grid, longest_mm: float, seeds: Seeds) -> Float32:
    """Return the field (S, A) whose largest values are the rusty places.

    It does not depend on the grid's cells.
    """
    return coarse_field(grid, seeds.of("rust"), longest_mm)


def coarse_field(grid: Grid, random: np.random.Generator, longest_mm: float) -> Float32:
    """Return a field that depends on place only, not on the grid's cells, down to waves of 1 mm or so.

    It is made on a separate grid and interpolated, so that relief and albedo have their rust at the same
    places.
    """
    span = (float(grid.distance_mm[0]), float(grid.distance_mm[-1]) + grid.step_mm)
    own = grid_over(span, grid.radius_mm, max(longest_mm / 160, grid.radius_mm / 120))
    values = field(own, random, longest_mm=longest_mm, slope=0.9)
    columns = np.mod((grid.azimuth_rad + np.pi) / (2 * np.pi) * own.shape[1] - 0.5, own.shape[1])
    rows = (grid.distance_mm - own.distance_mm[0]) / own.step_mm
    wide = np.concatenate([values, values[:, :2]], 1)
    many = int(_MOST_ROWS * min(own.step_mm / grid.step_mm, 1.0))
    parts = [rows[n : n + many] for n in range(0, len(rows), many)]
    return np.concatenate([_between(wide, part, columns) for part in parts])


def _between(values: Float32, rows: Float, columns: Float) -> Float32:
    """Return a field at fractional rows and columns, from the part of it that these rows need."""
    first, last = int(rows[0]), int(rows[-1]) + 2
    x, y = np.meshgrid(columns.astype(np.float32), (rows - first).astype(np.float32))
    part = values[first:last]
    return np.asarray(cv2.remap(part, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)


def weld_rows(grid: Grid, weld: Weld, reach_mm: float) -> Int:
    """Return the rows of a grid near a weld's middle.

    No bead deviates from a circle by more than its width.
    """
    return np.flatnonzero(np.abs(grid.distance_mm - weld.distance_mm) <= reach_mm)


def weld_relief(grid: Grid, weld: Weld, random: np.random.Generator, rows: Int) -> Float:
    """Return the change of the radius (rows, A) by a bead: inward, irregular, with ripples along it."""
    across, height = weld_across(grid, weld, random, rows)
    profile = np.clip(1 - across**2, 0, None)
    pitch = max(weld.width_mm / 3, 4 * grid.arc_step_mm)
    count = max(round(2 * np.pi * grid.radius_mm / pitch), 1)
    ripple = np.cos(count * grid.azimuth_rad[None] - 1.5 * across**2)
    return np.asarray(-profile * (weld.height_mm * (1 + 0.12 * height[None]) + weld.ripple_mm * ripple))


def weld_across(grid: Grid, weld: Weld, random: np.random.Generator, rows: Int) -> tuple[Float, Float]:
    """Return offsets (rows, A) from a bead's wavy middle in half widths, and its uneven height (A,)."""
    waver, height = (_periodic(grid, random, order) for order in (9, 14))
    middle = weld.distance_mm + 0.08 * weld.width_mm * waver[None]
    return (grid.distance_mm[rows, None] - middle) / (weld.width_mm / 2), height


def branch_cover(branch: Branch, along_mm: Float, around_mm: Float) -> Float:
    """Return (n, m) 1 inside the hole of a branch, 0 outside, with a chamfered edge."""
    inside = branch.diameter_mm / 2 - np.hypot(along_mm, around_mm)
    return np.asarray(np.clip(inside / _BRANCH_CHAMFER_MM, 0, 1))


def _surface_relief(grid: Grid, pipe: Pipe, seeds: Seeds) -> Float:
    relief = pipe.relief
    total = np.zeros(grid.shape)
    if relief.roughness_mm > 0:
        longest, slope = relief.roughness_longest_mm, relief.roughness_slope
        rough = field(grid, seeds.of("roughness"), longest_mm=longest, slope=slope)
        total += relief.roughness_mm * rough
    if relief.form_mm > 0:
        total += relief.form_mm * coarse_field(grid, seeds.of("form"), _FORM_LONGEST_MM)
    if relief.rust_mm > 0:
        place = rust_field(grid, pipe.surface.rust_patch_mm, seeds)
        total -= relief.rust_mm * above_share(place, pipe.surface.rust, 0.5)
    if relief.corrosion_mm > 0:
        eaten = coarse_field(grid, seeds.of("corrosion"), 4 * relief.roughness_longest_mm)
        total += relief.corrosion_mm * np.clip(1 + 0.6 * eaten, 0, None)
    return total


def _periodic(grid: Grid, random: np.random.Generator, orders: int) -> Float:
    """Return a smooth random function (A,) of azimuth of about unit variance."""
    phase = random.uniform(0, 2 * np.pi, orders)
    order = np.arange(1, orders + 1)[:, None]
    return np.asarray(np.cos(order * grid.azimuth_rad + phase[:, None]).sum(0) * np.sqrt(2 / orders))
