"""Left-out physics: what could be seen, what is seen, what it is, and what else bears it out."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.artefacts import RingSamples
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.physics.catalogue import effect
from pipeline.recording.base import Recording
from pipeline.stage import Context
from stages.calibrate.gauge.calibrate import measure_gauge
from stages.calibrate.gauge.parameters import GaugeParameters
from stages.diagnose.compose import composed
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.field.evidence import field_evidence
from stages.diagnose.field.join import with_field
from stages.diagnose.gauge.examine import examine
from stages.diagnose.profile.evidence import ProfileEvidence, profile_evidence
from stages.diagnose.result import Diagnosis
from stages.diagnose.seen import Seen
from stages.diagnose.travel.gauge import gauge_travel
from stages.rings import RingParameters, extract_rings

# What motion against encoder tells better than rings and fiducials do.
TRAVEL_EFFECTS = frozenset(
    {"probe_vibration", "encoder_scale", "encoder_slip", "encoder_backlash", "time_offset"}
)


def diagnose(
    field: Recording | None,
    gauge: Recording | None,
    probe: Probe,
    library: Mapping[str, EffectModel],
    context: Context,
) -> Diagnosis:
    """Compare recordings of one probe with what the stated instrument predicts."""
    of_gauge = examine_gauge(gauge, probe, library, context) if gauge is not None else None
    of_field = examine_field(field, probe, library, context) if field is not None else None
    return with_field(composed(of_field, of_gauge, probe), of_field, of_gauge, probe, library)


def examine_gauge(
    recording: Recording, probe: Probe, library: Mapping[str, EffectModel], context: Context
) -> Seen:
    """Return what a gauge run's rings, fiducials, motion and line profile say."""
    missing: list[str] = []
    rings = extract_rings(recording, probe, RingParameters.model_validate({}), context)
    profile = _profile(recording, rings, probe, context, missing)
    geometry, travel = None, None
    try:
        run = measure_gauge(recording, rings, probe, GaugeParameters.model_validate({}), context)
        geometry = examine(run, _of_geometry(library, profile), probe)
        travel = gauge_travel(recording, run, geometry.searched.found.state)
        missing += travel.shortcomings
    except UnusableError as error:
        missing.append(f"Rings and fiducials of the gauge run tell nothing: {error}")
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
        missing.append(f"The line's profile tells nothing: {error}")
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
