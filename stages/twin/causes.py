"""Causes of differences over time and along the laser line, named only if other frames then fit better.

In lit frames: a step of the exposure, an LED that fails, flicker. In laser frames: a step of the laser's
power, flicker, a dim sector of the sheet. What wall, photo and light may leave without a named cause is
fitted first: a constant brightness of every sector (for the line: two harmonics), and a slow drift.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t

from pipeline.adjustment.robust import spread_about_median
from pipeline.arrays import Float
from pipeline.artefacts.twin import Mismatch, NamedFigure
from pipeline.instrument.probe import Lighting
from stages.twin.at_times import dim_at_times
from stages.twin.banding import banding_of_line
from stages.twin.cells import (
    SECTORS,
    Cells,
    Fitted,
    Law,
    fitted,
    half_turn,
    sigmas,
    try_law,
)
from stages.twin.flicker import flicker, slowly
from stages.twin.laws import SECTOR_STEP_DEG, line_laws, lit_laws
from stages.twin.locate import FALSE_ALARM
from stages.twin.photo_course import share_of_frames
from stages.twin.reference import BlockSamples
from stages.twin.scene import Ring
from stages.twin.sides import darker_side, of_led, slow_side
from stages.twin.steps import (
    FEWEST_FRAMES,
    first_frame,
    name_of_step,
    of_a_light,
    side_at_once,
    steps_named,
    told_apart,
)

_ROUNDS = 3
"""Most causes per light."""
_SURE = 3.0
"""σ, by the spread from frame to frame, by which one law must fit better than another to be distinguished."""
_LEAST = {"step": 0.02, "led_dead": 0.2, "lamp_sector": 0.1, "laser_sector": 0.25}
"""Smallest sizes that are reported. A photo errs by one or two per cent from frame to frame; for the laser's
colour, the wall's reflectance errs by more, from place to place."""
_AROUND = ("led_dead", "lamp_sector")
"""Laws of lit frames that change one side of the picture from a frame on."""
_LOBE = 0.15
"""Relative 1 σ of an LED's share of the light because its lobe is unknown: uniform emission and emission as
the cosine differ by this much at the ring."""
_SHAPE, _NARROW_DEG, _OF_WIDTH = 0.03, 20.0, 0.08
"""1 σ of a sector's loss because its shape is unknown. For a sector narrower than two cells, 20°, only loss
times width is measured, and widths are tried in steps of a quarter: relative 1 σ of the loss, half a step
over √3."""


Chosen = tuple[Fitted, list[str]]
"""A cause, and names of others that fit about as well."""


def causes(
    lit: Cells | None, line: Cells | None, lighting: Lighting, ring: Ring, samples: BlockSamples | None = None
) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return causes of changes over time and along the line, from the cells of each light's frames.

    Second are withdrawn ones: a side that darkens, but not at once. ``samples`` tell from which frames the
    wall's photo was made, and whether a step is alike all over the picture.
    """
    found: list[Mismatch] = []
    slow: list[Mismatch] = []
    steps: dict[str, tuple[Fitted, Cells, list[str]]] = {}
    for light, cells, other in (("LEDs", lit, line), ("laser", line, lit)):
        if cells is None or len(cells.frame) < FEWEST_FRAMES:
            continue
        if light == "LEDs":
            base, laws = lit_laws(cells, lighting, ring, share_of_frames(samples, ring, cells.frame))
        else:
            base, laws = line_laws(cells)
        chosen, base, unsure = _chosen(cells, base, laws, light, other)
        for best, rivals in chosen:
            if best.law.name == "step":
                steps[light] = best, cells, rivals
            else:
                found.append(_mismatch(best, rivals, cells, ring))
        found += _flicker_or_else(cells, base, unsure, light, ring, other)
        if light == "laser":
            found += (*dim_at_times(cells, base, ring), *banding_of_line(cells, ring))
        if unsure is not None and unsure[0].probability <= FALSE_ALARM:
            slow.append(slow_side(unsure[0], _lost(unsure[0]), cells, ring))
    return (*steps_named(steps, lit, line, ring, samples), *found), tuple(slow)


def _chosen(
    cells: Cells, base: Float, laws: Sequence[Law], light: str, other: Cells | None
) -> tuple[list[Chosen], Float, Chosen | None]:
    """Return the causes found one after the other, each with rivals that fit as well, and the base with them.

    Last is the next cause if it is not certain, or does not act at once as it should; or None.
    """
    chosen: list[Chosen] = []
    unsure = None
    for _ in range(_ROUNDS):
        tries = [try_law(cells, base, law, len(laws) * _places(law)) for law in laws]
        tries = [f for f in tries if _may_be(f, cells, base)]
        if not tries:
            break
        tries.sort(key=lambda f: -f.fall.sum())
        best = _by_other_sectors(_simplest(_at_once_first(tries, cells)), cells, base)
        if size_of(best) <= _LEAST[best.law.name]:
            break
        rivals = _rivals(best, tries, cells, light, other)
        if best.probability > FALSE_ALARM or not _at_once(best, cells):  # what fits less well is none either
            unsure = best, rivals
            break
        if best.law.name == "lamp_sector":  # what came at once with it, and what comes next, is its misfit
            chosen = [(c, r) for c, r in chosen if abs(_first(c) - _first(best)) > 1]
        if not any(_same_sector(best, earlier) for earlier, _ in chosen):
            chosen.append((best, rivals))
        base = np.concatenate([base, best.change[None]])
        if best.law.name == "lamp_sector":
            break
    return chosen, base, unsure


def _rivals(
    best: Fitted, tries: Sequence[Fitted], cells: Cells, light: str, other: Cells | None
) -> list[str]:
    """Return names of other laws that fit about as well, however many places each of them tried."""
    return [
        name_of_step(o, cells, light, other) if o.law.name == "step" else o.law.name
        for o in tries
        if o.law.name not in (best.law.name, "lamp_sector")
        and size_of(o) > _LEAST[o.law.name]
        and sigmas(best.fall - o.fall) < _SURE
    ]


def _may_be(found: Fitted, cells: Cells, base: Float) -> bool:
    """Return whether a law may be what it says: a light's step, or no more than an LED's light."""
    if found.law.name == "step":
        return of_a_light(found, cells, base)
    size = size_of(found)  # σ is in proportion to it: that of all its light decides
    return found.law.name != "led_dead" or size < 1.0 + _SURE * _size_sd(found) / max(size, 1.0)


def _simplest(tries: Sequence[Fitted]) -> Fitted:
    """Return the law that fits best; one without a name only where no named law fits about as well.

    A law that has no certain size does not, where the other one has.
    """
    named = next((o for o in tries if o.law.name != "lamp_sector"), tries[0])
    by_chance = named.probability > FALSE_ALARM >= tries[0].probability
    return tries[0] if by_chance or sigmas(tries[0].fall - named.fall) >= _SURE else named


def _at_once_first(tries: Sequence[Fitted], cells: Cells) -> Sequence[Fitted]:
    """Return laws, best first, without those that should act at once and do not: they remain rivals.

    If they fit clearly better than the others, all are kept: what fits less well is none either.
    """
    possible = [o for o in tries if _at_once(o, cells)]
    if not possible or sigmas(tries[0].fall - possible[0].fall) >= _SURE:
        return tries
    return possible


def _at_once(found: Fitted, cells: Cells) -> bool:
    """Return whether a side of the picture, if it is one, may darken at once."""
    return found.law.name not in _AROUND or side_at_once(found, _first(found), cells)


def _first(found: Fitted) -> int:
    """Return the index of the first frame of a change of lit frames."""
    return int(found.place[0 if found.law.name == "step" else 1])


def _same_sector(one: Fitted, other: Fitted) -> bool:
    """Return whether two dim sectors overlap: the second is then a misfit of the first one's shape."""
    if not one.law.name == other.law.name == "laser_sector":
        return False
    away = abs(half_turn(float(one.place[0] - other.place[0])))
    return bool(away < (one.place[1] + other.place[1]) / 2 + 360 / SECTORS)


def _places(law: Law) -> int:
    """Return how many independent places a law may have."""
    if law.name == "laser_sector":
        return SECTORS
    return len(law.columns) // 3 if law.name in _AROUND else len(law.columns)


def _by_other_sectors(best: Fitted, cells: Cells, base: Float) -> Fitted:
    """Return a dim sector with the probability that the scatter of the other sectors makes one as deep.

    Wall differs in patches: scatter is known from no more places than sectors of that width fit beside it.
    """
    if best.law.name != "laser_sector":
        return best
    with_it = np.concatenate([base, best.change[None]])
    rest = cells.log_ratio - fitted(cells, with_it, np.ones(len(cells.frame), bool))
    seen = cells.usable.any(0)
    left = np.where(cells.usable, rest, 0.0).sum(0)[seen] / cells.usable.sum(0)[seen]
    depth = float(np.abs(best.change).max())
    beside = 360 / float(best.place[1]) - 1
    chance = 2 * SECTORS * float(t.sf(depth / max(spread_about_median(left), 1e-6), beside))
    return replace(best, probability=min(1.0, max(best.probability, chance)))


def size_of(found: Fitted) -> float:
    """Return the size of a cause in the unit of its law; 0 where its sign is opposite to the law's."""
    if found.law.name == "step":
        return float(abs(np.expm1(found.size)))
    if found.law.name == "led_dead":
        most = found.place[2]
        return float((1 - (1 - 0.999 * most) ** max(found.size, 0.0)) / most)
    return float(1 - (1 - found.place[2]) ** max(found.size, 0.0))


def _size_sd(found: Fitted) -> float:
    more = replace(found, size=found.size + found.sd)
    narrow = found.law.name == "laser_sector" and found.place[1] < _NARROW_DEG
    of_shape = float(np.hypot(_SHAPE, _OF_WIDTH * size_of(found) * narrow))
    beyond = {"led_dead": _LOBE * size_of(found)}.get(found.law.name, of_shape)
    return float(np.hypot(size_of(more) - size_of(found), beyond))


def _lost(found: Fitted) -> NamedFigure:
    return NamedFigure("lost", size_of(found), _size_sd(found), "share of the light")


def _mismatch(best: Fitted, rivals: list[str], cells: Cells, ring: Ring) -> Mismatch:
    size = _lost(best)
    name = best.law.name
    if name == "lamp_sector":
        return darker_side(best, size, cells, ring)
    if name == "led_dead":
        place = of_led(best, cells)
        said = f"From frame {place[0].value:.0f} on, the LED at image azimuth {place[1].value:.0f}° has lost"
        fixed_to, look = "time", ring.at(cells.frame[int(best.place[1])], float(best.place[0]))
    else:
        where, width = best.place[:2]
        place = (
            NamedFigure("azimuth_deg", where, SECTOR_STEP_DEG / 2, "deg"),
            NamedFigure("width_deg", width, 0.25 * width, "deg"),
        )
        said = f"About image azimuth {where:.0f}°, over {width:.0f}°, the laser has lost"
        fixed_to, look = "line", ring.at(cells.frame[0], np.radians(where))
    said += f" {100 * size.value:.0f} % of its light."
    if rivals:
        said += f" {told_apart(rivals)}"
    return Mismatch(
        " or ".join([name, *rivals]), "line" if fixed_to == "line" else "intensity", fixed_to, place, (size,),
        best.probability, best.chi2_before, best.chi2_after, said, look,
    )  # fmt: skip


def _flicker_or_else(
    cells: Cells, base: Float, unsure: Chosen | None, light: str, ring: Ring, other: Cells | None
) -> list[Mismatch]:
    """Return flicker, or the slow change that explains most of it.

    As "flicker or X" if it vanishes once the uncertain cause X is fitted.
    """
    found = [slowly(one, cells, base, light, ring) for one in flicker(cells, base, light, ring)]
    if unsure is None or unsure[0].law.name == "laser_sector" or not any(m.name for m in found):
        return found  # a sector changes no frame alone
    if flicker(cells, np.concatenate([base, unsure[0].change[None]]), light, ring):
        return found
    return [_flicker_or(found[0], unsure, cells, light, other)]


def _flicker_or(found: Mismatch, unsure: Chosen, cells: Cells, light: str, other: Cells | None) -> Mismatch:
    """Return flicker that may as well be an uncertain cause, or one of its rivals."""
    cause, rivals = unsure
    what, names = "a step of brightness", [found.name, *rivals]
    place: tuple[NamedFigure, ...] = (first_frame(cells.frame, int(cause.place[0])),)
    if cause.law.name == "step":
        names.insert(1, name_of_step(cause, cells, light, other))
    if cause.law.name in _AROUND:
        place = of_led(cause, cells)
        what, names = f"an LED that fails at image azimuth {place[1].value:.0f}°", ["flicker", "led_dead"]
    if cause.law.name == "lamp_sector" or not _at_once(cause, cells):
        what, names = f"a side that darkens, about image azimuth {place[1].value:.0f}°,", [""]
    said = (
        f"{found.statement} {len(cells.frame)} frames do not distinguish this from {what} from frame "
        f"{place[0].value:.0f} on. What to do: withhold more frames."
    )
    return replace(found, name=" or ".join(names), place=place, statement=said)
