"""A field recording measured and adjusted with the stated instrument, without the encoder."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Int
from pipeline.artefacts.measured import RingSamples, Trajectory
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.recording.base import Recording
from stages import motion
from stages.motion import MotionParameters
from stages.motion.bundle_adjustment.equations import MATCH_BIASES, Equations, Measurements
from stages.motion.bundle_adjustment.unknowns import EncoderReadings, State
from stages.motion.encoder import encoder_at_frames
from stages.motion.events import find_events
from stages.motion.rings import at_all_frames, ring_bins
from stages.motion.tracking.prediction import Predictor
from stages.motion.trajectory import in_pipe_frame
from stages.motion.windows.measured_run import LOOSE, first_guess
from stages.motion.windows.submaps import estimated
from stages.rings import RingParameters, extract_rings
from stages.triangulate import TriangulateParameters, triangulate_rings


@dataclass(frozen=True)
class FieldRun:
    """A field recording at the optimum with the stated instrument.

    Attributes
    ----------
    recording : Recording
    probe : Probe
        As stated.
    rings : RingSamples
    measured : Measurements
        Without encoder.
    state : State
    equations : Equations
        At ``state``, with the weights that count from now on.
    trajectory : Trajectory
        In P.
    encoder : EncoderReadings or None
    ring_frames : (F,) int
        Places of the ring frames in the frame table.
    parameters : MotionParameters
    """

    recording: Recording
    probe: Probe
    rings: RingSamples
    measured: Measurements
    state: State
    equations: Equations
    trajectory: Trajectory
    encoder: EncoderReadings | None
    ring_frames: Int
    parameters: MotionParameters


def field_run(
    recording: Recording, probe: Probe, context: Context, rings: RingSamples | None = None
) -> FieldRun:
    """Measure rings and texture of a recording and adjust poses, pipe and wall to them.

    The encoder has no say, so that it can be compared with what is seen.

    Raises
    ------
    UnusableError
        When rings and texture alone do not determine the motion.
    """
    parameters = MotionParameters.model_validate({})
    if rings is None:
        rings = extract_rings(recording, probe, RingParameters.model_validate({}), context)
    points = triangulate_rings(rings, probe, TriangulateParameters.model_validate({}), context)
    centre_c, radius_mm = motion._pipe_in_rings(points)
    grid = motion._strip_grid(radius_mm, parameters)
    frames = recording.frames
    ring_frames = np.searchsorted(frames.frame, rings.frame)
    predictor = Predictor(frames.time_s, None, at_all_frames(ring_frames, centre_c, len(frames.frame)))
    tracks = motion._tracked(recording, probe, grid, predictor, parameters, context)
    motion._require_distance(tracks, None)
    unsure = probe.principal_uncertainties()
    bins = ring_bins(rings, probe, unsure, parameters.ring_bins, parameters.surface_sigma_mm)
    bins = replace(bins, frame=np.searchsorted(frames.frame, bins.frame))
    measured = Measurements(tracks, bins, frames.time_s, None, probe, unsure, LOOSE)
    T_pc = predictor.between(tracks.frames, tracks.T_pc, len(frames.frame))
    start = first_guess(T_pc, measured, grid.radius_mm, grid.far_mm, parameters)
    encoder = encoder_at_frames(recording, parameters.encoder_sigma_mm, grid.far_mm, context)
    source = _Source(recording, rings, encoder, np.asarray(ring_frames), parameters)
    return _adjusted(source, measured, start, radius_mm, context)


def with_probe(run: FieldRun, probe: Probe, context: Context) -> FieldRun:
    """Return the run adjusted anew with another probe, from the same ring samples and texture tracks.

    Raises
    ------
    UnusableError
        When rings and texture do not determine the motion with that probe.
    """
    parameters, unsure = run.parameters, probe.principal_uncertainties()
    bins = ring_bins(run.rings, probe, unsure, parameters.ring_bins, parameters.surface_sigma_mm)
    bins = replace(bins, frame=np.searchsorted(run.recording.frames.frame, bins.frame))
    measured = replace(run.measured, rings=bins, probe=probe, unsure=unsure, smooth_sigma=LOOSE)
    points = triangulate_rings(run.rings, probe, TriangulateParameters.model_validate({}), context)
    start = replace(run.state, instrument=np.zeros(unsure.shape[1] + MATCH_BIASES))
    source = _Source(run.recording, run.rings, run.encoder, run.ring_frames, parameters)
    return _adjusted(source, measured, start, motion._pipe_in_rings(points)[1], context)


@dataclass(frozen=True)
class _Source:
    recording: Recording
    rings: RingSamples
    encoder: EncoderReadings | None
    ring_frames: Int
    parameters: MotionParameters


def _adjusted(
    source: _Source, measured: Measurements, start: State, radius_mm: float, context: Context
) -> FieldRun:
    recording, parameters = source.recording, source.parameters
    estimate = estimated(start, measured, parameters)
    motion._require_convergence(estimate, radius_mm, context)
    trajectory = in_pipe_frame(estimate, recording.frames, measured)
    events = find_events(recording.frames, trajectory, measured.tracks, estimate.state.slip, False)
    return FieldRun(
        recording, measured.probe, source.rings, measured, estimate.state, estimate.adjusted.equations,
        replace(trajectory, events=events), source.encoder, source.ring_frames, parameters,
    )  # fmt: skip


__all__ = ["FieldRun", "UnusableError", "field_run", "with_probe"]
