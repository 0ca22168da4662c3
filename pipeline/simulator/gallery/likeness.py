"""Similarity of effects: the angle between their patterns on the ring, or else on line or odometer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Float
from pipeline.simulator.gallery.exhibit import Exhibit

# States that a run does not know beforehand, by the harmonic that they take up in every bore by itself.
STATES = {"off-centre probe": 1, "pipe of another radius": 0}
# Typical 1 σ of a frame's light, width and skewness along one azimuth, in which they are weighed together.
_PROFILE_SIGMA = (0.05, 0.05, 0.15)


@dataclass(frozen=True)
class Likeness:
    """Another effect or state whose pattern is alike: |cosine| in 4 inch alone and over all three bores."""

    name: str
    one_bore: float
    all_bores: float


def likenesses(exhibits: Sequence[Exhibit], most: int = 5, least: float = 0.9) -> dict[str, list[Likeness]]:
    """Return for each effect what looks like it in one bore, first what does so in all three.

    Compared are radius errors over azimuth; of effects that leave the radius alone the motion less the
    encoder's reading, or else light, width and skewness of the line. An effect with a direction of its own
    is turned to where it is most alike.
    """
    return {e.name: _alike(e, exhibits, least)[:most] for e in exhibits}


def _alike(one: Exhibit, exhibits: Sequence[Exhibit], least: float) -> list[Likeness]:
    found = [_effect_likeness(one, e) for e in exhibits if e is not one and _kind(e) == _kind(one)]
    if one.shows_on_ring:
        found += [_state_likeness(one, name, order) for name, order in STATES.items()]
    return sorted((f for f in found if f.one_bore >= least), key=lambda f: -f.all_bores)


def _kind(exhibit: Exhibit) -> str:
    """Return what of an effect is compared."""
    if exhibit.shows_on_ring:
        return "ring"
    return "line" if exhibit.course is None else "course"


def _effect_likeness(one: Exhibit, other: Exhibit) -> Likeness:
    if one.course is not None and other.course is not None and not one.shows_on_ring:
        cosine = float(_cosines(one.course.value_mm[None], other.course.value_mm)[0])
        return Likeness(other.name, cosine, cosine)
    turned = _directed(one) or _directed(other)
    sizes = []
    for radii in ([max(one.residual)], sorted(one.residual)):
        a, b = (_pattern(e, radii) for e in (one, other))
        steps = range(a.shape[1]) if turned else (0,)
        turns = np.stack([np.roll(a, k, axis=1).ravel() for k in steps])
        sizes.append(float(_cosines(turns, b.ravel()).max()))
    return Likeness(other.name, *sizes)


def _state_likeness(one: Exhibit, name: str, order: int) -> Likeness:
    """Return the share of the radius error that a state takes up, fitted in each bore by itself."""
    wave = np.exp(1j * order * one.azimuth_rad)
    basis = np.stack([wave.real, wave.imag] if order else [wave.real], -1)
    taken, whole = {}, {}
    for radius, residual in one.residual.items():
        fitted = basis @ np.linalg.lstsq(basis, residual.error_mm, rcond=None)[0]
        taken[radius], whole[radius] = float(fitted @ fitted), float(residual.error_mm @ residual.error_mm)
    last = max(one.residual)
    shares = taken[last] / whole[last], sum(taken.values()) / sum(whole.values())
    return Likeness(name, *np.sqrt(shares).tolist())


def _pattern(exhibit: Exhibit, radii: Sequence[float]) -> Float:
    """Return what is compared, (rows, A)."""
    residuals = [exhibit.residual[r] for r in radii]
    if exhibit.shows_on_ring:
        return np.stack([r.error_mm for r in residuals])
    parts = [(r.light, r.width_px, r.skewness) for r in residuals]
    return np.concatenate([np.stack(p) / np.array(_PROFILE_SIGMA)[:, None] for p in parts])


def _directed(exhibit: Exhibit) -> bool:
    return any(q.name in ("direction_deg", "azimuth_deg") for q in exhibit.switch.effect.quantities)


def _cosines(rows: Float, other: Float) -> Float:
    sizes = np.linalg.norm(rows, axis=1) * np.linalg.norm(other)
    return np.asarray(np.abs(rows @ other) / np.maximum(sizes, 1e-12))
