"""Apply the effects that were found to the stated probe and to the encoder's readings."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Annotated

import numpy as np

from pipeline.arrays import Float
from pipeline.artefacts.measured import RingSamples
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Of, Parameters, Stage
from pipeline.physics.catalogue import EFFECTS
from pipeline.recording.base import Encoder, Recording
from pipeline.recording.checks import CheckedFrames
from stages.diagnose.channels import FreeMotion, Seen
from stages.diagnose.effects.base import Amplitude, Shape, Travel
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.field.run import Adjusted, FieldRun, with_probe
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.gauge.fit import evidence
from stages.diagnose.gauge.run import Term
from stages.diagnose.gauge.sets import prior_sigma
from stages.diagnose.inference import INSTRUMENT, Column, Evidence, Stated, estimate, stated_belief
from stages.diagnose.result import EffectFound

Change = Callable[[dict[str, float], Float, Shape], None]
# A longer exposure delays pictures: readings then appear late by that delay, in addition to their own.
_OF_ENCODER = {
    "encoder_scale": "relative", "encoder_slip": "slip_mm", "encoder_backlash": "backlash_mm",
    "time_offset": "delay_s", "motion_blur": "late_s",
}  # fmt: skip
ENCODER_EFFECTS = frozenset(_OF_ENCODER)
_ROUNDS = 3
_OF_CAMERA = frozenset({"principal_point", "focal_scale", "pixel_aspect", "radial_distortion"})


def encoder_effects(effects: Sequence[EffectFound]) -> tuple[EffectFound, ...]:
    """Return the effects that falsify the inspection's encoder readings."""
    return tuple(e for e in effects if e.name in _OF_ENCODER and e.recording != "gauge")


def with_true_readings(recording: Recording, effects: Sequence[EffectFound]) -> Recording:
    """Return the recording with its encoder's readings corrected for the effects.

    Its ``content_key`` stays the same: a caller that stores results by it must distinguish the readings
    itself.
    """
    if recording.encoder is None:
        return recording
    encoder, found = recording.encoder, encoder_effects(effects)
    # Steps first: the rest of one would look like a dependence on speed to the other effects.
    reading = encoder.distance_mm - _shift(encoder, encoder.distance_mm, [e for e in found if _shape(e)])
    smooth, true = [e for e in found if not _shape(e)], reading
    for _ in range(_ROUNDS):
        true = reading - _shift(encoder, true, smooth)
    return replace(recording, encoder=Encoder(encoder.time_s, true))


def _shift(encoder: Encoder, true_mm: Float, effects: Sequence[EffectFound]) -> Float:
    """Return by how much the effects falsify readings (N,), mm, at true distances (N,), mm."""
    travel = Travel(encoder.time_s, true_mm, np.gradient(true_mm, encoder.time_s))
    shift = np.zeros(len(true_mm))
    for e in effects:
        shift += LIBRARY[e.name].reading_shift_mm(travel, _shape(e), np.array([_size(e)]))
    return shift


def _size(effect: EffectFound) -> float:
    """Return the size of an effect; for a longer exposure, only the delay that the encoder shows."""
    size = effect.parameters.get(_OF_ENCODER[effect.name])
    if effect.name == "motion_blur":
        return 2 * size.value if size is not None else 0.0
    return effect.parameters[_OF_ENCODER[effect.name]].value


def _shape(effect: EffectFound) -> Shape:
    return tuple(effect.parameters[n].value for n in ("time_s", "duration_s") if n in effect.parameters)


def _adds(*names: str, unit: float = 1.0) -> Change:
    """Return a change that adds each amplitude, times ``unit``, to a parameter of the probe."""

    def change(p: dict[str, float], a: Float, shape: Shape) -> None:
        for name, value in zip(names, a, strict=True):
            p[name] += unit * float(value)

    return change


def _tilt(p: dict[str, float], a: Float, shape: Shape) -> None:
    tilt = np.radians(a)
    stretch = np.tan(np.hypot(*tilt)) / max(float(np.hypot(*tilt)), 1e-300)
    p["tilt_x"] += float(tilt[0] * stretch)
    p["tilt_y"] += float(tilt[1] * stretch)


def _waves(p: dict[str, float], a: Float, shape: Shape) -> None:
    for name, value in zip((f"wave{shape[0]:.0f}_cos", f"wave{shape[0]:.0f}_sin"), a, strict=True):
        if name in p:
            p[name] += 1e-3 * float(value)


def _focal(p: dict[str, float], a: Float, shape: Shape) -> None:
    p["fx"] *= 1 + float(a[0])
    p["fy"] *= 1 + float(a[0])


def _aspect(p: dict[str, float], a: Float, shape: Shape) -> None:
    p["fx"] *= float(np.sqrt(1 + a[0]))
    p["fy"] /= float(np.sqrt(1 + a[0]))


# Effects that a probe file can express, and the change of its parameters.
CHANGES: Mapping[str, Change] = MappingProxyType({
    "laser_tilt": _tilt, "laser_cone": _adds("cone_rad", unit=float(np.radians(1.0))),
    "baseline": _adds("baseline_mm"), "beam_decentre": _adds("decentre_x_mm", "decentre_y_mm"),
    "sheet_waviness": _waves, "principal_point": _adds("cx", "cy"), "focal_scale": _focal,
    "pixel_aspect": _aspect, "radial_distortion": _adds("k1"),
})  # fmt: skip


_NO_CAUSE = "a pattern without a known cause"


@dataclass(frozen=True)
class Correction:
    """The stated probe with the effects that a gauge run found.

    Attributes
    ----------
    applied, inexpressible : tuple of str
        Effects that the probe now contains, and those that a probe file cannot express.
    """

    probe: Probe
    applied: tuple[str, ...]
    inexpressible: tuple[str, ...]

    @property
    def found(self) -> bool:
        """Whether the gauge run found anything."""
        return bool(self.applied or self.inexpressible)

    @property
    def beyond_probe(self) -> str:
        """What a probe file cannot express, in words: effects by name, patterns without a cause once."""
        laws = (n if re.split("[ ,]", n)[0] in EFFECTS else _NO_CAUSE for n in self.inexpressible)
        return " and ".join(dict.fromkeys(laws))


def correction_by_gauge(examined: Examined, probe: Probe, stated: Stated, source: str) -> Correction:
    """Return the probe of the gauge run's likeliest explanation, with its uncertainty."""
    found = examined.best.fit if examined.best is not None else examined.searched.found
    names = [t.model.name for t in found.terms]
    known = evidence(examined.searched.run, found, ())[0]
    at = _Parameters(probe, known.columns, found.terms)
    middle = at.middle(found.state.probe.parameters - probe.parameters)
    spread = _spread(known, stated, found.terms)
    slope = at.slope(middle, np.sqrt(np.diag(spread)))
    covariance = slope @ spread @ slope.T
    made = probe.with_parameters(at.of(middle), (covariance + covariance.T) / 2)
    return Correction(
        replace(made, calibrated_from=source),
        tuple(n for n in names if at.expressible(n)), tuple(n for n in names if not at.expressible(n)),
    )  # fmt: skip


@dataclass(frozen=True)
class Corrected:
    """The probe corrected by a gauge run; None where the run determines nothing of it."""

    correction: Correction | None


def correct(seen: Seen, probe: Probe, *, parameters: Parameters, context: Context) -> Corrected:
    """Apply the effects that a gauge run shows to the stated probe."""
    if seen.geometry is None:
        return Corrected(None)
    return Corrected(correction_by_gauge(seen.geometry, probe, stated_belief(probe), seen.name))


@dataclass(frozen=True)
class CorrectedMotion:
    """An inspection adjusted with the corrected probe; None where there is none, or it does not fit."""

    adjusted: Adjusted | None

    def run(self, stated: FieldRun, correction: Correction) -> FieldRun | None:
        """Return the adjusted run, given the stated run and the correction it was made from."""
        if self.adjusted is None:
            return None
        return replace(stated, probe=correction.probe, **vars(self.adjusted))


def adjust_corrected(
    recording: Recording, frames: CheckedFrames, rings: RingSamples, motion: FreeMotion, probe: Probe,
    corrected: Annotated[Corrected, Of("gauge")], *, parameters: Parameters, context: Context,
) -> CorrectedMotion:  # fmt: skip
    """Adjust an inspection again with the probe that its gauge run corrects."""
    run = motion.run(frames.applied_to(recording), probe, rings)
    if run is None or corrected.correction is None:
        return CorrectedMotion(None)
    try:
        return CorrectedMotion(with_probe(run, corrected.correction.probe, context).adjusted)
    except UnusableError:
        return CorrectedMotion(None)


CORRECTION = Stage("correction", "1", Parameters, correct, "the stated probe with the effects found")
CORRECTED_MOTION = Stage(
    "corrected_motion", "5", Parameters, adjust_corrected, "an inspection's motion with the corrected probe"
)


@dataclass(frozen=True)
class _Parameters:
    """The probe's parameters as a function of the columns of the evidence, true − stated."""

    probe: Probe
    columns: tuple[Column, ...]
    terms: tuple[Term, ...]

    def expressible(self, name: str) -> bool:
        """Whether a file of this probe can express the effect."""
        known = {"fx", "fy", "cx", "cy", "k1"} <= set(self.probe.parameter_names)
        return name in CHANGES and (known or name not in _OF_CAMERA)

    def middle(self, instrument: Float) -> Float:
        """Return the columns' values (K,) from the instrument's corrections (P,) and the terms."""
        of_instrument = dict(zip(self.probe.parameter_names, instrument, strict=True))
        of_terms = {
            _column(t, a): float(v)
            for t in self.terms
            for a, v in zip(t.model.amplitudes, t.amplitude, strict=True)
        }
        return np.array([
            of_instrument.get(c.amplitude, 0.0) if c.effect == INSTRUMENT else of_terms[c]
            for c in self.columns
        ])  # fmt: skip

    def of(self, x: Float) -> Float:
        """Return the parameters (P,) at values (K,) of the columns."""
        values = dict(zip(self.probe.parameter_names, self.probe.parameters.tolist(), strict=True))
        for c, value in zip(self.columns, x, strict=True):
            if c.effect == INSTRUMENT and c.amplitude in values:
                values[c.amplitude] += float(value)
        for t in self.terms:
            if self.expressible(t.model.name):
                own = [
                    k for a in t.model.amplitudes for k, c in enumerate(self.columns) if c == _column(t, a)
                ]
                CHANGES[t.model.name](values, x[own], t.shape)
        return np.array([values[n] for n in self.probe.parameter_names])

    def slope(self, x: Float, step: Float) -> Float:
        """Return the derivatives (P, K), by differences over ± ``step`` (K,)."""
        moves = np.diag(np.maximum(step, 1e-12))
        return np.stack([(self.of(x + m) - self.of(x - m)) / (2 * m.sum()) for m in moves], axis=1)


def _column(term: Term, amplitude: Amplitude) -> Column:
    return Column(term.model.name, amplitude.name, term.shape)


def _spread(known: Evidence, stated: Stated, terms: Sequence[Term]) -> Float:
    """Return the true covariance (K, K) of the estimate, with correlated neighbours counted once."""
    found = estimate(known, stated, prior_sigma(known, terms)).covariance
    excess = known.score_covariance - known.information
    return np.asarray(found + found @ excess @ found)
