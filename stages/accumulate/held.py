"""Rings that share the line's finest structure: how much, what may cause it, and what to do."""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.held_over import held_over
from pipeline.adjustment.shared_light import HeldOver
from pipeline.artefacts.measured import RingSamples
from pipeline.machine.stage import Context
from stages.accumulate.survey import RingSurvey

# Where rings are too few to tell them apart, errors at the same places of the image look like repeated light:
# 24 to 33 % were shared in pictures that were stored as single JPEGs.
_IN_IMAGE = (
    ", errors stay at the same places of the image (pixels, their colour mosaic, blocks of the codec), or "
    "scratches run along the pipe"
)
_PREDICTED = "the codec, or a noise filter, repeats light of earlier pictures"
_ALONE = (
    "the codec, which keeps each picture apart or loses nothing, is not the cause. A noise filter repeats "
    "light of earlier pictures"
)


def held_in(rings: RingSamples, survey: RingSurvey, radius_mm: float) -> HeldOver:
    """Return the share of the line's light that rings have in common, from its height, width and position."""
    lines = (np.log(np.maximum(rings.amplitude, 1.0)), rings.width_px, rings.radius_px)
    known = [np.where(rings.valid, line, np.nan).astype(float) for line in lines]
    sample_mm = 2 * np.pi * radius_mm / len(rings.azimuth_rad)
    return held_over(known, survey.middle_mm, sample_mm, known[-1])


def warn_of_held(held: HeldOver, predicted: bool, context: Context) -> None:
    """Report the correlation of rings' finest structure, and warn where much of it is repeated light.

    The codec is named as a possible cause only where it predicts pictures from others (``predicted``).
    """
    alike = float(held.likeness[1:].max(initial=0.0))
    context.report("correlation of neighbouring rings in their finest structure", alike, "")
    if held.repeated is not None:
        repeated = float(held.repeated[1:].max(initial=0.0))
        context.report("of it by light of earlier pictures, not by places of the image", repeated, "")
    if held.more_than_usual:
        causes = (_PREDICTED if predicted else _ALONE) + ("" if held.repeated is not None else _IN_IMAGE)
        context.warn(
            f"neighbouring rings share {100 * alike:.0f} % of the line's finest structure (good recordings: "
            f"16 % at most): {causes}. The σ of radii "
            "includes this, and such rings count as one when they confirm a finding. But single findings may "
            "be false, and small pits may be missed or too shallow, which their σ includes. What to do: look "
            "at the picture of every finding, record with less compression and without noise reduction"
        )
