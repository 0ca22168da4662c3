"""Where the probe turned between two pictures, and what play of the encoder does to readings there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.recording.base import Encoder
from stages.diagnose.effects.base import Travel
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.travel.sight import Sight, readings_at


@dataclass(frozen=True)
class Turns:
    """Where the probe turned between two pictures: before picture ``place`` (K,), at ``distance_mm`` (K,)."""

    place: Int
    distance_mm: Float


def turns_between(sight: Sight, steady: Encoder, delay_s: float) -> Turns:
    """Return where the probe turned between pictures: as far beyond the last one as the reading still went.

    Until it turns, the reading follows the probe, whatever play there is after that.
    """
    way = sight.direction
    before = np.flatnonzero(way[1:] != way[:-1])
    place, distance = [], []
    for turn in before:
        # The direction is a mean over neighbours, so that the reversal may be a picture later or earlier.
        first, last = max(int(turn) - 1, 0), min(int(turn) + 2, len(way) - 1)
        inside = (steady.time_s > sight.time_s[first] + delay_s) & (
            steady.time_s < sight.time_s[last] + delay_s
        )
        if not inside.any():
            continue
        at = np.flatnonzero(inside)[np.argmax(way[turn] * steady.distance_mm[inside])]
        k = int(np.clip(np.searchsorted(sight.time_s, steady.time_s[at] - delay_s), 1, len(way) - 1))
        went = steady.distance_mm[at] - readings_at(steady, sight.time_s[k - 1 : k] + delay_s)[0]
        place.append(k)
        distance.append(sight.distance_mm[k - 1] + went)
    return Turns(np.array(place, np.int64), np.array(distance, float))


def lag_mm(sight: Sight, turns: Turns, play_mm: float) -> Float:
    """Return (N,) by how much readings are ahead for play of that size."""
    way = np.insert(sight.distance_mm, turns.place, turns.distance_mm)
    same = np.zeros(len(way))
    travel = Travel(same, way, same, way)
    lag = LIBRARY["encoder_backlash"].reading_shift_mm(travel, (), np.array([play_mm]))
    return np.asarray(np.delete(lag, turns.place + np.arange(len(turns.place))))
