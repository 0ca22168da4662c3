"""Regressions on the line's width and place: on the image's scale, its speed, and the sensor's pixels."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.probe import Probe
from stages.diagnose.profile.cells import Cells, LineGeometry
from stages.diagnose.profile.finding import Finding, Regression, Size, finding, regress, tested, untestable
from stages.diagnose.profile.measure import LineProfiles

# Changes of (line σ / stated)² and of exposure², s², that compression and clipped neighbours may cause. Debt:
# data/debts.md.
SCALE_FLOOR, EXPOSURE2_FLOOR = 0.03, 2e-5
_LEAST_SCALE_SPREAD = 0.05
# 1 σ of the growth of blur² from the optical axis to the edge of the picture, relative to blur² (chosen:
# lenses are less sharp at their edge, and no data sheet of a probe says by how much). A finding needs 6 σ:
# blur that is twice as wide at the edge, three times the variance more, makes none. Debt: data/debts.md.
_EDGE_BLUR = 0.5
# Apparent pixel locking by pixel integration, rounding and compression, px. Debt: data/debts.md.
LOCKING_FLOOR_PX = 1.5e-3
# Apparent gains by speckle on a wall at rest; those by compression are measured. Debt: data/debts.md.
GAIN_FLOOR = 0.01
# Codecs code blocks of 8 px, so that their errors are correlated over several pixels. Gains are compared
# along rows; pixels above each other are in different rows, where gains of single pixels have nothing in
# common.
_ROWS_APART = (1, 2, 3, 4)
_SMOOTH_AZIMUTHS = 41
_LEAST_SEEN = 3.0e3
_LEAST_PIXELS = 500
_TILE_PX = 64


def width_findings(cells: Cells, geometry: LineGeometry, probe: Probe) -> tuple[Finding, Finding]:
    """Return the findings of `gamma` and `albedo_bias`: width² = blur² + s (stated σ · px per mm)².

    A response I^γ divides all widths² by γ; a wider sheet than stated changes only s. The blur is not stated,
    so that both look the same here. Its growth towards the edge of the picture is not stated either, and as
    the scale changes with the place in the picture as well, s is no surer than that.
    """
    stated = stated_variance(geometry, probe)
    fit = scale_law(cells, geometry, probe)
    spread = np.nanstd(stated) / np.nanmean(stated) if np.isfinite(stated).any() else 0.0
    if not np.isfinite(fit.sigma[0]) or spread < _LEAST_SCALE_SPREAD:
        why = "The line is seen at one scale only: its own width and the image's blur look the same."
        return untestable("gamma", why), untestable("albedo_bias", why)
    scale = float(fit.coefficient[0])
    floor = float(np.hypot(SCALE_FLOOR, scale_by_edge_blur(float(fit.coefficient[1]), geometry, probe)))
    test = tested(scale - 1, float(fit.sigma[0]), floor, fit.groups)
    sigma = test.sigma
    safe = max(scale, 0.05)
    exponent = Size("exponent", "", 1 / safe, sigma / safe**2)
    stated_mm = probe.laser.line_sigma_mm
    line = Size("line_sigma_mm", "mm", stated_mm * np.sqrt(safe), stated_mm * sigma / (2 * np.sqrt(safe)))
    seen = f"The width² that the line has on the wall is {scale:.3f} ± {sigma:.3f} times the stated."
    return (
        finding("gamma", test.z, test.p_value, (exponent,), seen, alike=("albedo_bias",)),
        finding("albedo_bias", test.z, test.p_value, (line,), seen, alike=("gamma",)),
    )


def stated_variance(geometry: LineGeometry, probe: Probe) -> Float:
    """Return the stated line's variance in the image (F, S), px²."""
    return np.asarray((probe.laser.line_sigma_mm * geometry.px_per_mm) ** 2)


def scale_by_edge_blur(blur_px2: float, geometry: LineGeometry, probe: Probe) -> float:
    """Return 1 σ of (σ / stated)² by blur that grows towards the picture's edge by an unknown amount."""
    stated, edge_px = stated_variance(geometry, probe), min(probe.camera.image_size) / 2
    grown = _EDGE_BLUR * max(blur_px2, 0.0) * (geometry.radius_px / edge_px) ** 2
    known = np.isfinite(stated) & np.isfinite(grown) & np.isfinite(geometry.width_px)
    around = stated[known] - stated[known].mean()
    return float(abs(around @ grown[known]) / (around @ around))


def scale_law(cells: Cells, geometry: LineGeometry, probe: Probe) -> Regression:
    """Regress width², px², on the stated line's and on 1: (σ / stated)², blur², camera patterns."""
    stated = stated_variance(geometry, probe)
    design = np.stack([stated, np.ones_like(stated), *_fixed_patterns(geometry)], axis=-1)
    return regress(design, geometry.width_px**2, cells.block_of_frames(len(stated)))


def blur_finding(cells: Cells, geometry: LineGeometry, probe: Probe) -> Finding:
    """Return the finding of `motion_blur`: width² grows by (speed · exposure)² / 12.

    Each frame's own mean is subtracted, so that only the pattern around the ring counts.
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
    fit = regress(design, width2[..., 0], cells.block_of_frames(len(width2)))
    own = probe.shutter.exposure_s
    test = fit.test(0, EXPOSURE2_FLOOR, own**2)
    if test is None:
        return untestable("motion_blur", "The line does not move enough for its width to show the exposure.")
    total, sigma = np.sqrt(max(float(fit.coefficient[0]), 0.0)), test.sigma
    size = Size("exposure_s", "s", float(total - own), sigma / (2 * max(total, np.sqrt(sigma))))
    return finding(
        "motion_blur", test.z, test.p_value, (size,),
        f"The line widens with its speed as an exposure of {1e3 * total:.1f} ms makes it.",
    )  # fmt: skip


def _fixed_patterns(geometry: LineGeometry) -> list[Float]:
    """Return patterns fixed to the camera: a tilted sheet's apparent radius, obliquely seen pixels."""
    psi = np.broadcast_to(geometry.azimuth_rad, geometry.px_per_mm.shape)
    return [f(order * psi) for order in (1, 2, 4) for f in (np.cos, np.sin)]


def _without_frame_means(values: Float, known: Bool) -> Float:
    """Return values (F, S, K) minus each frame's mean over known ones; NaN elsewhere."""
    some = np.where(known[..., None], values, 0.0)
    mean = some.sum(1, keepdims=True) / np.maximum(known.sum(1), 1)[:, None, None]
    return np.where(known[..., None], values - mean, np.nan)


def locking_finding(rings: RingSamples, profiles: LineProfiles, cells: Cells) -> Finding:
    """Return the finding of `pixel_locking`: the line's radius is displaced by a sin 2πρ.

    What is smooth around the ring is subtracted from radius and prediction: it belongs to the pipe.
    """
    rows = np.concatenate([profiles.row[b] for b in cells.frames]) if cells.frames else np.empty(0, int)
    if not len(rows):
        return untestable("pixel_locking", "The ring never keeps its size long enough.")
    group = np.repeat(np.arange(len(cells.frames)), [len(b) for b in cells.frames])
    valid = rings.valid[rows]
    smooth = _smoothed(rings.radius_px[rows].astype(float), valid)
    rough = np.where(valid, rings.radius_px[rows] - smooth, np.nan)
    phase = 2 * np.pi * smooth
    parts = [np.where(valid, f(phase) - _smoothed(f(phase), valid), np.nan) for f in (np.sin, np.cos)]
    fit = regress(np.stack(parts, axis=-1), rough, group)
    test = fit.test_wave(LOCKING_FLOOR_PX)
    if test is None:
        return untestable("pixel_locking", "The line is at the same fraction of a pixel everywhere.")
    size, sigma = float(np.hypot(*fit.coefficient)), test.sigma
    return finding(
        "pixel_locking", test.z, test.p_value,
        (Size("amplitude_px", "px", float(fit.coefficient[0]), sigma),),
        f"The line's measured radius varies with the fraction of a pixel by {size:.4f} ± {sigma:.4f} px.",
    )  # fmt: skip


def pattern_finding(profiles: LineProfiles, image_size: tuple[int, int]) -> Finding:
    """Return the finding of `fixed_pattern`: gains of single pixels that two halves of the frames share.

    The covariance of the halves is the variance of what is fixed to the pixels. A pixel is compared with its
    neighbours in the row, which cancels the line's own shape. What pixels above each other have in common is
    not their own: it comes from codec and line, and counts as an error of the variance.
    """
    gain, seen = _gains(profiles, image_size)
    rough = [g - _row_means(g, s) for g, s in zip(gain, seen, strict=True)]
    tiles = _tiles(image_size)
    fit = _in_common(rough, seen, tiles, 0)
    if fit is None:
        return untestable("fixed_pattern", "No pixels show the line in both halves of the frames.")
    variance = float(fit.coefficient[0]) * 1.5
    apart = [one for rows in _ROWS_APART if (one := _in_common(rough, seen, tiles, rows)) is not None]
    shared = max((abs(float(one.coefficient[0])) for one in apart), default=0.0)
    floor = float(np.hypot(GAIN_FLOOR**2, 1.5 * shared))
    test = tested(variance, 1.5 * float(fit.sigma[0]), floor, fit.groups)
    sigma = test.sigma
    size = float(np.sqrt(max(variance, 0.0)))
    return finding(
        "fixed_pattern", test.z, test.p_value,
        (Size("relative", "", size, sigma / (2 * max(size, np.sqrt(sigma)))),),
        f"Pixels differ in gain by {100 * size:.2f} % (1 σ).", alike=("dust",),
    )  # fmt: skip


def _in_common(rough: list[Float], seen: list[Bool], tiles: Int, rows: int) -> Regression | None:
    """Return the halves' covariance of pixels ``rows`` rows apart; None with too few pixels."""
    other, shows = np.roll(rough[1], -rows, 0), np.roll(seen[1], -rows, 0)
    both = seen[0] & shows
    if np.count_nonzero(both) < _LEAST_PIXELS:
        return None
    return regress(np.ones((np.count_nonzero(both), 1)), (rough[0] * other)[both], tiles[both])


def _smoothed(values: Float, valid: Bool) -> Float:
    """Return running means around the ring over valid values."""
    some = np.where(valid, values, 0.0)
    total = uniform_filter1d(some, _SMOOTH_AZIMUTHS, axis=1, mode="wrap")
    weight = uniform_filter1d(valid.astype(float), _SMOOTH_AZIMUTHS, axis=1, mode="wrap")
    return np.asarray(total / np.maximum(weight, 1e-3))


def _gains(profiles: LineProfiles, image_size: tuple[int, int]) -> tuple[list[Float], list[Bool]]:
    """Return, for both halves, the relative gain minus 1 of every pixel (H, W), and where it is seen."""
    gains, seen = [], []
    for residual, square in profiles.gain:
        enough = square > _LEAST_SEEN
        gains.append(np.where(enough, residual / np.maximum(square, 1e-9), 0.0).reshape(image_size[::-1]))
        seen.append(enough.reshape(image_size[::-1]))
    return gains, seen


def _row_means(values: Float, seen: Bool) -> Float:
    """Return the mean of the two neighbours in the row, as far as they are seen."""
    left, right = np.roll(values, 1, 1), np.roll(values, -1, 1)
    a, b = np.roll(seen, 1, 1), np.roll(seen, -1, 1)
    return np.asarray((left * a + right * b) / np.maximum(a.astype(float) + b, 1.0))


def _tiles(image_size: tuple[int, int]) -> Int:
    v, u = np.mgrid[: image_size[1], : image_size[0]]
    return np.asarray((v // _TILE_PX) * 1000 + u // _TILE_PX)
