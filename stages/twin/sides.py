"""A side of the picture that darkens from a frame on: where it is reported, and what it may be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.cells import Cells, Fitted, half_turn
from stages.twin.laws import LED_AZIMUTHS
from stages.twin.scene import Ring
from stages.twin.steps import first_frame


def darker_side(best: Fitted, size: NamedFigure, cells: Cells, ring: Ring) -> Mismatch:
    """Return a change of one side of the picture that no LED makes."""
    place = of_led(best, cells)
    said = (
        f"From frame {place[0].value:.0f} on, lit wall about image azimuth {place[1].value:.0f}° is up to "
        f"{100 * size.value:.0f} % darker, otherwise than one LED of the probe makes it: several lamps have "
        "failed, or something shades them or the window."
    )
    look = ring.at(cells.frame[int(best.place[1])], float(best.place[0]))
    chi2 = best.chi2_before, best.chi2_after
    return Mismatch("", "intensity", "time", place, (size,), best.probability, *chi2, said, look)


def slow_side(side: Fitted, size: NamedFigure, cells: Cells, ring: Ring) -> Mismatch:
    """Return a side that darkens, without its name: the frames beside it do not step as it does."""
    at = float(np.degrees(side.place[0]))
    said = (
        f"During the run, lit wall about image azimuth {half_turn(at):.0f}° gets darker. But the frames do "
        "not show that it does so at once: LEDs that fade, dirt that gathers on the window, and an uneven "
        "photo of the wall beside which the probe rolls look the same."
    )
    darker = darker_side(side, size, cells, ring)
    return replace(darker, place=darker.place[1:], statement=said)  # it has no frame at which it comes


def of_led(found: Fitted, cells: Cells) -> tuple[NamedFigure, NamedFigure]:
    """Return when an LED fails (frame) and where (image azimuth)."""
    where = half_turn(float(np.degrees(found.place[0])))
    at = NamedFigure("azimuth_deg", where, 180 / LED_AZIMUTHS, "deg")
    return first_frame(cells.frame, int(found.place[1])), at
