"""Motion: one robust estimate of camera, pipe axis and encoder from texture, rings and encoder together."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingPoints, RingSamples, Trajectory
from pipeline.errors import UnusableError
from pipeline.geometry.axis import distance_along
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Stage
from pipeline.recording.base import Recording
from stages.motion.bundle_adjustment.unknowns import EncoderReadings
from stages.motion.encoder import contradicted, encoder_at_frames
from stages.motion.events import find_events
from stages.motion.loops.loop_closure import close_loops
from stages.motion.loops.revisits import Passage, Signs, bands_in_rings, texture_at
from stages.motion.parameters import MotionParameters
from stages.motion.rings import at_all_frames, ring_centres
from stages.motion.stated import report_instrument
from stages.motion.tracking.observations import Course, Tracks
from stages.motion.tracking.prediction import Predictor
from stages.motion.tracking.strips import StripGrid
from stages.motion.tracking.tracker import Followed, TextureTracker, track_texture
from stages.motion.tracking.wall_view import WallView
from stages.motion.trajectory import trajectory_of
from stages.motion.windows.measured_run import MeasuredRun
from stages.motion.windows.sliding_window import RunEstimate, adjust_run
from stages.motion.windows.submaps import Estimate

__all__ = ["MOTION", "MotionParameters", "estimate_motion"]

_LARGEST_CHANGE = 0.1
_AT_ONCE = 1 << 16


def estimate_motion(
    recording: Recording,
    probe: Probe,
    rings: RingSamples,
    points: RingPoints,
    parameters: MotionParameters,
    context: Context,
) -> Trajectory:
    """Estimate the camera's pose in every frame, with the axis of the pipe and corrections of the probe.

    Texture tracks are landmarks on the wall; rings lie on the wall; the encoder has a scale and slips; the
    motion is smooth; the axis bends as little as it may; the instrument is as stated within its uncertainty.
    All of it is one least-squares problem with robust weights; a long run is a chain of them, whose loops are
    closed where the probe passes a wall again.

    Raises
    ------
    UnusableError
        When neither rings nor texture and encoder determine the motion.
    """
    centre_c, radius_mm = _pipe_in_rings(points)
    grid = _strip_grid(radius_mm, parameters)
    encoder = encoder_at_frames(recording, parameters.encoder_sigma_mm, grid.far_mm, context)
    all_centres = at_all_frames(_index_of(recording, points.frame), centre_c, len(recording.frames.frame))
    predictor = Predictor(recording.frames.time_s, encoder, all_centres)
    view = WallView(recording, probe, grid)
    followed = _followed(view, predictor, parameters, context)
    if encoder is not None and contradicted(encoder, followed, context):
        encoder, predictor = None, Predictor(recording.frames.time_s, None, all_centres)
        followed = _followed(view, predictor, parameters, context)
    _require_distance(followed, encoder)
    place = _index_of(recording, rings.frame)
    unsure = probe.principal_uncertainties()
    T_pc = predictor.between(followed.frames, followed.T_pc, len(recording.frames.frame))
    run = MeasuredRun(followed, rings, place, recording.frames.time_s, T_pc, encoder, probe, unsure)
    estimate = adjust_run(run, parameters, partial(_require_pipe, radius_mm), context.progress)
    distance = distance_along(estimate.joined.axis, estimate.joined.T_pc)
    passage = Passage.of(followed.frames, distance[followed.frames], grid.near_mm, grid.far_mm)
    at_rings = distance[_index_of(recording, points.frame)] + probe.laser.baseline_mm
    signs = partial(_signs, followed, points, at_rings)
    joined, loops = close_loops(estimate.joined, passage, signs, view, parameters, context.scratch)
    trajectory = trajectory_of(joined, recording.frames, probe, unsure, encoder is not None)
    events = find_events(recording.frames, trajectory, followed, joined.slip, encoder is not None)
    _report(context, estimate, followed, trajectory)
    loops.report(context)
    report_instrument(probe, trajectory, context)
    return replace(trajectory, events=events)


def _pipe_in_rings(points: RingPoints) -> tuple[Float, float]:
    centre_c, radius, _ = ring_centres(points)
    if np.isfinite(radius).sum() < 3:
        raise UnusableError(
            "motion",
            f"only {int(np.isfinite(radius).sum())} laser frames show enough of a ring to place the pipe",
            limit="3 rings seen over 30 % of the circle",
            hint="check exposure and that the laser is on; see the rejected ring samples by reason",
        )
    return centre_c, float(np.nanmedian(radius))


def _strip_grid(radius_mm: float, parameters: MotionParameters) -> StripGrid:
    near = radius_mm / np.tan(np.radians(parameters.near_angle_deg))
    far = radius_mm / np.tan(np.radians(parameters.far_angle_deg))
    columns = max(round(2 * np.pi * radius_mm / parameters.strip_step_mm / 4), 60) * 4
    return StripGrid(radius_mm, columns, near, far)


def _index_of(recording: Recording, frame: Int) -> Int:
    """Return the positions of frame numbers in the recording's frame table."""
    return np.asarray(np.searchsorted(recording.frames.frame, frame))


def _tracked(
    recording: Recording,
    probe: Probe,
    grid: StripGrid,
    predictor: Predictor,
    parameters: MotionParameters,
    context: Context,
) -> Tracks:
    """Return the tracks of a whole recording at once."""
    followed = _followed(WallView(recording, probe, grid), predictor, parameters, context)
    return followed.between(0, len(recording.frames.frame))


def _followed(
    view: WallView, predictor: Predictor, parameters: MotionParameters, context: Context
) -> Followed:
    tracker = TextureTracker(view.probe, view.grid, parameters, view.blocked_mm, context.scratch)
    lit = view.lit
    return track_texture(view.images(lit), predictor, tracker, lambda done: context.progress(done, len(lit)))


def _signs(followed: Followed, points: RingPoints, ring_distance_mm: Float, passage: Passage) -> Signs:
    """Return what makes the wall of a passage easy to recognise; rings (F,) lie at these distances."""
    observations = followed.store.spool.parts(_AT_ONCE)
    bands_mm = bands_in_rings(ring_distance_mm, ring_centres(points)[1])
    return Signs(texture_at(passage.frame, observations), bands_mm)


def _require_distance(tracks: Course, encoder: EncoderReadings | None) -> None:
    tracked = float(np.mean(~tracks.lost[1:])) if len(tracks.lost) > 1 else 0.0
    if encoder is None and tracked < 0.5:
        raise UnusableError(
            "motion",
            f"the wall's texture could be followed in only {100 * tracked:.0f} % of the lit frames and "
            "there is no encoder, so distance is not determined",
            limit="half of the lit frames",
            hint="give the encoder file, light the wall better, or record lit frames more often",
        )


def _require_convergence(estimate: Estimate, radius_mm: float, context: Context) -> None:
    """Refuse an estimate that ran away from the pipe that the rings show; say if it could still gain."""
    _report_steps(context, estimate.adjusted.trials, int(not estimate.adjusted.settled))
    _require_pipe(radius_mm, estimate)


def _require_pipe(radius_mm: float, estimate: Estimate) -> None:
    found = float(estimate.state.globals[0])
    if not abs(found - radius_mm) < _LARGEST_CHANGE * radius_mm:
        raise UnusableError(
            "motion",
            f"the joint estimate does not converge: radius {found:.4g} mm, rings {radius_mm:.4g} mm",
            limit=f"{100 * _LARGEST_CHANGE:.0f} % of change",
            hint="cut the recording where the pictures jump, and process the parts",
        )


def _report_steps(context: Context, steps: int, unsettled: int) -> None:
    context.report("steps of the joint adjustment", steps, "")
    if unsettled:
        context.logger.warning("the joint adjustment has not settled after all its steps")


def _report(context: Context, estimate: RunEstimate, followed: Followed, trajectory: Trajectory) -> None:
    _report_steps(context, estimate.trials, estimate.unsettled)
    context.report("landmarks", followed.store.landmarks, "")
    context.report("texture observations", followed.store.spool.count, "")
    context.report("lit frames without enough texture", int(followed.lost[1:].sum()), "frames")
    context.report("median reprojection error", estimate.reprojection_px, "px")
    context.report("pipe radius", trajectory.radius_mm, "mm")
    context.report("encoder scale", trajectory.encoder_scale, "")
    context.report(
        "distance travelled", float(np.ptp(distance_along(trajectory.axis, trajectory.T_pc))), "mm"
    )
    context.report("1 σ of distance at the end", trajectory.distance_sigma_mm, "mm")


MOTION = Stage(
    "motion",
    "4",
    MotionParameters,
    estimate_motion,
    "camera pose in every frame and the pipe's axis, from texture, rings and encoder together",
)
