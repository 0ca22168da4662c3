"""An encoder's readings with what was found of them taken out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.arrays import Float
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
    encoder, found = recording.encoder, encoder_effects(effects)
    # Steps first: what is left of one would look like speed to the others.
    reading = encoder.distance_mm - _shift(encoder, encoder.distance_mm, [e for e in found if _shape(e)])
    smooth, true = [e for e in found if not _shape(e)], reading
    for _ in range(_ROUNDS):
        true = reading - _shift(encoder, true, smooth)
    return replace(recording, encoder=Encoder(encoder.time_s, true))


def _shift(encoder: Encoder, true_mm: Float, effects: Sequence[EffectFound]) -> Float:
    """Return by how much effects falsify readings (N,) of a way (N,)."""
    travel = Travel(encoder.time_s, true_mm, np.gradient(true_mm, encoder.time_s), encoder.distance_mm)
    shift = np.zeros(len(true_mm))
    for e in effects:
        size = np.array([e.parameters[_OF_ENCODER[e.name]].value])
        shift += LIBRARY[e.name].reading_shift_mm(travel, _shape(e), size)
    return shift


def _shape(effect: EffectFound) -> Shape:
    return (effect.parameters["time_s"].value,) if "time_s" in effect.parameters else ()
