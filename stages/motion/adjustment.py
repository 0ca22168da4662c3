"""The joint robust estimate of motion, landmarks and pipe."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.geometry.rigid import inverse, skew, transform, vector_from_rotation
from pipeline.instrument.camera.base import Camera
from pipeline.instrument.probe import Probe
from stages.motion import terms
from stages.motion.bordered import BorderedSystem, Factor, LandmarkRows, Rows, landmark_steps
from stages.motion.parameters import MotionParameters
from stages.motion.state import EncoderReadings, State
from stages.motion.terms import RingBins, cauchy
from stages.motion.tracking import Tracks

Float = NDArray[np.float64]
_CONVERGED_MM = 1e-3
MATCH_BIASES = 2
_THETA_SPAN = 0.35  # half the range of polar angles tracked, rad


@dataclass(frozen=True)
class Measurements:
    """All that the adjustment is fed with.

    Attributes
    ----------
    tracks : Tracks
    rings : RingBins
    time_s : (N,)
    encoder : EncoderReadings or None
    probe : Probe
        As stated.
    unsure : (P, Q)
        Its principal uncertainties.
    smooth_sigma : (6,)
        1 σ of the pose's third difference from frame to frame, mm and rad.
    """

    tracks: Tracks
    rings: RingBins
    time_s: Float
    encoder: EncoderReadings | None
    probe: Probe
    unsure: Float
    smooth_sigma: Float

    def camera_at(self, state: State) -> Camera:
        """Return the camera with the corrections found so far."""
        parameters = self.probe.parameters + self.unsure @ state.instrument[: self.unsure.shape[1]]
        return self.probe.camera.with_parameters(parameters[: len(self.probe.camera.parameter_names)])


@dataclass(frozen=True)
class Estimate:
    """State at the optimum, the factorised equations there, and the texture's reprojection error, px."""

    state: State
    factor: Factor
    reprojection_px: float


def adjust(state: State, measured: Measurements, parameters: MotionParameters) -> Estimate:
    """Minimise all residuals together by Gauss-Newton with Cauchy weights.

    Raises
    ------
    numpy.linalg.LinAlgError
        When the motion is not determined.
    """
    excess = 3.0
    for _ in range(parameters.iterations):
        landmarks, reprojection, excess = landmark_rows(state, measured, parameters, excess)
        system = assembled(state, measured, parameters)
        inverse_information, right = system.add_landmarks(landmarks)
        factor = system.factor()
        frames, border = factor.step()
        points = landmark_steps(landmarks, inverse_information, right, frames, border)
        # A step longer than the pipe is wide is no longer linear.
        part = min(1.0, state.nominal_radius_mm / max(float(np.abs(frames[:, :3]).max()), 1e-9))
        state = state.step(part * frames, part * border, part * points)
        if np.abs(frames[:, :3]).max() < _CONVERGED_MM:
            break
    return Estimate(state, factor, reprojection)


def assembled(state: State, measured: Measurements, parameters: MotionParameters) -> BorderedSystem:
    """Return the system with every equation that has no landmark."""
    reach = max(int(_span(measured.tracks)), 4)
    system = BorderedSystem(len(state.T_pc), state.border_size, reach)
    rows: list[Rows] = [terms.origin_rows(state), terms.ring_rows(state, measured.rings)]
    rows.append(terms.smooth_rows(state, measured.time_s, measured.smooth_sigma))
    rows.append(terms.turn_rows(state, parameters.turn_sigma_rad))
    if measured.encoder is None:
        rows.append(terms.no_slip_rows(state))
    else:
        rows.extend(terms.encoder_rows(state, measured.encoder, parameters.encoder_slip_sigma_mm))
    encoder_sigma, radius_sigma_mm = measured.probe.encoder_scale_sigma, 0.1 * state.nominal_radius_mm
    rows.append(terms.border_rows(state, parameters.axis_bend_sigma, encoder_sigma, radius_sigma_mm))
    for row in rows:
        system.add(row)
    return system


def landmark_rows(
    state: State, measured: Measurements, parameters: MotionParameters, excess: float
) -> tuple[LandmarkRows, float, float]:
    """Linearise the texture; return its equations, the robust reprojection error and its excess over σ."""
    tracks, camera = measured.tracks, measured.camera_at(state)
    T = state.T_pc[tracks.frame]
    xyz_c = transform(inverse(T), state.xyz_p[tracks.landmark])
    bias = _match_bias(xyz_c, tracks.uv - camera.centre_px) * parameters.match_bias_px
    residual = camera.project(xyz_c).uv + bias @ state.instrument[-MATCH_BIASES:] - tracks.uv
    by_c, by_parameters = camera.project_jacobian(xyz_c)
    by_camera = by_parameters @ measured.unsure[: by_parameters.shape[2]]
    by_instrument = np.concatenate([by_camera, bias], -1)
    by_point = by_c @ np.swapaxes(T[:, :3, :3], 1, 2)
    by_pose = np.concatenate([-by_point, by_c @ skew(xyz_c)], -1)
    size = np.linalg.norm(residual, axis=1)
    sigma = tracks.sigma_px * excess
    weight = cauchy(size / sigma) / sigma**2
    bad = ~np.isfinite(residual).all(1)
    for part in (weight, residual, by_point, by_pose, by_instrument):
        part[bad] = 0.0
    s_residual, normal, by_border = terms.surface(state, state.xyz_p)
    s_sigma = parameters.surface_sigma_mm
    start = np.searchsorted(tracks.landmark, np.arange(len(state.xyz_p) + 1))
    rows = LandmarkRows(
        start, tracks.frame, by_pose, by_point, by_instrument, residual, weight,
        normal, by_border, s_residual, cauchy(s_residual / s_sigma) / s_sigma**2,
    )  # fmt: skip
    reprojection = float(np.median(size[~bad])) if not bad.all() else 0.0
    return rows, reprojection, _excess_of(size[~bad], tracks.sigma_px[~bad]) * np.sqrt(parameters.alike)


def _excess_of(size: Float, sigma: Float) -> float:
    """Return by how much residuals (M,) of two coordinates exceed their σ: for Rayleigh's median, 1."""
    if not len(size):
        return 1.0
    return max(float(np.median(size / sigma) / np.sqrt(2 * np.log(2))), 0.3)


def _match_bias(xyz_c: Float, from_centre_px: Float) -> Float:
    """Return (M, 2, 2) what matching may get wrong alike all round: radial, constant and linear in θ.

    Light that falls off across a patch and blur that grows with distance shift matches along the radius; that
    must not be taken for the lens.
    """
    theta = np.arctan2(np.hypot(xyz_c[:, 0], xyz_c[:, 1]), xyz_c[:, 2])
    radial = from_centre_px / np.maximum(np.linalg.norm(from_centre_px, axis=1), 1.0)[:, None]
    return np.asarray(
        radial[:, :, None] * np.stack([np.ones_like(theta), (theta - 1.0) / 0.35], -1)[:, None, :]
    )


def third_difference_sigma(state: State, lit: NDArray[np.int64]) -> Float:
    """Return the robust size (6,) of the pose's third differences, scaled from lit frames to all frames."""
    floor = np.array([1e-4] * 3 + [1e-6] * 3)
    if len(lit) < 8:
        return 100 * floor
    window = np.arange(len(lit) - 3)[:, None] + np.arange(4)
    T = state.T_pc[lit[window]]
    turn = vector_from_rotation(np.swapaxes(T[:, 1:2, :3, :3], -1, -2) @ T[..., :3, :3])
    pose = np.concatenate([T[..., :3, 3], turn], -1)
    third = np.einsum("k,nki->ni", np.array([-1.0, 3, -3, 1]), pose)
    stride = float(np.median(np.diff(lit)))
    return np.asarray(np.maximum(1.4826 * np.median(np.abs(third), 0) / stride**2, floor))


def _span(tracks: Tracks) -> float:
    """Return the longest span of frames of one landmark."""
    if not len(tracks.frame):
        return 0.0
    start = np.flatnonzero(np.diff(tracks.landmark, prepend=-1))
    end = np.append(start[1:], len(tracks.landmark)) - 1
    return float(np.max(tracks.frame[end] - tracks.frame[start]))
