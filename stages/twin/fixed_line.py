"""Places of the image at which the line is displaced in all rings, whatever wall passes by.

What bends the line's light displaces the wall that is measured through it. Lit frames are compared with a
photo of that wall and may show nothing. `stages.accumulate.fixed` uses the probe's roll to show that the wall
itself is not displaced.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.arrays import Bool, Float, runs_of
from pipeline.artefacts.measured import RingSamples
from pipeline.artefacts.twin import Mismatch, NamedFigure
from pipeline.artefacts.wall_map import FixedPlace, FixedToProbe
from stages.twin.discs import meet
from stages.twin.scene import Ring
from stages.twin.seen_in_photo import dimmed, looks_at

_SEEN, _SURE = 0.5, 3.0
"""Share of rings that must show an azimuth, else the line is not seen there. σ by which light must differ
from none. Chosen."""


def on_line(
    fixed: FixedToProbe | None, samples: RingSamples, ring: Ring, others: Sequence[Mismatch]
) -> tuple[Mismatch, ...]:
    """Return places at which the line is displaced, other than the places of ``others``.

    Places that a groove along the pipe would explain as well are left out. Inside a drop the line may not be
    seen at all: neighbouring azimuths at which most rings have no line belong to the place.
    """
    places = () if fixed is None else tuple(p for p in fixed.places if p.on_probe)
    at = [_within(p, samples.azimuth_rad) for p in places]
    joined = _parts(np.any([samples.valid.mean(0) < _SEEN, *at], axis=0)) if places else []
    made = []
    for part in joined:
        own = [p for p, inside in zip(places, at, strict=True) if (part & inside).any()]
        if own:
            made.append(
                _mismatch(part, samples.azimuth_rad, max(own, key=lambda p: abs(p.departure_mm)), ring)
            )
    return tuple(m for m in made if not any(meet(m, other) for other in others))


def beside_absent_light(
    found: Sequence[Mismatch], sectors: Sequence[Mismatch], ring: Ring
) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return the findings that remain, and displaced lines in sectors that may have lost all of their light.

    What is seen there instead of the line is other light, for example of the line beside it.
    """
    dark = [s for s in sectors if s.channel == "line" and any(map(_may_be_all, s.parameters))]
    reach = [r for r in map(dimmed, dark) if r is not None]
    of_line = [m for m in found if not m.name and (m.channel, m.fixed_to) == ("line", "image")]
    left = [m for m in of_line if any(looks_at(m, *r, ring) for r in reach)]
    said = (
        "{} But hardly any light of the laser may be left there: other light, as of the line beside it, may "
        "have been taken for the line."
    )
    withdrawn = tuple(replace(m, statement=said.format(m.statement)) for m in left)
    return tuple(m for m in found if m not in left), withdrawn


def _may_be_all(lost: NamedFigure) -> bool:
    """Return whether a loss may be that of all light: what is left does not surely differ from none."""
    return lost.name == "lost" and lost.value + _SURE * lost.sd >= 1


def _within(place: FixedPlace, azimuth_rad: Float) -> Bool:
    """Return which azimuths (A,) a place covers; at least the nearest one."""
    away = np.abs(np.angle(np.exp(1j * (azimuth_rad - place.azimuth_rad))))
    return np.asarray(away <= max(place.width_rad / 2, float(away.min())))


def _parts(marked: Bool) -> list[Bool]:
    """Return the runs of marked azimuths (A,), periodic around the circle."""
    start = int(np.argmin(marked))
    parts = runs_of(np.roll(marked, -start))
    index = np.arange(len(marked))
    return [np.isin(index, (index[run] + start) % len(marked)) for run in parts]


def _mismatch(part: Bool, azimuth_rad: Float, place: FixedPlace, ring: Ring) -> Mismatch:
    middle = float(np.angle(np.exp(1j * azimuth_rad[part]).sum()))
    look, nan = ring.at(place.frame_from, middle), float("nan")
    radius = max(ring.radius_px * np.pi * float(part.mean()), 1.0)
    at = zip(("u_px", "v_px", "radius_px"), (look.u_px, look.v_px, radius), strict=True)
    return Mismatch(
        "", "line", "image", tuple(NamedFigure(n, float(x), radius / 2, "px") for n, x in at),
        (NamedFigure("departure", place.departure_mm, place.departure_sd_mm, "mm"),),
        nan, nan, nan,
        f"About ({look.u_px:.0f}, {look.v_px:.0f}) the line is displaced by {place.departure_mm:+.2f} mm in "
        "all frames, whatever wall passes by: a drop or a scratch on the window bends its light, or the "
        "laser sheet is not plane there.", look,
    )  # fmt: skip
