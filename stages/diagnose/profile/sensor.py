"""Errors fixed to the sensor's pixels: locking of the line to pixels, and unequal gains."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import RingSamples
from stages.diagnose.profile.cells import Cells
from stages.diagnose.profile.finding import (
    Finding,
    Regression,
    Size,
    finding,
    regress,
    tested,
    untestable,
)
from stages.diagnose.profile.measure import LineProfiles

# Locking of a line to pixels by pixel integration, rounding and compression, px. Debt: data/debts.md.
LOCKING_FLOOR_PX = 1.5e-3
# Gains that speckle on a wall at rest may imitate; what compression imitates is measured. Debt:
# data/debts.md.
GAIN_FLOOR = 0.01
# Codecs code blocks of 8 px, so that what they leave is alike over several pixels. Those above each other lie
# across the rows along which gains are compared, so that gains of single pixels have nothing in common there.
_ROWS_APART = (1, 2, 3, 4)
_SMOOTH_AZIMUTHS = 41
_LEAST_SEEN = 3.0e3
_LEAST_PIXELS = 500
_TILE_PX = 64


def locking_finding(rings: RingSamples, profiles: LineProfiles, cells: Cells) -> Finding:
    """Return the finding of `pixel_locking`: the line's radius pulled by a sin 2πρ.

    Radius and prediction are both freed of what is smooth around the ring: that is the pipe's.
    """
    rows = np.concatenate([profiles.row[b] for b in cells.frames]) if cells.frames else np.empty(0, int)
    if not len(rows):
        return untestable("pixel_locking", "No steady frames.")
    group = np.repeat(np.arange(len(cells.frames)), [len(b) for b in cells.frames])
    valid = rings.valid[rows]
    smooth = _smoothed(rings.radius_px[rows].astype(float), valid)
    rough = np.where(valid, rings.radius_px[rows] - smooth, np.nan)
    phase = 2 * np.pi * smooth
    parts = [np.where(valid, f(phase) - _smoothed(f(phase), valid), np.nan) for f in (np.sin, np.cos)]
    design = np.stack(parts, axis=-1).reshape(-1, 2)
    fit = regress(design, rough.ravel(), np.repeat(group, rough.shape[1]))
    if not np.isfinite(fit.sigma[0]):
        return untestable("pixel_locking", "The line keeps to one place of its pixels.")
    size = float(np.hypot(*fit.coefficient))
    random = float(np.sqrt(np.trace(fit.covariance) / 2))
    test = tested(size, random, LOCKING_FLOOR_PX, fit.groups)
    sigma = test.sigma
    return finding(
        "pixel_locking", test.z, test.p_value,
        (Size("amplitude_px", "px", float(fit.coefficient[0]), sigma),),
        f"The line's radius follows the pixels by {size:.4f} ± {sigma:.4f} px.",
    )  # fmt: skip


def pattern_finding(profiles: LineProfiles, image_size: tuple[int, int]) -> Finding:
    """Return the finding of `fixed_pattern`: gains of single pixels, alike in two halves of the frames.

    The halves' covariance is the variance of what stays in the pixels. A pixel is compared with its
    neighbours along the row, so that the line's own shape falls out. What pixels above each other have in
    common is not their own: that is what codec and line leave, and it counts as an error of the variance.
    """
    gain, seen = _gains(profiles, image_size)
    rough = [g - _row_means(g, s) for g, s in zip(gain, seen, strict=True)]
    tiles = _tiles(image_size)
    fit = _in_common(rough, seen, tiles, 0)
    if fit is None:
        return untestable("fixed_pattern", "The line does not come back to the same pixels.")
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
        f"Pixels keep gains of their own of {100 * size:.2f} % (1 σ).", alike=("dust",),
    )  # fmt: skip


def _in_common(rough: list[Float], seen: list[Bool], tiles: Int, rows: int) -> Regression | None:
    """Return the halves' covariance of pixels so many rows apart; None where too few are seen."""
    other, shows = np.roll(rough[1], -rows, 0), np.roll(seen[1], -rows, 0)
    both = seen[0] & shows
    if np.count_nonzero(both) < _LEAST_PIXELS:
        return None
    return regress(np.ones((np.count_nonzero(both), 1)), (rough[0] * other)[both], tiles[both])


def _smoothed(values: Float, valid: Bool) -> Float:
    """Return running means around the ring of what is valid."""
    some = np.where(valid, values, 0.0)
    total = uniform_filter1d(some, _SMOOTH_AZIMUTHS, axis=1, mode="wrap")
    weight = uniform_filter1d(valid.astype(float), _SMOOTH_AZIMUTHS, axis=1, mode="wrap")
    return np.asarray(total / np.maximum(weight, 1e-3))


def _gains(profiles: LineProfiles, image_size: tuple[int, int]) -> tuple[list[Float], list[Bool]]:
    """Return for both halves the relative gain less 1 of every pixel (H, W), and where it is seen."""
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
