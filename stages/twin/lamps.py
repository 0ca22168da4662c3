"""Lamps that shine unevenly, around the picture or from frame to frame, in frames used by the measurement.

The lamps' pattern around the picture is described by two harmonics. A single dim LED gives both, in a ratio
and at angles that follow from its place and the bore; another pattern gets no name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import norm, theilslopes

from pipeline.arrays import Float, Int
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.cells import SECTORS, Cells, centred, sector_azimuth_rad
from stages.twin.dead_led import seen_from
from stages.twin.gate import Suspected
from stages.twin.lamp_light import Course, LampLight
from stages.twin.laws import LED_AZIMUTHS, dim_share
from stages.twin.reference import WALL_COLUMNS, BlockSamples
from stages.twin.scene import Ring, Scene
from stages.twin.significance import ratio_over_frames
from stages.twin.state import PhotometricState
from stages.twin.switched import dim_led, lamp_pattern, share_at

_LEAST, _LEFT, _SURE = 0.012, 0.003, 5.0
"""Smallest relative amplitude of the first harmonic that is reported; largest that a sound photo leaves;
significance in σ. Recordings with even lamps leave 0.002."""
_LOSSES = np.linspace(0.1, 1.0, 19)
"""Losses for which the pattern is computed; it is nearly linear between them."""
_OF_SECOND = 2.0
"""The relative σ of the second harmonic, because the lobe is unknown, over that of the first: order two."""
_VARIES, _FEWEST_FRAMES = {"flicker": 0.02, "laser_flicker": 0.08}, 8
"""Spread of brightness from frame to frame above which flicker is named, twice the limit for compared frames,
since the photo is made from the measured ones; fewest frames."""
_MOSTLY, _SURE_OF_WALL, _PARTS, _OVER_CELLS = 0.5, 3.0, 6, 4.0
"""Least share of an uneven pattern that the same wall must show at several places of the image; its
significance in σ; parts of the frames, each left out once for that σ. Least ratio of the pattern's variance
on the same wall to that within a cell, where wall that is paler on one side varies alike: below it the share
would be too large by more than a quarter."""
_BESIDE = 0.5
"""Spread of compared frames about the curve through the measured ones, over the spread of these, below which
light changes slowly: flicker leaves about 1, an exposure that swings by a third 1.3 times in 12 frames .1.
And the spread of measured frames over that of compared ones below which the photo may be the cause: flicker
makes it 1 to 3 (6 recordings), wall that shines .1."""
_FADES, _CONFIDENCE = 0.25, 0.99
"""Least slow change of a light, as a logarithm, that is reported: the photo errs by less, as for a dim sector
of the laser. Confidence with which it must be larger. Chosen."""
_WIDER = 1.8
"""1 σ of a spread estimated from the median size of steps over that of a standard deviation: from 20,000
draws for each of 6 to 40 normal samples."""


def uneven_lamps(lamp: LampLight | None, scene: Scene, frame: Int) -> tuple[Suspected, ...]:
    """Return the cause of an uneven pattern of the lamps in lit frames (F,); nothing where it is even."""
    if lamp is None:
        return ()
    first, second = (complex(*lamp.pattern[k : k + 2]) for k in (0, 2))
    sd = float(np.hypot(*lamp.pattern_sd[:2]))
    if abs(first) < max(_LEAST, _SURE * sd):
        return ()
    dim, spread = _harmonics(lamp, scene)
    azimuth = float(np.angle(-first))
    lost = float(np.interp(abs(first), -dim[:, 0], _LOSSES))
    predicted = float(np.interp(lost, _LOSSES, dim[:, 1])) * np.exp(2j * azimuth)
    allowed = _LEFT + _OF_SECOND * spread * abs(predicted)
    one = abs(first) < -(1 + 2 * spread) * dim[-1, 0] and abs(second - predicted) < allowed
    look, nan = scene.ring.at(int(frame[0]), azimuth), float("nan")
    at = NamedFigure("azimuth_deg", float(np.degrees(azimuth)), 180 / LED_AZIMUTHS, "deg")
    sizes = np.tile([lost if one else 0.0, azimuth], (len(frame), 1))
    if one:
        size = NamedFigure(
            "lost", lost, float(np.hypot(spread, sd / abs(first))) * lost, "share of the light"
        )
        said = f"In all frames, the LED at image azimuth {at.value:.0f}° sends {100 * lost:.0f} % less light"
        name = "led_dead"
        if abs(predicted) < allowed:  # lamps that lean give the first harmonic alone
            name, said = "led_dead or uneven_lamps", said + ", or the lamps lean or shine unevenly"
        found = Mismatch(name, "intensity", "image", (at,), (size,), nan, nan, nan, f"{said}.", look)
        return (Suspected(found, dim_led, frame, sizes),)
    size = NamedFigure("amplitude", abs(first), sd, "relative")
    said = (
        f"In all frames, the side at image azimuth {np.degrees(np.angle(first)):.0f}° is "
        f"{100 * abs(first):.0f} % brighter than the mean, which no single dim LED explains: the lamps stand "
        "or shine unevenly."
    )
    found = Mismatch("", "intensity", "image", (at,), (size,), nan, nan, nan, said, look)
    return (Suspected(found, lamp_pattern, frame, sizes),)


def separated_from_wall(
    uneven: Sequence[Suspected], lamp: LampLight | None, scene: Scene, samples: BlockSamples | None
) -> tuple[tuple[Suspected, ...], tuple[Mismatch, ...]]:
    """Return uneven lamps confirmed by wall that is seen at several places of the image, and those withdrawn.

    The wall's photo was made in the same light. Wall that is paler on one side and lamps that are brighter
    there can be separated only where the same wall is seen at another azimuth, as when the probe rolls, or at
    another polar angle, where an LED's share of the light differs. Brightness that stays on the wall is
    fitted freely.
    """
    if lamp is None or samples is None:
        return (), tuple(_of_wall(one.mismatch, np.nan, np.inf) for one in uneven)
    kept, withdrawn = [], []
    for one in uneven:
        size, sd = _beside_wall(one, lamp, scene, samples)
        if size > max(_MOSTLY, _SURE_OF_WALL * sd):
            kept.append(one)
        else:
            withdrawn.append(_of_wall(one.mismatch, size, sd))
    return tuple(kept), tuple(withdrawn)


def beside_response(uneven: Mismatch) -> Mismatch:
    """Return uneven lamps that are withdrawn because brightness does not follow the light as it is."""
    said = (
        "The lamps look uneven around the picture, but brightness follows their light to another power than "
        "1, which makes lamps that come nearer to one side look uneven, too: the cause cannot be told."
    )
    return replace(uneven, statement=said)


def _of_wall(found: Mismatch, size: float, sd: float) -> Mismatch:
    """Return uneven lamps as withdrawn: wall seen at several places contradicts them or does not decide."""
    if size + _SURE_OF_WALL * sd < _MOSTLY:
        said = (
            "The wall's photo makes the lamps look uneven around the picture, but wall that is seen at "
            "several places of the picture does not: the photo is too dark on one side."
        )
    else:
        said = (
            "The lamps look uneven around the picture, but wall that is paler on one side would look the "
            "same while the probe hardly rolls. What to do: record once more with the probe rolled."
        )
    return replace(found, statement=said)


def _beside_wall(one: Suspected, lamp: LampLight, scene: Scene, samples: BlockSamples) -> tuple[float, float]:
    """Return which share of uneven lamps wall seen at several places of the image shows, and its 1 σ."""
    theta, phi = seen_from(samples, scene)
    pattern = law = lamp.around(phi)
    if one.mismatch.name == "led_dead":  # without any pattern that is the same at every polar angle
        lost, azimuth = one.sizes[0]
        law = np.log1p(-np.float32(min(lost, 0.999)) * share_at(scene, float(azimuth), theta, phi))
    groups = samples.orders["wall"], samples.frame
    light = centred(samples.log_light, *groups)
    values = (centred(np.asarray(a, float), *groups) for a in (law, samples.log_change + pattern))
    # A power by which brightness follows uneven light, or the light of a moving probe, is not part of the
    # pattern.
    made, bright = (a - (a @ light) / max(float(light @ light), 1e-12) * light for a in values)
    step = np.float32(2 * np.pi / WALL_COLUMNS)
    within = float(np.mean((lamp.around(phi + step) - pattern) ** 2)) / 12
    if made @ made < _OVER_CELLS * within * len(made):
        return float("nan"), float("inf")
    sums = np.stack([np.bincount(samples.frame, made * a) for a in (bright, made)], 1).astype(float)
    return ratio_over_frames(sums, _PARTS)


def _harmonics(lamp: LampLight, scene: Scene) -> tuple[Float, float]:
    """Return both harmonics (L, 2) of the log light around the picture for an LED that loses the shares L.

    They are averaged over the picture, as the lamps' pattern is. A probe file does not state the LEDs' lobe:
    the result is the mean of uniform emission and emission as the cosine. The second result is the relative 1
    σ, half of the difference between the two.
    """
    theta = np.linspace(lamp.theta_rad[0], min(float(lamp.theta_rad[-1]), np.pi / 2), len(lamp.theta_rad))
    share, around = dim_share(scene.probe.lighting, 0.0, scene.ring.radius_mm, theta), sector_azimuth_rad()
    waves = np.cos(np.arange(1, 3) * around[:, None]) * 2 / SECTORS
    each = np.array([np.log1p(-0.999 * lost * share) @ waves for lost in _LOSSES])
    # An equidistant lens has a number of pixels at a polar angle that is proportional to the angle.
    each = np.average(each, axis=2, weights=theta)
    first = each[-1, :, 0]
    return each.mean(1), float(np.ptp(first) / 2 / abs(first.mean()))


def flicker_of_measured(
    state: PhotometricState,
    found: Sequence[Mismatch],
    ring: Ring,
    compared: tuple[Cells | None, Cells | None] = (None, None),
) -> tuple[Mismatch, ...]:
    """Return flicker that frames used by the measurement show; ``found`` is what the compared frames showed.

    Compared frames lie at regular steps: lights that flicker in step with them look steady. Those of LEDs and
    laser have ``compared`` cells in steady light: where they lie on the curve through the measured frames,
    the light changes slowly.
    """
    named = {name for m in found for name in m.names}
    cells = dict(zip(_VARIES, compared, strict=True))
    made = []
    for name, light, channel, course in _courses(state):
        if name in named or _changes_slowly(course, cells[name]):
            continue
        spread, nan = course.spread, float("nan")
        if spread < max(_VARIES[name], _SURE * float(np.median(course.sd))):
            continue
        sd = _WIDER * spread / np.sqrt(2 * (len(course.frame) - 1))
        size = NamedFigure("exposure", spread, sd, "relative")
        said = (
            f"{len(course.frame)} measured frames lit by the {light}, spread over the recording, vary in "
            f"brightness by {100 * spread:.1f} % (1 σ) beside a slow change. The compared frames do not show "
            "it, or are too few: lights may flicker in step with them."
        )
        look = ring.whole(int(course.frame[0]))
        made.append(Mismatch(name, channel, "time", (), (size,), nan, nan, nan, said, look))
    return tuple(made)


def beside_measured(found: Sequence[Mismatch], state: PhotometricState) -> tuple[Mismatch, ...]:
    """Return findings; flicker of the compared frames has no name where measured frames do not vary.

    The photo fits the frames that it was made from: where wall shines, it errs in the others.
    """
    steady = {name: c for name, _, _, c in _courses(state)}
    return tuple(_or_photo(m, steady[m.name]) if m.name in steady else m for m in found)


def _or_photo(flicker: Mismatch, measured: Course) -> Mismatch:
    """Return flicker, without a name if frames that the photo was made from vary much less."""
    if measured.spread >= _BESIDE * flicker.parameters[0].value:
        return flicker
    said = (
        f"{flicker.statement} But {len(measured.frame)} measured frames between them vary by "
        f"{100 * measured.spread:.1f} % only: the wall's photo was made from these and may err in the "
        "others, as where wall shines, or lights flicker in step with them."
    )
    return replace(flicker, name="", statement=said)


def _changes_slowly(course: Course, cells: Cells | None) -> bool:
    """Return whether compared frames follow a smooth curve through the measured ones."""
    if cells is None:
        return False
    between = (cells.frame > course.frame[0]) & (cells.frame < course.frame[-1])
    mean = cells.log_ratio.sum(1) / np.maximum(cells.usable.sum(1), 1)
    beside = mean - CubicSpline(course.frame, course.log_value)(cells.frame)
    left = replace(course, frame=cells.frame[between], log_value=beside[between])
    return len(left.frame) > 2 and left.spread < _BESIDE * course.spread


def faded(state: PhotometricState, found: Sequence[Mismatch], ring: Ring) -> tuple[Mismatch, ...]:
    """Return lights that slowly change over the run; ``found`` is what is known to change over time.

    They have no name: what the light does, and what the photo errs by along the run, look alike. The change
    is the median slope between frames (H. Theil, 1950; P. K. Sen, 1968), which the first and the last
    frames, with little photo, do not govern.
    """
    steps = {"exposure_step", "lamp_step", "laser_step", "led_dead"} & {n for m in found for n in m.names}
    made = []
    for _, light, channel, course in () if steps else _courses(state):
        way = (course.frame - course.frame[0]) / np.ptp(course.frame)
        slope, _, low, high = theilslopes(course.log_value, way, _CONFIDENCE)
        if max(low, -high) < _FADES:
            continue
        change, nan = float(np.expm1(slope)), float("nan")
        sd = float((high - low) / 2 / norm.isf((1 - _CONFIDENCE) / 2) * np.exp(slope))
        said = (
            f"From the first to the last frame {'lit wall' if light == 'LEDs' else 'the line'} becomes "
            f"{100 * abs(change):.0f} % {'brighter' if change > 0 else 'darker'} than the wall's photo "
            f"predicts: the {light} may change slowly, or the photo along the pipe does, as where LEDs fade "
            "in whose light it was made."
        )
        size, look = NamedFigure("change", change, sd, "relative"), ring.whole(int(course.frame[-1]))
        made.append(Mismatch("", channel, "time", (), (size,), nan, nan, nan, said, look))
    return tuple(made)


def _courses(state: PhotometricState) -> list[tuple[str, str, str, Course]]:
    """Return flicker's name, light, channel and course of each light that enough frames show."""
    clipped = state.line_is_clipped  # a clipped line hardly shows the laser's power
    courses = (
        ("flicker", "LEDs", "intensity", None if state.lamp is None else state.lamp.gain),
        ("laser_flicker", "laser", "line", None if clipped or state.line is None else state.line.course),
    )
    return [(n, of, by, c) for n, of, by, c in courses if c is not None and len(c.frame) >= _FEWEST_FRAMES]
