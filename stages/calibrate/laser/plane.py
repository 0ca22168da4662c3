"""Planes through points by total least squares, plain and robust, with covariance.

The plane of least squared distances passes through the centroid, square to the direction of least scatter
(K. Pearson, "On lines and planes of closest fit to systems of points in space", 1901). Outliers are weighted
down after Tukey by iterated reweighting.
"""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.robust import cluster_sums, robust_spread
from pipeline.arrays import Float, Int
from pipeline.instrument.laser import LaserPlane

_TUKEY = 4.685
_MOST_STEPS, _SETTLED = 50, 1e-9
# A straight line in a picture has two numbers; the plane takes three of all of them.
_NUMBERS_PER_LINE, _UNKNOWNS = 2, 3


def fit_plane(xyz_c: Float, group: Int) -> LaserPlane:
    """Return the plane of least squared distances of points (N, 3), mm.

    Parameters
    ----------
    group : (N,)
        Which points err together, such as the number of the picture that each comes from: 0, 1, ...
    """
    return _weighted(xyz_c, group, np.ones(len(xyz_c)))


def fit_plane_robustly(xyz_c: Float, group: Int) -> LaserPlane:
    """Return the plane through points (N, 3), mm, of which a minority lies off it: see `fit_plane`."""
    weight = np.ones(len(xyz_c))
    for _ in range(_MOST_STEPS):
        distance = np.abs(_weighted(xyz_c, group, weight).distances(xyz_c))
        following = _tukey(distance / max(robust_spread(distance), 1e-12))
        moved = float(np.abs(following - weight).max())
        weight = following
        if moved < _SETTLED:
            break
    return _weighted(xyz_c, group, weight)


def _weighted(xyz_c: Float, group: Int, weight: Float) -> LaserPlane:
    centroid = weight @ xyz_c / weight.sum()
    centred = xyz_c - centroid
    axes = np.linalg.eigh((centred * weight[:, None]).T @ centred)[1]
    normal = axes[:, 0] * np.sign(axes[np.argmax(np.abs(axes[:, 0])), 0])
    residual = centred @ normal
    used = weight > 0
    return LaserPlane(
        normal,
        float(normal @ centroid),
        _covariance(xyz_c, group, weight, residual, axes[:, 1:]),
        float(np.sqrt(np.mean(residual[used] ** 2))),
        int(np.count_nonzero(used)),
    )


def _covariance(xyz_c: Float, group: Int, weight: Float, residual: Float, tangents: Float) -> Float:
    """Return the covariance (4, 4) of (n, d) from the residuals' own spread.

    It is scaled up by the factor by which the groups' gradients scatter more than independent points make
    them: an error of a board's pose displaces all points of its picture.
    """
    jacobian = np.concatenate([xyz_c @ tangents, -np.ones((len(xyz_c), 1))], 1)
    inverse = np.linalg.pinv((jacobian * weight[:, None]).T @ jacobian, hermitian=True)
    variance = float(weight @ residual**2) / max(int(np.count_nonzero(weight)) - _UNKNOWNS, 1)
    spread = (
        variance * _togetherness(jacobian * (weight * residual)[:, None], group, inverse, variance) * inverse
    )
    embedding = np.zeros((4, 3))
    embedding[:3, :2], embedding[3, 2] = tangents, 1.0
    return np.asarray(embedding @ spread @ embedding.T)


def _togetherness(gradient: Float, group: Int, inverse: Float, variance: float) -> float:
    """Return the scatter of the groups' gradients (N, 3) against that of independent points, at least 1."""
    summed = cluster_sums(gradient, group)
    groups = len(summed)
    freedom = _NUMBERS_PER_LINE * groups - _UNKNOWNS
    if groups == 1 or freedom < 1 or variance == 0:
        return 1.0
    scatter = float(np.einsum("gi,ij,gj->", summed, inverse, summed)) / variance / _UNKNOWNS
    return max(scatter * _NUMBERS_PER_LINE * groups / freedom, 1.0)


def _tukey(ratio: Float) -> Float:
    return np.asarray(np.where(ratio < _TUKEY, (1 - (ratio / _TUKEY) ** 2) ** 2, 0.0))
