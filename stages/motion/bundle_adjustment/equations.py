"""All equations of the bundle adjustment at one state: their cost and the step to their minimum."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.bordered import BorderedSystem, Factor, landmark_steps
from pipeline.adjustment.motion_priors import LOOSE, smooth_motion_rows
from pipeline.adjustment.robust import Cauchy, GemanMcClure, robust_spread
from pipeline.adjustment.rows import LandmarkRows, Rows, Step
from pipeline.arrays import Float
from pipeline.geometry.axis import to_pipe
from pipeline.geometry.rigid import inverse, transform
from pipeline.instrument.camera import Camera
from pipeline.instrument.probe import Probe
from pipeline.system.parallel import in_threads
from stages.motion.bundle_adjustment import residuals
from stages.motion.bundle_adjustment.observations import observe
from stages.motion.bundle_adjustment.unknowns import State
from stages.motion.encoder import EncoderReadings
from stages.motion.parameters import MotionParameters
from stages.motion.rings import RingBins
from stages.motion.tracking.landmarks import Tracks

MATCH_BIASES = 5
"""Corrections of texture matching, last among the instrument's: radial, at this many knots of the polar angle
and linear between. Causes of these errors are local in the picture: compression drops the fine texture of the
dim wall far ahead, an edge of the tracked field cuts patches, a template is seen from another angle. A bias
at the far end alone, modelled as a constant and a slope, was taken for 0.8 mm of distance with 0.03 mm stated
(`test_a_bias_of_distant_matches_is_not_taken_for_distance`)."""
_RADIUS_SHARE = 0.1
"""Prior 1 σ of radius and ovality, as a share of the radius: rings are far more precise."""
_FINEST_WALL_MM = 0.02
"""Smallest spread of the rings around the smooth pipe that is accepted. Not measured."""
_REDESCENT = 2.5
"""Width of the rings' Geman-McClure loss in spreads of the wall: points farther off, such as defects, have
hardly any weight. The usual tuning constant; not measured here."""
_LEAST_EXCESS = 0.3
"""Matches never count as more than three times better than predicted. Not measured."""
_DAMPED = 1e-5
"""Relative damping with which covariances are computed if rounding made the equations singular."""
LEAST_REACH = 4
"""Smallest number of coupled frames: a third difference has four."""
_NO_EVIDENCE_MM = 1e3
"""1 σ of readings that have no weight: it only keeps the slip, which nothing else determines, regular."""
_AT_ONCE, _THREADS = 16384, 2


@dataclass(frozen=True)
class Measurements:
    """The measurements that the adjustment uses.

    Attributes
    ----------
    tracks : Tracks
    rings : RingBins
    time_s : (N,)
    encoder : EncoderReadings or None
    probe : Probe
        The stated probe.
    unsure : (P, Q)
        Principal uncertainties of the probe.
    smooth_sigma : (6,)
        1 σ of the pose's third difference from frame to frame, mm and rad.
    shared : (S,) or None
        Encoder scale and instrument (`State.shared`) of the whole run, once they are known.
    held : int
        Index of the fixed frame, which defines the coordinate frame of the estimate.
    """

    tracks: Tracks
    rings: RingBins
    time_s: Float
    encoder: EncoderReadings | None
    probe: Probe
    unsure: Float
    smooth_sigma: Float
    shared: Float | None = None
    held: int = 0

    @staticmethod
    def of(
        tracks: Tracks, rings: RingBins, time_s: Float, encoder: EncoderReadings | None, probe: Probe
    ) -> Measurements:
        """Return measurements of a motion of yet unknown smoothness."""
        unsure = probe.principal_uncertainties()
        return Measurements(tracks, rings, time_s, encoder, probe, unsure, LOOSE)

    def camera_at(self, state: State) -> Camera:
        """Return the camera with the corrections found so far."""
        parameters = self.probe.parameters + self.unsure @ state.instrument[: self.unsure.shape[1]]
        return self.probe.camera.with_parameters(parameters[: len(self.probe.camera.parameter_names)])


@dataclass(frozen=True)
class Scales:
    """Scales of the residuals, estimated from them.

    Attributes
    ----------
    texture : float
        Error of the matches over their predicted σ.
    wall_mm : float
        1 σ of the wall around the smooth pipe.
    """

    texture: float
    wall_mm: float


@dataclass(frozen=True)
class Equations:
    """All equations, linearised at one state of ``frames`` frames.

    Attributes
    ----------
    rows : tuple of Rows
        Equations without landmarks, with known σ.
    rings : Rows
    texture : LandmarkRows
    readings : int or None
        Place of the encoder's readings in ``rows``.
    """

    frames: int
    rows: tuple[Rows, ...]
    rings: Rows
    texture: LandmarkRows
    readings: int | None = None

    def without_encoder(self) -> Equations:
        """Return the equations without weight of the encoder's readings."""
        if self.readings is None:
            return self
        rows = list(self.rows)
        reading = rows[self.readings]
        rows[self.readings] = replace(reading, sigma=np.full_like(reading.sigma, _NO_EVIDENCE_MM))
        return replace(self, rows=tuple(rows), readings=None)

    @property
    def cost(self) -> float:
        """Return the robust cost: half the squared residuals in σ, as far as they are small."""
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
        """Return the decrease of the cost that the linear equations predict for a step."""
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
        return factorised(system)

    def _system(self) -> BorderedSystem:
        border = self.rings.by_border.shape[1]
        system = BorderedSystem(self.frames, border, max(self.texture.reach, LEAST_REACH))
        for row in (*self.rows, self.rings):
            system.add(row)
        return system


def factorised(system: BorderedSystem) -> Factor:
    """Return the factorised system, for covariances.

    Raises
    ------
    numpy.linalg.LinAlgError
        When some unknown is not determined.
    """
    try:
        return system.factor()
    except np.linalg.LinAlgError:
        # Rounding can make a weakly determined direction negative: its σ is then a little too small.
        return system.factor(_DAMPED)


def linearised(
    state: State, measured: Measurements, parameters: MotionParameters, scales: Scales
) -> Equations:
    """Return all equations at a state, weighted by given scales."""
    rows = [
        residuals.origin_rows(state, measured.held),
        smooth_motion_rows(state.T_pc, measured.time_s, measured.smooth_sigma, state.border_size),
    ]
    rows.append(residuals.turn_rows(state, parameters.turn_sigma_rad))
    rows.append(residuals.view_rows(state))
    readings = None if measured.encoder is None else len(rows)
    if measured.encoder is None:
        rows.append(residuals.no_slip_rows(state))
    else:
        rows.extend(residuals.encoder_rows(state, measured.encoder, parameters.encoder_slip_sigma_mm))
    rows.append(residuals.axis_rows(state, parameters.axis_bend_sigma))
    scale_sigma, radius_sigma_mm = measured.probe.encoder_scale_sigma, _RADIUS_SHARE * state.nominal_radius_mm
    rows.append(residuals.prior_rows(state, scale_sigma, radius_sigma_mm, measured.shared))
    with ThreadPoolExecutor(1) as beside:
        loss = GemanMcClure(_REDESCENT * scales.wall_mm)
        rings = beside.submit(residuals.ring_rows, state, measured.rings, loss)
        texture = landmark_rows(state, measured, parameters)
    equations = Equations(len(state.T_pc), tuple(rows), rings.result(), texture, readings)
    return rescaled(equations, measured.tracks, scales)


def rescaled(equations: Equations, tracks: Tracks, scales: Scales) -> Equations:
    """Return the same equations, weighted by other scales."""
    rings = replace(equations.rings, loss=GemanMcClure(_REDESCENT * scales.wall_mm))
    texture = replace(equations.texture, sigma=scales.texture * tracks.sigma_px)
    return replace(equations, rings=rings, texture=texture)


def scales_of(equations: Equations, tracks: Tracks, alike: float) -> Scales:
    """Return the scales of the residuals; ``alike`` neighbouring observations of a landmark share errors."""
    size = np.linalg.norm(equations.texture.residual, axis=1)
    excess = _excess_of(size, tracks.sigma_px) * np.sqrt(alike)
    relief = np.abs(equations.rings.residual)
    wall_mm = robust_spread(relief) if relief.size else 1.0
    return Scales(excess, max(wall_mm, _FINEST_WALL_MM))


def landmark_rows(state: State, measured: Measurements, parameters: MotionParameters) -> LandmarkRows:
    """Return the equations of texture, each match with its predicted σ.

    A landmark without a projection has no influence, but costs as much as one far from its match.
    """
    tracks, count = measured.tracks, len(measured.tracks.frame)
    unsure = measured.unsure.shape[1]
    residual, by_point = np.empty((count, 2)), np.empty((count, 2, 3))
    by_pose, by_instrument = np.empty((count, 2, 6)), np.empty((count, 2, unsure + MATCH_BIASES))
    arrays = residual, by_point, by_pose, by_instrument

    def fill(part: slice) -> None:
        _observe(state, T_cp, measured, parameters.match_bias_px, part, tuple(a[part] for a in arrays))

    T_cp = inverse(state.T_pc)
    parts = [slice(a, a + _AT_ONCE) for a in range(0, count, _AT_ONCE)]
    for _ in in_threads(fill, parts, _THREADS):
        pass
    start = np.searchsorted(tracks.landmark, np.arange(len(state.xyz_p) + 1))
    relief, normal, by_border = residuals.surface(state, state.xyz_p)
    at_mm = to_pipe(state.axis, state.xyz_p)[0]
    unsure_mm = state.bore.sigma_at(at_mm, state.nominal_radius_mm)
    return LandmarkRows(
        start, tracks.frame, by_pose, by_point, by_instrument, residual, tracks.sigma_px,
        normal, by_border, relief, np.hypot(parameters.surface_sigma_mm, unsure_mm), Cauchy(),
    )  # fmt: skip


def _observe(
    state: State, T_cp: Float, measured: Measurements, bias_px: float, part: slice, out: tuple[Float, ...]
) -> None:
    """Write residuals of some observations and their derivatives by point, pose and instrument.

    Shared errors point outward at the projected place: at the matched one, its noise lengthened distances.
    """
    tracks, camera = measured.tracks, measured.camera_at(state)
    frame, uv = tracks.frame[part], tracks.uv[part]
    xyz_c = transform(T_cp[frame], state.xyz_p[tracks.landmark[part]])
    by_c, by_parameters = camera.project_jacobian(xyz_c)
    unsure = measured.unsure[: by_parameters.shape[2]]
    seen, biases = camera.project(xyz_c).uv, state.instrument[-MATCH_BIASES:]
    observe(
        seen - uv, by_c, by_parameters, unsure, xyz_c, state.T_pc[frame], seen - camera.centre_px, bias_px,
        biases, *out,
    )  # fmt: skip


def _excess_of(size: Float, sigma: Float) -> float:
    """Return the ratio of residuals (M,) of two coordinates to their σ; 1 at the median of Rayleigh's law."""
    if not len(size):
        return 1.0
    return max(float(np.median(size / sigma) / np.sqrt(2 * np.log(2))), _LEAST_EXCESS)
