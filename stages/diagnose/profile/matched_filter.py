"""How strongly the profile of the line indicates a second line at any distance: a matched filter."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from pipeline.adjustment.robust import robust_spreads
from pipeline.arrays import Float
from stages.diagnose.profile.cells import Cells

REACH_PX, STEP_PX = 45.0, 0.5
# Beyond this many widths a Gaussian is below 0.3 %, and is neglected.
_REACH_WIDTHS = 3.5
# Beyond this many widths a Gaussian of height 1 is below the rounding of 1: exp(−8.6² / 2) = 9e-17.
_NOTHING_WIDTHS = 8.6
# Least noise of a bin, relative to the line's height; chosen, not measured (data/debts.md).
NOISE_FLOOR = 3e-4


@dataclass(frozen=True)
class Responses:
    """How strongly each of N cells indicates a second line at D distances from the line.

    Attributes
    ----------
    distance_px : (D,)
        Uniform.
    score, information : (N, D)
        Their ratio is the height relative to the line, minus that on the opposite side of the line; 1 /
        √information is its σ if bins have independent errors.
    skirt : (N, D)
        Score of the mean of both sides of the line, at the same information.
    """

    distance_px: Float
    score: Float
    information: Float
    skirt: Float


def responses(cells: Cells) -> Responses:
    """Return matched-filter responses of the whole cells, orthogonal to what a Gaussian fit absorbs.

    What the opposite side of the line shows as well is subtracted: halos, glare and compression are
    symmetric.
    """
    distance = np.arange(-REACH_PX, REACH_PX + STEP_PX / 2, STEP_PX)
    rest = cells.rest[cells.whole]
    noise = np.hypot(robust_spreads(rest - np.median(rest, axis=0), axis=0), NOISE_FLOOR)
    score, information = np.zeros((len(rest), len(distance))), np.zeros((len(rest), len(distance)))
    _match(
        rest, cells.offset_px, cells.centre_px[cells.whole], cells.width_px[cells.whole], 1 / noise**2,
        distance, score, information,
    )  # fmt: skip
    with np.errstate(invalid="ignore", divide="ignore"):
        height = np.where(information > 0, score / information, 0.0)
    opposite = height[:, ::-1] * information
    return Responses(distance, score - opposite, information, (score + opposite) / 2)


@numba.njit(cache=True, nogil=True)
def _match(rest, offset, centre, width, weight, distance, score, information):  # type: ignore[no-untyped-def]
    bins = offset.size
    basis, cross, ghost = np.zeros((3, bins)), np.zeros(3), np.zeros(bins)
    gram = np.zeros((3, 3))
    for n in range(rest.shape[0]):
        for b in range(bins):
            x = (offset[b] - centre[n]) / width[n]
            e = np.exp(-0.5 * x * x) if abs(x) < _REACH_WIDTHS else 0.0
            basis[0, b], basis[1, b], basis[2, b] = e, x * e, x * x * e
        for i in range(3):
            for j in range(3):
                gram[i, j] = np.sum(basis[i] * basis[j])
        inverse = np.linalg.inv(gram)
        for d in range(distance.size):
            _draw_ghost(offset, centre[n] + distance[d], width[n], basis, ghost, cross)
            taken = inverse @ cross
            for b in range(bins):
                if (ghost[b] == 0.0 and basis[0, b] == 0.0) or np.isnan(rest[n, b]):
                    continue
                template = ghost[b]
                for i in range(3):
                    template -= taken[i] * basis[i, b]
                score[n, d] += weight[b] * template * rest[n, b]
                information[n, d] += weight[b] * template * template


@numba.njit(cache=True, nogil=True)
def _draw_ghost(offset, centre, width, basis, ghost, cross):  # type: ignore[no-untyped-def]
    """Write a Gaussian of height 1 at the bins (B,), and its inner products with the basis (3, B)."""
    cross[:] = 0.0
    for b in range(offset.size):
        x = (offset[b] - centre) / width
        ghost[b] = np.exp(-0.5 * x**2) if abs(x) < _NOTHING_WIDTHS else 0.0
        if ghost[b] != 0.0 and basis[0, b] != 0.0:
            for i in range(3):
                cross[i] += basis[i, b] * ghost[b]
