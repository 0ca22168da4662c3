"""Left-out physics: what could be seen, what is seen, what it is, and what else bears it out."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from pipeline.artefacts.measured import RingSamples
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.physics.catalogue import effect
from pipeline.recording.base import Recording
from stages.calibrate.gauge.calibrate import measure_gauge
from stages.calibrate.gauge.parameters import GaugeParameters
from stages.diagnose.compared import Compared, compared, with_pictures
from stages.diagnose.compose import composed
from stages.diagnose.correct import Correction, correction_by_gauge
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.effects.library import without as library_without
from stages.diagnose.field.evidence import field_evidence, travel_of_run
from stages.diagnose.field.join import with_field
from stages.diagnose.field.run import FieldRun, with_probe
from stages.diagnose.gauge.examine import examine
from stages.diagnose.inference import stated_belief
from stages.diagnose.profile.evidence import ProfileEvidence, profile_evidence
from stages.diagnose.result import Diagnosis
from stages.diagnose.second_line import held_against_rings, sheet_by_rings
from stages.diagnose.seen import Seen
from stages.diagnose.travel.evidence import TravelEvidence
from stages.diagnose.travel.gauge import gauge_travel
from stages.rings import RingParameters, extract_rings

# What motion against encoder tells better than rings and fiducials do.
TRAVEL_EFFECTS = frozenset(
    {"probe_vibration", "encoder_scale", "encoder_slip", "encoder_backlash", "time_offset"}
)


@dataclass(frozen=True)
class Examination:
    """A diagnosis with what it rests on.

    Attributes
    ----------
    found : Diagnosis
    correction : Correction or None
        None without a gauge run that tells the instrument.
    compared : Compared or None
        Residuals before and after.
    field, gauge : Seen or None
    corrected : FieldRun or None
        The field adjusted anew with the corrected probe.
    """

    found: Diagnosis
    correction: Correction | None
    compared: Compared | None
    field: Seen | None
    gauge: Seen | None
    corrected: FieldRun | None


def diagnose(
    field: Recording | None,
    gauge: Recording | None,
    probe: Probe,
    context: Context,
    without: Collection[str] = (),
) -> Examination:
    """Compare recordings of one probe with what the stated instrument predicts.

    Effects ``without`` which the library has to do may be seen, but not named.

    Raises
    ------
    InputError
        When the catalogue lacks one of them.
    """
    library = library_without(without)
    of_gauge = examine_gauge(gauge, probe, library, context, without) if gauge is not None else None
    of_field = examine_field(field, probe, library, context) if field is not None else None
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
    found = with_field(composed(of_field, of_gauge, probe, without), of_field, of_gauge, probe, library)
    run = of_field.field.run if of_field is not None and of_field.field is not None else None
    seen = compared(run, corrected, of_gauge, correction)
    return Examination(with_pictures(found, seen), correction, seen, of_field, of_gauge, corrected)


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
    recording: Recording,
    probe: Probe,
    library: Mapping[str, EffectModel],
    context: Context,
    without: Collection[str] = (),
) -> Seen:
    """Return what a gauge run's rings, fiducials, motion and line profile say."""
    missing: list[str] = []
    rings = extract_rings(recording, probe, RingParameters.model_validate({}), context)
    profile = _profile(recording, rings, probe, context, missing)
    geometry, travel = None, None
    try:
        run = measure_gauge(recording, rings, probe, GaugeParameters.model_validate({}), context)
        geometry = examine(run, _of_geometry(library, profile), probe, without)
        travel = gauge_travel(recording, run, geometry.searched.found.state)
        missing += travel.shortcomings
    except UnusableError as error:
        missing.append(f"Rings and fiducials of the gauge run tell nothing: {error.problem}.")
    return Seen(recording, geometry, travel, profile, tuple(missing))


def examine_field(
    recording: Recording, probe: Probe, library: Mapping[str, EffectModel], context: Context
) -> Seen:
    """Return what an inspection's rings, texture, motion and line profile say."""
    missing: list[str] = []
    rings = extract_rings(recording, probe, RingParameters.model_validate({}), context)
    profile = _profile(recording, rings, probe, context, missing)
    found = field_evidence(recording, probe, context, _of_geometry(library, profile), rings)
    missing += found.channel.shortcomings
    return Seen(recording, None, found.travel, profile, tuple(missing), found)


def _profile(
    recording: Recording, rings: RingSamples, probe: Probe, context: Context, missing: list[str]
) -> ProfileEvidence | None:
    try:
        return profile_evidence(recording, rings, probe, context)
    except UnusableError as error:
        missing.append(f"The line's profile tells nothing: {error.problem}.")
        return None


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
