"""Finds the pipe's straight lengths and bends, and aligns the run with them, a plan and an IMU."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import Trajectory
from pipeline.artefacts.motion import PipePiece
from pipeline.geometry.axis import PipeAxis, axis_through, distance_along, frames_at
from pipeline.geometry.rigid import from_parts, rotation_from_vector, skew, transform, vector_from_rotation
from pipeline.instrument.probe import ImuMount, Probe
from pipeline.machine.stage import Context
from pipeline.recording.base import PlannedPiece, Recording
from stages.motion.route.alignment import HEADING_DRIFT, find_pieces
from stages.motion.route.inertial import contradicts, inertia_at, still_spans
from stages.motion.route.nodes import Inertia, Nodes, PlannedTurn, Rotations
from stages.motion.route.rotation_graph import STRAIGHT_MM, RotationGraph

_MOST_NODES = 120
"""Largest number of nodes: the graph is solved densely, and the spacing is then 0.8 % of the run."""
_NODE_MM = 30.0
"""Smallest distance between nodes: a knot of the axis' spline."""
_LEAST_VARIANCE = 1e-10
"""Least variance, rad², of a rotation by vision between nodes: (10 µrad)², far below any pose's."""
_PLAN_RAD = np.radians(1.0)
"""1 σ of the angle of a planned bend as built: elbows are within 1 % of their angle (EN 10253-2), and weld
gaps add about half a degree. A choice."""
_TOO_FAR = 4.0
"""Largest difference, σ, of a plan's angle from the measured one with which the plan is used."""
_STEEP = 0.3
"""Least share of gravity across the pipe's start for which a 12 o'clock is defined: pipes up to 72° steep."""


def lay_route(
    trajectory: Trajectory, turn_variance: Float, recording: Recording, probe: Probe, context: Context
) -> Trajectory:
    """Return the trajectory with its straight lengths and bends, aligned with these, a plan and an IMU.

    ``turn_variance`` (N, 3), rad², is the variance of the camera's rotations summed up to each frame, in C,
    without its drift.

    Straightness is no evidence over less than half of a tube. So without plan and IMU, shorter runs are not
    rotated; they only get the list of their pieces.
    """
    found = _with_pieces(trajectory)
    nodes, frame = _nodes(found, turn_variance)
    if len(frame) < 3 or not found.pieces:
        return found
    planned = _planned_turns(found.pieces, recording.pipe.plan, context)
    inertia = _inertia(recording, probe, found, frame, context)
    way = float(np.ptp(nodes.distance_mm))
    if inertia is not None or planned or way > STRAIGHT_MM:
        rotations = RotationGraph(nodes, inertia, planned).solve()
        is_upright = rotations.up_p is not None and _has_clock(rotations, context)
        found = relaid(found, nodes.distance_mm, rotations.about_up() if is_upright else rotations)
        if is_upright and rotations.up_p is not None:
            found = turned_upright(found, rotations.up_p)
        found = _with_pieces(found)
    _report(found, context)
    return found


def _with_pieces(trajectory: Trajectory) -> Trajectory:
    s = distance_along(trajectory.axis, trajectory.T_pc)
    pieces = find_pieces(
        trajectory.axis,
        float(s.min()),
        float(s.max()),
        2 * trajectory.radius_mm,
        trajectory.distance_sigma_mm,
    )
    return replace(trajectory, pieces=pieces)


def _nodes(trajectory: Trajectory, turn_variance: Float) -> tuple[Nodes, Int]:
    """Return nodes along the pipe, and the frames (K,) in which the probe first came to them."""
    s = distance_along(trajectory.axis, trajectory.T_pc)
    count = int(np.clip((s.max() - s[0]) / _NODE_MM, 1, _MOST_NODES - 1)) + 1
    reached = np.maximum.accumulate(s)
    frame = np.unique(np.searchsorted(reached, np.linspace(s[0], s.max(), count)))
    distance = reached[frame]
    at = frames_at(trajectory.axis, distance)[1]
    variance = np.maximum(np.diff(turn_variance[frame], axis=0), _LEAST_VARIANCE)
    R = trajectory.T_pc[:, :3, :3]
    # The drift acts about C's axes, and C rotates between nodes: with the last node's axes alone, a roll by
    # 0.3 rad in 28 m bent a straight pipe by a milliradian.
    about = np.cumsum((R[1:] + R[:-1]) / 2 * np.diff(s)[:, None, None], 0)[frame[1:] - 1]
    about = np.diff(about, axis=0, prepend=np.zeros((1, 3, 3)))
    by_drift = (np.swapaxes(R[frame[1:]], 1, 2) @ about)[:, :, :2]
    length = _length_of(distance, trajectory.pieces)
    return Nodes(distance, R[frame], at[:, :, 2], variance, by_drift, length), frame


def _length_of(distance_mm: np.ndarray, pieces: tuple[PipePiece, ...]) -> Int:
    """Return the number of the straight length in which each distance lies; −1 in a bend.

    Lengths in which no distance lies get no number.
    """
    out = np.full(len(distance_mm), -1)
    for j, piece in enumerate(p for p in pieces if p.kind == "straight"):
        out[(distance_mm >= piece.from_mm - 1e-6) & (distance_mm <= piece.to_mm + 1e-6)] = j
    known = out >= 0
    out[known] = np.unique(out[known], return_inverse=True)[1]
    return out


def _planned_turns(
    pieces: tuple[PipePiece, ...], plan: tuple[PlannedPiece, ...], context: Context
) -> tuple[PlannedTurn, ...]:
    """Return the plan's angles between straight lengths; none, with a warning, for another pipe."""
    planned, bends = [p for p in plan if p.bend_deg], [p for p in pieces if p.kind == "bend"]
    if not plan:
        return ()
    if len(planned) != len(bends):
        context.warn(
            f"the plan in recording.yaml is not used: it has {len(planned)} bends, the measured pipe "
            f"{len(bends)}. What to do: list the bends between the run's start and end, in order"
        )
        return ()
    out: list[PlannedTurn] = []
    length = -1
    for piece in pieces:
        if piece.kind == "straight":
            length += 1
            continue
        angle = np.radians(planned[len(out)].bend_deg)
        if abs(angle - piece.angle_rad) > _TOO_FAR * np.hypot(_PLAN_RAD, piece.angle_sigma_rad):
            context.warn(
                f"the plan in recording.yaml is not used: its bend {len(out) + 1} turns by "
                f"{np.degrees(angle):.1f}°, the pipe at {piece.from_mm:.0f} mm by "
                f"{np.degrees(piece.angle_rad):.1f}°. What to do: check the order of the bends"
            )
            return ()
        out.append(PlannedTurn(length, float(angle), float(_PLAN_RAD)))
    lengths = sum(p.kind == "straight" for p in pieces)
    return tuple(t for t in out if 0 <= t.length < lengths - 1)


def _inertia(
    recording: Recording, probe: Probe, trajectory: Trajectory, frame: Int, context: Context
) -> Inertia | None:
    if recording.imu is None:
        return None
    mount = probe.imu
    if mount is None:
        context.warn(
            "the IMU is not used: probe.yaml does not state its orientation. What to do: add the "
            "section imu with R_ci, the rotation from the IMU's axes to the camera's"
        )
        return None
    return _consistent_inertia(recording, mount, trajectory, frame, context)


def _consistent_inertia(
    recording: Recording, mount: ImuMount, trajectory: Trajectory, frame: Int, context: Context
) -> Inertia | None:
    assert recording.imu is not None
    R_pc = trajectory.T_pc[frame, :3, :3]
    s = distance_along(trajectory.axis, trajectory.T_pc)
    still = still_spans(trajectory.time_s, s)
    found = inertia_at(recording.imu, mount, trajectory.time_s[frame], R_pc, still, context)
    if found is not None and contradicts(found, R_pc):
        context.warn(
            "the IMU is not used: its gyroscope shows other rotations than the camera. What to do: check "
            "R_ci in probe.yaml, the unit (rad/s) and the clock (s, as in frames.csv) of imu.csv"
        )
        return None
    return found


def _has_clock(rotations: Rotations, context: Context) -> bool:
    """Report 12 o'clock and slope by gravity; return whether gravity determines 12 o'clock."""
    up_p = rotations.up_p
    assert up_p is not None
    across = float(np.hypot(up_p[0], up_p[1]))
    if across < _STEEP:
        context.report("12 o'clock", "the pipe is too steep: that of the camera at the first frame", "")
        return False
    context.report("1 σ of 12 o'clock, by gravity", float(np.degrees(rotations.clock_sigma_rad)), "°")
    context.report(
        "slope of the pipe at its start", float(np.degrees(np.arcsin(np.clip(up_p[2], -1, 1)))), "°"
    )
    return True


def _report(trajectory: Trajectory, context: Context) -> None:
    bends = [p for p in trajectory.pieces if p.kind == "bend"]
    context.report("straight lengths", len(trajectory.pieces) - len(bends), "")
    context.report("bends", len(bends), "")
    across = float(np.sqrt(np.diagonal(trajectory.covariance[-1])[:2].max()))
    context.report("1 σ across the pipe at the end, if its lengths are straight", across, "mm")
    way = sum(p.to_mm - p.from_mm for p in trajectory.pieces)
    # A length that curves as evenly as the camera's heading drifts is off by κ L² / 2 at its end.
    curving = float(HEADING_DRIFT * way**2 / 2)
    context.report(
        "1 σ across the pipe at the end, if its lengths may curve", float(np.hypot(across, curving)), "mm"
    )


def relaid(trajectory: Trajectory, distance_mm: Float, rotations: Rotations) -> Trajectory:
    """Return the trajectory with rotations at nodes (K,) along its axis applied, and their covariance.

    Nothing moves relative to the axis: each pose and its piece of axis rotate together.
    """
    old = trajectory.axis
    turn = _between(old.distance_mm, distance_mm, rotations.turn_p)
    step = np.diff(old.origin_p, axis=0)
    middle = _between((old.distance_mm[1:] + old.distance_mm[:-1]) / 2, distance_mm, rotations.turn_p)
    moved = np.cumsum(np.einsum("kij,kj->ki", middle, step), 0)
    origin = old.origin_p[0] + np.concatenate([np.zeros((1, 3)), moved])
    first = int(np.searchsorted(old.distance_mm, distance_mm[0]))
    # The first node is fixed: it defines the frame.
    origin = origin + (old.origin_p[first] - origin[first])
    axis = axis_through(origin, turn[0] @ old.R_pa[0, :, 0], float(old.distance_mm[0]))
    s = distance_along(old, trajectory.T_pc)
    T_pc = _carried(old, axis, s, _between(s, distance_mm, rotations.turn_p), trajectory.T_pc)
    moved_trajectory = replace(trajectory, axis=axis, T_pc=T_pc)
    return replace(moved_trajectory, covariance=_covariance(moved_trajectory, s, distance_mm, rotations))


def turned_upright(trajectory: Trajectory, up_p: Float) -> Trajectory:
    """Return the trajectory in P rotated about z until the direction up is −y, so that 12 o'clock is up."""
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
        # Azimuths are counted in the sections' frames: these rotate back, so that azimuth 0 is P's new x.
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

    Across the pipe, the error of a place is the sum of the rotations before it times the distance since.
    Along the pipe, the earlier variance is treated as an error proportional to distance, so that after a bend
    it acts across; the rest of it is random.
    """
    count, node = len(distance_mm), frames_at(trajectory.axis, distance_mm)
    step = np.diff(node[0], axis=0)
    at = trajectory.covariance[np.minimum(np.searchsorted(s, distance_mm), len(s) - 1)]
    lever = np.zeros((count, 3, count, 3))
    for k, way in enumerate(step):  # a rotation e moves all that follows by e × way
        lever[k + 1 :, :, k] += -skew(way) / 2
        lever[k + 1 :, :, k + 1] += -skew(way) / 2
    by_turn = lever.reshape(3 * count, 3 * count)
    turned = by_turn @ rotations.covariance
    whole = (turned @ by_turn.T, turned, rotations.covariance)
    place, mixed, turning = (np.einsum("kikj->kij", m.reshape(count, 3, count, 3)) for m in whole)
    tangent, way = node[1][:, :, 2], node[0] - node[0][0]
    along = np.einsum("ki,kij,kj->k", tangent, at[:, :3, :3], tangent)
    ahead = np.sum(tangent * way, axis=1) ** 2
    scale = float(along.sum() / max(ahead.sum(), 1e-9))
    rest = np.maximum(along - scale * ahead, 0.0)[:, None, None]
    place = (
        place + scale * way[:, :, None] * way[:, None, :] + rest * tangent[:, :, None] * tangent[:, None, :]
    )
    own = np.block([[place, mixed], [np.swapaxes(mixed, 1, 2), turning]])
    right = np.clip(np.searchsorted(distance_mm, s), 1, count - 1)
    share = np.clip((s - distance_mm[right - 1]) / np.diff(distance_mm)[right - 1], 0, 1)[:, None, None]
    found = own[right - 1] * (1 - share) + own[right] * share
    # Errors of rotations are about C's axes in the trajectory, about P's in the graph.
    to_c = np.zeros((len(s), 6, 6))
    to_c[:, :3, :3], to_c[:, 3:, 3:] = np.eye(3), np.swapaxes(trajectory.T_pc[:, :3, :3], 1, 2)
    return np.asarray(to_c @ found @ np.swapaxes(to_c, 1, 2))
