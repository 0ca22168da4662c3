"""Where the line lies aside in all rings at one place of the image, whatever wall passes by.

What bends the line's light hides in the wall that is measured through it, and lit frames are compared with a
photo of that wall: they may show nothing. That the wall is not so, `stages.accumulate.fixed` tells by the
probe's roll.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.arrays import Bool, Float, runs_of
from pipeline.artefacts.measured import RingSamples
from pipeline.artefacts.twin import Mismatch, NamedFigure
from pipeline.artefacts.wall_map import FixedPlace, FixedToProbe
from stages.twin.discs import meet
from stages.twin.scene import Ring

_SEEN = 0.5
"""Share of rings that show an azimuth, below which the line is not seen there. Chosen."""


def on_line(
    fixed: FixedToProbe | None, samples: RingSamples, ring: Ring, others: Sequence[Mismatch]
) -> tuple[Mismatch, ...]:
    """Return places at which the line lies aside, beside ``others`` that have a place in the image.

    Places that a groove along the pipe would make as well are left out. Amid a drop the line may not be seen
    at all: azimuths that join a place, and at which most rings have no line, belong to it.
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


def _within(place: FixedPlace, azimuth_rad: Float) -> Bool:
    """Return which azimuths (A,) a place covers: the nearest at least."""
    away = np.abs(np.angle(np.exp(1j * (azimuth_rad - place.azimuth_rad))))
    return np.asarray(away <= max(place.width_rad / 2, float(away.min())))


def _parts(marked: Bool) -> list[Bool]:
    """Return the stretches of marked azimuths (A,) of a circle."""
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
        f"About ({look.u_px:.0f}, {look.v_px:.0f}) the line lies {place.departure_mm:+.2f} mm aside in all "
        "frames, whatever wall goes by: a drop or a scratch on the window bends its light, or the sheet is "
        "not plane there.", look,
    )  # fmt: skip
