"""Laws of changes of brightness over time and around the image, as columns over frames and sectors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Bool, Float
from pipeline.instrument.probe import Lighting
from stages.twin.cells import SECTORS, Cells, Law, drift, half_turn, sector_azimuth_rad
from stages.twin.leds import even_light
from stages.twin.scene import Ring

LED_AZIMUTHS, _FINE = 24, 5
_SECTOR_WIDTHS_DEG, _SECTOR_LOSSES = (10, 13, 16, 20, 25, 32, 40, 50, 65, 80, 100, 120), (0.3, 0.7, 0.95)
_SIDE_WIDTHS_DEG, _SIDE_LOSS = (40.0, 80.0, 160.0), 0.5
"""Widths, and the loss, of a side of the picture that darkens; other losses are powers of it. Chosen."""
SECTOR_STEP_DEG = 180 / SECTORS
"""Step, degrees, between azimuths at which a dim sector is tried: half a sector of the cells."""
_MOST_OWN = 1 / 3
"""Most that a frame's photo may contain of that frame itself. Drawn courses: at a third, sizes err by up to a
fifth, whenever between two frames the change came; at three quarters, by a factor of up to 2.4."""
TRIED = slice(2, -1)
"""First frames of a step that are tried: two frames or more lie on each side."""
_MOST_ENDS = 50
"""Most frames at which a slow change may begin or end: usually fewer of one light are compared. Chosen."""
_LEAST_AHEAD = 0.05
"""Least distance ahead of the LEDs, in radii, from which they are taken to light the wall."""


def of_sectors(frames: int, around: Float) -> Float:
    """Return columns (K, F, S) that are constant over the frames, with patterns (K, S) around the image."""
    return np.asarray(np.repeat(around[:, None], frames, 1), float)


def sectors_and_drift(frames: int) -> Float:
    """Return columns (K, F, S): a constant of every sector, and slow changes in time that all share."""
    return np.concatenate([of_sectors(frames, np.eye(SECTORS)), drift(frames)])


def lit_laws(cells: Cells, lighting: Lighting, ring: Ring, in_photo: Float) -> tuple[Float, list[Law]]:
    """Return base columns (K, F, S) for lit frames, and the laws of a step and of a side that darkens.

    ``in_photo`` (F, F) is the share of the photo in each frame that was made from each of the frames.
    """
    frames = len(cells.frame)
    base = sectors_and_drift(frames)
    azimuth = 2 * np.pi * np.arange(LED_AZIMUTHS) / LED_AZIMUTHS
    share = led_share(lighting, azimuth, ring)
    steps, first = steps_of(frames)
    columns = np.log1p(-0.999 * share)[:, None, None] * steps[None, ..., :1]
    places = np.stack(
        [np.repeat(azimuth, len(first)), np.tile(first, LED_AZIMUTHS), np.repeat(share.max(1), len(first))], 1
    )
    led = Law("led_dead", columns.reshape(-1, frames, SECTORS), places)
    sides = [_with_photo(law, in_photo) for law in (led, _lamp_sector(azimuth, steps, first))]
    return base, [Law("step", steps, first[:, None]), *sides]


def _with_photo(law: Law, in_photo: Float) -> Law:
    """Return a law whose change the photo may hold as well, as far as it was made from the frames (F, F).

    A step of all lamps is taken out of the photo as exposure; one of a side is not. Between frames far apart,
    whose photos overlap little, when the change came decides what the photo holds: only the law without the
    photo is tried.
    """
    near = follows_photo(in_photo)[law.places[:, 1].astype(int)]
    if not in_photo.any() or not near.any():
        return law
    beyond = law.columns[near] - np.einsum("tf,cfs->cts", in_photo, law.columns[near], optimize=True)
    places = np.concatenate([law.places, law.places[near]])
    return Law(law.name, np.concatenate([law.columns, beyond]), places)


def follows_photo(in_photo: Float) -> Bool:
    """Return for each frame (F,) whether it is so near to the one before that the photo in both is known.

    ``in_photo`` (F, F) is the share of the photo in each frame that was made from each.
    """
    own = in_photo.diagonal()
    return np.asarray(np.maximum(own, np.concatenate([own[:1], own[:-1]])) < _MOST_OWN)


def _lamp_sector(azimuth_rad: Float, steps: Float, first: Float) -> Law:
    """Return the law of one side of the picture that darkens in a step, whatever makes it so.

    Its places are image azimuth (rad), first frame, loss and width (deg).
    """
    away = np.abs(half_turn(np.degrees(sector_azimuth_rad() - azimuth_rad[:, None])))
    shape = np.stack([np.exp(-np.log(2) * (2 * away / width) ** 2) for width in _SIDE_WIDTHS_DEG], 1)
    columns = np.log1p(-_SIDE_LOSS * shape)[:, :, None, None] * steps[None, None, ..., :1]
    places = [(a, f, _SIDE_LOSS, w) for a in azimuth_rad for w in _SIDE_WIDTHS_DEG for f in first]
    return Law("lamp_sector", columns.reshape(-1, *steps.shape[1:]), np.array(places))


def line_laws(cells: Cells) -> tuple[Float, list[Law]]:
    """Return base columns (K, F, S) for the line, and the laws of a step and of a dim sector."""
    frames, azimuth = len(cells.frame), sector_azimuth_rad()
    around = [np.ones(SECTORS), *(f(m * azimuth) for m in (1, 2) for f in (np.cos, np.sin))]
    base = np.concatenate([of_sectors(frames, np.array(around)), drift(frames)])
    steps, first = steps_of(frames)
    patterns, places = _sector_patterns()
    return base, [
        Law("step", steps, first[:, None]),
        Law("laser_sector", of_sectors(frames, patterns), places),
    ]


def steps_of(frames: int) -> tuple[Float, Float]:
    """Return columns (C, F, S) of steps, and their first frames (C,)."""
    first = np.arange(frames)[TRIED]
    after = (np.arange(frames)[None] >= first[:, None]).astype(float)
    return np.repeat(after[..., None], SECTORS, 2), first.astype(float)


def ramps_of(frames: int) -> tuple[Float, Float, Float]:
    """Return columns (C, F, S) of changes within one step or over more, and first and last frames of each.

    Two frames or more lie on each side of a change over several: another is a kink of the drift.
    Of many frames, those over more than one step begin and end at every n-th frame: their number grows with
    the square of it, and those of 300 frames took 3 GB.
    """
    every = ends_apart(frames)
    one = [(f, f + 1) for f in range(frames - 1)]
    several = [
        (f, f + k)
        for k in range(every, frames // 2 + 1, every) for f in range(1, frames - k - 1, every)
        if k > 1
    ]  # fmt: skip
    first, last = np.array([*one, *several], float).reshape(-1, 2).T
    course = np.clip((np.arange(frames) - first[:, None]) / (last - first)[:, None], 0, 1)
    return np.repeat(course[..., None], SECTORS, 2), first, last


def ends_apart(frames: int) -> int:
    """Return from how many frames to the next a slow change is tried to begin or end."""
    return -(-frames // _MOST_ENDS)


def led_share(lighting: Lighting, azimuth_rad: Float, ring: Ring) -> Float:
    """Return the share (L, S) of each sector's light that comes from an LED at azimuths (L,)."""
    around = sector_azimuth_rad()
    point = np.stack(
        [*(ring.radius_mm * f(around) for f in (np.cos, np.sin)), np.full(SECTORS, ring.ahead_mm)], 1
    )
    inward = np.stack([-np.cos(around), -np.sin(around), np.zeros(SECTORS)], 1)
    whole = even_light(lighting, point, inward)
    return np.stack([
        even_light(replace(lighting, leds=1), _turned(point, -a), _turned(inward, -a)) / lighting.leds / whole
        for a in azimuth_rad
    ])  # fmt: skip


def dim_share(lighting: Lighting, azimuth_rad: float, radius_mm: float, theta_rad: Float) -> Float:
    """Return the share (2, T, S) of an LED in the light at polar angles (T,) of a bore and in sectors (S,).

    First for LEDs that emit uniformly, then for LEDs that emit as the cosine.
    """
    turn = azimuth_rad + 2 * np.pi * np.arange(lighting.leds) / lighting.leds
    around, share = sector_azimuth_rad(), []
    x, y = (radius_mm * f(around) - lighting.radius_mm * f(turn)[:, None] for f in (np.cos, np.sin))
    toward = radius_mm - lighting.radius_mm * np.cos(around - turn[:, None])
    for ahead_mm in radius_mm / np.tan(theta_rad):
        z = max(ahead_mm - lighting.z_mm, _LEAST_AHEAD * radius_mm)
        even = toward / (x**2 + y**2 + z**2) ** 1.5
        cosine = even * z / np.sqrt(x**2 + y**2 + z**2)
        share.append([light[0] / light.sum(0) for light in (even, cosine)])
    return np.moveaxis(np.array(share), 1, 0)


def _turned(vector: Float, angle: float) -> Float:
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(vector @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]]))


def _sector_patterns() -> tuple[Float, Float]:
    """Return log brightness (C, S) of dim sectors, and middle, width (degrees) and loss of each (C, 3)."""
    fine = (np.arange(SECTORS * _FINE) + 0.5) / _FINE * 360 / SECTORS - 180
    patterns, places = [], []
    for middle in np.arange(-180.0, 180.0, SECTOR_STEP_DEG):
        away = np.abs(half_turn(fine - middle))
        for width in _SECTOR_WIDTHS_DEG:
            shape = np.exp(-np.log(2) * (2 * away / width) ** 8).reshape(SECTORS, _FINE).mean(1)
            for lost in _SECTOR_LOSSES:
                patterns.append(np.log1p(-lost * shape))
                places.append((middle, width, lost))
    return np.array(patterns), np.array(places)
