"""The pipe's own shape: bore, steps, taper, ovality, joints, and the way of its axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.arrays import Float
from pipeline.simulator.wall.description import Bend, Joint, Pipe
from pipeline.simulator.wall.grid import Grid


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
    """Return the radius (...) of the stepped bore, its steps falling evenly over the chamfer's length."""
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
    """Return what a joint adds to the radius: a groove, and the second pipe out of line."""
    inside = np.abs(s - joint.distance_mm) - joint.gap_mm / 2
    groove = joint.depth_mm * np.clip(0.5 - inside / joint.chamfer_mm, 0, 1) if joint.gap_mm > 0 else 0.0
    beyond = np.clip((s - joint.distance_mm) / joint.chamfer_mm + 0.5, 0, 1)
    shift = joint.offset_mm * np.cos(psi - np.radians(joint.direction_deg))
    return np.asarray(groove + beyond * shift)
