"""Compares stated sizes with the pictures: pipe diameter, the probe's units, the encoder's unit and sign."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter

from pipeline.adjustment.circles import circles_through
from pipeline.adjustment.robust import basis_of, ring_harmonics, row_median
from pipeline.arrays import Float
from pipeline.artefacts.findings import clock_of_azimuth
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.pages import notation
from pipeline.recording.base import Encoder, PipeFacts, Recording
from stages.premises.losses import Steps
from stages.premises.pictures import CLOSED, Pictures

# Nominal sizes differ from inner diameters by up to a quarter (ASME B36.10: NPS 1/2 has a 15.8 mm bore). From
# a tenth on there is a warning; a factor of 1.5 means another pipe, another probe or another unit.
_WARNED, _ANOTHER = 1.1, 1.5
# Largest radius of the lamps, in radii of the pipe (chosen). If all lengths of open-1 are stated in inches or
# metres, its lamps are 6 or 250 times as wide as its pipe, also with the default radius of the lamps.
_TOO_WIDE = 2.0
_UNITS = (("inch", 25.4), ("m", 1000.0), ("cm", 10.0), ("ft", 304.8))
# A ratio counts as that of a unit within this factor; the units differ by more from each other.
_NEAR_UNIT = 1.25
# A ratio off by this factor contradicts the tables. Unrolled walls show motion to about a tenth, and a
# gauge's bores differ from their mean, but neither reaches a factor of two.
_CONTRADICTS = 2.0
_LEAST_STEPS, _ONE_SIGN = 8, 0.8
# The pipe's radius at a picture is the median of this many rings around it: four wrong ones do not move it.
_RINGS = 9
_MAYBE_BACKWARDS = (
    "Or the pictures are stored in reverse order, which the motion in this recording cannot show: then "
    "distances are wrong by as much as the speed varied. Check whether the video runs backwards. "
)
# Second harmonic of the ring, in radii, from which it is reported; .013 at most in 15 fields (open-1 to
# open-3, a01 to a12), .030 where pictures were made 2 % wider.
_OVAL = 0.02
# With the right probe every pixel of the line lies on the laser sheet; half leaves room for false lines.
_MOST_LOST = 0.5


def rings_seen_mm(pictures: Pictures, probe: Probe) -> Float:
    """Return the points of closed laser lines (L, R, 2) across the camera's axis, mm, frame C."""
    closed = pictures.line_px[pictures.closed > CLOSED].astype(float)
    direction = np.stack([np.cos(pictures.azimuth_rad), np.sin(pictures.azimuth_rad)], -1)
    uv = np.asarray(probe.camera.centre_px) + closed[..., None] * direction
    return probe.triangulate(uv)[..., :2] if closed.size else np.empty((0, len(direction), 2))


def radius_seen_mm(rings_mm: Float) -> float:
    """Return the median distance of rings (L, R, 2) from the camera's axis; NaN without any.

    Raises
    ------
    UnusableError
        When, with the stated probe, the rays of most pixels of the line miss the laser sheet.
    """
    if not rings_mm.size:
        return float("nan")
    radius_mm = np.linalg.norm(rings_mm, axis=-1)
    lost = 1 - float(np.isfinite(radius_mm).mean())
    if lost > _MOST_LOST:
        raise UnusableError(
            "premises",
            f"with the stated probe, {100 * lost:.0f} % of the laser line's pixels have rays that miss "
            "the laser sheet",
            limit=f"{100 * _MOST_LOST:.0f} %",
            hint="check camera.focal_px, centre_px, distortion and the laser in probe.yaml; the camera must "
            "be stated for pictures of this size",
        )
    return float(np.nanmedian(radius_mm))


def radius_along_mm(pictures: Pictures, rings_mm: Float) -> Float:
    """Return the pipe's radius (F,), mm, at each picture from the closed lines around it; NaN without any."""
    place, ring_mm = np.flatnonzero(pictures.closed > CLOSED), row_median(np.linalg.norm(rings_mm, axis=-1))
    known = np.isfinite(ring_mm)
    if not known.any():
        return np.full(len(pictures.closed), np.nan)
    smooth_mm = median_filter(ring_mm[known], _RINGS, mode="nearest")
    return np.interp(np.arange(len(pictures.closed)), place[known], smooth_mm)


def warn_of_oval(rings_mm: Float, context: Context) -> None:
    """Warn of oval rings (L, R, 2): the pipe is oval, or the picture was stretched."""
    if not len(rings_mm):
        return
    centre, radius = circles_through(rings_mm.astype(np.float32))
    known = np.isfinite(radius)
    if known.sum() < _LEAST_STEPS:
        return
    away = np.linalg.norm((rings_mm - centre[:, None])[known], axis=-1) / radius[known, None] - 1
    rays = np.linspace(-np.pi, np.pi, away.shape[1], endpoint=False)
    # Blocks of a codec, taken for the line on one ray in seven, had made a ring 4.6 % longer than wide.
    twice = ring_harmonics(away, basis_of(rays))[:, 3:]
    measured = np.isfinite(twice).all(1)
    if measured.sum() < _LEAST_STEPS:
        return
    oval = complex(*np.median(twice[measured], axis=0))
    context.report("ring longer than wide by", 200 * abs(oval), "%")
    if abs(oval) > _OVAL:
        towards = notation.clock(float(clock_of_azimuth(np.angle(oval) / 2)))
        context.warn(
            f"with the stated probe the laser ring is {200 * abs(oval):.1f} % longer towards {towards} in "
            "the picture than across. Either the pipe is oval, or something mirrors the line; or pictures "
            "were stretched, cropped or taken by another camera, and radii and findings are wrong by more "
            "than their σ. What to do: measure the pipe's height and width; check that camera and recorder "
            "keep the pictures' shape, and that the probe file belongs to this camera with these settings"
        )


def check_diameter(radius_mm: float, pipe: PipeFacts, lamps_mm: float, context: Context) -> None:
    """Compare the stated diameter, and the radius ``lamps_mm`` of the probe's lamps, with the laser ring.

    The median ring of a run through several bores may have any diameter between the smallest and the largest.

    Raises
    ------
    UnusableError
        When the diameter differs by half or more, naming the unit that would explain it, or when the lamps
        would not fit into the pipe.
    """
    if not np.isfinite(radius_mm):
        return
    stated = [pipe.nominal_diameter_mm, *(b.diameter_mm for b in pipe.bore)]
    nearest = float(np.clip(2 * radius_mm, min(stated), max(stated)))
    ratio = 2 * radius_mm / nearest
    if max(ratio, 1 / ratio) > _ANOTHER:
        raise UnusableError(
            "premises",
            f"with the stated probe the laser ring has a diameter of {2 * radius_mm:.4g} mm, but the pipe's "
            f"is stated as {nearest:g} mm{_unit_hint(ratio)}",
            limit=f"a factor of {_ANOTHER:g}",
            hint="check pipe.nominal_diameter_mm in recording.yaml and laser.baseline_mm and the camera in "
            "probe.yaml, all in mm, and that the recorder neither scales nor frames the pictures",
        )
    if lamps_mm > _TOO_WIDE * radius_mm:
        raise UnusableError(
            "premises",
            f"with the stated probe the laser ring has a radius of {radius_mm:.4g} mm: the probe, whose "
            f"lamps are on a radius of {lamps_mm:.4g} mm, does not fit into such a pipe",
            hint="state lengths in mm: laser.baseline_mm and lighting.radius_mm in probe.yaml, "
            "pipe.nominal_diameter_mm in recording.yaml, and distances in encoder.csv",
        )
    if max(ratio, 1 / ratio) > _WARNED:
        context.warn(
            f"with the stated probe the laser ring has a diameter of {2 * radius_mm:.1f} mm, but the pipe's "
            f"is stated as {nearest:g} mm. What to do: check nominal_diameter_mm; deviations from it and "
            "wall losses refer to it"
        )


def _unit_hint(ratio: float) -> str:
    for name, size in _UNITS:
        if max(ratio / size, size / ratio) < _NEAR_UNIT:
            return f": {size:g} times as much, as if the diameter were stated in {name}"
        if max(ratio * size, 1 / (ratio * size)) < _NEAR_UNIT:
            return f": {size:g} times less, as if the laser's baseline were stated in {name}"
    if max(ratio / 2, 2 / ratio) < _NEAR_UNIT:
        return ": twice as much, as if the radius were stated"
    return ""


@dataclass(frozen=True)
class _Ratio:
    """Ratio of encoder to texture: the median over steps, their number, and the share that has its sign."""

    value: float
    steps: int
    one_sign: float

    @property
    def unusable(self) -> bool:
        """Whether the ratio is unusable: too few steps, changing signs, or an encoder that stands."""
        return self.steps < _LEAST_STEPS or self.one_sign < _ONE_SIGN


def encoder_factor(
    recording: Recording, time_s: Float, steps: Steps, radius_mm: float, forwards: bool, context: Context
) -> float:
    """Return the factor that converts the encoder to mm and to the wall's direction of motion; warn of it.

    Parameters
    ----------
    time_s : (F,)
        Times of the pictures, corrected.
    radius_mm
        The pipe's radius from the laser ring: the texture's motion is measured in pipe radii.
    forwards : bool
        Whether the motion shows that the pictures are stored in the order of time: see `runs_forwards`.
    """
    if recording.encoder is None or not np.isfinite(radius_mm):
        return 1.0
    found = _ratio(recording.encoder, time_s, steps, radius_mm)
    if found.unusable:
        return 1.0
    unit, size = _nearest_unit(abs(found.value))
    contradicts = max(abs(found.value) * size, 1 / max(abs(found.value) * size, 1e-9)) > _CONTRADICTS
    factor = 1.0 if contradicts else size * float(np.sign(found.value))
    wrong = [f"in {unit} instead of mm"] * (abs(factor) != 1.0) + ["with its sign reversed"] * (factor < 0)
    if wrong:
        perhaps = _MAYBE_BACKWARDS if factor < 0 and not forwards else ""
        context.warn(
            f"the encoder reads {found.value:.3g} mm where the wall's texture moves by 1 mm, in "
            f"{found.steps} steps: it seems to count {' and '.join(wrong)}, so its readings are multiplied "
            f"by {factor:g}. {perhaps}What to do: correct encoder.csv"
        )
    elif contradicts:
        held_back = ", or the codec holds the wall's texture back" if abs(found.value) > 1 else ""
        context.warn(
            f"the encoder reads {found.value:.3g} mm where the wall's texture moves by 1 mm, in "
            f"{found.steps} steps: one of the encoder's scale, its clock and the probe's baseline is "
            f"wrong{held_back}. What to do: check whether the wall moves evenly in lit pictures, and check "
            "all three; distances may be wrong by this factor"
        )
    return factor


def _ratio(encoder: Encoder, time_s: Float, steps: Steps, radius_mm: float) -> _Ratio:
    known = (time_s >= encoder.time_s[0]) & (time_s <= encoder.time_s[-1])
    by_encoder, by_wall = steps.by_encoder(encoder, time_s), steps.size * radius_mm
    # Only steps above half of the fast ones (the 0.9 quantile) count: the ratio of two short steps is noisy.
    moving = np.abs(by_wall) > 0.5 * np.nanquantile(np.abs(by_wall), 0.9) if len(by_wall) else by_wall > 0
    use = known[steps.end] & known[steps.start] & moving
    if not use.any():
        return _Ratio(1.0, 0, 1.0)
    ratio = by_encoder[use] / by_wall[use]
    value = float(np.median(ratio))
    return _Ratio(value, len(ratio), float((np.sign(ratio) == np.sign(value)).mean()) if value else 0.0)


def in_mm(encoder: Encoder | None, time_s: Float, steps: Steps, radius_mm: float) -> Encoder | None:
    """Return the encoder converted to mm by the wall's motion, if that shows its unit; its sign is kept.

    Parameters
    ----------
    encoder
        Its readings in an unknown unit of length.
    time_s : (F,)
        Times of the pictures, s, corrected.
    steps
        Motion of the wall between pictures, in radii of the pipe.
    radius_mm
        The pipe's radius; if it is NaN, the encoder is returned unchanged.
    """
    if encoder is None or not np.isfinite(radius_mm):
        return encoder
    found = _ratio(encoder, time_s, steps, radius_mm)
    if found.unusable:
        return encoder
    _, size = _nearest_unit(abs(found.value))
    return replace(encoder, distance_mm=encoder.distance_mm * size)


def _nearest_unit(ratio: float) -> tuple[str, float]:
    for name, size in _UNITS:
        if max(ratio * size, 1 / (ratio * size)) < _NEAR_UNIT:
            return name, size
    return "mm", 1.0
