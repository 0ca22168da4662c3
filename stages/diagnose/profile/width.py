"""How wide the line is: against the image's scale, and against how fast it moves."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Bool, Float, Int
from pipeline.instrument.probe import Probe
from stages.diagnose.profile.cells import Cells, LineGeometry
from stages.diagnose.profile.finding import (
    Finding,
    Regression,
    Size,
    finding,
    regress,
    tested,
    untestable,
)

# Changes of (line σ / stated)² and of exposure², s², that compression and clipped neighbours may cause.
# Debt: data/debts.md.
SCALE_FLOOR, EXPOSURE2_FLOOR = 0.03, 2e-5
_LEAST_SCALE_SPREAD = 0.05


def width_findings(cells: Cells, geometry: LineGeometry, probe: Probe) -> tuple[Finding, Finding]:
    """Return the findings of `gamma` and `albedo_bias`: width² = blur² + s (stated σ · px per mm)².

    A response I^γ divides all widths² by γ; a wider sheet than stated changes s alone. The blur is not
    stated, so the two look alike here.
    """
    stated = stated_variance(geometry, probe)
    fit = scale_law(cells, geometry, probe)
    spread = np.nanstd(stated) / np.nanmean(stated) if np.isfinite(stated).any() else 0.0
    if not np.isfinite(fit.sigma[0]) or spread < _LEAST_SCALE_SPREAD:
        why = "The line is seen at one scale only: its own width and the image's blur cannot be told apart."
        return untestable("gamma", why), untestable("albedo_bias", why)
    scale = float(fit.coefficient[0])
    test = tested(scale - 1, float(fit.sigma[0]), SCALE_FLOOR, fit.groups)
    sigma = test.sigma
    safe = max(scale, 0.05)
    exponent = Size("exponent", "", 1 / safe, sigma / safe**2)
    stated_mm = probe.laser.line_sigma_mm
    line = Size("line_sigma_mm", "mm", stated_mm * np.sqrt(safe), stated_mm * sigma / (2 * np.sqrt(safe)))
    seen = f"The line's width² follows the image's scale with {scale:.3f} ± {sigma:.3f} of what is stated."
    return (
        finding("gamma", test.z, test.p_value, (exponent,), seen, alike=("albedo_bias",)),
        finding("albedo_bias", test.z, test.p_value, (line,), seen, alike=("gamma",)),
    )


def stated_variance(geometry: LineGeometry, probe: Probe) -> Float:
    """Return (F, S) the stated line's variance in the image, px²."""
    return np.asarray((probe.laser.line_sigma_mm * geometry.px_per_mm) ** 2)


def scale_law(cells: Cells, geometry: LineGeometry, probe: Probe) -> Regression:
    """Regress width², px², on the stated line's and on 1: (σ / stated)², blur², fixed patterns."""
    stated = stated_variance(geometry, probe)
    design = np.stack([stated, np.ones_like(stated), *_fixed_patterns(geometry)], axis=-1)
    width2 = (geometry.width_px**2).ravel()
    return regress(design.reshape(-1, design.shape[-1]), width2, _groups(cells, geometry))


def blur_finding(cells: Cells, geometry: LineGeometry, probe: Probe) -> Finding:
    """Return the finding of `motion_blur`: width² grows by (speed · exposure)² / 12.

    Each frame's own mean is taken out, so that only the pattern around the ring counts.
    """
    columns = [
        geometry.speed_px_s**2 / 12,
        stated_variance(geometry, probe),
        1 / geometry.height,
        *_fixed_patterns(geometry),
    ]
    design = np.stack(columns, axis=-1)
    width2 = geometry.width_px**2
    known = np.isfinite(width2) & np.isfinite(design).all(-1)
    design, width2 = _without_frame_means(design, known), _without_frame_means(width2[..., None], known)
    fit = regress(design.reshape(-1, design.shape[-1]), width2.ravel(), _groups(cells, geometry))
    if not np.isfinite(fit.sigma[0]):
        return untestable("motion_blur", "The line does not move enough for its width to tell the exposure.")
    exposure2, own = float(fit.coefficient[0]), probe.shutter.exposure_s
    test = tested(exposure2 - own**2, float(fit.sigma[0]), EXPOSURE2_FLOOR, fit.groups)
    sigma = test.sigma
    total = np.sqrt(max(exposure2, 0.0))
    size = Size("exposure_s", "s", float(total - own), sigma / (2 * max(total, np.sqrt(sigma))))
    return finding(
        "motion_blur", test.z, test.p_value, (size,),
        f"The line widens with its own speed as an exposure of {1e3 * total:.1f} ms makes it.",
    )  # fmt: skip


def _fixed_patterns(geometry: LineGeometry) -> list[Float]:
    """Return patterns that stay with the camera: a tilted sheet's false radius, pixels seen askew."""
    psi = np.broadcast_to(geometry.azimuth_rad, geometry.px_per_mm.shape)
    return [f(order * psi) for order in (1, 2, 4) for f in (np.cos, np.sin)]


def _groups(cells: Cells, geometry: LineGeometry) -> Int:
    """Return the block (F · S,) of every sector of every frame; −1 for frames of no block."""
    group = np.full(len(geometry.steady), -1)
    for k, rows in enumerate(cells.frames):
        group[rows] = k
    return np.repeat(group, len(geometry.azimuth_rad))


def _without_frame_means(values: Float, known: Bool) -> Float:
    """Return values (F, S, K) less each frame's mean over what is known; NaN elsewhere."""
    some = np.where(known[..., None], values, 0.0)
    mean = some.sum(1, keepdims=True) / np.maximum(known.sum(1), 1)[:, None, None]
    return np.where(known[..., None], values - mean, np.nan)
