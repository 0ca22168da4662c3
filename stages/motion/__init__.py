"""Motion: one robust estimate of camera, pipe axis and encoder from texture, rings and encoder together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from pipeline.artefacts import RingPoints, RingSamples, Trajectory
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Illumination, Recording
from pipeline.stage import Context, Stage
from stages.motion.adjustment import adjust, third_difference_sigma
from stages.motion.encoder import contradicted, encoder_at_frames
from stages.motion.equations import MATCH_BIASES, Measurements
from stages.motion.events import find_events
from stages.motion.output import Estimate, in_pipe_frame
from stages.motion.parameters import MotionParameters
from stages.motion.prediction import Predictor
from stages.motion.sections import at_all_frames, ring_bins, ring_centres
from stages.motion.state import EncoderReadings, State, straight_start
from stages.motion.strip import StripGrid
from stages.motion.tracking import TextureTracker, Tracks, track_texture

__all__ = ["MOTION", "MotionParameters", "estimate_motion"]

Float = NDArray[np.float64]
_LOOSE = np.array([0.3, 0.3, 0.3, 0.01, 0.01, 0.01])
_MARGIN_MM = 20.0
_LARGEST_CHANGE = 0.1
_ROUGHLY, _CLOSELY = 1e-2, 1e-5
_BLUE, _RED = 0, 2
_YELLOW_NM = 575.0


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
    All of it is one least-squares problem with robust weights.

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
    tracks = _tracked(recording, probe, grid, predictor, parameters, context)
    if encoder is not None and contradicted(encoder, tracks, context):
        encoder, predictor = None, Predictor(recording.frames.time_s, None, all_centres)
        tracks = _tracked(recording, probe, grid, predictor, parameters, context)
    _require_distance(tracks, encoder)
    unsure = probe.principal_uncertainties()
    bins = ring_bins(rings, probe, unsure, parameters.ring_bins, parameters.surface_sigma_mm)
    bins = replace(bins, frame=_index_of(recording, bins.frame))
    measured = Measurements(tracks, bins, recording.frames.time_s, encoder, probe, unsure, _LOOSE)
    T_pc = predictor.between(tracks.frames, tracks.T_pc, len(recording.frames.frame))
    start = _first_guess(T_pc, tracks.xyz, grid, unsure.shape[1] + MATCH_BIASES, parameters)
    estimate = _adjusted(start, measured, parameters)
    _require_convergence(estimate, radius_mm, context)
    trajectory = in_pipe_frame(estimate, recording.frames, measured)
    events = find_events(recording.frames, trajectory, tracks, estimate.state.slip, encoder is not None)
    _report(context, estimate, tracks, trajectory)
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


def _index_of(recording: Recording, frame: NDArray[np.int64]) -> NDArray[np.int64]:
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
    lit = recording.frames.of(Illumination.LED, Illumination.BOTH)
    both = bool(np.any(recording.frames.illumination == Illumination.BOTH.value))
    # The line is a few σ wide on the wall; its glow is a slope that the normalisation takes out.
    half = 12 * probe.laser.line_sigma_mm if both else 0.0
    blocked = (probe.laser.baseline_mm - half, probe.laser.baseline_mm + half)
    tracker = TextureTracker(probe, grid, parameters, blocked)
    images = zip(_index_of(recording, lit), _wall_images(recording, lit, both, probe), strict=False)
    return track_texture(images, predictor, tracker, lambda done: context.progress(done, len(lit)))


def _wall_images(
    recording: Recording, lit: NDArray[np.int64], both: bool, probe: Probe
) -> Iterator[NDArray[np.uint8] | None]:
    """Yield the lit frames' grey pictures; with the laser on, the colour that its light reaches least."""
    if not both:
        yield from (image for _, image in recording.read(lit, "grey"))
        return
    channel = _RED if probe.laser.wavelength_nm < _YELLOW_NM else _BLUE
    for _, image in recording.read(lit, "bgr"):
        yield None if image is None else np.ascontiguousarray(image[..., channel])


def _require_distance(tracks: Tracks, encoder: EncoderReadings | None) -> None:
    tracked = float(np.mean(~tracks.lost[1:])) if len(tracks.lost) > 1 else 0.0
    if encoder is None and tracked < 0.5:
        raise UnusableError(
            "motion",
            f"the wall's texture could be followed in only {100 * tracked:.0f} % of the lit frames and "
            "there is no encoder, so distance is not determined",
            limit="half of the lit frames",
            hint="give the encoder file, light the wall better, or record lit frames more often",
        )


def _first_guess(
    T_pc: Float, xyz: Float, grid: StripGrid, unsure: int, parameters: MotionParameters
) -> State:
    z = T_pc[:, 2, 3]
    span = (float(z.min()) - _MARGIN_MM, float(z.max()) + grid.far_mm + _MARGIN_MM)
    return straight_start(T_pc, xyz, *span, grid.radius_mm, parameters.axis_knot_mm, unsure)


def _adjusted(start: State, measured: Measurements, parameters: MotionParameters) -> Estimate:
    """Adjust with free motion first, learn from it how smooth the motion is, then adjust again."""
    try:
        # More threads gain nothing on blocks this small, and stall when the machine is busy.
        with threadpool_limits(1):
            free = adjust(start, measured, parameters, _ROUGHLY).state
            sigma = third_difference_sigma(free, measured.tracks.frames)
            smooth = adjust(free, replace(measured, smooth_sigma=sigma), parameters, _CLOSELY)
            return Estimate(smooth, smooth.equations.factor())
    except np.linalg.LinAlgError as error:
        raise UnusableError(
            "motion",
            f"the motion is not determined by this recording ({error})",
            hint="record more lit frames or rings, or give an encoder",
        ) from error


def _require_convergence(estimate: Estimate, radius_mm: float, context: Context) -> None:
    """Refuse an estimate that ran away from the pipe that the rings show; say if it could still gain."""
    context.report("steps of the joint adjustment", estimate.adjusted.trials, "")
    if not estimate.adjusted.settled:
        context.logger.warning("the joint adjustment has not settled after all its steps")
    found = float(estimate.state.globals[0])
    if not abs(found - radius_mm) < _LARGEST_CHANGE * radius_mm:
        raise UnusableError(
            "motion",
            f"the joint estimate does not converge: radius {found:.4g} mm, rings {radius_mm:.4g} mm",
            limit=f"{100 * _LARGEST_CHANGE:.0f} % of change",
            hint="cut the recording where the pictures jump, and process the parts",
        )


def _report(context: Context, estimate: Estimate, tracks: Tracks, trajectory: Trajectory) -> None:
    context.report("landmarks", len(tracks.xyz), "")
    context.report("texture observations", len(tracks.uv), "")
    context.report("lit frames without enough texture", int(tracks.lost[1:].sum()), "frames")
    context.report("median reprojection error", estimate.adjusted.equations.reprojection_px, "px")
    context.report("pipe radius", trajectory.radius_mm, "mm")
    context.report("encoder scale", trajectory.encoder_scale, "")
    context.report("distance travelled", float(np.ptp(trajectory.T_pc[:, 2, 3])), "mm")
    context.report("1 σ of distance at the end", float(np.sqrt(trajectory.covariance[-1, 2, 2])), "mm")


MOTION = Stage(
    "motion",
    "2",
    MotionParameters,
    estimate_motion,
    "camera pose in every frame and the pipe's axis, from texture, rings and encoder together",
)
