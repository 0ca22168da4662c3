"""Flicker: brightness of whole frames that changes from frame to frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float, Int
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.cells import SECTORS, Cells, Law, best_column, drift, fitted
from stages.twin.glints import MOST_OF_VIEW
from stages.twin.laws import ends_apart, ramps_of
from stages.twin.locate import FALSE_ALARM
from stages.twin.scene import Ring

_LEAST = {"flicker": 0.01, "laser_flicker": 0.04}
"""Smallest sizes that are named. A photo errs by one or two per cent from frame to frame; for the laser's
colour, the wall's reflectance errs by more, from place to place."""
_USUAL, _FEW = 0.4, 10
"""For flicker, the robust spread of steps between frames must be at least this share of the plain spread: it
is 1 for normal numbers, and more for a sine, but small where a weld or a joint changes the whole bore in a
few frames. Tested from so many frames on. Chosen."""
_HALF_SECTORS = 3
"""Number of neighbouring sectors in one group, when one half of the picture is to predict the other."""
_COMMON = 0.5
"""Least share of flicker that opposite halves of the picture must have in common: 1 if all of it changes
alike, 0 if one side alone does. Chosen."""

_EXPLAINED = 0.5
"""Spread from frame to frame beside the best change over several frames, as a share of that without it,
below which the change explains it. Drawn, of 14 frames: a light that fades leaves up to .4, flicker that
follows no such change .5 in 1 % of cases and .6 in 5 %; of 8 frames, it leaves .3 in 1 %."""


def flicker(cells: Cells, base: Float, light: str, ring: Ring) -> list[Mismatch]:
    """Return flicker: in a frame, the brightness of one half of the picture predicts that of the other.

    The halves are groups of sectors that alternate. Opposite sides of the picture must change alike as well:
    where some lamps fail, or one side is shaded, only alternating groups do.
    """
    known, rest = _rest(cells, base)
    sector = np.arange(SECTORS)
    half = sector // _HALF_SECTORS % 2
    parts = _of_halves(cells, rest, half)
    spread, name = _common(parts), "flicker" if light == "LEDs" else "laser_flicker"
    chance = _chance(parts)
    predicted = known + np.where(half == 0, parts[1][:, None], parts[0][:, None])
    before, after = (float(cells.chi2(k).sum() / max(cells.counted.sum(), 1)) for k in (known, predicted))
    sides = [(sector + turn) // (SECTORS // 2) % 2 for turn in (0, SECTORS // 4)]
    alike = min(_common(_of_halves(cells, rest, side)) for side in sides) > _COMMON * spread
    often = len(cells.frame) < _FEW or (robust_spread(np.diff(parts.mean(0))) > _USUAL * np.sqrt(2) * spread)
    if chance > FALSE_ALARM or spread < _LEAST[name] or after >= before or not often or not alike:
        return []
    sd = float((parts[0] * parts[1]).std()) / np.sqrt(len(cells.frame)) / (2 * spread)
    place = tuple(
        NamedFigure(n, float(f), 0.0)
        for n, f in (("frame_from", cells.frame[0]), ("frame_to", cells.frame[-1]))
    )
    return [Mismatch(
        name, "intensity" if light == "LEDs" else "line", "time",
        place, (NamedFigure("exposure", spread, sd, "relative"),), chance, before, after,
        f"Frames lit by the {light} vary in brightness by {100 * spread:.1f} % (1 σ) from frame to frame.",
        ring.whole(cells.frame[int(np.argmax(np.abs(parts.mean(0))))]),
    )]  # fmt: skip


def beside_spots(found: Sequence[Mismatch], spots: Sequence[Mismatch]) -> tuple[Mismatch, ...]:
    """Return what is found, with LEDs' flicker unnamed if spots that come and go may make as much of it."""
    come_and_go = any(m.fixed_to == "time" and m.channel == "intensity" and not m.name for m in spots)
    return tuple(_or_spots(m) if come_and_go and m.name == "flicker" else m for m in found)


def _or_spots(flickers: Mismatch) -> Mismatch:
    if flickers.parameters[0].value > MOST_OF_VIEW:
        return flickers
    said = f"{flickers.statement} Spots that come and go in these frames change their brightness, too."
    return replace(flickers, name="", statement=said)


def slowly(flickers: Mismatch, cells: Cells, base: Float, light: str, ring: Ring) -> Mismatch:
    """Return flicker, or a slow change without a name if that explains most of it, and more than a step."""
    columns, first, last = ramps_of(len(cells.frame))
    ramps = Law("ramp", columns, np.stack([first, last], 1))
    k = best_column(cells, base, ramps, np.ones(len(cells.frame), bool))[0]
    more = np.concatenate([base, columns[[k]]])
    before, after = (float(np.std(_rest(cells, b)[1].mean(1))) for b in (base, more))
    if after > _EXPLAINED * before or last[k] == first[k] + 1:
        return flickers
    # It may begin and end anywhere about the frames that were tried.
    sd = ends_apart(len(cells.frame)) * float(np.median(np.diff(cells.frame))) / 2
    place = tuple(
        NamedFigure(n, float(cells.frame[int(at[k])]), sd, "frame")
        for n, at in (("frame_from", first), ("frame_to", last))
    )
    # As the frames themselves show it: a size beside a drift may be the difference of two large ones.
    mean, ends = cells.log_ratio.sum(1) / np.maximum(cells.usable.sum(1), 1), (int(first[k]), int(last[k]))
    size = float(mean[ends[1]] - mean[ends[0]])
    change = NamedFigure(
        "change", float(np.expm1(size)), float(np.exp(size) * np.sqrt(2) * after), "relative"
    )
    said = (
        f"Between frames {place[0].value:.0f} and {place[1].value:.0f}, those lit by the {light} get about "
        f"{100 * abs(change.value):.0f} % {'brighter' if size > 0 else 'darker'}, as it seems not at once: "
        "light that fades, also of one LED, an exposure that is regulated, or other wall."
    )
    return replace(
        flickers, name="", place=place, parameters=(change,), statement=said,
        look=ring.whole(int(cells.frame[int(last[k])])),
    )  # fmt: skip


def _rest(cells: Cells, base: Float) -> tuple[Float, Float]:
    """Return what base columns explain of the logarithm of brightness (F, S), and what they leave."""
    known = fitted(cells, base, np.ones(len(cells.frame), bool))
    return known, np.where(cells.usable, cells.log_ratio - known, 0.0)


def _of_halves(cells: Cells, rest: Float, half: Int) -> Float:
    """Return the mean change (2, F) of each half of the sectors, 0 over all frames."""
    parts = np.stack([
        rest[:, half == h].sum(1) / np.maximum(cells.usable[:, half == h].sum(1), 1) for h in (0, 1)
    ])  # fmt: skip
    return np.asarray(parts - parts.mean(1, keepdims=True))


def _common(parts: Float) -> float:
    """Return the 1 σ of what both halves (2, F) have in common; what the drift absorbs is allowed for."""
    frames = parts.shape[1]
    return float(np.sqrt(max((parts[0] * parts[1]).sum() / max(frames - len(drift(frames)), 1), 0.0)))


def _chance(parts: Float) -> float:
    """Return the probability that halves (2, F) which have nothing in common agree so well."""
    frames = parts.shape[1]
    product = float((parts[0] * parts[1]).mean()) / max(float(parts[0].std() * parts[1].std()), 1e-12)
    alike = min(product, 1 - 1e-9)
    return float(t.sf(alike * np.sqrt((frames - 2) / (1 - alike**2)), frames - 2))
