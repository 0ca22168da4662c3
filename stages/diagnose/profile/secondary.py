"""Findings of a second line: `ghost_ring` and `tube_ghost`."""

from __future__ import annotations

import numpy as np

from pipeline.instrument.probe import Probe
from stages.diagnose.profile.cells import Cells, LineGeometry
from stages.diagnose.profile.finding import Finding, Size, finding, untestable
from stages.diagnose.profile.ghost import SecondLine, bounced, copied
from stages.diagnose.profile.matched_filter import responses

# Light relative to the line's height that compression may leave on one side only: in places, and everywhere.
# Debt: data/debts.md.
BOUNCED_FLOOR, COPIED_FLOOR = 1e-3, 5e-4
# Error of a faint line's place, px; relative error, because the radius is that of the stated sheet.
# Debt: data/debts.md.
PLACE_FLOOR_PX, SCALE_FLOOR = 0.05, 0.01
_LEAST_CELLS = 30
_BETTER = 1.2
# The copy is preferred at this share of the misfit, because it has one parameter and the bounced line has
# three. Debt: data/debts.md.
_SIMPLER = 0.95


def ghost_findings(cells: Cells, geometry: LineGeometry, probe: Probe) -> tuple[Finding, Finding]:
    """Return the findings of `ghost_ring` and `tube_ghost`; of two that fit, the clearly better one is kept.

    The bounced line also measures the sheet's tilt and cone, whatever the camera's errors are.
    """
    if cells.whole.sum() < _LEAST_CELLS:
        why = "The line's middle is hardly ever seen unclipped: no fainter line can be compared with it."
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
