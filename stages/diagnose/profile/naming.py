"""Name an asymmetry of the line (second lines, tails, widths) by a shape that fits, or by none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.instrument.probe import Probe
from stages.diagnose.profile.cells import Cells, LineGeometry
from stages.diagnose.profile.finding import Finding, Regression, Size, finding, untestable, withdrawn
from stages.diagnose.profile.ghost import SecondLine, bounced, copied
from stages.diagnose.profile.line_spread import Fitted, Shape, explanations, line_spread, without_mean_shape
from stages.diagnose.profile.matched_filter import responses
from stages.diagnose.profile.shape import OF_A_TAIL, skew_findings
from stages.diagnose.profile.width import scale_law, width_findings

UNEXPLAINED = "unexplained"
_CLEARLY = 3.0
# Change of (line σ / stated)² that image formation may cause across the scales of the image. Debt:
# data/debts.md.
WIDTH_FLOOR = 0.05
_SMALLEST_BLUR_PX2 = 1 / 12
# Relative error of the mean path of scattered light, because the form of its profile is unknown. Debt:
# data/debts.md.
_FORM = 0.1
# Light relative to the line's height that compression may leave on one side only: at some places, and all
# round. Debt: data/debts.md.
BOUNCED_FLOOR, COPIED_FLOOR = 1e-3, 5e-4
# Error of a faint line's place, px; relative error, because the radius is computed with the stated sheet.
# Debt: data/debts.md.
PLACE_FLOOR_PX, SCALE_FLOOR = 0.05, 0.01
_LEAST_CELLS = 30
_BETTER = 1.2
# The copy is preferred at this share of the misfit, because it has one parameter and the bounced line has
# three. Debt: data/debts.md.
_SIMPLER = 0.95


def shape_findings(cells: Cells, geometry: LineGeometry, probe: Probe) -> tuple[Finding, ...]:
    """Return the findings of the line's shape: second lines, tails and widths, named by the shapes that fit.

    Where the line is asymmetric and no named shape fits, all of them are withdrawn and replaced by a finding
    `UNEXPLAINED`.
    """
    ring, *all_round = _asymmetries(cells, geometry, probe)
    widths = width_findings(cells, geometry, probe)
    if ring.found and _clearest(all_round) is not None:
        ring, all_round, cells = _told_apart(ring, all_round, cells, geometry, probe)
    clearest = _clearest(all_round)
    if clearest is None:
        return (ring, *all_round, *widths)
    fitting = explanations(line_spread(cells))
    widths_off = tuple(withdrawn(f) for f in widths)
    if not fitting:
        return (withdrawn(ring), *(withdrawn(f) for f in all_round), *widths_off, _unexplained(clearest))
    stated_mm = probe.laser.line_sigma_mm
    names = _names(fitting, scale_law(cells, geometry, probe), stated_mm)
    return (ring, *(_renamed(f, names, clearest, stated_mm) for f in all_round), *widths_off)


def _asymmetries(cells: Cells, geometry: LineGeometry, probe: Probe) -> list[Finding]:
    """Return the finding of `ghost_ring`, and after it all that are constant all round."""
    ring, copy = ghost_findings(cells, geometry, probe)
    return [ring, *skew_findings(cells), copy]


def _told_apart(
    ring: Finding, all_round: list[Finding], cells: Cells, geometry: LineGeometry, probe: Probe
) -> tuple[Finding, list[Finding], Cells]:
    """Return a line bounced across the bore and findings constant all round, each if it stands.

    The cells are those without the bounced line, if it stands.
    """
    without_ring = without_bounced_line(cells)
    _, *others = _asymmetries(without_ring, geometry, probe)
    if _clearest(others) is None:
        return ring, others, without_ring
    if not _asymmetries(without_mean_shape(cells), geometry, probe)[0].found:
        return withdrawn(ring), all_round, cells
    return ring, others, without_ring


def _clearest(findings: Sequence[Finding]) -> Finding | None:
    return min((f for f in findings if f.found), key=lambda f: f.p_value, default=None)


def _names(fitting: Sequence[Fitted], law: Regression, stated_mm: float) -> dict[str, Fitted]:
    """Return the effects whose shapes fit, each with the one that fits best; ``law`` as of `scale_law`."""
    named = dict[str, Fitted]()
    for fitted in fitting:
        copy = fitted.shape is Shape.COPY
        for name in ("tube_ghost",) if copy else _of_sheet_or_wall(fitted, law, stated_mm):
            named.setdefault(name, fitted)
    return named


def _of_sheet_or_wall(fitted: Fitted, law: Regression, stated_mm: float) -> tuple[str, ...]:
    """Return whether sheet or wall makes light on one side, as far as the line's width separates them.

    A skewed sheet has the stated 1 σ together with its tail; light that returns from within the wall comes in
    addition to a sheet of the stated 1 σ.
    """
    of_tail = (fitted.way_mm / stated_mm) ** 2
    skewed = fitted.shape is Shape.TAIL and _allows(fitted.core, law, 1 - of_tail)
    each = zip(OF_A_TAIL, (skewed, _allows(fitted.core, law, 1.0)), strict=True)
    return tuple(name for name, allowed in each if allowed) or OF_A_TAIL


def _allows(core: float, law: Regression, scale: float) -> bool:
    """Return whether the widths allow (σ / stated)² = ``scale`` of the line without the light beside it.

    The blur that is left for the lens is at least that of a pixel.
    """
    found, blur_px2 = core * law.coefficient[:2]
    covariance = core**2 * law.covariance[:2, :2]
    variance = max(float(covariance[0, 0]), 1e-300)
    off = abs(found - scale) / np.hypot(np.sqrt(variance), WIDTH_FLOOR)
    rate = float(covariance[0, 1]) / variance
    left = blur_px2 + rate * (scale - found)
    spread = np.sqrt(max(float(covariance[1, 1]) - rate**2 * variance, 0.0))
    # 0.05 px² at least (chosen): a pixel's own variance, 1/12 px², is known no better.
    return bool(off < _CLEARLY and left > _SMALLEST_BLUR_PX2 - _CLEARLY * max(spread, 0.05))


def _renamed(found: Finding, names: Mapping[str, Fitted], clearest: Finding, stated_mm: float) -> Finding:
    """Return a finding with the size of the shape that fits it, or withdrawn if none does."""
    if found.effect not in names:
        return withdrawn(found)
    shape, rivals = names[found.effect], tuple(n for n in names if n != found.effect)
    if shape.shape is Shape.COPY:
        return replace(found, z=clearest.z, p_value=clearest.p_value, alike=rivals)
    size = _sizes(found, shape, stated_mm)
    return finding(found.effect, clearest.z, clearest.p_value, size, _in_words(shape), alike=rivals)


def _sizes(found: Finding, shape: Fitted, stated_mm: float) -> tuple[Size, ...]:
    """Return the size of light on one side; the skewness of a sheet only from a tail, forward positive.

    Skewness grows as the third power of a tail's length, so that a third of its relative error is that of the
    length.
    """
    way = abs(shape.way_mm)
    of_tail = float(np.hypot(SCALE_FLOOR, 1 / (3 * max(abs(found.z), 1))))
    share = _FORM if shape.shape is Shape.HALO else of_tail
    sigma = float(np.hypot(shape.way_sigma_mm, share * way))
    if found.effect == "subsurface":
        return (Size("transport_mm", "mm", way, sigma),)
    if shape.shape is Shape.HALO:
        return ()
    skewness = 2 * float(np.sign(shape.way_mm)) * (way / stated_mm) ** 3
    return (Size("skewness", "", skewness, 3 * abs(skewness) * sigma / max(way, 1e-9)),)


def _in_words(shape: Fitted) -> str:
    left = f"This shape leaves {100 * shape.left:.1f} % of the misfit."
    if shape.shape is Shape.TAIL:
        # Forward along the axis is inward in the image.
        side = "inside" if shape.way_mm > 0 else "outside"
        return f"The line has an exponential tail of {abs(shape.way_mm):.3f} mm on its {side}. {left}"
    return (
        f"Beside the line there is light of {100 * shape.relative:.0f} % of its height, {shape.way_mm:+.2f} "
        f"mm from it along the axis and wider than the line by {shape.spread_mm:.2f} mm (1 σ). {left}"
    )


def _unexplained(clearest: Finding) -> Finding:
    """Return the finding that the line is asymmetric and no named shape fits it."""
    return finding(
        UNEXPLAINED, clearest.z, clearest.p_value, (),
        f"The line is asymmetric ({abs(clearest.z):.1f} σ), and neither an exponential tail, "
        "nor a second line, nor blurred light beside it fits its shape.",
    )  # fmt: skip


def ghost_findings(cells: Cells, geometry: LineGeometry, probe: Probe) -> tuple[Finding, Finding]:
    """Return the findings of `ghost_ring` and `tube_ghost`; of two that fit, the clearly better one is kept.

    The bounced line also measures the sheet's tilt and cone, independently of errors of the camera.
    """
    if cells.whole.sum() < _LEAST_CELLS:
        why = "The line's middle is clipped almost everywhere: no fainter line can be compared with it."
        return untestable("ghost_ring", why), untestable("tube_ghost", why)
    found = responses(cells)
    ring, copy = bounced(found, cells, BOUNCED_FLOOR), copied(found, cells, COPIED_FLOOR)
    bounced_wins = ring.misfit_drop > _BETTER * copy.misfit_drop
    copied_wins = copy.misfit_drop > _SIMPLER * ring.misfit_drop
    return (
        _ring_finding(ring, geometry, probe, kept=not copied_wins),
        _copy_finding(copy, geometry, kept=not bounced_wins),
    )


def without_bounced_line(cells: Cells) -> Cells:
    """Return the cells without the best line bounced across the bore."""
    line, w = bounced(responses(cells), cells, BOUNCED_FLOOR), cells.whole
    away = (cells.offset_px - cells.centre_px[w, None] - line.distance_px[:, None]) / cells.width_px[w, None]
    return cells.less(line.relative * np.exp(-0.5 * away**2))


def _ring_finding(line: SecondLine, geometry: LineGeometry, probe: Probe, *, kept: bool) -> Finding:
    test = line.test
    tilt_x, tilt_y, cone = line.parameters
    lever_px = np.array([4.0, 4.0, 2.0]) * float(np.nanmedian(geometry.px_per_mm * geometry.radius_mm))
    systematic = np.hypot(PLACE_FLOOR_PX / lever_px, SCALE_FLOOR * np.linalg.norm(line.parameters))
    sigma = np.sqrt(np.diagonal(line.parameter_covariance) + systematic**2)
    stated = probe.laser
    confirms = (
        _degrees("laser_tilt.tilt_deg along x", tilt_x - stated.tilt_x, sigma[0]),
        _degrees("laser_tilt.tilt_deg along y", tilt_y - stated.tilt_y, sigma[1]),
        _degrees("laser_cone.cone_deg", cone - np.tan(stated.cone_rad), sigma[2]),
    )
    tilt_deg, cone_deg = np.degrees(np.arctan(np.hypot(tilt_x, tilt_y))), np.degrees(np.arctan(cone))
    return finding(
        "ghost_ring", test.z, test.p_value if kept else 1.0,
        (Size("relative", "", line.relative, test.sigma),),
        f"A second line of {100 * line.relative:.2f} % lies where light bounced across the bore would: "
        f"the sheet tilts by {tilt_deg:.3f}° and is a cone of {cone_deg:+.3f}°.",
        confirms if kept else (),
        alike=() if kept else ("tube_ghost",),
    )  # fmt: skip


def _copy_finding(line: SecondLine, geometry: LineGeometry, *, kept: bool) -> Finding:
    distance, test = float(line.parameters[0]), line.test
    systematic = PLACE_FLOOR_PX / float(np.nanmedian(geometry.px_per_mm))
    sigma = float(np.hypot(np.sqrt(line.parameter_covariance[0, 0]), systematic))
    return finding(
        "tube_ghost", test.z, test.p_value if kept else 1.0,
        (Size("relative", "", line.relative, test.sigma), Size("separation_mm", "mm", distance, sigma)),
        f"A copy of the line of {100 * line.relative:.2f} % lies {distance:+.2f} mm along the axis from it, "
        "the same all round.",
        alike=() if kept else ("ghost_ring",),
    )  # fmt: skip


def _degrees(name: str, slope: float, sigma: float) -> Size:
    return Size(name, "deg", float(np.degrees(slope)), float(np.degrees(sigma)))
