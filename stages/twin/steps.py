"""Steps of brightness from one frame to the next: of the exposure, or of one light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.cells import SECTORS, Cells, Fitted, Law, best_column
from stages.twin.laws import sectors_and_drift, steps_of
from stages.twin.reference import BlockSamples
from stages.twin.scene import Ring

FEWEST_FRAMES, _BESIDE = 6, 3
"""Least frames per light; frames on each side that show a step."""
_SURE = 3.0
"""σ, by the spread from frame to frame, by which steps of two lights must differ to be two."""
_NO_WALL = 2.0
"""σ by which the photo of the wall must step less than the line: in 2 % of cases chance alone makes it so.
Three would leave a drawn step of 30 % over texture of 10 % unnamed."""
LEAST_SHARE, _SIDES_APART, _LEAST_SEEN = 0.5, 3, 0.5
"""Least share of a step that the frames beside it must show by themselves, and of the step of the opposite
half of the picture that every half must; sectors from one half to the next; least share of a half that must
be usable for it to count. Chosen."""
_HALVES = (np.arange(SECTORS) - np.arange(0, SECTORS, _SIDES_APART)[:, None]) % SECTORS < SECTORS // 2
"""(H, S) sectors in each half of the picture."""
_OWN_STEP = {"LEDs": "lamp_step", "laser": "laser_step"}
_FEWEST_BLOCKS, _PARTS = 40, (0.25, 0.75)
"""Least blocks that two frames must have in common; quantiles of their distance from the picture's middle up
to which they are its middle, and from which they are its border. Chosen."""
_OR_WALL = "Or other wall begins there, for example a liner or another material."
_OF_BORDER = (
    "Relative to its middle, lit wall at the border of the picture becomes {}: no change of the exposure or "
    "of all lamps does that. Vignetting by the lens or its hood, or haze on the window, would."
)


def at_once(step: Fitted, cells: Cells) -> float:
    """Return by how much the frames next to a step differ, as a logarithm: the rest may be drift."""
    mean = cells.log_ratio.sum(1) / np.maximum(cells.usable.sum(1), 1)
    first = int(step.place[0])
    after, before = mean[first : first + _BESIDE], mean[max(first - _BESIDE, 0) : first]
    return float(after.mean() - before.mean())


def side_at_once(side: Fitted, first: int, cells: Cells) -> bool:
    """Return whether a side of the picture may darken as much between two frames as it does in all.

    Where the photo is uneven and the probe rolls, a side seems to darken slowly. Sectors are compared with
    each other, since the brightness of all together may change in between; each in the last and the first
    frame that show it. The σ is that of other neighbouring frames.
    """
    usable = cells.usable
    last, then = first - 1 - usable[first - 1 :: -1].argmax(0), first + usable[first:].argmax(0)
    both = np.flatnonzero(usable[:first].any(0) & usable[first:].any(0))
    if not len(both):
        return True
    law, seen = (a[then[both], both] - a[last[both], both] for a in (side.change, cells.log_ratio))
    law = law - law.mean()
    each = np.where(usable[1:] & usable[:-1], np.diff(cells.log_ratio, axis=0), 0.0)[:, both] @ law
    sd = float(np.sqrt(np.mean(np.delete(each, first - 1) ** 2)))
    return bool(law @ seen + sd > LEAST_SHARE * (law @ law))


def of_a_light(step: Fitted, cells: Cells, base: Float) -> bool:
    """Return whether a step may be one of a light: it comes at once, and no side contradicts it.

    A side contradicts it if its half of the picture steps by less than half as much as the opposite one, by
    more than the σ of both. ``base`` (K, F, S) are the columns beyond which the step was fitted.
    """
    if at_once(step, cells) * np.sign(step.size) <= LEAST_SHARE * abs(step.size):
        return False
    halves = _HALVES[_seen(cells)]
    if not len(halves):
        return True
    own = [_again(step, replace(cells, pixels=np.where(half, cells.pixels, 0.0)), base) for half in halves]
    size, sd = np.array(own).T
    other, other_sd = (np.roll(value, len(halves) // 2) for value in (size, sd))
    short = np.sign(step.size) * (LEAST_SHARE * other - size) - np.hypot(sd, LEAST_SHARE * other_sd)
    return not np.any(short > 0)


def _seen(cells: Cells) -> Bool:
    """Return which halves of the picture (H,), and their opposites as well, have enough usable sectors."""
    enough = np.array([cells.usable[:, half].mean() >= _LEAST_SEEN for half in _HALVES])
    return np.asarray(enough & np.roll(enough, len(_HALVES) // 2))


def _may_be_wall(step: Fitted, cells: Cells, light: str) -> bool:
    """Return whether other wall that begins at the step's frame may look like a step of the light.

    It may where no two opposite halves of the picture are seen. The photo of the wall tells the two apart: it
    is made from lit frames that overlap, so that the same wall is seen before and after a step of the LEDs.
    Every laser frame has a line on wall of its own: there the photo, by which the line was predicted, must
    surely step by less than half as much as the line.
    """
    if not _seen(cells).any():
        return True
    if light == "LEDs":
        return False
    mean = cells.predicted / np.maximum(cells.pixels, 1)
    photo = replace(cells, cross=mean, own=np.sign(cells.own))  # its logarithm is that of the photo alone
    size, sd = _again(step, photo, sectors_and_drift(len(cells.frame)))
    return abs(size) + _NO_WALL * sd > LEAST_SHARE * abs(step.size)


def _again(step: Fitted, cells: Cells, base: Float) -> tuple[float, float]:
    """Return size and σ of a step at the same frame, fitted to other cells beyond base columns (K, F, S)."""
    law = Law("step", step.law.columns[[step.column]], step.place[None])
    return best_column(cells, base, law, np.ones(len(cells.frame), bool))[1:]


def toward_border(samples: BlockSamples) -> Float:
    """Return by how much more (F − 1,) brightness changes at the border than in the middle of the picture.

    Each is for lit wall of two neighbouring frames, as a logarithm; NaN where they share few places.
    """
    image, out = samples.orders["image"], np.full(len(samples.number) - 1, np.nan)
    for k in range(len(out)):
        before, after = (np.flatnonzero(samples.frame == f) for f in (k, k + 1))
        both, one, two = np.intersect1d(image[before], image[after], return_indices=True)
        if len(both) < _FEWEST_BLOCKS:
            continue
        away = samples.away[after[two]]
        change = samples.log_change[after[two]] - samples.log_change[before[one]]
        inner, outer = np.quantile(away, _PARTS)
        out[k] = np.median(change[away >= outer]) - np.median(change[away <= inner])
    return out


def _at_border(step: Fitted, between: Int, samples: BlockSamples | None) -> float:
    """Return by how much more the lit wall steps at the picture's border than in its middle; 0 if it may not.

    A lamp, a laser or an exposure dims middle and border alike; vignetting, for example, does not. The σ is
    the scatter of other neighbouring frames.
    """
    if samples is None or len(samples.number) < FEWEST_FRAMES:
        return 0.0
    each = toward_border(samples)
    here = (samples.number[1:] > between[0]) & (samples.number[:-1] < between[1]) & np.isfinite(each)
    others = each[~here & np.isfinite(each)]
    if not here.any() or not len(others):
        return 0.0
    most = float(each[here][np.abs(each[here]).argmax()])
    least = max(_SURE * float(np.sqrt(np.mean(others**2))), LEAST_SHARE * abs(step.size))
    return most if abs(most) > least else 0.0


def first_frame(frame: Int, first: int) -> NamedFigure:
    """Return the frame from which something changed, between two compared ones of those (F,)."""
    gap = float(frame[first] - frame[first - 1])
    return NamedFigure("frame_from", (frame[first] + frame[first - 1]) / 2, gap / np.sqrt(12), "frame")


def steps_named(
    steps: dict[str, tuple[Fitted, Cells, list[str]]], lit: Cells | None, line: Cells | None, ring: Ring,
    samples: BlockSamples | None = None,
) -> list[Mismatch]:  # fmt: skip
    """Return steps of brightness: of the exposure where both lights step alike, else of one light.

    Beside each are names of other causes that fit about as well: a step of both lights is none of them.
    A step has no name where the lit wall of ``samples`` steps otherwise at the border of the picture.
    """
    found = []
    for light, (best, cells, rivals) in steps.items():
        other = {"LEDs": line, "laser": lit}[light]
        first = int(best.place[0])
        at = first_frame(cells.frame, first)
        same = _same_step(best, cells.frame[first - 1 : first + 1], other)
        if same and light == "laser" and "LEDs" in steps:
            continue  # already reported
        name = _named(same, light)
        # With drift all frames measure a step, without it only the frames beside it: σ includes their
        # disagreement.
        sd = float(np.exp(best.size) * np.hypot(best.sd, at_once(best, cells) - best.size))
        size = NamedFigure("change", float(np.expm1(best.size)), sd, "relative")
        what = {
            True: "all frames are",
            False: f"frames lit by the {light} alone are",
            None: f"frames lit by the {light} are",
        }[same]
        way = "brighter" if best.size > 0 else "darker"
        said = at_all = f"From frame {at.value:.0f} on, {what} {100 * abs(size.value):.0f} % {way}."
        if _may_be_wall(best, cells, light):
            name, said = f"{name} or other_wall", f"{said} {_OR_WALL}"
        if rivals and not same:
            name, said = " or ".join([name, *rivals]), f"{said} {told_apart(rivals)}"
        more = _at_border(best, cells.frame[first - 1 : first + 1], samples)
        if more:
            name, said = "", f"{at_all} {_OF_BORDER.format(_percent(more))}"
        found.append(Mismatch(
            name, "line" if light == "laser" and not same else "intensity", "time", (at,), (size,),
            best.probability, best.chi2_before, best.chi2_after,
            said, ring.whole(cells.frame[first]),
        ))  # fmt: skip
    return found


def name_of_step(step: Fitted, cells: Cells, light: str, other: Cells | None) -> str:
    """Return the name of a step of one light; as for `steps_named`, cells of the ``other`` light decide."""
    first = int(step.place[0])
    return _named(_same_step(step, cells.frame[first - 1 : first + 1], other), light)


def _named(same: bool | None, light: str) -> str:
    """Return the name of a step by whether the other light steps alike; None if that is not known."""
    own = _OWN_STEP[light]
    return {True: "exposure_step", False: own, None: f"exposure_step or {own}"}[same]


def _percent(change: float) -> str:
    return f"{100 * abs(np.expm1(change)):.0f} % {'brighter' if change > 0 else 'darker'}"


def told_apart(rivals: list[str]) -> str:
    """Return the sentence that names causes which fit about as well."""
    return "The frames do not distinguish this from: " + ", ".join(rivals).replace("_", " ") + "."


def _same_step(best: Fitted, between: Int, other: Cells | None) -> bool | None:
    """Return whether frames of the other light step alike at that time; None if they cannot decide."""
    if other is None or len(other.frame) < FEWEST_FRAMES:
        return None
    columns, first = steps_of(len(other.frame))
    at = first.astype(int)
    here = (other.frame[at] > between[0]) & (other.frame[at - 1] < between[1])
    if not here.any():
        return None
    law, every = Law("step", columns[here], first[here, None]), np.ones(len(other.frame), bool)
    _, size, sd = best_column(other, sectors_and_drift(len(other.frame)), law, every)
    apart = float(np.hypot(sd, best.sd))
    alike, absent = abs(size - best.size) < _SURE * apart, abs(size) < _SURE * sd
    return None if alike == absent else alike
