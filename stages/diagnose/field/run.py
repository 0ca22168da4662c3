"""A field recording measured and adjusted with the stated instrument, without the encoder."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Int
from pipeline.artefacts.measured import RingPoints, RingSamples, Trajectory
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.recording.base import Recording
from stages.motion import (
    MATCH_BIASES,
    EncoderReadings,
    Equations,
    JointEstimate,
    Measurements,
    MotionParameters,
    State,
    adjust_at_once,
    encoder_at_frames,
    measure_run,
    ring_bins,
)


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
    recording: Recording,
    probe: Probe,
    rings: RingSamples,
    points: RingPoints,
    parameters: MotionParameters,
    context: Context,
) -> FieldRun:
    """Measure the texture of a recording and adjust poses, pipe and wall to rings and texture.

    The encoder is not used, so that it can be compared with the visual distance.

    Raises
    ------
    UnusableError
        When rings and texture alone do not determine the motion.
    """
    run = measure_run(recording, probe, rings, points, parameters, context, use_encoder=False)
    grid, frames = run.texture.grid, recording.frames
    measured = run.measured(run.whole, parameters)
    start = run.start(run.whole, measured, parameters)
    encoder = encoder_at_frames(recording, parameters.encoder_sigma_mm, grid.far_mm, context)
    found = adjust_at_once(start, measured, frames, grid.radius_mm, parameters, context)
    return FieldRun(
        recording, probe, rings, found.measured, found.state, found.equations, found.trajectory,
        encoder, run.ring_place, parameters,
    )  # fmt: skip


def with_probe(run: FieldRun, probe: Probe, context: Context) -> FieldRun:
    """Return the run adjusted anew with another probe, from the same ring samples and texture tracks.

    Raises
    ------
    UnusableError
        When rings and texture do not determine the motion with that probe.
    """
    found = _adjusted_with(run, probe, context)
    return replace(
        run, probe=probe, measured=found.measured, state=found.state, equations=found.equations,
        trajectory=found.trajectory,
    )  # fmt: skip


def _adjusted_with(run: FieldRun, probe: Probe, context: Context) -> JointEstimate:
    parameters, before, frames = run.parameters, run.measured, run.recording.frames
    bins = ring_bins(run.rings, run.ring_frames, probe, parameters.ring_bins, parameters.surface_sigma_mm)
    measured = Measurements.of(before.tracks, bins, before.time_s, None, probe)
    # Convergence is judged by the pipe's radius; the stated probe's is near enough.
    radius_mm = float(run.state.globals[0])
    start = replace(run.state, instrument=np.zeros(measured.unsure.shape[1] + MATCH_BIASES))
    return adjust_at_once(start, measured, frames, radius_mm, parameters, context)


__all__ = ["FieldRun", "UnusableError", "field_run", "with_probe"]
