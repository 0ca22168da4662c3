"""Report and warn after a search for defects: how many, how certain, and what may have been missed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.adjustment.shared_light import HeldOver
from pipeline.artefacts.findings import Defects, Detectable, usual_limit
from pipeline.machine.stage import Context
from stages.defects.corroborate import LEAST_RINGS
from stages.defects.limits import rings_needed, widest_spacing_mm
from stages.defects.parameters import DefectParameters

# So few unconfirmed findings need no warning, since they are quickly looked at. A warning is due where one
# defect in four is expected to be false.
_FEW_UNCONFIRMED, _MANY_FALSE = 3, 0.25
# One finding that lit pictures contradict may be a single splash; from two on, drops run over the window.
_SPLASHES = 2
# A warning is due where the depth that is found reliably exceeds the wanted one by this factor. Chosen; in
# good recordings the two are close.
_DEEPER = 2.0
# A warning is due where defects must be longer than 3 mm, the size for which the depth above holds, to be
# seen by two independent rings. Chosen.
_SHORT_MM = 3.0
# Number of stretches that a warning names (chosen).
_NAMED = 4


def report_findings(found: Defects, lines: int, moved_over: int, context: Context) -> None:
    """Report and warn of what was found; ``lines`` of the photo alone, ``moved_over`` the window."""
    report_found(len(found.items), found.false_alarm_rate, context)
    report_unconfirmed(len(found.items), len(found.unconfirmed) - lines, lines, context)
    warn_of_drops(moved_over, context)


def report_detectable(
    limits: Sequence[Detectable],
    parameters: DefectParameters,
    held: HeldOver,
    ring_spacing_mm: float,
    context: Context,
) -> None:
    """Report from which size and depth on defects are found, and warn where that is less than wanted."""
    report_limits(limits, context)
    warn_of_shallow(limits, parameters.min_depth_mm, context)
    warn_of_nothing(limits, parameters.min_size_mm, context)
    warn_of_sparse(limits, parameters.min_size_mm, held, context)
    warn_of_short_ones(held, ring_spacing_mm, context)


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
            f"{defects} defect{'' if defects == 1 else 's'}: glints, splashes or compression were taken for "
            "the line. What to do: look at the unconfirmed findings in the review; record again with less "
            "exposure of the laser, a clean window or less compression"
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


def report_limits(limits: Sequence[Detectable], context: Context) -> None:
    """Report from which size and depth on nine of ten defects are found on most of the pipe.

    Where none are found on most of it, `warn_of_nothing` and `warn_of_sparse` say so.
    """
    usual = usual_limit(limits) if limits else None
    if usual is not None and math.isfinite(usual.size_mm):
        context.report("nine of ten defects are found from a diameter of", usual.size_mm, "mm")
        context.report("and from a depth of", usual.depth_mm, "mm")


def warn_of_shallow(limits: Sequence[Detectable], asked_mm: float, context: Context) -> None:
    """Warn where defects are found reliably only if much deeper than the wanted smallest depth, mm."""
    known = [d for d in limits if math.isfinite(d.depth_mm)]
    shallow = [d for d in known if d.depth_mm > _DEEPER * asked_mm]
    if not shallow:
        return
    one = usual_limit(shallow)
    context.warn(
        f"defects of {one.size_mm:.2g} mm × {one.size_mm:.2g} mm must be {one.depth_mm:.2g} mm deep for nine "
        f"of ten to be found{_where(shallow, limits)}, but {asked_mm:.2g} mm are wanted: the laser line is "
        "too unsteady there. Shallower ones may be missed, and so are all where the wall was not measured. "
        "What to do: record with less compression, a sharper picture, a dry window and a camera that is "
        "firmly mounted"
    )


def warn_of_nothing(limits: Sequence[Detectable], wanted_mm: float, context: Context) -> None:
    """Warn where not even large defects are found although rings are close enough for the wanted diameter."""
    widest = widest_spacing_mm(wanted_mm, LEAST_RINGS)
    nothing = [d for d in limits if math.isinf(d.depth_mm) and d.ring_spacing_mm <= widest]
    if nothing:
        context.warn(
            f"not even large defects are found reliably{_where(nothing, limits)}: the laser line is too "
            "unsteady there, or shows less than half of the wall. What to do: record with less compression, "
            "a sharper picture and a clean, dry window"
        )


def warn_of_sparse(limits: Sequence[Detectable], wanted_mm: float, held: HeldOver, context: Context) -> None:
    """Warn where rings lie too far apart for enough of them to cross defects of the wanted diameter, mm."""
    widest, needed_rings = widest_spacing_mm(wanted_mm, LEAST_RINGS), rings_needed(held)
    sparse = [d for d in limits if d.size_mm > wanted_mm and d.ring_spacing_mm > widest]
    if not sparse:
        return
    worst = max(sparse, key=lambda d: d.ring_spacing_mm)
    apart, advised = worst.ring_spacing_mm, widest_spacing_mm(wanted_mm, needed_rings)
    needed = (
        f"not even large defects are found reliably{_where(sparse, limits)}"
        if any(math.isinf(d.depth_mm) for d in sparse)
        else f"only defects from {max(d.size_mm for d in sparse):.2g} mm × as much are found reliably"
        f"{_where(sparse, limits)}"
    )
    context.warn(
        f"{needed}: rings lie up to {apart:.2g} mm apart there, and {needed_rings} must cross a defect. "
        "Smaller ones are missed or unconfirmed, however deep, unless one ring crosses them and the photo "
        f"shows them. What to do: for defects of {wanted_mm:.2g} mm, pull the probe at most "
        f"{advised / apart:.2g} times as fast (rings {advised:.2g} mm apart), light the laser in more of the "
        "pictures, or record at a higher frame rate"
    )


def _where(some: Sequence[Detectable], limits: Sequence[Detectable]) -> str:
    """Return the places of some stretches, in words; nothing where these are all."""
    if len(some) == len(limits):
        return ""
    places = [f"{d.from_mm:.0f}–{d.to_mm:.0f} mm" for d in some]
    more = f" and {len(places) - _NAMED} more" if len(places) > _NAMED else ""
    return f" at {', '.join(places[:_NAMED])}{more}"


def warn_of_short_ones(held: HeldOver, ring_spacing_mm: float, context: Context) -> None:
    """Warn where rings share so much light that a short defect is not seen by two independent ones."""
    rings = rings_needed(held)
    length_mm = rings * ring_spacing_mm
    if length_mm > _SHORT_MM and rings > LEAST_RINGS:
        context.warn(
            f"neighbouring rings share so much that {rings} in a row are worth no more than {LEAST_RINGS} "
            f"of a good recording: defects shorter than {length_mm:.2g} mm along the pipe count only where "
            "the photo also shows them, and are unconfirmed elsewhere. What to do: record with less "
            "compression and without noise reduction"
        )
