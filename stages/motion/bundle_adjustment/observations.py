"""Equations of texture in compiled loops: projected landmarks, and errors that matches share."""

from __future__ import annotations

import numba
import numpy as np

_FIRST_RAD, _KNOT_RAD = np.radians(38.0), np.radians(10.0)
"""First knot and spacing, rad: five cover the polar angles at which texture is tracked by default."""
_NO_PIXEL_PX = 1000.0
"""Residual of a landmark without a projection."""


@numba.njit(cache=True, nogil=True, error_model="numpy")
def observe(  # type: ignore[no-untyped-def]
    off, by_c, by_parameters, unsure, xyz_c, T_pc, from_centre, bias_px, biases,
    residual, by_point, by_pose, by_instrument,
):  # fmt: skip
    """Write residuals of texture and their derivatives by point, pose and instrument.

    ``off`` (M, 2) is the distance of a projected landmark from its match, px, ``from_centre`` (M, 2) its
    projected place in the picture: the matched one contains noise, and the mean of derivative times residual
    would not be zero, as in `RingBins.instrument_where_expected` (.25 % of distance in the tests' scene).
    The pose moves by T = [R exp(w), t + d], (d, w), as in
    `stages.motion.bundle_adjustment.unknowns.moved`. The last parameters of the instrument are errors that
    matches share: ``biases`` (K,), in 1 σ of ``bias_px``.
    """
    camera = unsure.shape[1]
    share = np.empty(len(biases))
    for m in range(len(off)):
        if not (np.isfinite(off[m, 0]) and np.isfinite(off[m, 1])):
            residual[m] = _NO_PIXEL_PX
            by_point[m], by_pose[m], by_instrument[m] = 0.0, 0.0, 0.0
            continue
        x, y, z = xyz_c[m]
        _share_of_biases(x, y, z, share)
        length = max(np.hypot(from_centre[m, 0], from_centre[m, 1]), 1.0)
        for c in range(2):
            j0, j1, j2 = by_c[m, c]
            for a in range(3):
                by_point[m, c, a] = j0 * T_pc[m, a, 0] + j1 * T_pc[m, a, 1] + j2 * T_pc[m, a, 2]
                by_pose[m, c, a] = -by_point[m, c, a]
            by_pose[m, c, 3] = j1 * z - j2 * y
            by_pose[m, c, 4] = j2 * x - j0 * z
            by_pose[m, c, 5] = j0 * y - j1 * x
            own = by_instrument[m, c]
            own[:camera] = 0.0
            for p in range(len(unsure)):
                for q in range(camera):
                    own[q] += by_parameters[m, c, p] * unsure[p, q]
            residual[m, c] = off[m, c]
            for k in range(len(share)):
                own[camera + k] = bias_px * share[k] * from_centre[m, c] / length
                residual[m, c] += own[camera + k] * biases[k]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _share_of_biases(x, y, z, share):  # type: ignore[no-untyped-def]
    """Write the error of a match at a point in C per unit error at each knot of the polar angle.

    Errors are radial, equal all round, and piecewise linear in the polar angle. Light that falls off across a
    patch, blur that grows with distance, and compression shift matches along the radius; this must not be
    attributed to the lens.
    """
    theta = np.arctan2(np.hypot(x, y), z)
    place = min(max((theta - _FIRST_RAD) / _KNOT_RAD, 0.0), len(share) - 1.0)
    for k in range(len(share)):
        share[k] = max(1.0 - abs(place - k), 0.0)
