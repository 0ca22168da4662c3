"""An encoder's readings with what was found of them taken out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.recording.base import Encoder, Recording
from stages.diagnose.effects.base import Shape, Travel
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.result import EffectFound

_OF_ENCODER = {
    "encoder_scale": "relative", "encoder_slip": "slip_mm", "encoder_backlash": "backlash_mm",
    "time_offset": "delay_s",
}  # fmt: skip
_ROUNDS = 3


def encoder_effects(effects: Sequence[EffectFound]) -> tuple[EffectFound, ...]:
    """Return the effects that falsify the readings."""
    return tuple(e for e in effects if e.name in _OF_ENCODER)


def with_true_readings(recording: Recording, effects: Sequence[EffectFound]) -> Recording:
    """Return the recording with its encoder's readings as they would be without the effects.

    Its ``content_key`` stays: whoever stores results by it has to tell the readings apart.
    """
    if recording.encoder is None:
        return recording
    encoder = recording.encoder
    true = encoder.distance_mm
    for _ in range(_ROUNDS):
        travel = Travel(encoder.time_s, true, np.gradient(true, encoder.time_s), encoder.distance_mm)
        shift = np.zeros(len(true))
        for e in encoder_effects(effects):
            size = np.array([e.parameters[_OF_ENCODER[e.name]].value])
            shift += LIBRARY[e.name].reading_shift_mm(travel, _shape(e), size)
        true = encoder.distance_mm - shift
    return replace(recording, encoder=Encoder(encoder.time_s, np.asarray(true)))


def _shape(effect: EffectFound) -> Shape:
    return (effect.parameters["time_s"].value,) if "time_s" in effect.parameters else ()
