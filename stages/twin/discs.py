"""Circular places of the image: where a mismatch lies, and whether two of them touch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.artefacts.twin import Mismatch


class Disc(NamedTuple):
    """A circular place of the image: its middle and its radius, px."""

    u_px: float
    v_px: float
    radius_px: float

    def touches(self, other: Disc, apart_px: float = 0.0) -> bool:
        """Return whether two discs overlap, or are less than ``apart_px`` apart."""
        away = np.hypot(self.u_px - other.u_px, self.v_px - other.v_px)
        return bool(away < self.radius_px + other.radius_px + apart_px)

    def around(self, centre_px: tuple[float, float]) -> tuple[float, float]:
        """Return its azimuth about a centre, and half of its angular width, degrees."""
        u, v = self.u_px - centre_px[0], self.v_px - centre_px[1]
        wide = np.arctan2(self.radius_px, max(float(np.hypot(u, v)), 1.0))
        return float(np.degrees(np.arctan2(v, u))), float(np.degrees(wide))


def disc_of(found: Mismatch, sigmas: float = 0.0) -> Disc | None:
    """Return the place of a mismatch in the image, wider by some σ of its radius; None if it has none."""
    at = {p.name: p.value for p in found.place}
    more = sum(sigmas * p.sd for p in found.place if p.name == "radius_px")
    return Disc(at["u_px"], at["v_px"], at["radius_px"] + more) if "radius_px" in at else None


def meet(one: Mismatch, other: Mismatch, apart_px: float = 0.0) -> bool:
    """Return whether two mismatches have places in the image that touch; see `Disc.touches`."""
    discs = disc_of(one), disc_of(other)
    return discs[0] is not None and discs[1] is not None and discs[0].touches(discs[1], apart_px)
