"""Computes the contrast of an unrolled strip without the illumination, and equally sharp near and far.

Both a gradient of the light and a change of sharpness within a patch shift its match, always in the same
direction. The shift would look like an error of lens or distance, so both are removed before patches are
compared.
"""

from __future__ import annotations

import cv2
import numba
import numpy as np
from scipy.ndimage import gaussian_filter1d

from pipeline.arrays import Bool, Float, Float32
from pipeline.system.parallel import side_by_side
from stages.rings.kernels import FAST

SOFTENING_PX = 1.2
"""σ, image px, of the blur of a picture before it is sampled, so that noise finer than a strip sample does
not alias into it. Chosen for the open recordings, not measured since."""
_IMAGE_BLUR_PX = 1.5
"""σ, image px, of the whole blur: √(1.2² + 0.9²), where 0.9 px of lens and pixel are assumed."""
_SMOOTHED_ROWS = 3.0
"""σ, rows, over which the mean brightness of rows is smoothed: so few that the rest of the light within a
patch of 21 rows is small, so many that single bright rows of the wall are kept. Not measured."""
_FEWEST_USABLE = 0.1
"""Rows with a smaller usable share get the mean brightness of their neighbours. Not measured."""
_LEAST_SMOOTHING = 0.7
"""σ, strip samples, by which even the most blurred row is smoothed, against noise. Not measured."""
_BLURS = 4
"""Number of blurs computed; rows between mix two of them, since one blur for each row would be too slow."""


def without_illumination(grey: Float32, usable: Bool) -> Float32:
    """Return grey (H, W) over the mean brightness of its rows, minus 1; 0 where unusable.

    The predicted light has been divided out before. The rest along the pipe, equal all round, is removed
    here. A local mean would follow the light as well, but at the border of the usable part it sees one side
    only and shifts the texture there.
    """
    mean, count = _row_means(grey, usable)
    row = np.arange(len(mean))
    known = count > _FEWEST_USABLE * grey.shape[1]
    if not known.any():
        return np.zeros_like(grey)
    mean = gaussian_filter1d(np.interp(row, row[known], mean[known]), _SMOOTHED_ROWS)
    return np.asarray(_over(grey, usable, np.maximum(mean, 1.0).astype(np.float32)))


def equally_sharp(contrast: Float32, coarse_uv: Float32, steps: tuple[int, int]) -> Float32:
    """Return contrast (H, W) smoothed row by row until the near wall is as blurred as the far one.

    The blur of the picture covers more wall far ahead than near the camera. A few blurs are computed and
    mixed by variance.

    Parameters
    ----------
    contrast : (H, W)
    coarse_uv : (H / n + 1, W / m + 1, 2)
        Pixels of every nth row and mth column.
    steps : (int, int)
        n and m.
    """
    along, around = (_blur_variance(coarse_uv, steps, axis) for axis in (0, 1))
    wanted = np.sqrt(np.stack([along.max() - along, around.max() - around], -1) + _LEAST_SMOOTHING**2)
    share = np.linspace(0, 1, _BLURS)
    sizes = wanted.min(0) + share[:, None] * (wanted.max(0) - wanted.min(0))
    level = (_BLURS - 1) * np.clip((wanted[:, 0] - sizes[0, 0]) / max(np.ptp(sizes[:, 0]), 1e-6), 0, 1)
    weights = [np.maximum(1 - np.abs(level - k), 0).astype(np.float32)[:, None] for k in range(_BLURS)]
    parts = [(k, slice(r[0], r[-1] + 1)) for k, w in enumerate(weights) if (r := np.flatnonzero(w)).size]
    blurred = side_by_side(lambda part: _blurred(contrast, part[1], *sizes[part[0]]), parts)
    out = np.zeros_like(contrast)
    for (k, part), smooth in zip(parts, blurred, strict=True):
        out[part] += weights[k][part] * smooth
    return out


def correlated_samples(px_per_sample: Float) -> Float:
    """Return the number of samples (M,) of a strip with one common error: 4πs² for a blur of 1 σ s."""
    blur = (SOFTENING_PX / np.maximum(px_per_sample, 1e-3)) ** 2 + _LEAST_SMOOTHING**2
    return np.asarray(1 + 4 * np.pi * blur)


def noise_of_rows(contrast: Float32, usable: Bool) -> Float32:
    """Return the noise (H,), 1 σ from one sample to the next, of each row of contrast (H, W).

    It is measured by second differences around the pipe, over every other sample, which contain hardly any
    texture.
    """
    power, share = _second_differences(contrast, usable)
    known = gaussian_filter1d(share, 2 * _SMOOTHED_ROWS)
    return np.sqrt(gaussian_filter1d(power, 2 * _SMOOTHED_ROWS) / np.maximum(known, 1e-3)).astype(np.float32)


def _blurred(contrast: Float32, part: slice, sigma_along: float, sigma_around: float) -> Float32:
    """Return some rows of the blurred strip; only these and the rows within the blur are computed."""
    more = int(np.ceil(5 * sigma_along)) + 1
    first = max(part.start - more, 0)
    wide = cv2.GaussianBlur(contrast[first : part.stop + more], (0, 0), sigma_around, None, sigma_along)
    return np.asarray(wide[part.start - first : part.stop - first])


def _blur_variance(coarse_uv: Float32, steps: tuple[int, int], axis: int) -> Float:
    """Return the variance (H,), squared strip samples, of the blur along (axis 0) or around the pipe (1)."""
    along_u, along_v = (np.diff(coarse_uv[..., k].astype(np.float64), axis=axis) for k in range(2))
    moved_px = np.sqrt(along_u * along_u + along_v * along_v) / steps[axis]
    # nan_to_num and median take a tenth of the time of nanmedian.
    px_per_sample = np.median(np.nan_to_num(moved_px, nan=1.0), axis=1)
    variance = (_IMAGE_BLUR_PX / np.maximum(px_per_sample, 1e-3)) ** 2
    rows = (np.arange((coarse_uv.shape[0] - 1) * steps[0]) + 0.5) / steps[0]
    return np.asarray(np.interp(rows, np.arange(len(variance)) + (0.5 if axis == 0 else 0.0), variance))


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _row_means(grey, usable):  # type: ignore[no-untyped-def]
    """Return the mean (H,) of each row's usable samples, and their number."""
    mean, count = np.zeros(len(grey)), np.zeros(len(grey), np.int64)
    for i in range(grey.shape[0]):
        total, many = np.float32(0), 0
        for j in range(grey.shape[1]):
            total += grey[i, j] if usable[i, j] else np.float32(0)
            many += usable[i, j]
        mean[i], count[i] = total / max(many, 1), many
    return mean, count


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _over(grey, usable, mean):  # type: ignore[no-untyped-def]
    """Return grey over the ``mean`` (H,) of its row, minus 1; 0 where unusable."""
    out = np.empty_like(grey)
    for i in range(grey.shape[0]):
        for j in range(grey.shape[1]):
            out[i, j] = grey[i, j] / mean[i] - np.float32(1) if usable[i, j] else np.float32(0)
    return out


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _second_differences(contrast, usable):  # type: ignore[no-untyped-def]
    """Return a sixth of each row's mean square (H,), and the share (H,) that is usable.

    White noise of variance v gives second differences of variance (1 + 4 + 1) v.
    """
    rows, columns = contrast.shape
    power, share = np.zeros(rows), np.zeros(rows)
    for i in range(rows):
        total, count = np.float32(0), 0
        for j in range(columns - 4):
            d = contrast[i, j + 4] - np.float32(2) * contrast[i, j + 2] + contrast[i, j]
            ok = usable[i, j + 4] and usable[i, j + 2] and usable[i, j]
            total += d * d if ok else np.float32(0)
            count += ok
        power[i], share[i] = total / max(count, 1) / 6, count / (columns - 4)
    return power, share
