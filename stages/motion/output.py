"""The estimate expressed in the pipe frame P of the run: its origin, roll and covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.artefacts import PipeAxis, Trajectory
from pipeline.geometry.axis import frames_at, to_pipe
from pipeline.geometry.rigid import from_parts, inverse, transform
from pipeline.recording.base import FrameTable
from stages.motion.adjustment import Adjusted
from stages.motion.bordered import Factor
from stages.motion.equations import Measurements
from stages.motion.state import GLOBALS, State

Float = NDArray[np.float64]
_COVARIANCES = 60
_START_MM = 60.0


@dataclass(frozen=True)
class Estimate:
    """The adjustment's end and the factorised equations there."""

    adjusted: Adjusted
    factor: Factor

    @property
    def state(self) -> State:
        """Return the state at the optimum."""
        return self.adjusted.state


def in_pipe_frame(estimate: Estimate, frames: FrameTable, measured: Measurements) -> Trajectory:
    """Return the trajectory in P: distance 0 and roll those of the first camera, z along the pipe there."""
    state = estimate.state
    T_po = _pipe_of_origin(state.T_pc[0], state.axis)
    first = float(to_pipe(state.axis, state.T_pc[0, :3, 3])[0])
    axis = PipeAxis(
        state.axis.distance_mm - first,
        transform(T_po, state.axis.origin_p),
        T_po[:3, :3] @ state.axis.R_pa @ _roll_of(T_po, state.axis, first),
    )
    T_pc = T_po @ state.T_pc
    covariance = _covariances(estimate, T_po[:3, :3])
    border = estimate.factor.border_covariance()
    unsure = measured.unsure.shape[1]
    own = slice(len(border) - len(state.instrument), len(border) - len(state.instrument) + unsure)
    instrument = border[own, own]
    has_encoder = measured.encoder is not None
    return Trajectory(
        frame=frames.frame,
        time_s=frames.time_s,
        T_pc=T_pc,
        covariance=covariance,
        axis=axis,
        radius_mm=float(state.globals[0]),
        encoder_scale=float(state.globals[3]) if has_encoder else float("nan"),
        encoder_scale_sigma=float(np.sqrt(border[GLOBALS - 1, GLOBALS - 1])) if has_encoder else float("nan"),
        scale_sigma=float(np.sqrt(border[0, 0]) / state.globals[0]),
        events=(),
        instrument=measured.probe.parameters + measured.unsure @ state.instrument[:unsure],
        instrument_covariance=measured.unsure @ instrument @ measured.unsure.T,
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


def _covariances(estimate: Estimate, rotation: Float) -> Float:
    """Return (N, 6, 6) in P; computed for some frames and interpolated, because it varies slowly."""
    n = len(estimate.state.T_pc)
    some = np.unique(np.linspace(0, n - 1, min(n, _COVARIANCES)).round().astype(int))
    own = estimate.factor.frame_covariance(some)[:, :6, :6]
    turn = np.eye(6)
    turn[:3, :3] = rotation
    own = turn @ own @ turn.T
    right = np.clip(np.searchsorted(some, np.arange(n)), min(1, len(some) - 1), len(some) - 1)
    left = np.maximum(right - 1, 0)
    weight = ((np.arange(n) - some[left]) / np.maximum(some[right] - some[left], 1))[:, None, None]
    return np.asarray(own[left] * (1 - weight) + own[right] * weight)
