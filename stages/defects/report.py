"""Report and warn after a search for defects: how many, how certain, and what may have been missed."""

from __future__ import annotations

from pipeline.adjustment.shared_light import HeldOver
from pipeline.machine.stage import Context
from stages.defects.corroborate import LEAST_RINGS

# So few unconfirmed findings need no warning, since they are quickly looked at. A warning is due where one
# defect in four is expected to be false.
_FEW_UNCONFIRMED, _MANY_FALSE = 3, 0.25
# One finding that lit pictures contradict may be a single splash; from two on, drops run over the window.
_SPLASHES = 2
# A warning is due where the depth that is found reliably exceeds the wanted one by this factor. Chosen; in
# good recordings the two are close.
_DEEPER = 2.0
# A warning is due where defects must be longer than 3 mm, the size for which the depth above holds, to be
# seen by two independent rings; up to 40 rings are tried. Chosen.
_SHORT_MM, _MOST_RINGS = 3.0, 40


def report_found(defects: int, expected_false: float, context: Context) -> None:
    """Report the number of defects, and warn where many of them are expected to be false."""
    context.report("defects", defects, "")
    context.report("false findings expected among the defects", expected_false, "")
    if expected_false > _MANY_FALSE * max(defects, 1) and defects > 1:
        context.warn(
            f"of {defects} defects, {expected_false:.1f} are expected to be false. What to do: accept or "
            "reject each in the review by its picture before any is counted"
        )


def report_unconfirmed(defects: int, unconfirmed: int, lines: int, context: Context) -> None:
    """Report the unconfirmed findings of rings and the dark lines of the photo, and warn of too many."""
    context.report(
        "unconfirmed: one ring alone shows them, or they are more likely false than real",
        unconfirmed,
        "detections",
    )
    context.report("unconfirmed: dark lines that the photo alone shows", lines, "detections")
    if unconfirmed > max(_FEW_UNCONFIRMED, defects):
        context.warn(
            f"{unconfirmed} places are shown by one ring alone or are more likely false than real, beside "
            f"{defects} defects: glints, splashes or compression were taken for the line. What to do: look "
            "at the unconfirmed findings in the review; record again with less exposure of the laser, a "
            "clean window or less compression"
        )


def warn_of_drops(contradicted: int, context: Context) -> None:
    """Report how many findings lit pictures contradict, and warn where they are several."""
    context.report("unconfirmed: lit pictures show the wall without them", contradicted, "detections")
    if contradicted >= _SPLASHES:
        context.warn(
            f"at {contradicted} places the line departs from the wall as at a defect, but lit pictures "
            "show the wall without it, or displaced while the line passed and not before and after: drops or "
            "dirt moved over the window. These places are unconfirmed. Others may be false as well, and the "
            "depth of a defect under a drop may be wrong. What to do: look at each finding's pictures; dry "
            "the window and record again"
        )


def warn_of_missed(smallest_mm: float, asked_mm: float, context: Context) -> None:
    """Warn where defects are found reliably only if much deeper than the wanted smallest depth, mm."""
    context.report("depth from which nine of ten defects of 3 mm × 3 mm are found", smallest_mm, "mm")
    if smallest_mm > _DEEPER * asked_mm:
        context.warn(
            f"defects of 3 mm × 3 mm must be {smallest_mm:.2g} mm deep for nine of ten to be found, but "
            f"{asked_mm:.2g} mm are wanted: the laser line is too unsteady here. Shallower ones may be "
            "missed, and so are all where the wall was not measured. What to do: record with less "
            "compression, a sharper picture, a dry window and a camera that is firmly mounted"
        )


def warn_of_short_ones(held: HeldOver, ring_spacing_mm: float, context: Context) -> None:
    """Warn where rings share so much light that a short defect is not seen by two independent ones."""
    enough = (n for n in range(LEAST_RINGS, _MOST_RINGS) if held.independent(n) >= LEAST_RINGS)
    rings = next(enough, _MOST_RINGS)
    length_mm = rings * ring_spacing_mm
    if length_mm > _SHORT_MM and rings > LEAST_RINGS:
        context.warn(
            f"neighbouring rings share so much that {rings} in a row are worth no more than {LEAST_RINGS} "
            f"of a good recording: defects shorter than {length_mm:.2g} mm along the pipe count only where "
            "the photo also shows them, and are unconfirmed elsewhere. What to do: record with less "
            "compression and without noise reduction"
        )
