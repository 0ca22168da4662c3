"""What is measured once of each recording, before anything is asked about left-out physics: three stages."""

from __future__ import annotations

from dataclasses import dataclass, fields

from pipeline.arrays import Int
from pipeline.artefacts.measured import RingPoints, RingSamples, Trajectory
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.recording.base import Recording
from pipeline.recording.checked_frames import CheckedFrames
from stages.calibrate.gauge import GaugeParameters
from stages.calibrate.gauge.calibrate import MeasuredRun, measure_gauge
from stages.diagnose.field.run import FieldRun, field_run
from stages.diagnose.profile.evidence import ProfileEvidence, profile_evidence
from stages.motion import EncoderReadings, Equations, Measurements, MotionParameters, State


@dataclass(frozen=True)
class LineProfile:
    """What the line's light says of a recording; without evidence, ``problem`` tells why."""

    evidence: ProfileEvidence | None
    problem: str = ""


@dataclass(frozen=True)
class GaugeMeasured:
    """A gauge run measured, before any adjustment; without a run, ``problem`` tells why."""

    run: MeasuredRun | None
    problem: str = ""


@dataclass(frozen=True)
class Adjusted:
    """A `FieldRun` without the recording, the probe and the rings that it was made from."""

    measured: Measurements
    state: State
    equations: Equations
    trajectory: Trajectory
    encoder: EncoderReadings | None
    ring_frames: Int
    parameters: MotionParameters


@dataclass(frozen=True)
class FreeMotion:
    """A field recording adjusted without its encoder; without an adjustment, ``problem`` tells why."""

    adjusted: Adjusted | None
    problem: str = ""

    def run(self, recording: Recording, probe: Probe, rings: RingSamples) -> FieldRun | None:
        """Return the adjusted run of the recording, probe and rings that it was made from."""
        if self.adjusted is None:
            return None
        return FieldRun(recording=recording, probe=probe, rings=rings, **vars(self.adjusted))


def examine_line(
    recording: Recording,
    frames: CheckedFrames,
    rings: RingSamples,
    probe: Probe,
    *,
    parameters: Parameters,
    context: Context,
) -> LineProfile:
    """Test every effect that the line's light can show: see `profile_evidence`."""
    try:
        return LineProfile(profile_evidence(frames.applied_to(recording), rings, probe, context))
    except UnusableError as error:
        return LineProfile(None, error.problem)


def measure_fiducials(
    recording: Recording,
    frames: CheckedFrames,
    rings: RingSamples,
    probe: Probe,
    *,
    parameters: GaugeParameters,
    context: Context,
) -> GaugeMeasured:
    """Measure rings and fiducials of a gauge run: see `measure_gauge`."""
    try:
        checked = frames.applied_to(recording)
        return GaugeMeasured(measure_gauge(checked, rings, probe, parameters, context))
    except UnusableError as error:
        return GaugeMeasured(None, error.problem)


def adjust_freely(
    recording: Recording,
    frames: CheckedFrames,
    probe: Probe,
    rings: RingSamples,
    points: RingPoints,
    *,
    parameters: MotionParameters,
    context: Context,
) -> FreeMotion:
    """Adjust a field recording without its encoder, so that what is seen can be held against it."""
    try:
        run = field_run(frames.applied_to(recording), probe, rings, points, parameters, context)
    except UnusableError as error:
        return FreeMotion(None, error.problem)
    return FreeMotion(Adjusted(**{f.name: getattr(run, f.name) for f in fields(Adjusted)}))


LINE_PROFILE = Stage("line_profile", "1", Parameters, examine_line, "what the line's light says of effects")
FIDUCIALS = Stage(
    "fiducials", "1", GaugeParameters, measure_fiducials, "a gauge run's rings and fiducials", "gauge"
)
FREE_MOTION = Stage(
    "free_motion", "1", MotionParameters, adjust_freely, "an inspection's motion without encoder", "motion"
)
