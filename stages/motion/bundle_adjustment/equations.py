"""All equations of the joint adjustment at one state, what they cost, and the step they ask for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.bordered import BorderedSystem, Factor, LandmarkRows, Rows, Step, landmark_steps
from pipeline.adjustment.elimination import by_point_and_pose
from pipeline.adjustment.robust import Cauchy, GemanMcClure, robust_spread
from pipeline.arrays import Float
from pipeline.geometry.rigid import inverse, transform
from pipeline.instrument.camera.base import Camera
from pipeline.instrument.probe import Probe
from pipeline.system.threads import in_threads
from stages.motion.bundle_adjustment import residuals
from stages.motion.bundle_adjustment.residuals import RingBins
from stages.motion.bundle_adjustment.unknowns import EncoderReadings, State
from stages.motion.parameters import MotionParameters
from stages.motion.tracking.observations import Tracks

MATCH_BIASES = 2
_FINEST_WALL_MM = 0.02
_REDESCENT = 2.5
_LEAST_EXCESS = 0.3
_ASTRAY_PX = 1000.0
_ROUNDING = 1e-5
_LEAST_REACH = 4
_AT_ONCE, _THREADS = 16384, 2


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
    settled : (1 + Q,) or None
        Encoder scale and instrument, where the rest of the run has settled them.
    """

    tracks: Tracks
    rings: RingBins
    time_s: Float
    encoder: EncoderReadings | None
    probe: Probe
    unsure: Float
    smooth_sigma: Float
    settled: Float | None = None

    def camera_at(self, state: State) -> Camera:
        """Return the camera with the corrections found so far."""
        parameters = self.probe.parameters + self.unsure @ state.instrument[: self.unsure.shape[1]]
        return self.probe.camera.with_parameters(parameters[: len(self.probe.camera.parameter_names)])


@dataclass(frozen=True)
class Scales:
    """What residuals show of themselves.

    Attributes
    ----------
    texture : float
        By how much matches err beyond their predicted σ.
    wall_mm : float
        1 σ of the wall about the smooth pipe.
    """

    texture: float
    wall_mm: float


@dataclass(frozen=True)
class Equations:
    """Every equation, linearised at one state of so many ``frames``.

    Attributes
    ----------
    rows : tuple of Rows
        Those without landmarks whose σ is known beforehand.
    rings : Rows
    texture : LandmarkRows
    """

    frames: int
    rows: tuple[Rows, ...]
    rings: Rows
    texture: LandmarkRows

    @property
    def cost(self) -> float:
        """Return the robust cost: half the squared residuals in σ, where they are small."""
        return sum(row.cost for row in (*self.rows, self.rings)) + self.texture.cost

    @property
    def reprojection_px(self) -> float:
        """Return the median reprojection error, px."""
        size = np.linalg.norm(self.texture.residual, axis=1)
        return float(np.median(size)) if size.size else 0.0

    def step(self, damping: float) -> Step:
        """Return the step to the minimum of the linear equations, shortened by a relative ``damping``.

        Raises
        ------
        numpy.linalg.LinAlgError
            When some unknown is not determined.
        """
        system = self._system()
        inverse_information, right = system.add_landmarks(self.texture, damping)
        frames, border = system.factor(damping).step()
        return Step(frames, border, landmark_steps(self.texture, inverse_information, right, frames, border))

    def decrease(self, step: Step) -> float:
        """Return the decrease of the cost that the linear equations predict of a step."""
        return sum(row.decrease(step) for row in (*self.rows, self.rings)) + self.texture.decrease(step)

    def factor(self) -> Factor:
        """Return the factorised normal equations, for covariances.

        Raises
        ------
        numpy.linalg.LinAlgError
            When some unknown is not determined.
        """
        system = self._system()
        system.add_landmarks(self.texture)
        try:
            return system.factor()
        except np.linalg.LinAlgError:
            # Rounding can make a weakly held direction negative: its σ is then a little too small.
            return system.factor(_ROUNDING)

    def _system(self) -> BorderedSystem:
        border = self.rings.by_border.shape[1]
        system = BorderedSystem(self.frames, border, max(self.texture.reach, _LEAST_REACH))
        for row in (*self.rows, self.rings):
            system.add(row)
        return system


def linearised(
    state: State, measured: Measurements, parameters: MotionParameters, scales: Scales
) -> Equations:
    """Return all equations at a state, judged by given scales."""
    rows = [
        residuals.origin_rows(state),
        residuals.smooth_rows(state, measured.time_s, measured.smooth_sigma),
    ]
    rows.append(residuals.turn_rows(state, parameters.turn_sigma_rad))
    if measured.encoder is None:
        rows.append(residuals.no_slip_rows(state))
    else:
        rows.extend(residuals.encoder_rows(state, measured.encoder, parameters.encoder_slip_sigma_mm))
    rows.append(residuals.axis_rows(state, parameters.axis_bend_sigma))
    scale_sigma, radius_sigma_mm = measured.probe.encoder_scale_sigma, 0.1 * state.nominal_radius_mm
    rows.append(residuals.prior_rows(state, scale_sigma, radius_sigma_mm, measured.settled))
    rings = residuals.ring_rows(state, measured.rings, GemanMcClure(_REDESCENT * scales.wall_mm))
    texture = landmark_rows(state, measured, parameters)
    return rescaled(Equations(len(state.T_pc), tuple(rows), rings, texture), measured.tracks, scales)


def rescaled(equations: Equations, tracks: Tracks, scales: Scales) -> Equations:
    """Return the same equations, judged by other scales."""
    rings = replace(equations.rings, loss=GemanMcClure(_REDESCENT * scales.wall_mm))
    texture = replace(equations.texture, sigma=scales.texture * tracks.sigma_px)
    return replace(equations, rings=rings, texture=texture)


def scales_of(equations: Equations, tracks: Tracks, alike: float) -> Scales:
    """Return the scales that the residuals show; ``alike`` observations of a landmark err alike."""
    size = np.linalg.norm(equations.texture.residual, axis=1)
    excess = _excess_of(size, tracks.sigma_px) * np.sqrt(alike)
    relief = np.abs(equations.rings.residual)
    wall_mm = robust_spread(relief) if relief.size else 1.0
    return Scales(excess, max(wall_mm, _FINEST_WALL_MM))


def landmark_rows(state: State, measured: Measurements, parameters: MotionParameters) -> LandmarkRows:
    """Return the equations of texture, each match with its predicted σ.

    A landmark without a pixel pulls nothing, but costs as one far astray.
    """
    tracks, count = measured.tracks, len(measured.tracks.frame)
    unsure = measured.unsure.shape[1]
    residual, by_point = np.empty((count, 2)), np.empty((count, 2, 3))
    by_pose, by_instrument = np.empty((count, 2, 6)), np.empty((count, 2, unsure + MATCH_BIASES))

    def fill(part: slice) -> None:
        found = _observed(state, measured, parameters.match_bias_px, part)
        for whole, own in zip((residual, by_point, by_pose, by_instrument), found, strict=True):
            whole[part] = own

    parts = [slice(a, a + _AT_ONCE) for a in range(0, count, _AT_ONCE)]
    for _ in in_threads(fill, parts, _THREADS):
        pass
    start = np.searchsorted(tracks.landmark, np.arange(len(state.xyz_p) + 1))
    relief, normal, by_border = residuals.surface(state, state.xyz_p)
    return LandmarkRows(
        start, tracks.frame, by_pose, by_point, by_instrument, residual, tracks.sigma_px,
        normal, by_border, relief, np.full(len(relief), parameters.surface_sigma_mm), Cauchy(),
    )  # fmt: skip


def _observed(
    state: State, measured: Measurements, match_bias_px: float, part: slice
) -> tuple[Float, Float, Float, Float]:
    """Return residuals of some observations and their derivatives by point, pose and instrument."""
    tracks, camera = measured.tracks, measured.camera_at(state)
    T = state.T_pc[tracks.frame[part]]
    xyz_c = transform(inverse(T), state.xyz_p[tracks.landmark[part]])
    bias = _match_bias(xyz_c, tracks.uv[part] - camera.centre_px) * match_bias_px
    residual = camera.project(xyz_c).uv + bias @ state.instrument[-MATCH_BIASES:] - tracks.uv[part]
    by_c, by_parameters = camera.project_jacobian(xyz_c)
    unsure = measured.unsure[: by_parameters.shape[2]]
    by_camera = by_parameters.reshape(2 * len(T), len(unsure)) @ unsure
    by_instrument = np.concatenate([by_camera.reshape(len(T), 2, unsure.shape[1]), bias], -1)
    by_point, by_pose = by_point_and_pose(by_c, T, xyz_c)
    astray = ~np.isfinite(residual).all(1)
    residual[astray] = _ASTRAY_PX
    for derivative in (by_point, by_pose, by_instrument):
        derivative[astray] = 0.0
    return residual, by_point, by_pose, by_instrument


def _excess_of(size: Float, sigma: Float) -> float:
    """Return by how much residuals (M,) of two coordinates exceed their σ: for Rayleigh's median, 1."""
    if not len(size):
        return 1.0
    return max(float(np.median(size / sigma) / np.sqrt(2 * np.log(2))), _LEAST_EXCESS)


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
