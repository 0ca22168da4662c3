"""Left-out physics: what could be seen, what is seen, what it is, and what else bears it out."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

from pydantic import Field

from pipeline.artefacts.measured import RingSamples
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Of, Parameters, Stage
from pipeline.physics.catalogue import effect
from pipeline.recording.base import Recording
from pipeline.recording.checked_frames import CheckedFrames
from stages.diagnose.channels import (
    FIDUCIALS,
    FREE_MOTION,
    LINE_PROFILE,
    FieldMeasured,
    FreeMotion,
    GaugeMeasured,
    GaugeRecorded,
    LineProfile,
    Seen,
    gauge_travel,
)
from stages.diagnose.compared import OnImage, compared, image_of, with_pictures
from stages.diagnose.compose import composed
from stages.diagnose.correct import Correction, correction_by_gauge
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.library import without as library_without
from stages.diagnose.field.answer import with_field
from stages.diagnose.field.evidence import FieldEvidence, field_evidence, nothing_said, travel_of_run
from stages.diagnose.field.run import FieldRun, with_probe
from stages.diagnose.gauge.examine import examine
from stages.diagnose.inference import stated_belief
from stages.diagnose.profile.evidence import ProfileEvidence
from stages.diagnose.resimulate import Resimulated, resimulate
from stages.diagnose.result import Diagnosis, FitQuality
from stages.diagnose.second_line import held_against_rings, sheet_by_rings
from stages.diagnose.travel.evidence import TravelEvidence
from stages.premises import PREMISES
from stages.rings import RINGS
from stages.triangulate import TRIANGULATE

_STEPS = 5
# What motion against encoder tells better than rings and fiducials do.
TRAVEL_EFFECTS = frozenset(
    {"probe_vibration", "encoder_scale", "encoder_slip", "encoder_backlash", "time_offset"}
)


class DiagnosisParameters(Parameters):
    """What the diagnosis lets the user choose."""

    without: tuple[str, ...] = Field((), description="effects that are left out of the library")


@dataclass(frozen=True)
class Noticed:
    """What the command noticed of the recordings, to be told with the answer."""

    sentences: tuple[str, ...] = ()


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis with what its files show.

    Attributes
    ----------
    found : Diagnosis
    probe : Probe
        As corrected; as stated without a gauge run that tells the instrument.
    simulated : Resimulated or None
        The gauge run simulated again with and without what was found.
    image : OnImage or None
        The residual on one picture.
    """

    found: Diagnosis
    probe: Probe
    simulated: Resimulated | None
    image: OnImage | None


def diagnose_both(
    field: Annotated[Recording, Of("field")],
    frames: Annotated[CheckedFrames, Of("field")],
    rings: Annotated[RingSamples, Of("field")],
    profile: Annotated[LineProfile, Of("field")],
    motion: Annotated[FreeMotion, Of("field")],
    gauge: Annotated[Recording, Of("gauge")],
    gauge_frames: Annotated[CheckedFrames, Of("gauge")],
    gauge_profile: Annotated[LineProfile, Of("gauge")],
    fiducials: Annotated[GaugeMeasured, Of("gauge")],
    probe: Probe,
    noticed: Noticed,
    *,
    parameters: DiagnosisParameters,
    context: Context,
) -> Diagnosed:
    """Diagnose an inspection and a gauge run of one probe: see `diagnosed`."""
    of_field = FieldMeasured(frames.applied_to(field), rings, profile, motion)
    of_gauge = GaugeRecorded(gauge_frames.applied_to(gauge), gauge_profile, fiducials)
    return diagnosed(of_field, of_gauge, probe, noticed, parameters, context)


def diagnose_field(
    field: Annotated[Recording, Of("field")],
    frames: Annotated[CheckedFrames, Of("field")],
    rings: Annotated[RingSamples, Of("field")],
    profile: Annotated[LineProfile, Of("field")],
    motion: Annotated[FreeMotion, Of("field")],
    probe: Probe,
    noticed: Noticed,
    *,
    parameters: DiagnosisParameters,
    context: Context,
) -> Diagnosed:
    """Diagnose an inspection alone: see `diagnosed`."""
    of_field = FieldMeasured(frames.applied_to(field), rings, profile, motion)
    return diagnosed(of_field, None, probe, noticed, parameters, context)


def diagnose_gauge(
    gauge: Annotated[Recording, Of("gauge")],
    gauge_frames: Annotated[CheckedFrames, Of("gauge")],
    profile: Annotated[LineProfile, Of("gauge")],
    fiducials: Annotated[GaugeMeasured, Of("gauge")],
    probe: Probe,
    noticed: Noticed,
    *,
    parameters: DiagnosisParameters,
    context: Context,
) -> Diagnosed:
    """Diagnose a gauge run alone: see `diagnosed`."""
    of_gauge = GaugeRecorded(gauge_frames.applied_to(gauge), profile, fiducials)
    return diagnosed(None, of_gauge, probe, noticed, parameters, context)


def diagnosed(
    field: FieldMeasured | None,
    gauge: GaugeRecorded | None,
    probe: Probe,
    noticed: Noticed,
    parameters: DiagnosisParameters,
    context: Context,
) -> Diagnosed:
    """Compare recordings of one probe with what the stated instrument predicts.

    Effects ``parameters.without`` which the library has to do may be seen, but not named.

    Raises
    ------
    InputError
        When the catalogue lacks one of them.
    """
    without = parameters.without
    library = library_without(without)
    context.progress(0, _STEPS)
    of_gauge = examine_gauge(gauge, probe, library, without) if gauge is not None else None
    context.progress(1, _STEPS)
    of_field = examine_field(field, probe, library) if field is not None else None
    context.progress(2, _STEPS)
    correction = _correction(of_gauge, probe)
    corrected = _corrected(of_field, correction, context)
    if of_field is not None and corrected is not None:
        # The scale of the way seen is the instrument's: what is wrong with that is not the encoder's.
        of_field = _with_travel(of_field, travel_of_run(corrected, "field with the corrected probe"))
    if of_field is not None and correction is not None and correction.unsaid:
        of_field = _without_scale(of_field, correction.unsaid)
    sheet = sheet_by_rings(of_gauge, correction, probe)
    if sheet is not None:
        of_gauge, of_field = (held_against_rings(s, sheet) if s else None for s in (of_gauge, of_field))
    context.progress(3, _STEPS)
    found = with_field(composed(of_field, of_gauge, probe, without), of_field, of_gauge, probe, library)
    run = of_field.field.run if of_field is not None and of_field.field is not None else None
    seen = compared(run, corrected, of_gauge, correction)
    found = with_pictures(found, seen)
    context.progress(4, _STEPS)
    simulated = resimulate(of_gauge)
    image = image_of(seen, field.recording if field else None, gauge.recording if gauge else None)
    context.report("verdict", str(found.verdict))
    found = replace(found, shortcomings=(*noticed.sentences, *found.shortcomings))
    if correction is None or not (correction.put_in or correction.unsaid) or not _worse(found.fit):
        return Diagnosed(found, correction.probe if correction is not None else probe, simulated, image)
    return Diagnosed(replace(found, notes=(*found.notes, _NOT_CORRECTED)), probe, simulated, image)


_NOT_CORRECTED = (
    "The probe file is written as it was stated: with what was found put in, rings that had no say in it fit "
    "worse."
)


def _worse(fit: FitQuality | None) -> bool:
    """Return whether measurements that were held out fit worse after the correction than before."""
    return fit is not None and fit.heldout_after > fit.heldout_before


def _with_travel(seen: Seen, travel: TravelEvidence | None) -> Seen:
    old = seen.travel.shortcomings if seen.travel is not None else ()
    new = travel.shortcomings if travel is not None else ()
    kept = tuple(s for s in seen.shortcomings if s not in old)
    return replace(seen, travel=travel, shortcomings=(*kept, *new))


def _without_scale(seen: Seen, unsaid: Sequence[str]) -> Seen:
    """Return the field without the encoder's scale: its way is seen with an instrument in part wrong."""
    if seen.travel is None:
        return seen
    kept = tuple(e for e in seen.travel.estimates if e.effect != "encoder_scale")
    words = f"The field does not tell the encoder's scale: no probe file can say {' and '.join(unsaid)}."
    travel = replace(seen.travel, estimates=kept)
    return replace(seen, travel=travel, shortcomings=(*seen.shortcomings, words))


def _correction(gauge: Seen | None, probe: Probe) -> Correction | None:
    if gauge is None or gauge.geometry is None:
        return None
    return correction_by_gauge(gauge.geometry, probe, stated_belief(probe), gauge.recording.name)


def _corrected(field: Seen | None, correction: Correction | None, context: Context) -> FieldRun | None:
    """Return the field adjusted with the corrected probe; None where there is none or it fails."""
    if field is None or field.field is None or field.field.run is None or correction is None:
        return None
    try:
        return with_probe(field.field.run, correction.probe, context)
    except UnusableError:
        return None


def examine_gauge(
    gauge: GaugeRecorded, probe: Probe, library: Mapping[str, EffectModel], without: Collection[str] = ()
) -> Seen:
    """Return what a gauge run's rings, fiducials, motion and line profile say."""
    recording, run, profile = gauge.recording, gauge.measured.run, gauge.profile.evidence
    missing, problem = _profile_problem(gauge.profile), gauge.measured.problem
    geometry, travel = None, None
    if run is not None:
        try:
            geometry = examine(run, _of_geometry(library, profile), probe, without)
            travel = gauge_travel(recording, run, geometry.searched.found.state)
            missing += travel.shortcomings
        except UnusableError as error:
            problem = error.problem
    if problem:
        missing += (f"Rings and fiducials of the gauge run tell nothing: {problem}.",)
    return Seen(recording, geometry, travel, profile, missing)


def examine_field(field: FieldMeasured, probe: Probe, library: Mapping[str, EffectModel]) -> Seen:
    """Return what an inspection's rings, texture, motion and line profile say."""
    recording, profile = field.recording, field.profile.evidence
    run = field.motion.run(recording, probe, field.rings)
    if run is None:
        found = FieldEvidence(None, None, nothing_said(recording, field.motion.problem))
    else:
        found = field_evidence(run, _of_geometry(library, profile))
    missing = (*_profile_problem(field.profile), *found.channel.shortcomings)
    return Seen(recording, None, found.travel, profile, missing, found)


def _profile_problem(profile: LineProfile) -> tuple[str, ...]:
    return (f"The line's profile tells nothing: {profile.problem}.",) if profile.problem else ()


def _of_geometry(
    library: Mapping[str, EffectModel], profile: ProfileEvidence | None
) -> dict[str, EffectModel]:
    """Return the effects that rings and fiducials are asked about.

    Light moves the line in ways that many causes share: where the profile was examined, only those count that
    it shows.
    """
    shown = {f.effect for f in profile.found} if profile is not None else None
    return {
        name: model
        for name, model in library.items()
        if name not in TRAVEL_EFFECTS
        and (effect(name).family != "photometric" or shown is None or name in shown)
    }


_SUMMARY = "what physics was left out, where it shows, and what bears it out"
_DIAGNOSIS = Stage("diagnosis", "1", DiagnosisParameters, diagnose_both, _SUMMARY)
OF_FIELD = tuple(s.for_role("field") for s in (PREMISES, RINGS, TRIANGULATE, LINE_PROFILE, FREE_MOTION))
OF_GAUGE = tuple(s.for_role("gauge") for s in (PREMISES, RINGS, LINE_PROFILE, FIDUCIALS))


def diagnosis_stages(with_field: bool, with_gauge: bool) -> tuple[Stage, ...]:
    """Return the stages of a diagnosis of an inspection, a gauge run, or both."""
    if not with_field:
        return (*OF_GAUGE, replace(_DIAGNOSIS, function=diagnose_gauge))
    if not with_gauge:
        return (*OF_FIELD, replace(_DIAGNOSIS, function=diagnose_field))
    return (*OF_FIELD, *OF_GAUGE, _DIAGNOSIS)
