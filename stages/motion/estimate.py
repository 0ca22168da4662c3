"""The motion stage: one robust estimate of camera, pipe axis and encoder from texture, rings and encoder.

Texture tracks are landmarks on the wall; rings lie on the wall; the encoder has a scale and slips; the motion
is smooth; the axis bends as little as possible; the instrument is as stated, within its uncertainty. Together
these form one least-squares problem with robust weights. A long run is a chain of such problems, with loops
closed where the probe passes a wall again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pipeline.artefacts.measured import RingPoints, RingSamples, Trajectory
from pipeline.artefacts.motion import MotionEvent
from pipeline.errors import UnusableError
from pipeline.geometry.axis import distance_along, frames_at
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Stage
from pipeline.recording.base import FrameTable, Recording
from pipeline.recording.checks import CheckedFrames
from stages.motion.bundle_adjustment.beyond_rings import estimate_with_wall_beyond
from stages.motion.bundle_adjustment.equations import Equations, Measurements
from stages.motion.bundle_adjustment.solver import Estimate
from stages.motion.bundle_adjustment.unknowns import State
from stages.motion.cuts import beyond_cuts
from stages.motion.events import find_events, warn_of_slips
from stages.motion.loops.loop_closure import LoopReport, close_loops
from stages.motion.loops.revisits import Passage, WallFeatures, bands_in_rings, texture_at
from stages.motion.measuring import measure_run, places_of
from stages.motion.parameters import MotionParameters
from stages.motion.pipe_end import last_on_wall, without_pictures_behind
from stages.motion.rings import looking_at_wall
from stages.motion.route.laying import lay_route
from stages.motion.stated_probe import (
    contradiction,
    report_instrument,
    with_doubtful_instrument,
    with_rivals,
)
from stages.motion.tracking.strips import WallView
from stages.motion.trajectory import (
    SeenCentres,
    camera_trembles,
    displaced_in,
    report_motion,
    report_steps,
    trajectory_of,
)
from stages.motion.windows.measured_run import MeasuredRun
from stages.motion.windows.sliding_window import adjust_run, joined_at_once
from stages.motion.windows.submap_joining import JoinedRun
from stages.motion.wrong_parameters import wrong_parameters

_LARGEST_CHANGE = 0.1
"""Relative difference of the radius from that of the rings from which the adjustment counts as diverged: the
rings' median radius errs by far less. Not measured."""
_MOST_TURNED = np.radians(45)
"""Largest angle between the optical axis and the pipe's: the laser would draw an ellipse of 1.4 to 1 there.
In the sharpest elbow (short radius, a diameter, by ASME B16.9) a probe as long as the pipe is wide turns
by 30°."""
_OBSERVATIONS_AT_ONCE = 1 << 16
_STEPS = 20
"""Most steps of an adjustment with another probe, as in the test for a knock of the laser: with a right one
it takes 5 to 10, with a wrong one it may never converge."""


def estimate_motion(
    recording: Recording,
    probe: Probe,
    rings: RingSamples,
    points: RingPoints,
    parameters: MotionParameters,
    context: Context,
    cut: tuple[int, ...] = (),
    behind_end: int = 0,
) -> Trajectory:
    """Estimate the camera's pose in every frame, with the axis of the pipe and corrections of the probe.

    From the first of the frames ``cut`` on, distances are not known (`beyond_cuts`). ``behind_end``
    is as in `CheckedFrames`.

    Raises
    ------
    UnusableError
        When neither rings nor texture and encoder determine the motion.
    """
    last = last_on_wall(recording, points, behind_end)
    recording = without_pictures_behind(looking_at_wall(recording, rings, points), last)
    run = measure_run(recording, probe, rings, points, parameters, context, last=last)
    check = partial(_require_convergence, run.texture.grid.radius_mm)
    adjusted = run.with_probe_held() if run.bore.reduces else run
    estimate = adjust_run(adjusted, parameters, check, context.progress)
    joined, loops = _with_loops_closed(estimate.joined, run, recording, probe, parameters, context)
    wider = 2 * joined.radius_mm / recording.pipe.nominal_diameter_mm - 1
    doubt, has_encoder = estimate.encoder.doubt_of_probe(wider), run.encoder is not None
    joined = joined.with_scale_sigma(doubt)
    trajectory = trajectory_of(joined, recording.frames, adjusted.probe, has_encoder)
    trajectory = _with_held_probe(trajectory, probe, adjusted) if run.bore.reduces else trajectory
    trajectory = lay_route(trajectory, joined.turn_variance, recording, probe, context)
    trajectory = beyond_cuts(trajectory, cut, run.texture.grid.length_mm)
    events = _events_of(run, joined, trajectory, recording, context)
    seen = SeenCentres(run.circles.centre_c, probe.laser.baseline_mm)
    shakes = camera_trembles(trajectory, run.texture.poses, seen)
    doubted = shakes or run.texture.poses.much_lost
    trajectory = _beside_other_probes(trajectory, run, recording, parameters, context)
    steady, believed = estimate.steady, with_doubtful_instrument(trajectory, probe, estimate.lasting, doubted)
    report_motion(context, estimate, run, believed, shakes, wider)
    require_along_pipe(trajectory)
    loops.report(context)
    report_instrument(probe, trajectory, context)
    return replace(
        believed, events=events, image_scale=steady.scale, image_scale_sigma=steady.scale_sigma,
        radius_doubt=doubt, displaced=displaced_in(estimate.wall_twice, trajectory.frame),
        knock=steady.run.knock,
    )  # fmt: skip


def _with_held_probe(trajectory: Trajectory, probe: Probe, adjusted: MeasuredRun) -> Trajectory:
    """Return a trajectory for which the probe was held, with that probe's own uncertainty."""
    scale_sigma = float(np.hypot(trajectory.scale_sigma, adjusted.held_sigma))
    return replace(trajectory, instrument_covariance=probe.covariance, scale_sigma=scale_sigma)


def _events_of(
    run: MeasuredRun, joined: JoinedRun, trajectory: Trajectory, recording: Recording, context: Context
) -> tuple[MotionEvent, ...]:
    """Return stops, reversals and slips along a trajectory; slips are warned of."""
    has_encoder = run.encoder is not None
    events = find_events(recording.frames, trajectory, run.texture.poses, joined.slip, has_encoder)
    if run.encoder is not None:
        sigmas = run.probe.encoder_scale_sigma, run.encoder.sigma_mm
        warn_of_slips(events, trajectory, joined.slip, *sigmas, context)
    return events


def _beside_other_probes(
    trajectory: Trajectory,
    run: MeasuredRun,
    recording: Recording,
    parameters: MotionParameters,
    context: Context,
) -> Trajectory:
    """Return a trajectory that knows the motions with other probes, where it contradicts the stated one."""
    if not contradiction(trajectory, run.probe).certain:
        return trajectory
    wrong = wrong_parameters(trajectory, run.probe)
    allowed = [replace(run.probe, covariance=w.covariance) for w in wrong]
    few = parameters.model_copy(update={"iterations": min(_STEPS, parameters.iterations)})
    others = (_with_probe(run, probe, recording, few, context) for probe in allowed)
    return with_rivals(trajectory, [t for t in others if t is not None])


def _with_probe(
    run: MeasuredRun, probe: Probe, recording: Recording, parameters: MotionParameters, context: Context
) -> Trajectory | None:
    """Return the motion with another stated probe, without loops; None if pictures do not determine it."""
    check = partial(_require_convergence, run.texture.grid.radius_mm)
    try:
        joined = adjust_run(replace(run, probe=probe), parameters, check, context.progress).joined
    except UnusableError:
        return None
    return trajectory_of(joined, recording.frames, probe, run.encoder is not None)


def _with_loops_closed(
    joined: JoinedRun,
    run: MeasuredRun,
    recording: Recording,
    probe: Probe,
    parameters: MotionParameters,
    context: Context,
) -> tuple[JoinedRun, LoopReport]:
    """Return a joined run with its loops closed, and the report on them."""
    distance = distance_along(joined.axis, joined.T_pc)
    grid, lit, circles = run.texture.grid, run.texture.poses.frames, run.circles
    passage = Passage.of(lit, distance[lit], grid.near_mm, grid.far_mm)
    at_rings = distance[places_of(recording, circles.frame)] + probe.laser.baseline_mm

    def features(passage: Passage) -> WallFeatures:
        bands_mm = bands_in_rings(at_rings, circles.radius_mm)
        observations = run.texture.store.spool.parts(_OBSERVATIONS_AT_ONCE)
        return WallFeatures(texture_at(passage.frame, observations), bands_mm)

    view = WallView(recording, probe, grid)
    return close_loops(joined, passage, features, view, parameters, context.scratch)


@dataclass(frozen=True)
class JointEstimate:
    """All frames of a recording adjusted at once.

    Attributes
    ----------
    measured : Measurements
    state : State
        State at the optimum.
    equations : Equations
        Equations at the optimum, with the robust weights.
    trajectory : Trajectory
        In frame P.
    """

    measured: Measurements
    state: State
    equations: Equations
    trajectory: Trajectory


def adjust_at_once(
    start: State,
    measured: Measurements,
    frames: FrameTable,
    radius_mm: float,
    parameters: MotionParameters,
    context: Context,
) -> JointEstimate:
    """Adjust all frames of a recording at once, however many, without closing loops.

    ``radius_mm`` is the rings' radius, from which the adjusted one must not differ much.

    Raises
    ------
    UnusableError
        When rings and texture do not determine the motion.
    """
    watch = partial(context.progress, 0, 1)
    estimate = estimate_with_wall_beyond(start, measured, parameters, watch)
    report_steps(context, estimate.adjusted.trials, int(not estimate.adjusted.settled))
    _require_convergence(radius_mm, estimate)
    joined, has_encoder = joined_at_once(estimate), measured.encoder is not None
    trajectory = trajectory_of(joined, frames, measured.probe, has_encoder)
    events = find_events(frames, trajectory, measured.tracks.poses, estimate.state.slip, has_encoder)
    trajectory = replace(trajectory, events=events)
    return JointEstimate(measured, estimate.state, estimate.adjusted.equations, trajectory)


def _require_convergence(radius_mm: float, estimate: Estimate) -> None:
    """Refuse an estimate whose radius differs too much from that of the rings."""
    found = float(estimate.state.globals[0])
    if not abs(found - radius_mm) < _LARGEST_CHANGE * radius_mm:
        raise UnusableError(
            "motion",
            f"the adjustment of the motion does not converge: it gives a radius of {found:.4g} mm, the rings "
            f"{radius_mm:.4g} mm",
            limit=f"{100 * _LARGEST_CHANGE:.0f} % of difference",
            hint="check that the pictures are complete, not resized, and taken with the stated probe; where "
            "they jump, cut the recording and process the parts separately",
        )


def _motion_of_run(
    recording: Recording,
    frames: CheckedFrames,
    probe: Probe,
    rings: RingSamples,
    points: RingPoints,
    parameters: MotionParameters,
    context: Context,
) -> Trajectory:
    """Estimate the motion from the frames and encoder as corrected by the stage premises."""
    checked = frames.applied_to(recording)
    return estimate_motion(checked, probe, rings, points, parameters, context, frames.cut, frames.behind_end)


MOTION = Stage(
    "motion",
    "83",
    MotionParameters,
    _motion_of_run,
    "camera pose in every frame and the pipe's axis, from texture, rings and encoder together",
)


def require_along_pipe(trajectory: Trajectory) -> None:
    """Refuse a motion in which the camera looks at the wall and not along the pipe.

    Raises
    ------
    UnusableError
        When the angle between the optical axis and the pipe's exceeds 45°.
    """
    T_pc, limit_deg = trajectory.T_pc, np.degrees(_MOST_TURNED)
    _, R_pa = frames_at(trajectory.axis, distance_along(trajectory.axis, T_pc))
    turned = np.arccos(np.clip(np.einsum("ni,ni->n", T_pc[:, :3, 2], R_pa[:, :, 2]), -1, 1))
    lost = turned > _MOST_TURNED
    if lost.any():
        raise UnusableError(
            "motion",
            f"the estimated camera axis is turned by {np.degrees(turned.max()):.0f}° from the pipe's axis",
            limit=f"{limit_deg:.0f}°",
            frames=trajectory.frame[lost].tolist(),
            hint="read the earlier warnings: something that moves with the probe (a reflection, text, the "
            "line in lit pictures) may have been taken for the wall. Record with less compression, or cut "
            "the recording",
        )
