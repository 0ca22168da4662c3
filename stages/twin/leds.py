"""Light of a ring of LEDs on the wall."""

from __future__ import annotations

import numba
import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.probe import Lighting


def even_light(lighting: Lighting, xyz_c: Float, normal_c: Float) -> Float:
    """Return the irradiance (...), 1/mm², at wall points (..., 3) by LEDs that emit uniformly.

    cos(angle at the wall) / distance², averaged over the LEDs. Their real lobe is estimated from the frames.
    """
    turn = 2 * np.pi * np.arange(lighting.leds) / lighting.leds
    lamp = np.stack([lighting.radius_mm * np.cos(turn), lighting.radius_mm * np.sin(turn)], 1)
    flat = (np.ascontiguousarray(a, float).reshape(-1, 3) for a in (xyz_c, normal_c))
    return np.asarray(_even_light(lamp, float(lighting.z_mm), *flat)).reshape(xyz_c.shape[:-1])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _even_light(lamp, z_mm, point, normal):  # type: ignore[no-untyped-def]
    """Return the irradiance (N,) at points and unit normals (N, 3) by lamps (L, 2) at ``z_mm``."""
    out = np.zeros(len(point))
    for n in range(len(point)):
        z = point[n, 2] - z_mm
        for k in range(len(lamp)):
            x, y = point[n, 0] - lamp[k, 0], point[n, 1] - lamp[k, 1]
            square = x * x + y * y + z * z
            toward = -(x * normal[n, 0] + y * normal[n, 1] + z * normal[n, 2])
            if toward > 0:
                out[n] += toward / (square * np.sqrt(square))
            elif np.isnan(toward):
                out[n] = np.nan
    return out / len(lamp)
