"""The stage that diagnoses left-out physics: it combines all evidence, names causes and confirms them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Of, Stage
from pipeline.recording.base import Recording
from pipeline.recording.checks import CheckedFrames
from stages.diagnose.channels import (
    FIDUCIALS,
    FIELD_EVIDENCE,
    FREE_MOTION,
    GAUGE_EVIDENCE,
    LINE_PROFILE,
    DiagnosisParameters,
    FreeMotion,
    Seen,
)
from stages.diagnose.combine.compose import composed
from stages.diagnose.combine.second_line import compared_with_rings, sheet_by_rings
from stages.diagnose.compared import OnImage, compared, image_of, with_pictures, with_readings
from stages.diagnose.correct import CORRECTED_MOTION, CORRECTION, Corrected, CorrectedMotion, Correction
from stages.diagnose.effects.library import without as library_without
from stages.diagnose.field.answer import borne_out, encoder_share, field_confirmations, with_field
from stages.diagnose.field.evidence import travel_of_run
from stages.diagnose.field.run import FieldRun
from stages.diagnose.result import Diagnosis
from stages.diagnose.travel.evidence import TravelEvidence
from stages.diagnose.written_probe import Decision, decided
from stages.premises import PREMISES
from stages.rings import RINGS
from stages.triangulate import TRIANGULATE

_STEPS = 2


@dataclass(frozen=True)
class Noticed:
    """What the command noticed in the recordings, to be reported with the diagnosis."""

    sentences: tuple[str, ...] = ()


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis with what its files show.

    Attributes
    ----------
    probe : Probe
        Corrected; as stated without a gauge run that determines the instrument.
    image : OnImage or None
        The residual on one picture.
    """

    found: Diagnosis
    probe: Probe
    image: OnImage | None


def diagnose(
    field: Annotated[Recording, Of("field")] | None, frames: Annotated[CheckedFrames, Of("field")] | None,
    rings: Annotated[RingSamples, Of("field")] | None, motion: Annotated[FreeMotion, Of("field")] | None,
    of_field: Annotated[Seen, Of("field")] | None, gauge: Annotated[Recording, Of("gauge")] | None,
    gauge_frames: Annotated[CheckedFrames, Of("gauge")] | None, of_gauge: Annotated[Seen, Of("gauge")] | None,
    corrected: Annotated[Corrected, Of("gauge")] | None,
    corrected_motion: Annotated[CorrectedMotion, Of("field")] | None, probe: Probe, noticed: Noticed, *,
    parameters: DiagnosisParameters, context: Context,
) -> Diagnosed:  # fmt: skip
    """Combine the evidence of an inspection and of a gauge run of one probe; either may be missing.

    Effects in ``parameters.without`` may be seen, but not named.
    """
    correction = corrected.correction if corrected is not None else None
    run, run_corrected = None, None
    if of_field and field and frames and motion and rings:
        field = frames.applied_to(field)
        run = motion.run(field, probe, rings)
        of_field = of_field.with_run(run)
    if run and correction and corrected_motion:
        run_corrected = corrected_motion.run(run, correction)
    gauge, without = gauge_frames.applied_to(gauge) if gauge and gauge_frames else gauge, parameters.without
    of_field, of_gauge = _by_correction(of_field, of_gauge, run_corrected, correction, probe, without)
    context.progress(0, _STEPS)
    found = _answered(of_field, of_gauge, probe, without)
    context.progress(1, _STEPS)
    examined = of_gauge.geometry if of_gauge is not None else None
    share = encoder_share(found, of_field, probe)
    seen = compared(run, run_corrected, examined, gauge, correction, share)
    found = with_readings(with_pictures(found, seen), (of_field, of_gauge))
    context.report("verdict", str(found.verdict))
    found = replace(found, shortcomings=(*noticed.sentences, *found.shortcomings))
    image = image_of(seen, field, gauge) if found.ring_picture is not None else None
    of_rings = of_field.field.with_encoder(share / (1 - share)) if of_field and of_field.field else None
    asked = correction is not None and correction.found
    decision = decided(found, of_rings, correction, probe) if correction and asked else Decision(True)
    corrected_probe = correction.probe if correction is not None and decision.written else probe
    return Diagnosed(replace(found, notes=(*found.notes, *decision.notes)), corrected_probe, image)


def _answered(
    of_field: Seen | None, of_gauge: Seen | None, probe: Probe, without: Sequence[str]
) -> Diagnosis:
    """Return the answer from all channels, and what the inspection's rings and texture say of it."""
    met = field_confirmations(composed(of_field, of_gauge, probe, without), of_field, of_gauge, probe)
    found = composed(of_field, borne_out(of_gauge, met), probe, without)
    found = with_field(found, of_field, of_gauge, met, probe, library_without(without))
    return found.not_knowing(without)


def _by_correction(
    field: Seen | None, gauge: Seen | None, corrected: FieldRun | None, correction: Correction | None,
    probe: Probe, without: Sequence[str],
) -> tuple[Seen | None, Seen | None]:  # fmt: skip
    """Return the evidence of both recordings, without what the probe's correction explains or excludes."""
    if field is not None and corrected is not None:
        # The scale of the motion seen depends on the instrument: an error of that is not the encoder's.
        field = _with_travel(field, travel_of_run(corrected, "field with the corrected probe", without))
    if field is not None and correction is not None and correction.inexpressible:
        field = _without_scale(field, correction.beyond_probe)
    sheet = sheet_by_rings(gauge, correction, probe)
    if sheet is not None:
        gauge, field = (compared_with_rings(s, sheet) if s else None for s in (gauge, field))
    return field, gauge


def _with_travel(seen: Seen, travel: TravelEvidence | None) -> Seen:
    old = seen.travel.shortcomings if seen.travel is not None else ()
    new = travel.shortcomings if travel is not None else ()
    kept = tuple(s for s in seen.shortcomings if s not in old)
    return replace(seen, travel=travel, shortcomings=(*kept, *new))


def _without_scale(seen: Seen, beyond_probe: str) -> Seen:
    """Return the inspection's evidence without the encoder's scale, if the instrument is partly wrong."""
    if seen.travel is None:
        return seen
    kept = tuple(e for e in seen.travel.estimates if e.effect != "encoder_scale")
    words = (
        "The encoder's scale was not examined in the inspection: a probe file cannot express "
        f"{beyond_probe}, so that the motion was found with a partly wrong instrument."
    )
    travel = replace(seen.travel, estimates=kept)
    return replace(seen, travel=travel, shortcomings=(*seen.shortcomings, words))


DIAGNOSIS = Stage(
    "diagnosis", "66", DiagnosisParameters, diagnose,
    "what physics was left out, where it shows, and what confirms it",
)  # fmt: skip
_OF_FIELD = (PREMISES, RINGS, TRIANGULATE, LINE_PROFILE, FREE_MOTION, FIELD_EVIDENCE)
_OF_GAUGE = (PREMISES, RINGS, LINE_PROFILE, FIDUCIALS, GAUGE_EVIDENCE, CORRECTION)


def diagnosis_stages(with_field: bool, with_gauge: bool) -> tuple[Stage, ...]:
    """Return the stages of a diagnosis of an inspection, a gauge run, or both."""
    of_field = tuple(s.for_role("field") for s in _OF_FIELD if with_field)
    of_gauge = tuple(s.for_role("gauge") for s in _OF_GAUGE if with_gauge)
    of_both = (CORRECTED_MOTION.for_role("field"),) if with_field and with_gauge else ()
    return (*of_field, *of_gauge, *of_both, DIAGNOSIS)
