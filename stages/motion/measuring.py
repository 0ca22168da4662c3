"""Gathers the measurements for the motion: tracked texture of the wall, rings and their bore, encoder."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingPoints, RingSamples
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.recording.base import Recording
from stages.motion.bore import Bore, warn_of_steps
from stages.motion.bundle_adjustment.encoder_delay import in_step_with_wall
from stages.motion.bundle_adjustment.laser_knock import find_jump, texture_breaks
from stages.motion.encoder import (
    EncoderReadings,
    PosePredictor,
    contradicted,
    encoder_at_frames,
    warn_of_unread,
)
from stages.motion.frame_times import frame_times
from stages.motion.parameters import MotionParameters
from stages.motion.pipe_end import end_in_view
from stages.motion.rings import RingCircles, circles_in_rings
from stages.motion.tracking.landmarks import TrackedPoses
from stages.motion.tracking.strips import StripGrid, WallView
from stages.motion.tracking.tracker import TextureTracker, TrackedTexture, track_texture
from stages.motion.windows.measured_run import MeasuredRun

_OFTEN_AMBIGUOUS = 0.1
"""Share of the lit frames in which the step may be ambiguous without a warning (chosen)."""
_LEAST_TRACKED = 0.5
"""Share of the lit frames in which texture must be followed if there is no encoder. Not measured."""
_FEWEST_COLUMNS = 240
"""Fewest columns of a strip, in thin pipes: ten cells of ``cell_px`` around."""
_FOLLOWED_ANEW = 2
"""Number of times that texture is tracked again in a reducer, each time with a better known bore. Without an
encoder, texture seems to move faster in proportion as the bore is narrower."""


def measure_run(
    recording: Recording,
    probe: Probe,
    rings: RingSamples,
    points: RingPoints,
    parameters: MotionParameters,
    context: Context,
    use_encoder: bool = True,
    last: int | None = None,
) -> MeasuredRun:
    """Track the wall's texture and gather the measurements: texture, rings, times and encoder.

    Without ``use_encoder`` the encoder is left out, so that it can be compared with the pictures. ``last`` is
    the place, in the list of frames, of the last ring on the wall, if the run goes on behind it.

    Raises
    ------
    UnusableError
        When the rings do not place the pipe, or neither texture nor encoder determines the distance.
    """
    circles, rings = circles_in_rings(points), rings.placed_in(points)
    grid = strip_grid(circles.usual_radius_mm, parameters)
    view = WallView(recording, probe, grid, end_in_view(recording, last, grid.far_mm, context))
    tracked = _tracked(view, circles, parameters, context, use_encoder)
    encoder = tracked.encoder
    followed = _in_bore(circles, tracked.texture, tracked.predictor, view, encoder)
    if followed.bore.reduces:
        followed = _in_reducer(followed, circles, view, encoder, parameters, context)
        _warn_of_reducer(followed.bore, encoder, context)
    bore = followed.bore
    warn_of_steps(bore, context)
    context.report("steps of the bore", len(bore.at_mm) + bore.reduces, "")
    jump = find_jump(circles, followed.at_mm, points, probe)
    if jump is not None and texture_breaks(jump, rings.frame, followed.texture.poses):
        jump = None
    return MeasuredRun(
        followed.texture, rings, places_of(recording, rings.frame), tracked.time_s, followed.T_pc, encoder,
        probe, bore, circles, jump=jump,
    )  # fmt: skip


@dataclass(frozen=True)
class _Tracked:
    """Texture tracked on a cylinder, its predictor of poses, the encoder if used, and times (N,), s."""

    texture: TrackedTexture
    predictor: PosePredictor
    encoder: EncoderReadings | None
    time_s: Float


def _tracked(
    view: WallView, circles: RingCircles, parameters: MotionParameters, context: Context, use_encoder: bool
) -> _Tracked:
    """Track texture with the encoder, or without it if the texture contradicts it."""
    recording, far_mm, encoder = view.recording, view.grid.far_mm, None
    if use_encoder:
        encoder = encoder_at_frames(recording, parameters.encoder_sigma_mm, far_mm, context)
    texture, predictor = _track(view, circles, encoder, parameters, context)
    times = frame_times(recording, texture.poses, context)
    if encoder is not None and times is not recording.frames.time_s:
        recording = replace(recording, frames=replace(recording.frames, time_s=times))
        encoder = encoder_at_frames(recording, parameters.encoder_sigma_mm, far_mm, context)
    if encoder is not None and contradicted(encoder, texture.poses):
        encoder = in_step_with_wall(encoder, texture.poses, recording.frames, context)
        texture, predictor = _track(view, circles, encoder, parameters, context)
    if encoder is not None:
        warn_of_unread(encoder, texture.poses, recording.frames.frame, context)
    _require_distance(texture.poses, encoder)
    if encoder is None:
        _warn_of_repetition(texture, context)
    return _Tracked(texture, predictor, encoder, recording.frames.time_s)


def _warn_of_repetition(texture: TrackedTexture, context: Context) -> None:
    lit = len(texture.poses.frames)
    if texture.ambiguous <= _OFTEN_AMBIGUOUS * lit:
        return
    context.warn(
        f"the texture of the wall repeats along the pipe, and there is no encoder: in {texture.ambiguous} of "
        f"{lit} lit frames another step, longer or shorter by one period, fits the pictures as well, or the "
        "picture before was lost. Distances are right only if the probe moved by less than half a period "
        "between lit frames; otherwise each of these frames may be wrong by one period, which the σ of "
        "distances does not include. What to do: record with an encoder, or compare the distance with a "
        "known one"
    )


def strip_grid(radius_mm: float, parameters: MotionParameters) -> StripGrid:
    """Return the sampling of the wall between the near and the far angle, in a pipe of a radius."""
    near = radius_mm / np.tan(np.radians(parameters.near_angle_deg))
    far = radius_mm / np.tan(np.radians(parameters.far_angle_deg))
    columns = max(4 * round(2 * np.pi * radius_mm / parameters.strip_step_mm / 4), _FEWEST_COLUMNS)
    return StripGrid(radius_mm, columns, near, far)


def places_of(recording: Recording, frame: Int) -> Int:
    """Return the places of frame numbers in the recording's list of frames."""
    return np.asarray(np.searchsorted(recording.frames.frame, frame))


def _track(
    view: WallView,
    circles: RingCircles,
    encoder: EncoderReadings | None,
    parameters: MotionParameters,
    context: Context,
) -> tuple[TrackedTexture, PosePredictor]:
    frames, lit = view.recording.frames, view.lit
    predictor = PosePredictor(frames.time_s, encoder, circles.centre_at(frames.frame))
    tracker = TextureTracker(view.probe, view.grid, parameters, view.hidden, context.scratch)
    images = view.images(lit)
    found = track_texture(images, predictor, tracker, lambda done: context.progress(done, len(lit)))
    return found, predictor


@dataclass(frozen=True)
class _Followed:
    """Tracked texture, its poses (N, 4, 4), the distances of the rings (F,) by these poses, and the bore."""

    texture: TrackedTexture
    T_pc: Float
    at_mm: Float
    bore: Bore


def _in_bore(
    circles: RingCircles,
    texture: TrackedTexture,
    predictor: PosePredictor,
    view: WallView,
    encoder: EncoderReadings | None = None,
) -> _Followed:
    """Return first guesses of the poses, and the bore that follows from rings at these poses.

    In a reducer an ``encoder`` gives better distances than texture that was tracked on a cylinder.
    """
    T_pc, place = predictor.between(texture.poses), places_of(view.recording, circles.frame)
    at_mm = T_pc[place, 2, 3] + view.probe.laser.baseline_mm
    bore = Bore.of(circles.radius_mm, at_mm)
    if encoder is not None and bore.reduces:
        way = encoder.distance_mm - encoder.distance_mm[texture.poses.frames[0]]
        bore = Bore.of(circles.radius_mm, way[place] + view.probe.laser.baseline_mm)
    return _Followed(texture, T_pc, at_mm, bore)


def _in_reducer(
    followed: _Followed,
    circles: RingCircles,
    view: WallView,
    encoder: EncoderReadings | None,
    parameters: MotionParameters,
    context: Context,
) -> _Followed:
    """Return texture that was tracked on a wall with the width of its rings, not on a cylinder."""
    for _ in range(_FOLLOWED_ANEW):
        view = replace(view, grid=replace(view.grid, bore=followed.bore))
        texture, predictor = _track(view, circles, encoder, parameters, context)
        if texture.poses.lost.sum() > followed.texture.poses.lost.sum():
            break
        followed = _in_bore(circles, texture, predictor, view)
        if not followed.bore.reduces:
            break
    return followed


def _warn_of_reducer(bore: Bore, encoder: EncoderReadings | None, context: Context) -> None:
    by = "errors as in other reducers and the σ of the stated probe"
    by = by if encoder is None else "the difference of texture and encoder"
    context.warn(
        f"the pipe's width changes by {2 * np.ptp(bore.rings_wider_mm):.1f} mm along it (a reducer, a taper "
        "or ribs): texture is matched less well there, so that it is not used to check or refine the stated "
        f"probe. The σ of distances includes {by}; radii may err by more than their σ, most of all on the "
        "slope. What to do: compare distance and diameters with known ones, or process the pipe before and "
        "after a reducer as separate recordings"
    )


def _require_distance(tracked: TrackedPoses, encoder: EncoderReadings | None) -> None:
    share = float(np.mean(~tracked.lost[1:])) if len(tracked.lost) > 1 else 0.0
    if encoder is None and share < _LEAST_TRACKED:
        raise UnusableError(
            "motion",
            f"the wall's texture could be followed in only {100 * share:.0f} % of the lit frames and "
            "no encoder is used, so that distance is not determined",
            limit="half of the lit frames",
            hint="add the encoder file, or correct it if a warning says why it is not used; light the wall "
            "better, or record lit frames more often",
        )
