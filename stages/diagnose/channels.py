"""Measurements of each recording that are made once, and what each channel of evidence derives from them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from pipeline.arrays import Bool
from pipeline.artefacts.measured import RingPoints, RingSamples
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.physics.catalogue import effect
from pipeline.recording.base import Recording
from pipeline.recording.checks import CheckedFrames
from stages.calibrate.gauge import GaugeParameters, MeasuredRun, measure_gauge
from stages.calibrate.gauge.state import Unknowns
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.library import without as library_without
from stages.diagnose.field.evidence import FieldEvidence, empty_evidence, field_evidence
from stages.diagnose.field.run import Adjusted, FieldRun, field_run
from stages.diagnose.gauge.examine import Examined, examine
from stages.diagnose.profile.evidence import ProfileEvidence, profile_evidence
from stages.diagnose.travel.evidence import TravelEvidence, travel_evidence
from stages.diagnose.travel.sight import PLACED_SIGMA_MM, place_sigma_mm, sight_of_poses
from stages.motion import MotionParameters

_MOST_OF_RING = 0.5
# Effects that motion against encoder measures better than rings and fiducials do.
TRAVEL_EFFECTS = frozenset(
    {"probe_vibration", "encoder_scale", "encoder_slip", "encoder_backlash", "time_offset", "motion_blur"}
)


def gauge_travel(
    recording: Recording, run: MeasuredRun, state: Unknowns, without: Collection[str] = ()
) -> TravelEvidence:
    """Return what the motion and the encoder of a gauge run show.

    Only frames whose own fiducials determine the camera's place count: the encoder, of low weight in the
    adjustment, has no influence on them. The scale is that of the fiducials' stated places.

    Parameters
    ----------
    state
        The adjusted state, as of `stages.diagnose.gauge.search.prepare`.
    without
        Effects that are treated as unknown.
    """
    fiducials = recording.pipe.fiducials
    # Markers of one row were placed together and share an error: rows count as independent, not markers.
    places = np.unique([round(m.distance_mm, 1) for m in fiducials.markers]) if fiducials else np.zeros(1)
    spread = float(np.sqrt(np.sum((places - places.mean()) ** 2)))
    placed = run.posed[place_sigma_mm(state, run.measured.edges)[run.posed] < PLACED_SIGMA_MM]
    sight = sight_of_poses(recording, state.T_pc, placed, PLACED_SIGMA_MM / max(spread, 1.0))
    ends = placed if len(placed) else np.array([0, len(state.T_pc) - 1])
    span = slice(int(ends[0]), int(ends[-1]) + 1)
    return travel_evidence(
        "gauge", recording, sight, state.T_pc[span], state.stated.encoder_scale_sigma, _shown(run)[span],
        without,
    )  # fmt: skip


def _shown(run: MeasuredRun) -> Bool:
    """Return the frames (N,) with fiducials or most of a ring; poses of others are interpolated."""
    count = np.bincount(run.measured.rings.frame, minlength=len(run.measured.time_s))
    shown = count > _MOST_OF_RING * np.max(count, initial=1)
    shown[run.posed] = True
    return np.asarray(shown)


class DiagnosisParameters(Parameters):
    """Options of the diagnosis."""

    without: tuple[str, ...] = Field((), description="effects that are left out of the library")


@dataclass(frozen=True)
class Seen:
    """All evidence from one recording; a channel that could not be examined is None, and the reason is given.

    Attributes
    ----------
    name : str
        Of the recording.
    geometry : Examined or None
        Rings and fiducials of a gauge run.
    travel : TravelEvidence or None
        Motion in the pictures against the encoder.
    profile : ProfileEvidence or None
        Width, shape and brightness of the laser line.
    shortcomings : tuple of str
        Why channels could not be examined.
    field : FieldEvidence or None
        Rings and texture of an inspection.
    misdrawn : bool
        Whether a bore of the gauge that is not as drawn explains rings and fiducials as well as an effect.
    """

    name: str
    geometry: Examined | None
    travel: TravelEvidence | None
    profile: ProfileEvidence | None
    shortcomings: tuple[str, ...]
    field: FieldEvidence | None = None
    misdrawn: bool = False

    def with_run(self, run: FieldRun | None) -> Seen:
        """Return the evidence together with the adjusted run it came from, which is not stored with it."""
        return replace(self, field=replace(self.field, run=run)) if self.field is not None else self


@dataclass(frozen=True)
class LineProfile:
    """Evidence from the line's light in one recording; without evidence, ``problem`` says why."""

    evidence: ProfileEvidence | None
    problem: str = ""

    @property
    def limits(self) -> tuple[str, ...]:
        """Sentences on what it cannot show, and why."""
        if self.problem:
            return (f"The profile of the laser line was not examined: {self.problem}.",)
        return self.evidence.uncovered if self.evidence is not None else ()

    def known_light(self, without: Collection[str]) -> ProfileEvidence | None:
        """Return the evidence from the line's light with some effects treated as unknown."""
        return self.evidence.without(without) if self.evidence is not None and without else self.evidence


@dataclass(frozen=True)
class GaugeMeasured:
    """Measurements of a gauge run before any adjustment; without a run, ``problem`` says why."""

    run: MeasuredRun | None
    problem: str = ""


@dataclass(frozen=True)
class FreeMotion:
    """A field recording adjusted without its encoder; if it failed, ``problem`` says why."""

    adjusted: Adjusted | None
    problem: str = ""

    def run(self, recording: Recording, probe: Probe, rings: RingSamples) -> FieldRun | None:
        """Return the adjusted run, given the recording, probe and rings it was made from."""
        if self.adjusted is None:
            return None
        return FieldRun(recording=recording, probe=probe, rings=rings, **vars(self.adjusted))


def examine_line(
    recording: Recording, frames: CheckedFrames, rings: RingSamples, probe: Probe, *, parameters: Parameters,
    context: Context,
) -> LineProfile:  # fmt: skip
    """Test every effect that the line's light can show; see `profile_evidence`."""
    try:
        return LineProfile(profile_evidence(frames.applied_to(recording), rings, probe, context))
    except UnusableError as error:
        return LineProfile(None, error.problem)


def measure_fiducials(
    recording: Recording, frames: CheckedFrames, rings: RingSamples, probe: Probe, *,
    parameters: GaugeParameters, context: Context,
) -> GaugeMeasured:  # fmt: skip
    """Measure rings and fiducials of a gauge run; see `measure_gauge`."""
    try:
        checked = frames.applied_to(recording)
        return GaugeMeasured(measure_gauge(checked, rings, probe, parameters, context))
    except UnusableError as error:
        return GaugeMeasured(None, error.problem)


def adjust_freely(
    recording: Recording, frames: CheckedFrames, probe: Probe, rings: RingSamples, points: RingPoints, *,
    parameters: MotionParameters, context: Context,
) -> FreeMotion:  # fmt: skip
    """Adjust a field recording without its encoder, so that its motion can be compared with the encoder."""
    try:
        run = field_run(frames.applied_to(recording), probe, rings, points, parameters, context)
    except UnusableError as error:
        return FreeMotion(None, error.problem)
    return FreeMotion(run.adjusted)


def examine_gauge(
    recording: Recording, frames: CheckedFrames, profile: LineProfile, fiducials: GaugeMeasured, probe: Probe,
    *, parameters: DiagnosisParameters, context: Context,
) -> Seen:  # fmt: skip
    """Return what a gauge run's rings, fiducials, motion and line profile show."""
    recording, run, without = frames.applied_to(recording), fiducials.run, parameters.without
    missing, problem = profile.limits, fiducials.problem
    geometry, travel, bore, light = None, None, None, profile.known_light(without)
    if run is not None:
        try:
            library = _of_geometry(library_without(without), light)
            examined = examine(run, library, probe, progress=context.progress)
            bore = examined.misdrawn
            geometry = examined if bore is None else None
            state = examined.searched.found.state if bore is None else bore.state
            travel = gauge_travel(recording, run, state, without)
            missing += (*(examined.shortcomings if bore is None else (bore.words,)), *travel.shortcomings)
            if bore is not None:
                context.warn(bore.words)
        except UnusableError as error:
            problem = error.problem
    if problem:
        missing += (f"Rings and fiducials of the gauge run were not examined: {problem}.",)
        context.warn(missing[-1])
    return Seen(recording.name, geometry, travel, light, missing, misdrawn=bore is not None)


def examine_field(
    recording: Recording, frames: CheckedFrames, rings: RingSamples, profile: LineProfile, motion: FreeMotion,
    probe: Probe, *, parameters: DiagnosisParameters, context: Context,
) -> Seen:  # fmt: skip
    """Return what an inspection's rings, texture, motion and line profile show."""
    recording = frames.applied_to(recording)
    run, light = motion.run(recording, probe, rings), profile.known_light(parameters.without)
    if run is None:
        found = empty_evidence(recording, motion.problem)
        context.warn(found.shortcomings[0])
    else:
        library = _of_geometry(library_without(parameters.without), light)
        found = field_evidence(run, library, parameters.without, context.progress)
    missing = (*profile.limits, *found.shortcomings)
    return Seen(recording.name, None, found.travel, light, missing, found)


def _of_geometry(
    library: Mapping[str, EffectModel], profile: ProfileEvidence | None
) -> dict[str, EffectModel]:
    """Return the effects for which rings and fiducials are tested.

    Many causes in the line's light displace the line: where the profile was examined, only those that it
    shows are tested.
    """
    shown = {f.effect for f in profile.found} if profile is not None else None
    return {
        name: model
        for name, model in library.items()
        if name not in TRAVEL_EFFECTS
        and (effect(name).family != "photometric" or shown is None or name in shown)
    }


LINE_PROFILE = Stage("line_profile", "7", Parameters, examine_line, "effects that the line's profile shows")
FIDUCIALS = Stage(
    "fiducials", "9", GaugeParameters, measure_fiducials, "a gauge run's rings and fiducials", "gauge"
)
FREE_MOTION = Stage(
    "free_motion", "6", MotionParameters, adjust_freely, "an inspection's motion without encoder", "motion"
)
GAUGE_EVIDENCE = Stage(
    "evidence", "68", DiagnosisParameters, examine_gauge, "what a gauge run shows of effects", "diagnosis"
)
FIELD_EVIDENCE = Stage(
    "evidence", "31", DiagnosisParameters, examine_field, "what an inspection shows of effects", "diagnosis"
)
