"""Where the line lies aside in all rings at one place of the image, whatever wall passes by.

What bends the line's light hides in the wall that is measured through it, and lit frames are compared with a
photo of that wall: they may show nothing. That the wall is not so, `stages.accumulate.fixed` tells by the
probe's roll.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.artefacts.twin import Mismatch, NamedFigure
from pipeline.artefacts.wall_map import FixedPlace, FixedToProbe
from stages.twin.scene import Ring

_FOUND = 8.0
"""Robust σ, of all sectors over as long a way, from which a place is found: its departure is known to an
eighth at least, and noise does not make one."""


def on_line(fixed: FixedToProbe | None, ring: Ring, others: Sequence[Mismatch]) -> tuple[Mismatch, ...]:
    """Return places at which the line lies aside, beside ``others`` that have a place in the image.

    Places that a groove along the pipe would make as well are left out.
    """
    if fixed is None:
        return ()
    made = (_mismatch(place, ring) for place in fixed.places if place.on_probe)
    return tuple(m for m in made if not any(_touch(m, other) for other in others))


def _mismatch(place: FixedPlace, ring: Ring) -> Mismatch:
    look = ring.at(place.frame_from, place.azimuth_rad)
    radius, nan = max(ring.radius_px * place.width_rad / 2, 1.0), float("nan")
    at = zip(("u_px", "v_px", "radius_px"), (look.u_px, look.v_px, radius), strict=True)
    return Mismatch(
        "", "line", "image", tuple(NamedFigure(n, float(x), radius / 2, "px") for n, x in at),
        (NamedFigure("departure", place.departure_mm, abs(place.departure_mm) / _FOUND, "mm"),),
        nan, nan, nan,
        f"About ({look.u_px:.0f}, {look.v_px:.0f}) the line lies {place.departure_mm:+.2f} mm aside in all "
        "frames, whatever wall goes by: a drop or a scratch on the window bends its light, or the sheet is "
        "not plane there.", look,
    )  # fmt: skip


def _touch(one: Mismatch, other: Mismatch) -> bool:
    at = [{p.name: p.value for p in m.place} for m in (one, other)]
    if "radius_px" not in at[1]:
        return False
    away = np.hypot(at[0]["u_px"] - at[1]["u_px"], at[0]["v_px"] - at[1]["v_px"])
    return bool(away < at[0]["radius_px"] + at[1]["radius_px"])
