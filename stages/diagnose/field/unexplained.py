"""Whether the likeliest effect explains what an inspection shows, or leaves most of it."""

from __future__ import annotations

import numpy as np

from stages.diagnose.field.evidence import FieldEvidence
from stages.diagnose.gauge.scan import Scored
from stages.diagnose.residual import rings_against_texture

# 1 σ of the place of a ring's middle from texture alone, px: .09 to .11 in four sound inspections, of which
# the largest is used; its error there was .05 to .08 px (`RingResidual.floor_px`).
_MIDDLE_PX = 0.11
_LEFT = (
    "The inspection alone shows something that no effect of the library explains. The likeliest, {}, leaves "
    "{:.2f} px of {:.2f} px between rings and texture, most of it constant at one place of the image, where "
    "noise makes {:.2f} px"
)


def why_unexplained(field: FieldEvidence, likeliest: Scored) -> str:
    """Return why rings contradict the likeliest effect; empty where it may be right or cannot be judged.

    What repeats at one azimuth of the image on other wall is not noise, except for the uncertain place of a
    ring's middle from texture. An effect that explains the rest removes most of it: it does not if it leaves
    more than half, and more than noise and middle explain.
    """
    assert field.run is not None
    taken = ((likeliest.model, likeliest.shape, likeliest.score.amplitude),)
    try:
        before, after = (
            rings_against_texture(field.run, terms, field.encoder_scale) for terms in ((), taken)
        )
    except np.linalg.LinAlgError:
        return ""
    sound = before.floor_px**2 + _MIDDLE_PX**2
    repeated, left = before.rms_px**2 - sound, after.rms_px**2 - sound
    if not (left > sound and left > repeated / 2):
        return ""
    what = likeliest.model.law.replace("_", " ")
    return _LEFT.format(what, after.rms_px, before.rms_px, before.floor_px)
