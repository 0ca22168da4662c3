"""Solves the bundle adjustment of motion, landmarks and pipe (`pipeline.adjustment.levenberg_marquardt`)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from pipeline.adjustment.bordered import Factor
from pipeline.adjustment.levenberg_marquardt import Minimum, Stop, Watch, minimise, unwatched
from pipeline.adjustment.motion_priors import TREMBLING_GROWTH, third_difference_sigma, trembling
from pipeline.adjustment.rows import Step
from pipeline.arrays import Float, Int
from pipeline.errors import UnusableError
from pipeline.geometry.axis import distance_along
from pipeline.geometry.rigid import vector_from_rotation
from stages.motion.bundle_adjustment.equations import (
    Equations,
    Measurements,
    Scales,
    linearised,
    rescaled,
    scales_of,
)
from stages.motion.bundle_adjustment.uneven_steps import uneven_steps
from stages.motion.bundle_adjustment.unknowns import State, moved
from stages.motion.parameters import MotionParameters

ROUGHLY, CLOSELY = 1e-2, 1e-5
"""The adjustment ends if a step promises less than this share of the cost: at 1e-5, about a hundredth of the
cost of 1 σ on a window of some thousand equations. Before the motion's smoothness is known, 1e-2 suffices."""
_ONE_SIGMA = 0.5
"""Cost of 1 σ of any combination of unknowns. The derivatives neglect the rotation of the axis' frames. If a
step promises less than this and yet fails, that may be the reason: it is the last step."""
_FIRST_SCALES = Scales(3.0, 1.0)
"""Scales before there are residuals: wide, so that a poor start does not make outliers."""

_TREMBLES_RAD = 5e-4
"""Rotation from frame to frame, 1 σ, from which pictures count as trembling: a quarter of a pixel at 500 px
per radian. Open-1 shows less than 1e-4, pictures shifted by half a pixel 1.7e-3."""
_ACROSS = np.array([0, 1, 3, 4])
"""Positions and rotations across the pipe. Along it and in roll, differences from frame to frame are errors
of the poses, which smoothness may reduce."""
_LOOSER = 3.0
"""Factor on the 1 σ of trembling in its prior. With a prior of 0 at its own 1 σ all lengths shrink: a drawn
shift of .4 px shortened the pipe by 1.4 %. At three times that σ, the pull is a ninth."""
_SHORTEST_MM = 1.0
"""Distances are compared as if they were at least this long, mm: a probe that stands has none."""
_ROUNDS, _MORE = 3, 1.2
"""The smoothness of trembling pictures is estimated up to this many times more, as long as it grows by a
fifth: the first, loose prior still reduces strong trembling. Not measured."""
_IN_LINE = 4
"""Frames with texture from which the motion at an end of a run is extrapolated: their poses' noise has little
influence, and the motion has not changed much. Not measured."""
_SWING_RAD = np.radians(1)
"""Smallest swing of an end that is not motion: in the few pictures before texture is followed no probe
rotates as far in a pipe. Not measured."""
Adjusted = Minimum[State, Equations]


@dataclass(frozen=True)
class Estimate:
    """The adjustment's end, the factorised equations there, and the smoothness (6,) of the motion."""

    adjusted: Adjusted
    factor: Factor
    smooth_sigma: Float

    @property
    def state(self) -> State:
        """Return the state at the optimum."""
        return self.adjusted.state

    def without_encoder(self) -> Estimate:
        """Return the estimate with equations in which the encoder's readings have no weight, for one step."""
        equations = self.adjusted.equations.without_encoder()
        return replace(self, adjusted=replace(self.adjusted, equations=equations))


def estimate_state(
    start: State,
    measured: Measurements,
    parameters: MotionParameters,
    watch: Watch = unwatched,
    enough: float = CLOSELY,
) -> Estimate:
    """Adjust with a loose motion prior, estimate the smoothness of the motion, then adjust again.

    The second adjustment ends when a step promises less than the share ``enough`` of the cost. ``watch`` is
    called before every step.

    Raises
    ------
    UnusableError
        When the motion is not determined.
    """
    uneven = uneven_steps(measured.encoder, measured.tracks.poses, measured.time_s)
    with _refusing_undetermined():
        measured = replace(measured, smooth_sigma=np.hypot(measured.smooth_sigma, uneven))
        loose = _loosely(start, measured, parameters, watch)
        loose = loose.with_bore_in_place(measured.probe.laser.baseline_mm)
        sigma = np.hypot(_smoothness(loose.T_pc, measured.time_s, measured.tracks.poses.known), uneven)
        return _smoothly(loose, replace(measured, smooth_sigma=sigma), parameters, watch, enough)


def estimate_again(
    before: Estimate, measured: Measurements, parameters: MotionParameters, watch: Watch = unwatched
) -> Estimate:
    """Adjust again from an estimate, with other parameters or a probe of other σ but of the same motion.

    The smoothness of the motion is known from the estimate: that saves the loose adjustment, and most steps.

    Raises
    ------
    UnusableError
        When the motion is not determined.
    """
    with _refusing_undetermined():
        measured = replace(measured, smooth_sigma=before.smooth_sigma)
        return _smoothly(before.state, measured, parameters, watch, CLOSELY)


def _smoothly(
    start: State, measured: Measurements, parameters: MotionParameters, watch: Watch, enough: float
) -> Estimate:
    """Adjust with the measured smoothness of the motion, and again while the poses tremble more than that."""
    known, sigma = measured.tracks.poses.known, measured.smooth_sigma
    smooth = adjust(start, measured, parameters, enough, watch)
    for _ in range(_ROUNDS):
        looser = _looser(sigma, smooth.state.T_pc, measured.time_s, known)
        if np.all(looser < _MORE * sigma):
            break
        sigma = looser
        smooth = adjust(smooth.state, replace(measured, smooth_sigma=sigma), parameters, enough, watch)
    return Estimate(smooth, smooth.equations.factor(), sigma)


def _loosely(start: State, measured: Measurements, parameters: MotionParameters, watch: Watch) -> State:
    """Adjust with a loose motion prior. If the ends of the run swing, do so again with another frame held.

    With a loose prior, a ring alone does not determine the camera's direction. If the first pose, which is
    fixed, then lies on a swing of some degrees, all others rotate with it, and the robust smoothness of the
    next adjustment never removes that. So a frame is fixed whose pose texture determines.
    """
    loose = adjust(start, measured, parameters, ROUGHLY, watch).state
    seen = np.unique(measured.tracks.frame)
    in_line = ends_in_line(loose.T_pc, measured.time_s, seen)
    turn = vector_from_rotation(np.swapaxes(in_line, 1, 2)[:, :3, :3] @ loose.T_pc[:, :3, :3])
    if np.abs(turn).max() < _SWING_RAD:
        return loose
    held = replace(measured, held=int(seen[0]))
    loose = adjust(start, held, parameters, ROUGHLY, watch).state
    return replace(loose, T_pc=ends_in_line(loose.T_pc, measured.time_s, seen))


def ends_in_line(T_pc: Float, time_s: Float, seen: Int) -> Float:
    """Return poses (N, 4, 4); those before and after all texture are extrapolated at constant speed.

    Parameters
    ----------
    T_pc : (N, 4, 4)
    time_s : (N,)
    seen : (K,) int
        Frames with matches of texture, ascending. Ends longer than four of them are not changed.
    """
    out = T_pc.copy()
    if len(seen) < _IN_LINE:
        return out
    inner = seen[_IN_LINE - 1], seen[-_IN_LINE]
    for end, a, b in (
        (slice(0, seen[0]), seen[0], inner[0]),
        (slice(seen[-1] + 1, None), seen[-1], inner[1]),
    ):
        share = (time_s[end] - time_s[a]) / (time_s[b] - time_s[a])
        if np.all(share >= -1):
            turn = vector_from_rotation(T_pc[a, :3, :3].T @ T_pc[b, :3, :3])
            step = np.append(T_pc[b, :3, 3] - T_pc[a, :3, 3], turn)
            out[end] = moved(T_pc[a], share[:, None] * step)
    return out


def scale_between_halves(
    estimate: Estimate, measured: Measurements, parameters: MotionParameters, watch: Watch = unwatched
) -> float:
    """Return the relative 1 σ of distances from adjustments to near and to far matches alone.

    Compression and light shift all matches at one polar angle equally. Residuals do not show it, but the
    distance from either half of the matches then differs from that of all. The larger difference is returned;
    by chance alone it is as large as the σ of the whole estimate.
    """
    tracks = measured.tracks
    away = np.linalg.norm(tracks.uv - measured.probe.camera.centre_px, axis=1)
    near, whole, apart = away > np.median(away), _way_mm(estimate.state), []
    for half in (near, ~near):
        part, seen = tracks.some(half)
        start = replace(estimate.state, xyz_p=estimate.state.xyz_p[seen])
        alone = replace(measured, tracks=part, smooth_sigma=estimate.smooth_sigma)
        with _refusing_undetermined():
            way = _way_mm(adjust(start, alone, parameters, CLOSELY, watch).state)
        apart.append(way / max(whole, _SHORTEST_MM) - 1)
    return float(np.abs(apart).max())


def _way_mm(state: State) -> float:
    return float(np.ptp(distance_along(state.axis, state.T_pc)))


def _smoothness(T_pc: Float, time_s: Float, known: Int) -> Float:
    """Return the 1 σ (6,) of third differences, including the trembling of pictures that tremble."""
    sigma = third_difference_sigma(T_pc, time_s, known)
    shaken = trembling(T_pc, time_s, known)
    if not trembles(shaken):
        return sigma
    added = np.zeros(6)
    added[_ACROSS] = _LOOSER * TREMBLING_GROWTH * shaken[_ACROSS]
    return np.hypot(sigma, added)


def _looser(sigma: Float, T_pc: Float, time_s: Float, known: Int) -> Float:
    """Return 1 σ (6,) of third differences, increased where the poses found with it tremble more."""
    if not trembles(trembling(T_pc, time_s, known)):
        return sigma
    return np.maximum(sigma, _smoothness(T_pc, time_s, known))


def trembles(shaken: Float) -> bool:
    """Return whether trembling (6,) exceeds the error of poses, judged by rotations across the pipe."""
    return float(shaken[3:5].max()) > _TREMBLES_RAD


def estimate_with_shared(
    state: State,
    measured: Measurements,
    shared: Float,
    smooth_sigma: Float,
    parameters: MotionParameters,
    watch: Watch,
) -> Estimate:
    """Adjust from a window's own optimum with the shared parameters (S,) held.

    ``watch`` is called before every step.

    Raises
    ------
    UnusableError
        When the motion is not determined.
    """
    held = replace(measured, smooth_sigma=smooth_sigma, shared=shared)
    with _refusing_undetermined():
        found = adjust(state.with_shared(shared), held, parameters, CLOSELY, watch)
        return Estimate(found, found.equations.factor(), smooth_sigma)


def adjust(
    state: State,
    measured: Measurements,
    parameters: MotionParameters,
    enough: float,
    watch: Watch = unwatched,
) -> Adjusted:
    """Minimise the robust cost of all residuals, until a step promises less than the share ``enough`` of it.

    Raises
    ------
    numpy.linalg.LinAlgError
        When the motion is not determined.
    """

    def equations_at(there: State, scales: Scales | None) -> Equations:
        return linearised(there, measured, parameters, scales or _FIRST_SCALES)

    def moved(there: State, step: Step) -> State:
        return there.step(step.frames, step.border, step.landmarks)

    def with_new_scales(equations: Equations) -> tuple[Equations, Scales | None]:
        scales = scales_of(equations, measured.tracks, parameters.alike)
        return rescaled(equations, measured.tracks, scales), scales

    stop = Stop(parameters.iterations, enough, _ONE_SIGMA)
    return minimise(state, equations_at, moved, with_new_scales, stop, watch)


@contextmanager
def _refusing_undetermined() -> Iterator[None]:
    """Convert the failure to solve the equations into an error that says what to do."""
    try:
        # More threads gain nothing on blocks this small, and stall when the machine is busy.
        with threadpool_limits(1):
            yield
    except np.linalg.LinAlgError as error:
        raise UnusableError(
            "motion",
            f"the motion is not determined by this recording ({error})",
            hint="record more lit frames or rings, or use an encoder",
        ) from error
