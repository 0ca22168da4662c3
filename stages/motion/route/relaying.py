"""A run laid anew: every part of it is turned as the graph of rotations says, and put end to end again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Float
from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.axis import PipeAxis, axis_through, distance_along, frames_at
from pipeline.geometry.rigid import from_parts, rotation_from_vector, skew, transform, vector_from_rotation
from stages.motion.route.rotation_graph import Rotations


def relaid(trajectory: Trajectory, distance_mm: Float, rotations: Rotations) -> Trajectory:
    """Return the trajectory with rotations at nodes (K,) along its axis applied, and their covariance.

    Beside the axis nothing moves: each pose and its piece of axis turn together.
    """
    old = trajectory.axis
    turn = _between(old.distance_mm, distance_mm, rotations.turn_p)
    step = np.diff(old.origin_p, axis=0)
    middle = _between((old.distance_mm[1:] + old.distance_mm[:-1]) / 2, distance_mm, rotations.turn_p)
    moved = np.cumsum(np.einsum("kij,kj->ki", middle, step), 0)
    origin = old.origin_p[0] + np.concatenate([np.zeros((1, 3)), moved])
    first = int(np.searchsorted(old.distance_mm, distance_mm[0]))
    # The first node stays where it is: it defines the frame.
    origin = origin + (old.origin_p[first] - origin[first])
    axis = axis_through(origin, turn[0] @ old.R_pa[0, :, 0], float(old.distance_mm[0]))
    s = distance_along(old, trajectory.T_pc)
    T_pc = _carried(old, axis, s, _between(s, distance_mm, rotations.turn_p), trajectory.T_pc)
    moved_trajectory = replace(trajectory, axis=axis, T_pc=T_pc)
    return replace(moved_trajectory, covariance=_covariance(moved_trajectory, s, distance_mm, rotations))


def turned_upright(trajectory: Trajectory, up_p: Float) -> Trajectory:
    """Return the trajectory in P turned about z until the direction up is −y, so that 12 o'clock is up."""
    angle = np.arctan2(up_p[0], -up_p[1])
    turn = rotation_from_vector(np.array([0.0, 0.0, -angle]))
    T = from_parts(turn, np.zeros(3))
    axis = trajectory.axis
    six = np.eye(6)
    six[:3, :3] = turn
    return replace(
        trajectory,
        T_pc=T @ trajectory.T_pc,
        covariance=six @ trajectory.covariance @ six.T,
        # Azimuths are counted in the sections' frames: these turn back, so that azimuth 0 is P's new x.
        axis=PipeAxis(axis.distance_mm, transform(T, axis.origin_p), turn @ axis.R_pa @ turn.T),
    )


def _between(s: Float, distance_mm: Float, turn: Float) -> Float:
    """Return rotations (n, 3, 3) at distances (n,), even between nodes; the end ones beyond them."""
    right = np.clip(np.searchsorted(distance_mm, s), 1, len(distance_mm) - 1)
    left = right - 1
    share = np.clip((s - distance_mm[left]) / (distance_mm[right] - distance_mm[left]), 0, 1)
    step = vector_from_rotation(np.swapaxes(turn[left], 1, 2) @ turn[right])
    return np.asarray(turn[left] @ rotation_from_vector(share[:, None] * step))


def _carried(old: PipeAxis, new: PipeAxis, s: Float, turn: Float, T_pc: Float) -> Float:
    """Return poses (N, 4, 4) carried along with the axis' points beside them."""
    before, after = frames_at(old, s)[0], frames_at(new, s)[0]
    beside = np.einsum("nij,nj->ni", turn, T_pc[:, :3, 3] - before)
    return from_parts(turn @ T_pc[:, :3, :3], after + beside)


def _covariance(trajectory: Trajectory, s: Float, distance_mm: Float, rotations: Rotations) -> Float:
    """Return the poses' covariance (N, 6, 6).

    Across the pipe a place errs by the turns before it, times the way since; along it as it did before.
    """
    count, node = len(distance_mm), frames_at(trajectory.axis, distance_mm)
    step = np.diff(node[0], axis=0)
    at = trajectory.covariance[np.minimum(np.searchsorted(s, distance_mm), len(s) - 1)]
    lever = np.zeros((count, 3, count, 3))
    for k, way in enumerate(step):  # a turn e moves what lies behind by e × way
        lever[k + 1 :, :, k] += -skew(way) / 2
        lever[k + 1 :, :, k + 1] += -skew(way) / 2
    by_turn = lever.reshape(3 * count, 3 * count)
    turned = by_turn @ rotations.covariance
    whole = (turned @ by_turn.T, turned, rotations.covariance)
    place, mixed, turning = (np.einsum("kikj->kij", m.reshape(count, 3, count, 3)) for m in whole)
    tangent = node[1][:, :, 2]
    along = np.einsum("ki,kij,kj->k", tangent, at[:, :3, :3], tangent)
    place = place + along[:, None, None] * tangent[:, :, None] * tangent[:, None, :]
    own = np.block([[place, mixed], [np.swapaxes(mixed, 1, 2), turning]])
    right = np.clip(np.searchsorted(distance_mm, s), 1, count - 1)
    share = np.clip((s - distance_mm[right - 1]) / np.diff(distance_mm)[right - 1], 0, 1)[:, None, None]
    found = own[right - 1] * (1 - share) + own[right] * share
    # Rotations err about C's axes in the trajectory, about P's in the graph.
    to_c = np.zeros((len(s), 6, 6))
    to_c[:, :3, :3], to_c[:, 3:, 3:] = np.eye(3), np.swapaxes(trajectory.T_pc[:, :3, :3], 1, 2)
    return np.asarray(to_c @ found @ np.swapaxes(to_c, 1, 2))
