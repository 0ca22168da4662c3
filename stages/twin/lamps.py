"""Lamps that shine unevenly, around the picture or from frame to frame, in frames that were measured.

The lamps' pattern around the picture is described by two harmonics. A single LED that is dim gives both, in a
ratio and at angles that its place and the bore foretell; what gives others has no name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.adjustment.robust import left_out_sd
from pipeline.arrays import Float, Int
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.cells import SECTORS, centred, sector_azimuth_rad
from stages.twin.dead_led import seen_from
from stages.twin.gate import Suspected
from stages.twin.lamp_light import LampLight
from stages.twin.laws import LED_AZIMUTHS, dim_share
from stages.twin.reference import WALL_COLUMNS, BlockSamples
from stages.twin.scene import Ring, Scene
from stages.twin.state import PhotometricState
from stages.twin.switched import dim_led, lamp_pattern, share_at

_LEAST, _LEFT, _SURE = 0.012, 0.003, 5.0
"""Least amplitude of the first harmonic, relative; what a sound photo leaves of any; least in σ. Recordings
with even lamps leave 0.002."""
_LOSSES = np.linspace(0.1, 1.0, 19)
"""Losses at which the pattern is worked out; between them it is nearly straight."""
_OF_SECOND = 2.0
"""Relative σ of the first harmonic, for want of the lobe, by which the second may be another: order two."""
_VARIES, _FEWEST_FRAMES = {"flicker": 0.02, "laser_flicker": 0.08}, 8
"""Spread of brightness from frame to frame that is named, twice what the compared frames need: the photo
is made from the measured ones. Fewest of them."""
_MOSTLY, _SURE_OF_WALL, _PARTS, _OVER_CELLS = 0.5, 3.0, 6, 4.0
"""Share of an uneven pattern that the same wall must show at several places of the image, more than half;
that in σ; parts of the frames of which each is left out once for that σ. By which the variance of the pattern
on the same wall must exceed that within a cell, where wall that is paler on one side varies alike: the share
is then too large by a quarter at most."""
_WIDER = 1.8
"""1 σ of a spread by the median size of steps over that of a standard deviation: drawn, 20,000 times for each
of 6 to 40 normal samples."""


def uneven_lamps(lamp: LampLight | None, scene: Scene, frame: Int) -> tuple[Suspected, ...]:
    """Return what makes the lamps' pattern in lit frames (F,) uneven; nothing where it is even."""
    if lamp is None:
        return ()
    first, second = (complex(*lamp.pattern[k : k + 2]) for k in (0, 2))
    sd = float(np.hypot(*lamp.pattern_sd[:2]))
    if abs(first) < max(_LEAST, _SURE * sd):
        return ()
    dim, spread = _harmonics(lamp, scene)
    azimuth = float(np.angle(-first))
    lost = float(np.interp(abs(first), -dim[:, 0], _LOSSES))
    foretold = float(np.interp(lost, _LOSSES, dim[:, 1])) * np.exp(2j * azimuth)
    allowed = _LEFT + _OF_SECOND * spread * abs(foretold)
    one = abs(first) < -(1 + 2 * spread) * dim[-1, 0] and abs(second - foretold) < allowed
    look, nan = scene.ring.at(int(frame[0]), azimuth), float("nan")
    at = NamedFigure("azimuth_deg", float(np.degrees(azimuth)), 180 / LED_AZIMUTHS, "deg")
    told = np.tile([lost if one else 0.0, azimuth], (len(frame), 1))
    if one:
        size = NamedFigure(
            "lost", lost, float(np.hypot(spread, sd / abs(first))) * lost, "share of the light"
        )
        said = f"In all frames the LED at image azimuth {at.value:.0f}° sends {100 * lost:.0f} % less light"
        name = "led_dead"
        if abs(foretold) < allowed:  # lamps that lean give the first harmonic alone
            name, said = "led_dead or uneven_lamps", said + ", or the lamps lean or shine unevenly"
        found = Mismatch(name, "intensity", "image", (at,), (size,), nan, nan, nan, f"{said}.", look)
        return (Suspected(found, dim_led, frame, told),)
    size = NamedFigure("amplitude", abs(first), sd, "relative")
    said = (
        f"In all frames the side at image azimuth {np.degrees(np.angle(first)):.0f}° is "
        f"{100 * abs(first):.0f} % brighter than the mean, which no single dim LED explains: the lamps stand "
        "or shine unevenly."
    )
    found = Mismatch("", "intensity", "image", (at,), (size,), nan, nan, nan, said, look)
    return (Suspected(found, lamp_pattern, frame, told),)


def parted_from_wall(
    uneven: Sequence[Suspected], lamp: LampLight | None, scene: Scene, samples: BlockSamples | None
) -> tuple[tuple[Suspected, ...], tuple[Mismatch, ...]]:
    """Return uneven lamps that wall seen at several places of the image bears out, and those withdrawn.

    The wall's photo was made in the same light. A wall that is paler on one side and lamps that are brighter
    there are told apart only where the same wall is seen at another azimuth, as when the probe rolls, or at
    another polar angle, to which an LED sends another share: brightness that stays on the wall is granted.
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


def _of_wall(found: Mismatch, size: float, sd: float) -> Mismatch:
    """Return uneven lamps that are withdrawn: wall seen twice denies them, or tells nothing."""
    if size + _SURE_OF_WALL * sd < _MOSTLY:
        said = (
            "The wall's photo makes the lamps look uneven around the picture, but wall that is seen at "
            "several places of the picture does not: the photo is too dark on one side."
        )
    else:
        said = (
            "The lamps look uneven around the picture, but a wall that is paler on one side looks alike "
            "while the probe hardly rolls: it cannot be told. What to do: record once more with the probe "
            "rolled."
        )
    return replace(found, statement=said)


def _beside_wall(one: Suspected, lamp: LampLight, scene: Scene, samples: BlockSamples) -> tuple[float, float]:
    """Return which share of uneven lamps the same wall shows at several places of the image, and its 1 σ."""
    theta, phi = seen_from(samples, scene)
    pattern = law = lamp.around(phi)
    if one.mismatch.name == "led_dead":  # and nothing that sends the same share to every polar angle
        lost, azimuth = one.told[0]
        law = np.log1p(-np.float32(min(lost, 0.999)) * share_at(scene, float(azimuth), theta, phi))
    groups = samples.orders["wall"], samples.frame
    light = centred(samples.log_light, *groups)
    values = (centred(np.asarray(a, float), *groups) for a in (law, samples.log_change + pattern))
    # What follows light that is uneven in the image, or as the probe wanders, to another power is no pattern.
    made, bright = (a - (a @ light) / max(float(light @ light), 1e-12) * light for a in values)
    step = np.float32(2 * np.pi / WALL_COLUMNS)
    within = float(np.mean((lamp.around(phi + step) - pattern) ** 2)) / 12
    if made @ made < _OVER_CELLS * within * len(made):
        return float("nan"), float("inf")
    parts = samples.frame * _PARTS // (samples.frame.max() + 1)
    sums = np.stack([np.bincount(parts, made * a, _PARTS) for a in (bright, made)], 1)
    without = sums.sum(0) - sums
    size, *others = ((a[0] / max(a[1], 1e-12)) for a in (sums.sum(0), *without))
    return float(size), float(left_out_sd(np.array(others)))


def _harmonics(lamp: LampLight, scene: Scene) -> tuple[Float, float]:
    """Return both harmonics (L, 2) of the logarithm of light around the picture for an LED that loses L.

    They are the mean over the picture, as the lamps' pattern is. No probe states the LEDs' lobe: they are
    the mean of LEDs that shine evenly and as the cosine, too; half of by what these differ is the relative
    1 σ, returned beside them.
    """
    theta = np.linspace(lamp.theta_rad[0], min(float(lamp.theta_rad[-1]), np.pi / 2), len(lamp.theta_rad))
    share, around = dim_share(scene.probe.lighting, 0.0, scene.ring.radius_mm, theta), sector_azimuth_rad()
    waves = np.cos(np.arange(1, 3) * around[:, None]) * 2 / SECTORS
    each = np.array([np.log1p(-0.999 * lost * share) @ waves for lost in _LOSSES])
    # An equidistant lens shows as many pixels at a polar angle as the angle is wide.
    each = np.average(each, axis=2, weights=theta)
    first = each[-1, :, 0]
    return each.mean(1), float(np.ptp(first) / 2 / abs(first.mean()))


def flicker_of_measured(
    state: PhotometricState, found: Sequence[Mismatch], ring: Ring
) -> tuple[Mismatch, ...]:
    """Return flicker that measured frames show; ``found`` is what the compared ones, told first, show.

    Compared frames lie at regular steps, and lights that flicker in step with them look steady.
    """
    clipped = state.line_is_clipped  # tells hardly anything of the laser's power
    courses = (
        ("flicker", "LEDs", "intensity", None if state.lamp is None else state.lamp.gain),
        ("laser_flicker", "laser", "line", None if clipped or state.line is None else state.line.course),
    )
    told = {name for m in found for name in m.names}
    made = []
    for name, light, channel, course in courses:
        if course is None or name in told or len(course.frame) < _FEWEST_FRAMES:
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
