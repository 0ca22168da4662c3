"""Alignment: finds the straight lengths and bends of a pipe's axis.

Pipes consist of straight lengths joined by bends of constant radius. A bend is assumed only where the axis
turns by more than its noise and the camera's drift of heading explain (binary segmentation: A. Olshen
et al., "Circular binary segmentation for the analysis of array-based DNA copy number data", 2004).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float
from pipeline.artefacts.motion import PipePiece
from pipeline.geometry.axis import PipeAxis, frames_at

HEADING_DRIFT = 1e-5
"""1 σ, rad/mm, of a constant curvature that the camera sees in a straight pipe. The straight 100 m of
`tests.benchmarks.bench_long_run` ended 47 m aside, as a curvature of 0.94e-5 rad/mm explains; one run."""
_DRIFTS = 4.0
"""A bend turns by more than so many σ of that drift: radii up to 25 m. Larger ones are taken for straight."""
_CELL_MM = 60.0
"""Cells in which angles are summed: two knots of the axis' spline, so that cells are nearly independent."""
_FEWEST_CELLS = 4
"""With fewer cells there is no decision: a bend cannot be distinguished from the noise of three."""
_CELLS_IN_DIAMETERS = 0.5
"""In wide pipes cells are half a diameter long: the shortest standard bend, 1 D through 90°, has three."""
_WORTH = 30.0
"""Gain of χ² that a bend must bring: four parameters by the Bayesian information criterion (about 20 for 200
cells), and 10 more for the places that were tried."""
_SAME_WAY = 0.7
"""Least cosine of the directions of two touching bends that are one: 45°. A choice."""
_LEAST_NOISE_RAD = 1e-4
"""Smallest 1 σ of the angle of a cell: 3 µm across a knot of the axis."""
_STANDARD_DIAMETERS = (1.0, 1.5, 2.0, 2.5, 3.0, 5.0, 6.0, 8.0, 10.0)
"""Radii of bends over the diameter: ASME B16.9 (1 and 1.5), B16.49 and EN 10253 (2 to 10)."""
_STANDARD_SHARE = 0.02
"""Relative tolerance of a bend's radius: EN 10253-2 allows 1 to 2 % of centre to face. A choice."""


@dataclass(frozen=True)
class _Bend:
    """A bend between distances; ``turn`` (2,) is its rotation in the section's x and y, rad."""

    from_mm: float
    to_mm: float
    turn: Float
    limit_sigma_mm: float = 0.0


def find_pieces(
    axis: PipeAxis, from_mm: float, to_mm: float, diameter_mm: float, distance_sigma_mm: float
) -> tuple[PipePiece, ...]:
    """Return the straight lengths and bends of an axis between two distances; none if these are close.

    Parameters
    ----------
    axis
    from_mm, to_mm : float
        Ends of the range in which the probe saw the pipe.
    diameter_mm : float
        Bore, for the names of standard radii.
    distance_sigma_mm : float
        1 σ of the distance from one end to the other.
    """
    cell_mm = max(_CELL_MM, _CELLS_IN_DIAMETERS * diameter_mm)
    count = int((to_mm - from_mm) / cell_mm)
    if count < _FEWEST_CELLS:
        return ()
    limits = np.linspace(from_mm, to_mm, count + 1)
    turn = _turns(axis, limits)
    noise = max(robust_spread(np.diff(turn, axis=0).ravel()) / np.sqrt(2), _LEAST_NOISE_RAD)
    found = _merged(_bends_in(turn, 0, noise, (to_mm - from_mm) / count), turn)
    bends = [_refined(axis, limits, a, b, noise) for a, b in found]
    return tuple(_pieces(bends, from_mm, to_mm, diameter_mm, distance_sigma_mm, noise))


def _turns(axis: PipeAxis, limits: Float) -> Float:
    """Return the angles (n, 2), rad, of the axis from limit to limit, toward x and y of the section."""
    section = frames_at(axis, limits)[1]
    return np.asarray(np.einsum("kij,ki->kj", section[:-1], section[1:, :, 2])[:, :2])


def _bends_in(turn: Float, first: int, noise: float, cell_mm: float) -> list[tuple[int, int]]:
    """Return ranges of cells that bend: the one with the largest gain, then those on both sides of it."""
    n = len(turn)
    if not n:
        return []
    total = np.concatenate([np.zeros((1, 2)), np.cumsum(turn, 0)])
    a, b = np.triu_indices(n + 1, 1)
    sums = np.linalg.norm(total[b] - total[a], axis=1)
    beyond = np.maximum(sums - _DRIFTS * HEADING_DRIFT * cell_mm * (b - a), 0.0)
    gain = (beyond / noise) ** 2 / (b - a)
    best = int(np.argmax(gain))
    if gain[best] < _WORTH:
        return []
    i, j = int(a[best]), int(b[best])
    left = _bends_in(turn[:i], first, noise, cell_mm)
    return [*left, (first + i, first + j), *_bends_in(turn[j:], first + j, noise, cell_mm)]


def _merged(found: list[tuple[int, int]], turn: Float) -> list[tuple[int, int]]:
    """Return ranges of cells; touching ones that turn the same way are one bend."""
    out: list[tuple[int, int]] = []
    for a, b in found:
        if out and out[-1][1] >= a:
            before, now = turn[slice(*out[-1])].sum(0), turn[a:b].sum(0)
            if before @ now > _SAME_WAY * np.linalg.norm(before) * np.linalg.norm(now):
                out[-1] = (out[-1][0], b)
                continue
        out.append((a, b))
    return out


def _refined(axis: PipeAxis, limits: Float, first: int, last: int, noise: float) -> _Bend:
    """Return a bend with its ends fitted: the heading rises evenly between them and is constant outside."""
    n, cell = len(limits) - 1, float(limits[1] - limits[0])
    low, high = max(first - 1, 0), min(last + 1, n)
    s = np.linspace(limits[low], limits[high], max(4 * (high - low), 8) + 1)
    heading = np.concatenate([np.zeros((1, 2)), np.cumsum(_turns(axis, s), 0)])

    def misfit(x: Float) -> Float:
        share = np.clip((s - x[0]) / max(x[1] - x[0], 1e-6), 0, 1)
        return np.asarray((heading - x[4:6] - share[:, None] * x[2:4]).ravel())

    start = np.array([limits[first], limits[last], *(heading[-1] - heading[0]), *heading[0]])
    most = 2 * np.abs(heading).max() + 0.1
    low_limits = [s[0] - 1e-6, limits[first] + cell / 4, *[-2 * most] * 4]
    high_limits = [limits[last] - cell / 4, s[-1] + 1e-6, *[2 * most] * 4]
    fit = least_squares(
        misfit, start, bounds=(low_limits, high_limits), x_scale=[cell, cell, 0.1, 0.1, 0.1, 0.1]
    )
    begin, end = np.sort(fit.x[:2])
    rms = max(float(np.sqrt(np.mean(fit.fun**2))), noise)
    slope = float(np.linalg.norm(fit.x[2:4])) / max(end - begin, 1e-6)
    return _Bend(float(begin), float(end), fit.x[2:4], float(min(rms / max(slope, 1e-12), cell)))


def _pieces(
    bends: list[_Bend], from_mm: float, to_mm: float, diameter_mm: float, way_sigma_mm: float, noise: float
) -> list[PipePiece]:
    out, at = [], from_mm
    for bend in bends:
        # σ of the fitted end of the bend, and of the distance up to it.
        share = (bend.to_mm - from_mm) / max(to_mm - from_mm, 1e-9)
        sigma = float(np.hypot(bend.limit_sigma_mm, share * way_sigma_mm))
        if bend.from_mm > at:
            out.append(PipePiece("straight", at, bend.from_mm, sigma))
        out.append(_bend_piece(bend, diameter_mm, noise, sigma))
        at = bend.to_mm
    if at < to_mm:
        out.append(PipePiece("straight", at, to_mm, float(way_sigma_mm)))
    return out


def _bend_piece(bend: _Bend, diameter_mm: float, noise: float, sigma_mm: float) -> PipePiece:
    length, angle = max(bend.to_mm - bend.from_mm, 1e-6), float(np.linalg.norm(bend.turn))
    angle_sigma = float(np.hypot(np.sqrt(2) * noise, HEADING_DRIFT * length))
    radius = length / angle
    radius_sigma = radius * float(np.hypot(np.sqrt(2) * bend.limit_sigma_mm / length, angle_sigma / angle))
    slack = np.hypot(2 * radius_sigma, _STANDARD_SHARE * radius)
    fitting = [d for d in _STANDARD_DIAMETERS if abs(d * diameter_mm - radius) < slack]
    standard = f"{fitting[0]:g} D" if len(fitting) == 1 else ""
    toward = float(np.arctan2(bend.turn[1], bend.turn[0]))
    return PipePiece(
        "bend", bend.from_mm, bend.to_mm, sigma_mm, angle, angle_sigma, toward, radius, radius_sigma, standard
    )
