"""Which name a found asymmetry of the line gets: that of the shapes that fit it, or none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.instrument.probe import Probe
from stages.diagnose.profile.cells import Cells, LineGeometry
from stages.diagnose.profile.finding import Finding, Size, finding, withdrawn
from stages.diagnose.profile.line_spread import Fitted, Shape, explanations, line_spread, without_mean_shape
from stages.diagnose.profile.secondary import ghost_findings, without_bounced_line
from stages.diagnose.profile.shape import WIDTH_FLOOR, skew_findings
from stages.diagnose.profile.width import scale_law, width_findings

UNEXPLAINED = "unexplained"
_CLEARLY = 3.0
# Relative error of the mean way of scattered light, because nobody knows the form of its profile. Debt:
# data/debts.md.
_FORM = 0.1


def shape_findings(cells: Cells, geometry: LineGeometry, probe: Probe) -> tuple[Finding, ...]:
    """Return the findings of the line's shape: second lines, tails and widths, named by the shapes that fit.

    Where the line is not alike on both sides and no shape with a name fits, all of them are withdrawn, and a
    finding `UNEXPLAINED` tells of it.
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
    names = _names(fitting, all_round, cells, geometry, probe)
    return (ring, *(_renamed(f, names, clearest, fitting) for f in all_round), *widths_off)


def _asymmetries(cells: Cells, geometry: LineGeometry, probe: Probe) -> list[Finding]:
    """Return the findings of `ghost_ring` and, after it, of all that is alike all round."""
    ring, copy = ghost_findings(cells, geometry, probe)
    return [ring, *skew_findings(cells, geometry, probe), copy]


def _told_apart(
    ring: Finding, all_round: list[Finding], cells: Cells, geometry: LineGeometry, probe: Probe
) -> tuple[Finding, list[Finding], Cells]:
    """Return a line bounced across the bore and what is alike all round, each if it stands without the other.

    The cells are those without the bounced line, where it stands.
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


def _names(
    fitting: Sequence[Fitted],
    all_round: Sequence[Finding],
    cells: Cells,
    geometry: LineGeometry,
    probe: Probe,
) -> tuple[str, ...]:
    """Return the effects whose shapes fit; the line's width tells light in the wall from the sheet's own."""
    shapes = {f.shape: f for f in fitting}
    names = ["tube_ghost"] if Shape.COPY in shapes else []
    if Shape.TAIL in shapes:
        left = [f.effect for f in all_round[:2] if f.found]
        names += left or ["line_skew", "subsurface"]
    if Shape.HALO in shapes:
        stated = _core_as_stated(shapes[Shape.HALO], cells, geometry, probe)
        names += ["subsurface"] if stated else ["line_skew", "subsurface"]
    return tuple(names)


def _core_as_stated(halo: Fitted, cells: Cells, geometry: LineGeometry, probe: Probe) -> bool:
    """Return whether the line without what is washed out has the width that is stated of the sheet."""
    law = scale_law(cells, geometry, probe)
    scale, sigma = halo.core * float(law.coefficient[0]), halo.core * float(law.sigma[0])
    return bool(abs(scale - 1) < _CLEARLY * np.hypot(sigma, WIDTH_FLOOR))


def _renamed(found: Finding, names: tuple[str, ...], clearest: Finding, fitting: Sequence[Fitted]) -> Finding:
    """Return a finding with what the shapes that fit say of it."""
    name = found.effect
    if name not in names:
        return withdrawn(found)
    rivals = tuple(n for n in names if n != name)
    shape = _shape_of(name, fitting)
    if shape.shape is Shape.HALO:
        return _halo(name, shape, clearest, rivals)
    return replace(found, z=clearest.z, p_value=clearest.p_value, alike=rivals)


def _shape_of(name: str, fitting: Sequence[Fitted]) -> Fitted:
    of_copy = [f for f in fitting if (f.shape is Shape.COPY) == (name == "tube_ghost")]
    return of_copy[0]


def _halo(name: str, halo: Fitted, clearest: Finding, rivals: tuple[str, ...]) -> Finding:
    """Return the finding of light that lies washed out beside the line."""
    sigma = float(np.hypot(halo.way_sigma_mm, _FORM * halo.way_mm))
    size = () if name == "line_skew" else (Size("transport_mm", "mm", abs(halo.way_mm), sigma),)
    return finding(
        name, clearest.z, clearest.p_value, size,
        f"Beside the line lies light of {100 * halo.relative:.0f} % of its height, {halo.way_mm:+.2f} mm "
        f"along the axis from it and wider than the line by {halo.spread_mm:.2f} mm (1 σ). This shape leaves "
        f"{100 * halo.left:.1f} % of the misfit.",
        alike=rivals,
    )  # fmt: skip


def _unexplained(clearest: Finding) -> Finding:
    """Return the finding that the line is asymmetric and no shape with a name fits it."""
    return finding(
        UNEXPLAINED, clearest.z, clearest.p_value, (),
        f"The line is not alike on both sides ({abs(clearest.z):.1f} σ), and neither an exponential tail, "
        "nor a second line, nor light that is washed out fits its shape.",
    )  # fmt: skip
