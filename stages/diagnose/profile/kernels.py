"""Compiled loops over the pixels near the line."""

from __future__ import annotations

import numba
import numpy as np

from stages.rings.kernels import first_at_least


@numba.njit(cache=True, nogil=True)
def fit_height(image, pixel, radius, offset, low, high, line, slope, width, trusted, out):  # type: ignore[no-untyped-def]
    """Least-squares height and background (``out``) of a Gaussian of known place and width; clipped left out.

    Returns the largest grey level near the line's middle.
    """
    n0 = n1 = n2 = v0 = v1 = top = 0.0
    for k in range(low, high):
        x = (radius[k] - line - slope * offset[k]) / width
        y = image[pixel[k]]
        if abs(x) < 1.0 and y > top:
            top = y
        if y > trusted:
            continue
        e = np.exp(-0.5 * x * x)
        n0 += 1.0
        n1 += e
        n2 += e * e
        v0 += y
        v1 += e * y
    det = n0 * n2 - n1 * n1
    if det <= 1e-6 * max(n0 * n2, 1e-12):
        out[0], out[1] = np.nan, np.nan
        return top
    out[0] = (n0 * v1 - n1 * v0) / det
    out[1] = (n2 * v0 - n1 * v1) / det
    return top


@numba.njit(cache=True, nogil=True)
def stack_frame(  # type: ignore[no-untyped-def]
    image, start, pixel, radius, offset, line, slope, width, usable, dark, trusted,
    fit_widths, core_widths, reach, step, light, height, share, gain,
):  # fmt: skip
    """Add one frame's pixels, in line-centred coordinates, to its sectors' profiles.

    ``light`` and ``height`` (S, B) take grey levels above the background and the line's height for every
    pixel that cannot have clipped; ``share`` (S, 3) counts samples, clipped ones and the largest level;
    ``gain`` (2, H·W) takes residual × model and model² of the line's bright pixels. ``dark`` is the grey
    level without light.
    """
    azimuths, sectors = start.size - 1, light.shape[0]
    fit = np.empty(2)
    for a in range(azimuths):
        if not usable[a]:
            continue
        s = a * sectors // azimuths
        half = fit_widths * width[a]
        low = first_at_least(radius, start[a], start[a + 1], line[a] - half)
        high = first_at_least(radius, low, start[a + 1], line[a] + half)
        top = fit_height(image, pixel, radius, offset, low, high, line[a], slope[a], width[a], trusted, fit)
        share[s, 0] += 1.0
        share[s, 2] = max(share[s, 2], top)
        if np.isnan(fit[0]) or fit[0] <= 0:
            continue
        clipped = top > trusted or fit[0] + dark > trusted
        share[s, 1] += 1.0 if clipped else 0.0
        k = first_at_least(radius, start[a], start[a + 1], line[a] - reach - 1.0)
        while k < start[a + 1] and radius[k] < line[a] + reach + 1.0:
            t = radius[k] - line[a] - slope[a] * offset[k]
            y = image[pixel[k]]
            b = int(np.floor((t + reach) / step))
            if 0 <= b < light.shape[1] and (not clipped or abs(t) > core_widths * width[a]):
                light[s, b] += y - dark
                height[s, b] += fit[0]
                x = t / width[a]
                if abs(x) < 1.5 and not clipped:
                    m = fit[0] * np.exp(-0.5 * x * x)
                    gain[0, pixel[k]] += (y - dark - m) * m
                    gain[1, pixel[k]] += m * m
            k += 1
