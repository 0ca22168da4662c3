"""The estimate expressed in the pipe frame P of the run: its origin, roll and covariance."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.axis import PipeAxis, frames_at, to_pipe
from pipeline.geometry.rigid import from_parts, inverse, transform
from pipeline.instrument.probe import Probe
from pipeline.recording.base import FrameTable
from stages.motion.bundle_adjustment.equations import MATCH_BIASES, Measurements
from stages.motion.windows.sliding_window import of_one_window
from stages.motion.windows.submap_joining import Joined
from stages.motion.windows.submaps import Estimate

_START_MM = 60.0


def in_pipe_frame(estimate: Estimate, frames: FrameTable, measured: Measurements) -> Trajectory:
    """Return the trajectory in P of an estimate of all frames at once."""
    run, has_encoder = of_one_window(estimate), measured.encoder is not None
    return trajectory_of(run, frames, measured.probe, measured.unsure, has_encoder)


def trajectory_of(
    run: Joined, frames: FrameTable, probe: Probe, unsure: Float, has_encoder: bool
) -> Trajectory:
    """Return the trajectory in P: distance 0 and roll those of the first camera, z along the pipe there."""
    T_po = _pipe_of_origin(run.T_pc[0], run.axis)
    first = float(to_pipe(run.axis, run.T_pc[0, :3, 3])[0])
    axis = PipeAxis(
        run.axis.distance_mm - first,
        transform(T_po, run.axis.origin_p),
        T_po[:3, :3] @ run.axis.R_pa @ _roll_of(T_po, run.axis, first),
    )
    turn = np.eye(6)
    turn[:3, :3] = T_po[:3, :3]
    own = slice(1, -MATCH_BIASES)
    found, spread = run.settled.value[own], run.settled.covariance[own, own]
    scale_sigma = float(np.sqrt(run.settled.covariance[0, 0]))
    return Trajectory(
        frame=frames.frame,
        time_s=frames.time_s,
        T_pc=T_po @ run.T_pc,
        covariance=turn @ run.covariance @ turn.T,
        axis=axis,
        radius_mm=run.radius_mm,
        encoder_scale=float(run.settled.value[0]) if has_encoder else float("nan"),
        encoder_scale_sigma=scale_sigma if has_encoder else float("nan"),
        scale_sigma=run.radius_sigma_mm / run.radius_mm,
        distance_sigma_mm=run.distance_sigma_mm,
        events=(),
        instrument=probe.parameters + unsure @ found,
        instrument_covariance=unsure @ spread @ unsure.T,
    )


def _pipe_of_origin(T_oc: Float, axis: PipeAxis) -> Float:
    """Return the transform from the estimate's frame to P."""
    s = float(to_pipe(axis, T_oc[:3, 3])[0])
    near, far = (frames_at(axis, np.array(d))[0] for d in (s, s + _START_MM))
    origin = frames_at(axis, np.array(s))[0]
    z = (far - near) / np.linalg.norm(far - near)
    x = T_oc[:3, 0] - z * (z @ T_oc[:3, 0])
    x /= np.linalg.norm(x)
    return inverse(from_parts(np.stack([x, np.cross(z, x), z], -1), origin))


def _roll_of(T_po: Float, axis: PipeAxis, distance_mm: float) -> Float:
    """Return the turn about the tangent that brings the sections' x next to P's x at a distance."""
    rotation = T_po[:3, :3] @ frames_at(axis, np.array(distance_mm))[1]
    angle = np.arctan2(rotation[1, 0], rotation[0, 0])
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
