"""Residuals before and after the correction, on a recording that was not used for it, and on a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.adjustment.robust import root_mean_square as rms
from pipeline.arrays import Byte, Float
from pipeline.physics.effect import FixedTo
from pipeline.recording.base import Recording
from stages.diagnose.channels import Seen
from stages.diagnose.correct import ENCODER_EFFECTS, Correction
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.effects.courses import of_own_clock
from stages.diagnose.field.run import FieldRun
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.gauge.run import Term, pattern_of
from stages.diagnose.residual import (
    RingResidual,
    azimuths_rad,
    rings_against_fiducials,
    rings_against_texture,
    wall_distances_mm,
)
from stages.diagnose.result import Diagnosis, FitQuality, Picture, ReadingPicture, WallPicture
from stages.diagnose.travel.model import TravelFit

# A frame is shown only if it has this share of the bins of the fullest ring: chosen, so that the picture
# shows the pattern all round.
_MOST_OF_BINS = 0.8
_OF_GAUGE = (FixedTo.PIPE, FixedTo.GRAVITY)

Linear = tuple[tuple[EffectModel, Shape, Float], ...]


@dataclass(frozen=True)
class Compared:
    """Residuals of the same rings without and with the correction, and the resulting quality of fit.

    Attributes
    ----------
    fit : FitQuality or None
        None where the gauge run does not determine it.
    """

    before: RingResidual
    after: RingResidual
    fit: FitQuality | None


def compared(
    field: FieldRun | None, corrected: FieldRun | None, examined: Examined | None, gauge: Recording | None,
    correction: Correction | None, encoder_share: float = 0.0,
) -> Compared | None:  # fmt: skip
    """Return the residuals of the inspection, or else of the gauge run; None where neither has any.

    Parameters
    ----------
    field, corrected
        The inspection adjusted with the stated and with the corrected probe.
    examined, gauge
        Evidence from rings and fiducials of the gauge run, and its recording.
    """
    try:
        of_gauge = _of_gauge(gauge, examined) if gauge is not None and examined is not None else None
        terms = examined.best.fit.terms if examined is not None and examined.best is not None else ()
        # An event of the gauge run need not happen in the inspection: the held-out rings of the gauge run
        # itself are used.
        alone = field is None or any(of_own_clock(t.model) for t in terms)
        if of_gauge is not None and examined is not None and alone:
            # The quality of fit comes from parts of the run held out in turn.
            return Compared(*of_gauge, examined.quality)
        if field is None:
            return None
        linear = _beyond_probe(terms, correction)
        return _in_field(field, corrected or field, linear, of_gauge, encoder_share)
    except np.linalg.LinAlgError:
        return None


def with_pictures(found: Diagnosis, seen: Compared | None) -> Diagnosis:
    """Return the diagnosis with pictures of the residuals, and the quality of fit."""
    if seen is None:
        return found
    frames = np.unique(seen.before.frame)
    distance = wall_distances_mm(seen.before)
    over_frames = [r.over_frames(frames) for r in (seen.before, seen.after)]
    over_wall = [r.over_wall(distance) for r in (seen.before, seen.after)]
    return replace(
        found, fit=seen.fit, ring_picture=Picture(frames, azimuths_rad(), *over_frames),
        wall_picture=WallPicture(distance, azimuths_rad(), *over_wall),
    )  # fmt: skip


def with_readings(found: Diagnosis, recordings: Sequence[Seen | None]) -> Diagnosis:
    """Return the diagnosis with encoder readings in place of rings, if all its effects are the encoder's.

    Of several recordings, the one in which the effects make the largest difference is used.
    """
    names = {e.name for e in found.effects}
    fits = [s.travel.fit for s in recordings if s is not None and s.travel is not None and s.travel.fit]
    if not names or not names <= ENCODER_EFFECTS or not fits:
        return found
    best = max(fits, key=lambda f: rms(f.stated_mm) / rms(f.whitened.residual))
    shown = ReadingPicture(best.sight.time_s, best.stated_mm, best.whitened.residual)
    return replace(found, fit=_of_readings(best), ring_picture=None, wall_picture=None, reading_picture=shown)


def _of_readings(fit: TravelFit) -> FitQuality:
    """Return the quality of fit of readings to pictures; each picture is predicted from all others."""
    before, (missed, sigma) = rms(fit.stated_mm), fit.left_out_mm
    return FitQuality(
        "mm of the reading", before, rms(fit.whitened.residual), before, rms(missed), rms(sigma)
    )


def _of_gauge(gauge: Recording, examined: Examined) -> tuple[RingResidual, RingResidual]:
    searched = examined.searched
    terms = examined.best.fit.terms if examined.best is not None else ()
    return rings_against_fiducials(searched.run, searched.nothing.state, terms, gauge.frames.frame)


def _in_field(
    field: FieldRun, corrected: FieldRun, linear: Linear, of_gauge: tuple[RingResidual, RingResidual] | None,
    encoder_share: float,
) -> Compared:  # fmt: skip
    """Return the inspection's residuals; all of it is held out, since the correction did not use it."""
    before = rings_against_texture(field)
    after = rings_against_texture(corrected, linear, encoder_share)
    first, second = of_gauge or (before, after)
    every = first.rms_px, second.rms_px, before.rms_px, after.rms_px
    return Compared(before, after, FitQuality("px", *every, after.floor_px))


def _beyond_probe(terms: Sequence[Term], correction: Correction | None) -> Linear:
    """Return the effects found that a probe file cannot express, and that the inspection shares.

    What keeps its azimuth in the gauge has another in the inspection, whose frame P has another roll.
    """
    beyond = correction.inexpressible if correction is not None else ()
    shared = [t for t in terms if t.model.name in beyond and pattern_of(t)[0] not in _OF_GAUGE]
    return tuple((t.model, t.shape, t.amplitude) for t in shared)


@dataclass(frozen=True)
class OnImage:
    """One frame with its ring residuals.

    Attributes
    ----------
    grey : (H, W) uint8
    uv_before, uv_after : (M, 2), (K, 2)
        Ring samples, px, before and after the correction.
    before_px, after_px : (M,), (K,)
        Their residuals.
    """

    frame: int
    grey: Byte
    uv_before: Float
    uv_after: Float
    before_px: Float
    after_px: Float


def image_of(seen: Compared | None, field: Recording | None, gauge: Recording | None) -> OnImage | None:
    """Return the ring frame with the largest residuals, or None where no ring is usable."""
    if seen is None or not seen.before.usable.any():
        return None
    recording = field if seen.before.source == "field" else gauge
    if recording is None:
        return None
    number = worst_frame(seen.before)
    picture = next(iter(recording.read([number], "grey")))[1]
    if picture is None:
        return None
    before, after = (r.usable & (r.frame == number) for r in (seen.before, seen.after))
    return OnImage(
        number, picture.copy(), seen.before.uv[before], seen.after.uv[after],
        seen.before.residual_px[before], seen.after.residual_px[after],
    )  # fmt: skip


def worst_frame(residual: RingResidual) -> int:
    """Return the number of the frame with the largest median residual, among frames with most of a ring.

    An effect that begins during the recording is absent from earlier frames; the median ignores a single bad
    bin.
    """
    frames, count = np.unique(residual.frame[residual.usable], return_counts=True)
    whole = frames[count >= _MOST_OF_BINS * count.max()]
    sizes = np.abs(residual.residual_px)
    middle = [np.median(sizes[residual.usable & (residual.frame == f)]) for f in whole]
    return int(whole[np.argmax(middle)])
