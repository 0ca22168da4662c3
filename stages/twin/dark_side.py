"""A side of the picture on which the wall's photo is darker along the whole run: by its lights, or by itself.

The photo was made in the same light as the frames. Lights that are dim on one side in all frames, and wall
that is darker on one side all along, give the same photo and the same frames, unless the probe rolls: if it
did not, it is stated that the two cannot be distinguished. Where the probe rolls a little, or wall is seen at
another place of the image, frames differ from such a photo at both edges of that side. These edges are not
reported as places of the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.adjustment.robust import left_out_sd
from pipeline.arrays import Float
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.dead_led import seen_from
from stages.twin.reference import WALL_COLUMNS, BlockSamples
from stages.twin.scene import Scene
from stages.twin.seen_in_photo import SIDE_DEG, dimmed, looks_at

_LEAST, _SURE, _PARTS = 0.25, 5.0, 6
"""Least share by which a side is darker than the opposite one, chosen: the wall of a recording 60 mm long
makes 14 % at 2.7 σ. σ by which it must be, and parts of the frames for that σ."""
_LEFT_OF_WALL = 2 / np.pi
"""What a steady roll by half a turn leaves of the first harmonic of wall in the picture's mean."""
_RING = 0.05
"""Width of rings about the image's middle, in radii of the line, within which sides are compared."""


def dark_side(samples: BlockSamples | None, scene: Scene) -> tuple[Mismatch, ...]:
    """Return the side of the picture on which the photo is darker than on the opposite one all along."""
    if samples is None or len(samples.number) < _PARTS:
        return ()
    bright, sd = _brighter_side(samples, scene)
    darker = float(1 - np.exp(-2 * abs(bright)))
    if darker < _LEAST or abs(bright) < _SURE * sd:
        return ()
    azimuth = float(np.angle(-bright))
    at = NamedFigure("azimuth_deg", float(np.degrees(azimuth)), float(np.degrees(sd / abs(bright))), "deg")
    size = NamedFigure("darker", darker, 2 * sd * (1 - darker), "share of the light")
    said = (
        f"Along the whole run, the wall's photo is darker about image azimuth {at.value:.0f}° than on the "
        f"opposite side, by {100 * darker:.0f} % (the part that varies once around the picture). "
        + _either(samples, scene)
    )
    look, nan = scene.ring.at(int(samples.number[0]), azimuth), float("nan")
    return (Mismatch("", "intensity", "image", (at,), (size,), nan, nan, nan, said, look),)


def _either(samples: BlockSamples, scene: Scene) -> str:
    """Return what may make a dark side: where the probe rolls, wall turns in the picture, lights do not."""
    turn = 2 * np.pi * (samples.around + 0.5) / WALL_COLUMNS - seen_from(samples, scene)[1]
    waves = (np.bincount(samples.frame, f(turn)) for f in (np.sin, np.cos))
    turns = np.arctan2(*waves)[np.unique(samples.frame)]
    roll = float(np.degrees(np.ptp(np.unwrap(turns))))
    causes = "LEDs that are dim or shaded there, dirt on the window,"
    if abs(np.exp(1j * turns).mean()) > _LEFT_OF_WALL:
        return (
            f"{causes} and wall that is darker there look the same, since most frames are rolled alike; in "
            f"all, the probe rolled by {roll:.0f}°. What to do: record once more with the probe rolled by "
            "half a turn."
        )
    return (
        f"{causes} or a camera that is darker there make it so: the probe rolled by {roll:.0f}°, and wall "
        "would have turned in the picture. What to do: check the LEDs and the window."
    )


def beside_dark_side(
    found: Sequence[Mismatch], over_time: Sequence[Mismatch], samples: BlockSamples | None, scene: Scene
) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return the findings that remain beside a side that is dark in the photo; and it, and those withdrawn.

    Unnamed places of the image on that side are withdrawn, unless they differ by more than the side does. A
    side that darkens during the run, which is among what changes ``over_time``, is in the photo as well, and
    is not told twice.
    """
    sides = () if any(map(dimmed, over_time)) else dark_side(samples, scene)
    places = [m for m in found if not m.name and m.fixed_to == "image" and m.channel != "line"]
    left = [
        m
        for m in places
        if any(looks_at(m, s.place[0].value, SIDE_DEG, scene.ring) and not _exceeds(m, s) for s in sides)
    ]
    said = (
        "{} But the photo is darker on that side, too. If lights cause this, frames differ from it at "
        "both edges of the side."
    )
    withdrawn = tuple(replace(m, statement=said.format(m.statement)) for m in left)
    return tuple(m for m in found if m not in left), (*sides, *withdrawn)


def _exceeds(place: Mismatch, side: Mismatch) -> bool:
    """Return whether a place surely differs by more than wall that leaves a dark side for the light."""
    most = 1 / (1 - side.parameters[0].value) - 1
    sizes = [p for p in place.parameters if p.name in ("change", "share")]
    return any(abs(p.value) - _SURE * p.sd > most for p in sizes)


def _brighter_side(samples: BlockSamples, scene: Scene) -> tuple[complex, float]:
    """Return the first harmonic around the picture of the photo's logarithm, and its 1 σ per component.

    Blocks are compared with those of the same frame at about the same distance from the image's middle, each
    in the light of a centred ring of LEDs. For σ each part of the frames is left out once.
    """
    phi = np.asarray(seen_from(samples, scene)[1], float)
    ring = np.round(samples.away / _RING).astype(int)
    group = np.unique(samples.frame * (ring.max() + 1) + ring, return_inverse=True)[1]
    columns = (np.cos(phi), np.sin(phi), samples.log_level - samples.log_light)
    waves = np.stack([c - (np.bincount(group, c) / np.bincount(group))[group] for c in columns], 1)
    frames = int(samples.frame.max()) + 1
    products = np.zeros((frames, 3, 3))
    np.add.at(products, samples.frame, waves[:, :, None] * waves[:, None])
    each = np.stack([part.sum(0) for part in np.array_split(products, _PARTS)])
    sizes = np.array([_harmonic(s) for s in (each.sum(0), *(each.sum(0) - each))])
    return complex(*sizes[0]), float(np.hypot(*left_out_sd(sizes[1:])) / np.sqrt(2))


def _harmonic(products: Float) -> Float:
    """Return cosine and sine (2,) of the third column that fit best, from sums of products (3, 3)."""
    return np.asarray(np.linalg.lstsq(products[:2, :2], products[:2, 2], rcond=None)[0], float)
