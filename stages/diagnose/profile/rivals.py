"""Which of two effects that change the profile alike explains a finding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Float
from stages.diagnose.profile.cells import Cells, fit_gaussians
from stages.diagnose.profile.finding import Finding
from stages.diagnose.profile.skewed import cell_skewness, exponential_gaussian, skew_table

_REACH_WIDTHS, _STEP_WIDTHS = 7.0, 0.25
_OVERLAP_WIDTHS = 5.0
_SPOT_OR_PIXELS = {"dust": "fixed_pattern", "fixed_pattern": "dust"}


def settle(findings: tuple[Finding, ...], cells: Cells) -> tuple[Finding, ...]:
    """Return the findings, each effect kept only where no other found one explains it better.

    A skewed line and a copy on its shoulder look alike: the one that leaves less of the mean profile stays.
    A tail that light within the wall adds also widens the line, which is then no response's doing.
    """
    by_name = {f.effect: f for f in findings}
    lost: dict[str, str] = {}
    skewed = next((by_name[n] for n in ("line_skew", "subsurface") if by_name[n].found), None)
    if skewed is not None:
        copy = by_name["tube_ghost"]
        better = copy.found and _copy_is_better(cells, copy)
        for name in ("line_skew", "subsurface") if better else ("tube_ghost",):
            lost[name] = "tube_ghost" if better else skewed.effect
    if by_name["subsurface"].found and "subsurface" not in lost:
        lost |= {name: "subsurface" for name in ("gamma", "albedo_bias")}
    kept = (_yielded(f, lost[f.effect]) if f.effect in lost else f for f in findings)
    return tuple(_unrivalled(f, by_name) for f in kept)


def _unrivalled(finding: Finding, by_name: dict[str, Finding]) -> Finding:
    """Return a spot without the pixels' own gains as rival where these were measured and found even, or back.

    Gains of single pixels would show in their own test long before they made a dip in all frames.
    """
    rival = by_name.get(_SPOT_OR_PIXELS.get(finding.effect, ""))
    if rival is None or rival.found or not rival.sizes:
        return finding
    return replace(finding, alike=tuple(n for n in finding.alike if n != rival.effect))


def _yielded(finding: Finding, other: str) -> Finding:
    return replace(finding, p_value=1.0, alike=(other,), confirms=())


def _copy_is_better(cells: Cells, copy: Finding) -> bool:
    """Return whether a copy of the line leaves less of the mean profile than an exponential tail does."""
    relative, distance_mm = (s.value for s in copy.sizes)
    whole = cells.whole
    width = float(np.median(cells.width_px[whole]))
    apart = -distance_mm * float(np.median(cells.px_per_mm[whole])) / width
    if abs(apart) > _OVERLAP_WIDTHS:
        return True
    x = np.arange(-_REACH_WIDTHS, _REACH_WIDTHS + _STEP_WIDTHS / 2, _STEP_WIDTHS)
    rest = _mean_rest(cells, x)
    hermite = float(np.nanmedian(cell_skewness(cells)))
    table = skew_table()
    ratio = float(np.interp(abs(hermite), table.hermite, table.ratio))
    tail = _left_by_fit(exponential_gaussian(np.sign(hermite) * x, 1.0, ratio), x)
    second = _left_by_fit(np.exp(-0.5 * x**2) + relative * np.exp(-0.5 * (x - apart) ** 2), x)
    return bool(np.sum((rest - second) ** 2) < np.sum((rest - tail) ** 2))


def _mean_rest(cells: Cells, x: Float) -> Float:
    """Return the median over all cells of what a Gaussian leaves, at distances x (K,) in line widths."""
    whole = cells.whole
    place = (cells.offset_px - cells.centre_px[whole, None]) / cells.width_px[whole, None]
    rest = [np.interp(x, p, r) for p, r in zip(place, cells.rest[whole], strict=True)]
    return np.asarray(np.median(rest, axis=0))


def _left_by_fit(profile: Float, x: Float) -> Float:
    """Return what a Gaussian fit of a profile (K,), peak near 0, leaves over distances in fitted widths."""
    fine = np.arange(-12.0, 12.0, 0.05)
    at_peak = float(x[int(np.argmax(profile))])
    placed = np.interp(fine, x - at_peak, profile / profile.max(), left=0.0, right=0.0)
    centre, width, peak = fit_gaussians(placed[None], fine, start_px=1.0)
    rest = placed / peak[0] - np.exp(-0.5 * ((fine - centre[0]) / width[0]) ** 2)
    return np.asarray(np.interp(x, (fine - centre[0]) / width[0], rest))
