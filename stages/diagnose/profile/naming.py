"""Name an asymmetry of the line (second lines, tails, widths) by a shape that fits, or by none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.instrument.probe import Probe
from stages.diagnose.profile.cells import Cells, LineGeometry
from stages.diagnose.profile.finding import Finding, Regression, Size, finding, untestable, withdrawn
from stages.diagnose.profile.ghost import CLEAR_WIDTHS, SecondLine, bounced, copied
from stages.diagnose.profile.line_spread import Fitted, Shape, explanations, line_spread, without_mean_shape
from stages.diagnose.profile.matched_filter import responses
from stages.diagnose.profile.shape import OF_A_TAIL, skew_findings
from stages.diagnose.profile.width import scale_by_edge_blur, scale_law, width_findings

UNEXPLAINED = "unexplained"
_CLEARLY = 3.0
# Change of (line σ / stated)² that image formation may cause across the scales of the image. Debt:
# data/debts.md.
WIDTH_FLOOR = 0.05
_SMALLEST_BLUR_PX2 = 1 / 12
# Relative 1 σ of the stated width of the sheet (chosen: no probe file states it). Debt: data/debts.md.
_STATED = 0.05
# Relative error of the mean path of scattered light, because the form of its profile is unknown. Debt:
# data/debts.md.
_FORM = 0.1
# d ln τ / d ln skewness of a tail of mean τ on a line of 1 σ s: first plus τ/s times second (measured,
# Gaussian fits to drawn lines with τ/s from 0.3 to 3 agree to 10 %).
_TAIL_BY_SKEWNESS = (0.31, 0.38)
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
    fitting = [with_systematic(f, all_round[0].z) for f in explanations(line_spread(cells))]
    widths_off = tuple(withdrawn(f) for f in widths)
    if not fitting:
        return (withdrawn(ring), *(withdrawn(f) for f in all_round), *widths_off, _unexplained(clearest))
    names = _names(fitting, cells, geometry, probe)
    stated_mm = probe.laser.line_sigma_mm
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


def with_systematic(fitted: Fitted, z: float) -> Fitted:
    """Return a shape whose σ of the way includes the form of its profile, or for a tail that of the skewness.

    ``z`` is the line's skewness over its σ, which includes what compression leaves on one side.
    """
    way = abs(fitted.way_mm)
    short, longer = _TAIL_BY_SKEWNESS
    of_tail = np.hypot(SCALE_FLOOR, (short + longer * way / fitted.width_mm) / max(abs(z), 1.0))
    share = of_tail if fitted.shape is Shape.TAIL else _FORM
    return replace(fitted, way_sigma_mm=float(np.hypot(fitted.way_sigma_mm, share * way)))


def _names(
    fitting: Sequence[Fitted], cells: Cells, geometry: LineGeometry, probe: Probe
) -> dict[str, Fitted]:
    """Return the effects whose shapes fit, each with the one that fits best."""
    law, named = scale_law(cells, geometry, probe), dict[str, Fitted]()
    for fitted in fitting:
        if fitted.shape is Shape.COPY:
            # A second line that overlaps the first is no more than a line of another shape.
            apart = abs(fitted.way_mm) > CLEAR_WIDTHS * fitted.width_mm
            for name in ("tube_ghost",) if apart else ("tube_ghost", *OF_A_TAIL):
                named.setdefault(name, fitted)
            continue
        blur_px2 = max(fitted.core * float(law.coefficient[1]), _SMALLEST_BLUR_PX2)
        edge = scale_by_edge_blur(blur_px2, geometry, probe)
        for name in _of_sheet_or_wall(fitted, law, probe.laser.line_sigma_mm, edge):
            named.setdefault(name, fitted)
    return named


def _of_sheet_or_wall(fitted: Fitted, law: Regression, stated_mm: float, edge: float) -> tuple[str, ...]:
    """Return whether sheet or wall makes light on one side, as far as the line's width separates them.

    A skewed sheet has the stated 1 σ together with its tail; light that returns from within the wall comes in
    addition to a sheet of the stated 1 σ. Where the widths refuse both, the errors are larger than known, and
    in the same ratio as the less refused one is off. ``edge`` is 1 σ of (σ / stated)² by blur.
    """
    if not _is_clear(fitted.way_mm, fitted.way_sigma_mm):
        return OF_A_TAIL
    added = fitted.added_mm2 / stated_mm**2
    of_shape = 2 * added * fitted.way_sigma_mm / abs(fitted.way_mm)
    sigma = float(np.linalg.norm([WIDTH_FLOOR, 2 * _STATED, edge, of_shape]))
    off = [_off(fitted.core, law, scale, sigma) for scale in (1 - added, 1.0)]
    if not np.isfinite(off).all():
        return OF_A_TAIL
    return tuple(n for n, o in zip(OF_A_TAIL, off, strict=True) if o <= _CLEARLY * max(1.0, min(off)))


def _is_clear(value: float, sigma: float) -> bool:
    return abs(value) > _CLEARLY * sigma


def _off(core: float, law: Regression, scale: float, sigma: float) -> float:
    """Return by how many σ (σ / stated)² of the line without the light beside it differs from ``scale``.

    The blur that is left for the lens is at least that of a pixel.
    """
    found, blur_px2 = core * law.coefficient[:2]
    covariance = core**2 * law.covariance[:2, :2]
    variance = max(float(covariance[0, 0]), 1e-300)
    rate = float(covariance[0, 1]) / variance
    left = blur_px2 + rate * (scale - found)
    spread = np.sqrt(max(float(covariance[1, 1]) - rate**2 * variance, 0.0))
    # 0.05 px² at least (chosen): a pixel's own variance, 1/12 px², is known no better.
    of_blur = (_SMALLEST_BLUR_PX2 - left) / max(spread, 0.05)
    return float(max(abs(found - scale) / np.hypot(np.sqrt(variance), sigma), of_blur))


def _renamed(found: Finding, names: Mapping[str, Fitted], clearest: Finding, stated_mm: float) -> Finding:
    """Return a finding with the size of the shape that fits it, or withdrawn if none does."""
    if found.effect not in names:
        return withdrawn(found)
    shape, rivals = names[found.effect], tuple(n for n in names if n != found.effect)
    if shape.shape is Shape.COPY and found.found:
        return replace(found, z=clearest.z, p_value=clearest.p_value, alike=rivals)
    size = _size(found, shape, stated_mm)
    sizes = (size,) if size is not None and _is_clear(size.value, size.sigma) else ()
    return finding(found.effect, clearest.z, clearest.p_value, sizes, _in_words(shape), alike=rivals)


def _size(found: Finding, shape: Fitted, stated_mm: float) -> Size | None:
    """Return the size of light on one side; the skewness of a sheet only from a tail, forward positive."""
    if shape.shape is Shape.COPY:
        return None
    way, sigma = abs(shape.way_mm), shape.way_sigma_mm
    if found.effect == "subsurface":
        return Size("transport_mm", "mm", way, sigma)
    if shape.shape is Shape.HALO:
        return None
    skewness = 2 * float(np.sign(shape.way_mm)) * (way / stated_mm) ** 3
    return Size("skewness", "", skewness, 3 * abs(skewness) * sigma / max(way, 1e-9))


def _in_words(shape: Fitted) -> str:
    left = f"{100 * shape.left:.1f} % of the misfit remain with this shape."
    if shape.shape is Shape.TAIL:
        # Forward along the axis is inward in the image.
        side = "inside" if shape.way_mm > 0 else "outside"
        return f"The line has an exponential tail of {abs(shape.way_mm):.3f} mm on its {side}. {left}"
    wider = f"wider than the line by {shape.spread_mm:.2f} mm (1 σ)"
    return (
        f"Beside the line there is light of {100 * shape.relative:.0f} % of its height, {shape.way_mm:+.2f} "
        f"mm from it along the axis and {wider if shape.spread_mm else 'as sharp as the line'}. {left}"
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
