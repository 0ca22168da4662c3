"""Dirt on the window that the wall's photo contains appears inverted elsewhere in frames.

The photo was made through the same window. Wall that was photographed through dirt is darker in the photo.
Where frames show that wall beside the dirt (nearer or farther, at the same azimuth of the image) they are
brighter than the photo predicts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pipeline.artefacts.twin import Mismatch
from stages.twin.cells import half_turn
from stages.twin.discs import Disc, disc_of
from stages.twin.laws import SECTOR_STEP_DEG
from stages.twin.photo_course import REACH_RADII
from stages.twin.reference import BlockSamples
from stages.twin.scene import Ring

_DIMS = ("window_dirt", "window_scatter", "droplet")
_SURELY, _NEARLY_ALL = 2.0, 0.99
"""σ by which a place must be brighter; largest share of the light that a photo is taken to lack."""
SIDE_DEG = 90.0
"""Half the width of a side: a lamp lights at least half of the picture."""


def separated_from_photo(
    found: Sequence[Mismatch], ring: Ring
) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return what is on the window, and places that dim ones may have left in the photo.

    The latter are brighter, by no more than a photo so dim would make them, and at its image azimuth. That
    other light is mixed in, as by scatter, makes a dark stain of the photo brighter, too. What is itself
    brighter did not dim the photo: two such places would explain each other.
    """
    dim = [m for m in found if set(m.names) & set(_DIMS) and not _is_brighter(*_of(m, "brighter"))]
    left = [m for m in found if any(_may_be_left_by(m, d, ring) for d in dim if d is not m)]
    said = "{} But the photo may be darker there, as it was made through what lies at the same azimuth."
    withdrawn = tuple(replace(m, statement=said.format(m.statement)) for m in left)
    return tuple(m for m in found if m not in left), withdrawn


def beside_sectors(
    found: Sequence[Mismatch], sectors: Sequence[Mismatch], ring: Ring, samples: BlockSamples | None = None
) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return the findings that remain, and unnamed places where the photo was made in other light.

    That is so at the azimuth of a sector that the window may dim, and on a side that darkens during the run:
    wall that frames show beside it, or before it, differs from its photo. A displaced line remains: no photo
    shows it, and a drop both displaces the line and dims it. So does wall far from where a side darkens.
    """
    reach = [(s, r) for s in sectors if (r := dimmed(s)) is not None]
    places = [m for m in found if not m.name and m.channel != "line" and m.fixed_to in ("image", "wall")]
    left = [m for m in places if any(looks_at(m, *r, ring) and _meets(m, s, samples, ring) for s, r in reach)]
    said = (
        "{} But the photo may have been made in other light, or through what dims the line at that azimuth."
    )
    withdrawn = tuple(replace(m, statement=said.format(m.statement)) for m in left)
    return tuple(m for m in found if m not in left), withdrawn


def dimmed(found: Mismatch) -> tuple[float, float] | None:
    """Return azimuth and half the width, degrees, over which a change of light may be in the photo."""
    at = {p.name: p.value for p in found.place}
    if "azimuth_deg" not in at:
        return None
    if "window_scatter" in found.names and "width_deg" in at:
        return at["azimuth_deg"], (at["width_deg"] + SECTOR_STEP_DEG) / 2
    flickers = any(p.name == "exposure" for p in found.parameters)  # or one side darkens: it need not
    side = found.fixed_to == "time" and found.channel == "intensity" and not flickers
    return (at["azimuth_deg"], SIDE_DEG) if side else None


def looks_at(found: Mismatch, azimuth_deg: float, half_deg: float, ring: Ring) -> bool:
    """Return whether a mismatch is within some degrees of an azimuth of the image."""
    if found.look is None:
        return False
    at = Disc(found.look.u_px, found.look.v_px, 0.0).around(ring.centre_px)[0]
    return abs(half_turn(at - azimuth_deg)) < half_deg


def _meets(found: Mismatch, change: Mismatch, samples: BlockSamples | None, ring: Ring) -> bool:
    """Return whether a place may have been seen and photographed on both sides of a change in time.

    Only for wall can it be excluded: all frames that show it, or the wall for its photo, are on one side.
    """
    at = next((p.value for p in found.place if p.name == "distance_mm"), None)
    first = next((p.value for p in change.place if p.name == "frame_from"), None)
    if samples is None or at is None or first is None:
        return True
    after, reach = samples.number[samples.frame] >= first, REACH_RADII * ring.radius_mm
    if after.all() or not after.any():
        return True
    mm = samples.first_mm + (samples.along + 0.5) * samples.cell_mm
    return bool(mm[after].min() - reach < at < mm[~after].max() + reach)


def _may_be_left_by(bright: Mismatch, dim: Mismatch, ring: Ring) -> bool:
    """Return whether a place is brighter, by no more than where its photo lacks what a dim place takes."""
    taken, (more, sd) = _of(dim, "share"), _of(bright, "brighter")
    if not bright.name:
        more, sd = -_of(bright, "share")[0], _of(bright, "share")[1]
    most = min(taken[0] + _SURELY * taken[1], _NEARLY_ALL)
    if not _is_brighter(more, sd) or more - _SURELY * sd >= most / (1 - most):
        return False
    discs = [d for d in map(disc_of, (bright, dim)) if d is not None]
    (one, wide), (other, reach) = (d.around(ring.centre_px) for d in discs)
    return abs(half_turn(one - other)) < wide + reach


def _is_brighter(more: float, sd: float) -> bool:
    return more > _SURELY * sd


def _of(found: Mismatch, name: str) -> tuple[float, float]:
    """Return a figure of a mismatch and its 1 σ; 0 without it."""
    return next(((p.value, p.sd) for p in found.parameters if p.name == name), (0.0, 0.0))
