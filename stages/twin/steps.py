"""Steps of brightness from one frame to the next: of the exposure, or of one light."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.cells import SECTORS, Cells, Fitted, Law, drift, of_sectors, try_law
from stages.twin.laws import steps_of
from stages.twin.scene import Ring

FEWEST_FRAMES, _BESIDE = 6, 3
"""Least frames per light; frames on each side that show a step."""
_SURE = 3.0
"""σ, by the spread from frame to frame, by which steps of two lights must differ to be two."""
LEAST_SHARE, _SIDES_APART = 0.5, 3
"""Least share of a step that the frames beside it, and every half of the picture, must show by themselves;
sectors from one half to the next. Chosen."""
OWN_STEP = {"LEDs": "lamp_step", "laser": "laser_step"}


def at_once(step: Fitted, cells: Cells) -> float:
    """Return by how much the frames next to a step differ, as a logarithm: the rest may be drift."""
    mean = cells.log_ratio.sum(1) / np.maximum(cells.usable.sum(1), 1)
    first = int(step.place[0])
    after, before = mean[first : first + _BESIDE], mean[max(first - _BESIDE, 0) : first]
    return float(after.mean() - before.mean())


def all_round(step: Fitted, cells: Cells, base: Float) -> bool:
    """Return whether all sides of the picture step alike, as a light makes them; wall changes one side.

    ``base`` (K, F, S) are the columns beyond which the step was fitted.
    """
    columns = np.concatenate([base, step.law.columns[[step.column]]])
    for first in range(0, SECTORS, _SIDES_APART):
        inside = cells.usable & ((np.arange(SECTORS) - first) % SECTORS < SECTORS // 2)
        size = np.linalg.lstsq(columns[:, inside].T, cells.log_ratio[inside], rcond=None)[0][-1]
        if size / step.size <= LEAST_SHARE:
            return False
    return True


def first_frame(frame: Int, first: int) -> NamedFigure:
    """Return the frame from which something changed, between two compared ones of those (F,)."""
    gap = float(frame[first] - frame[first - 1])
    return NamedFigure("frame_from", (frame[first] + frame[first - 1]) / 2, gap / np.sqrt(12), "frame")


def steps_named(
    steps: dict[str, tuple[Fitted, Cells]], lit: Cells | None, line: Cells | None, ring: Ring
) -> list[Mismatch]:
    """Return steps of brightness: of the exposure where both lights step alike, else of one light."""
    found = []
    for light, (best, cells) in steps.items():
        other = {"LEDs": line, "laser": lit}[light]
        first = int(best.place[0])
        at = first_frame(cells.frame, first)
        same = _same_step(best, cells.frame[first - 1 : first + 1], other)
        if same and light == "laser" and "LEDs" in steps:
            continue  # already reported
        own = OWN_STEP[light]
        name = {True: "exposure_step", False: own, None: f"exposure_step or {own}"}[same]
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
        found.append(Mismatch(
            name, "line" if light == "laser" and not same else "intensity", "time", (at,), (size,),
            best.probability, best.chi2_before, best.chi2_after,
            f"From frame {at.value:.0f} on, {what} {100 * abs(size.value):.0f} % {way}.",
            ring.whole(cells.frame[first]),
        ))  # fmt: skip
    return found


def _same_step(best: Fitted, between: Int, other: Cells | None) -> bool | None:
    """Return whether frames of the other light step alike at that time; None if they cannot decide."""
    if other is None or len(other.frame) < FEWEST_FRAMES:
        return None
    columns, first = steps_of(len(other.frame))
    at = first.astype(int)
    here = (other.frame[at] > between[0]) & (other.frame[at - 1] < between[1])
    if not here.any():
        return None
    frames = len(other.frame)
    base = np.concatenate([of_sectors(frames, np.eye(SECTORS)), drift(frames)])
    own = try_law(other, base, Law("step", columns[here], first[here, None]), 1)
    sd = float(np.hypot(own.sd, best.sd))
    alike, absent = abs(own.size - best.size) < _SURE * sd, abs(own.size) < _SURE * own.sd
    return None if alike == absent else alike
