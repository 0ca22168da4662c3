"""What a search for defects reports and warns of: how many, how sure, and what it may have missed."""

from __future__ import annotations

from pipeline.adjustment.shared_light import HeldOver
from pipeline.machine.stage import Context
from stages.defects.corroborate import LEAST_RINGS

# Unconfirmed ones as few as these are looked at at once; a reader must know from where on one finding in four
# is expected to be false.
_FEW_UNCONFIRMED, _MANY_FALSE = 3, 0.25
# A limit of detection so many times what is asked for is told. Chosen; good ones are near what is asked for.
_DEEPER = 2.0
# Defects longer than the limit of detection is told for, mm, are warned of; so many rings are tried. Chosen.
_SHORT_MM, _MOST_RINGS = 3.0, 40


def report_found(defects: int, expected_false: float, context: Context) -> None:
    """Report how many defects were found, and warn where many of them are expected to be false."""
    context.report("defects", defects, "")
    context.report("false findings expected among the defects", expected_false, "")
    if expected_false > _MANY_FALSE * max(defects, 1) and defects > 1:
        context.warn(
            f"of {defects} defects {expected_false:.1f} are expected to be false. What to do: accept or "
            "reject each in the review by its picture before any is counted"
        )


def report_unconfirmed(defects: int, unconfirmed: int, lines: int, context: Context) -> None:
    """Report what rings show but nothing confirms, warn where it is much, and lines of the photo alone."""
    context.report(
        "unconfirmed: one ring alone shows them, or rather false than real", unconfirmed, "detections"
    )
    context.report("unconfirmed: dark lines that the photo alone shows", lines, "detections")
    if unconfirmed > max(_FEW_UNCONFIRMED, defects):
        context.warn(
            f"{unconfirmed} places show something in one ring alone or are rather false than real, beside "
            f"{defects} defects: glints, splashes or compression are taken for the line. What to do: look "
            "at the unconfirmed ones in the review; record again with less exposure of the laser, a clean "
            "window or less compression"
        )


def warn_of_missed(smallest_mm: float, asked_mm: float, context: Context) -> None:
    """Warn where defects must be much deeper than asked for, to be found."""
    context.report("depth from which nine of ten defects of 3 mm × 3 mm are found", smallest_mm, "mm")
    if smallest_mm > _DEEPER * asked_mm:
        context.warn(
            f"defects of 3 mm × 3 mm must be {smallest_mm:.2g} mm deep for nine of ten to be found, where "
            f"{asked_mm:.2g} mm are asked for: the laser's line is too unsteady here. Shallower ones may be "
            "missed, and so is any where the wall was not measured. What to do: record with less "
            "compression, a sharper picture and a camera that sits tight"
        )


def warn_of_short_ones(held: HeldOver, ring_spacing_mm: float, context: Context) -> None:
    """Warn where rings share so much light that a short defect has no two of them to show it."""
    enough = (n for n in range(LEAST_RINGS, _MOST_RINGS) if held.independent(n) >= LEAST_RINGS)
    rings = next(enough, _MOST_RINGS)
    length_mm = rings * ring_spacing_mm
    if length_mm > _SHORT_MM and rings > LEAST_RINGS:
        context.warn(
            f"the codec repeats so much light that {rings} rings in a row say no more than {LEAST_RINGS} of "
            f"a good recording: defects shorter than {length_mm:.2g} mm along the pipe count only where the "
            "photo shows them, too, and are unconfirmed elsewhere. What to do: record with less compression"
        )
