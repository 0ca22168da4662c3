"""Recognises pictures that are stored in reverse order: the encoder fits them if read backwards in time."""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.robust import root_mean_square
from pipeline.arrays import Float
from pipeline.errors import UnusableError
from pipeline.recording.base import Encoder
from stages.premises.losses import Steps

# The pictures count as reversed if their motion fits the encoder twice as well backwards in time. In 29 sound
# recordings (open-1 to a12) it fits at most 1.24 times as well; in all 14 gauge runs, when reversed, 2.2
# times or more. With fewer steps there is no decision.
_TWICE, _LEAST_KNOWN = 2.0, 20
# Delays of the encoder's clock, s, that are tried before pictures count as reversed. With ±0.1 s, up to 15 of
# 60 drawn runs that stop and go were wrongly refused where the clock was off by more; with ±1 s none was, and
# all 120 reversed ones were. In steps of 12.5 ms, no delay is farther from a tried one than a fifth of a
# frame at 30 frames a second.
_LATE_S = np.linspace(-1, 1, 161)


def runs_forwards(encoder: Encoder | None, time_s: Float, steps: Steps) -> bool:
    """Return whether the wall's motion shows that the pictures are stored in the order of time.

    False also if it cannot show that: without an encoder, at a steady speed, or with too few known steps.

    Parameters
    ----------
    encoder
        Its readings in any unit and of any sign.
    time_s : (F,)
        Times of the pictures, s, corrected.
    steps
        Motion of the wall between pictures, in radii of the pipe.

    Raises
    ------
    UnusableError
        When the encoder fits twice as well backwards in time as forwards, whatever its sign and unit, and
        even if its clock is a second off. A run to and fro looks the same in both directions and is never
        refused.
    """
    if encoder is None:
        return False
    mirrored_s = time_s[0] + time_s[-1] - time_s
    ends_s = np.stack([t[place] for t in (time_s, mirrored_s) for place in (steps.start, steps.end)])
    known = np.all((ends_s >= encoder.time_s[0]) & (ends_s <= encoder.time_s[-1]), axis=0)
    if known.sum() < _LEAST_KNOWN:
        return False
    late = (steps.by_encoder(encoder, time_s + by_s)[known] for by_s in _LATE_S)
    as_it_is = min(_misfit(steps.size[known], shown) for shown in late)
    backwards = _misfit(steps.size[known], steps.by_encoder(encoder, mirrored_s)[known])
    if _TWICE * backwards < as_it_is:
        raise UnusableError(
            "premises",
            "the pictures are stored in reverse order, last first: the wall's motion fits the encoder read "
            f"backwards in time {as_it_is / max(backwards, 1e-9):.1f} times as well as forwards",
            hint="reverse the order of the pictures, or find out what reversed the video",
        )
    return _TWICE * as_it_is < backwards


def _misfit(wall: Float, shown: Float) -> float:
    """Return how much steps of the wall (K,) differ from the ``shown`` steps (K,), after the best scaling."""
    return root_mean_square(wall - shown * float(wall @ shown) / max(float(shown @ shown), 1e-12))
