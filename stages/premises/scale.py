"""Stated sizes against the pictures: the pipe's diameter, the probe's units, the encoder's unit and sign."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.recording.base import Encoder, PipeFacts, Recording
from stages.premises.light import Steps
from stages.premises.pictures import CLOSED, Pictures

# Nominal sizes differ from inner diameters by up to a quarter (ASME B36.10: NPS 1/2 has a 15.8 mm bore);
# a tenth is worth a word, a half more or less is another pipe, another probe or another unit.
_WORTH_A_WORD, _ANOTHER = 1.1, 1.5
# Where inches or metres are taken for mm throughout, lamps come out 6 or 250 times too wide for the pipe of
# open-1; that much wider (chosen) they are in no pipe, also where their radius is not stated.
_TOO_WIDE = 2.0
_UNITS = (("inch", 25.4), ("m", 1000.0), ("cm", 10.0), ("ft", 304.8))
# A ratio is that of a unit when it comes so near to it; units lie further apart.
_NEAR_UNIT = 1.25
# Unrolled walls show motion to about a tenth, bores of a gauge differ from their mean: twice is neither.
_CONTRADICTS = 2.0
_LEAST_STEPS, _ONE_SIGN = 8, 0.8
# The line is on the laser sheet wherever a probe is as stated; half of it leaves room for chance lines.
_MOST_LOST = 0.5


def radius_seen_mm(pictures: Pictures, probe: Probe) -> float:
    """Return the median distance of the laser line from the camera's axis; NaN where no line closes.

    Raises
    ------
    UnusableError
        When the stated probe has no place on the laser sheet for most of the line.
    """
    closed = pictures.line_px[pictures.closed > CLOSED].astype(float)
    if not closed.size:
        return float("nan")
    direction = np.stack([np.cos(pictures.azimuth_rad), np.sin(pictures.azimuth_rad)], -1)
    uv = np.asarray(probe.camera.centre_px) + closed[..., None] * direction
    radius_mm = np.linalg.norm(probe.triangulate(uv)[..., :2], axis=-1)
    lost = 1 - float(np.isfinite(radius_mm).mean())
    if lost > _MOST_LOST:
        raise UnusableError(
            "premises",
            f"by the stated probe {100 * lost:.0f} % of the laser line's pixels look past the laser sheet or "
            "nowhere at all",
            limit=f"{100 * _MOST_LOST:.0f} %",
            hint="check camera.focal_px, centre_px and distortion and the laser in probe.yaml; the "
            "camera's lengths are px of these pictures",
        )
    return float(np.nanmedian(radius_mm))


def check_diameter(radius_mm: float, pipe: PipeFacts, lamps_mm: float, context: Context) -> None:
    """Hold the stated diameter, and the radius ``lamps_mm`` of the probe's lamps, against the ring.

    Raises
    ------
    UnusableError
        When the diameter differs by half or more, naming the unit that would explain it, or when the lamps
        would not fit into the pipe.
    """
    if not np.isfinite(radius_mm):
        return
    stated = [pipe.nominal_diameter_mm, *(b.diameter_mm for b in pipe.bore)]
    nearest = min(stated, key=lambda d: abs(np.log(2 * radius_mm / d)))
    ratio = 2 * radius_mm / nearest
    if max(ratio, 1 / ratio) > _ANOTHER:
        raise UnusableError(
            "premises",
            f"by the laser ring and the stated probe the pipe's diameter is {2 * radius_mm:.4g} mm, stated "
            f"are {nearest:g} mm{_unit_hint(ratio)}",
            limit=f"a factor of {_ANOTHER:g}",
            hint="check pipe.nominal_diameter_mm in recording.yaml and laser.baseline_mm and the camera in "
            "probe.yaml, all in mm, and that the recorder neither scales nor frames the pictures",
        )
    if lamps_mm > _TOO_WIDE * radius_mm:
        raise UnusableError(
            "premises",
            f"by the laser ring and the stated probe the pipe's radius is {radius_mm:.4g} mm: the probe with "
            f"its lamps on a radius of {lamps_mm:.4g} mm does not fit into it",
            hint="state lengths in mm: laser.baseline_mm and lighting.radius_mm in probe.yaml, "
            "pipe.nominal_diameter_mm in recording.yaml, and distances in encoder.csv",
        )
    if max(ratio, 1 / ratio) > _WORTH_A_WORD:
        context.warn(
            f"by the laser ring and the stated probe the pipe's diameter is {2 * radius_mm:.1f} mm, stated "
            f"are {nearest:g} mm. What to do: check nominal_diameter_mm; deviations from nominal and wall "
            "losses refer to it"
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
    """Encoder over texture: the median of the steps, how many there are, the share of the commoner sign."""

    value: float
    steps: int
    one_sign: float


def encoder_factor(
    recording: Recording, time_s: Float, steps: Steps, radius_mm: float, context: Context
) -> float:
    """Return by what the encoder is to be multiplied to be in mm and in the sense of the wall's motion; warn.

    Parameters
    ----------
    time_s : (F,)
        Of the pictures, as they are believed now.
    radius_mm
        Of the pipe as the ring shows it: the texture's motion is seen in pipe radii.
    """
    if recording.encoder is None or not np.isfinite(radius_mm):
        return 1.0
    found = _ratio(recording.encoder, time_s, steps, radius_mm)
    if found.steps < _LEAST_STEPS or found.one_sign < _ONE_SIGN:
        return 1.0
    unit, size = _nearest_unit(abs(found.value))
    contradicts = max(abs(found.value) * size, 1 / max(abs(found.value) * size, 1e-9)) > _CONTRADICTS
    factor = 1.0 if contradicts else size * float(np.sign(found.value))
    wrong = [f"in {unit} in place of mm"] * (abs(factor) != 1.0) + ["with its sign reversed"] * (factor < 0)
    if wrong:
        context.warn(
            f"the encoder reads {found.value:.3g} mm where the wall's texture moves by 1 mm, in "
            f"{found.steps} steps: its readings are taken as {' and '.join(wrong)}, and multiplied by "
            f"{factor:g}. What to do: correct encoder.csv"
        )
    elif contradicts:
        context.warn(
            f"the encoder reads {found.value:.3g} mm where the wall's texture moves by 1 mm, in "
            f"{found.steps} steps: one of the encoder's scale, its clock and the probe's baseline is wrong. "
            "What to do: check all three; distances may be wrong by this factor"
        )
    return factor


def _ratio(encoder: Encoder, time_s: Float, steps: Steps, radius_mm: float) -> _Ratio:
    known = (time_s >= encoder.time_s[0]) & (time_s <= encoder.time_s[-1])
    reading = np.interp(time_s, encoder.time_s, encoder.distance_mm)
    by_encoder, by_wall = reading[steps.end] - reading[steps.start], steps.size * radius_mm
    # Half of the fastest tenth's step: a ratio of two short ways says little.
    moving = np.abs(by_wall) > 0.5 * np.nanquantile(np.abs(by_wall), 0.9) if len(by_wall) else by_wall > 0
    use = known[steps.end] & known[steps.start] & moving
    if not use.any():
        return _Ratio(1.0, 0, 1.0)
    ratio = by_encoder[use] / by_wall[use]
    value = float(np.median(ratio))
    return _Ratio(value, len(ratio), float((np.sign(ratio) == np.sign(value)).mean()) if value else 0.0)


def _nearest_unit(ratio: float) -> tuple[str, float]:
    for name, size in _UNITS:
        if max(ratio * size, 1 / (ratio * size)) < _NEAR_UNIT:
            return name, size
    return "mm", 1.0
