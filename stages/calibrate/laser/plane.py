"""Fits a plane through laser lines on boards, robustly, with a covariance that includes the boards' poses.

The plane of least squared distances passes through the centroid, perpendicular to the direction of least
scatter (K. Pearson, "On lines and planes of closest fit to systems of points in space", 1901). Outliers are
weighted down after Tukey by iterated reweighting.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.adjustment.robust import TUKEY, cluster_sums, robust_spread, root_mean_square
from pipeline.arrays import Float, Int
from pipeline.instrument.laser import LaserPlane

# Weights have converged when none changes by more: half and twice of it move the plane by 1e-9 of its σ.
_MOST_STEPS, _SETTLED = 50, 1e-9
# A straight line in a picture has two parameters; the plane takes three of all of them.
_NUMBERS_PER_LINE, _UNKNOWNS = 2, 3


@dataclass(frozen=True)
class BoardErrors:
    """Common errors of the points of every board, which follow from the errors of the board's pose.

    Attributes
    ----------
    arm_c : (N, 3)
        Vector of every point from the origin of its board, mm.
    pose_covariance : (G, 6, 6)
        Covariance of the boards' rotation vectors, rad, and translations, mm, in C.
    """

    arm_c: Float
    pose_covariance: Float


def fit_plane_robustly(xyz_c: Float, group: Int, boards: BoardErrors | None = None) -> LaserPlane:
    """Return the plane through points (N, 3), mm, of which a minority lies off it: see `weighted_plane`."""
    weight = np.ones(len(xyz_c))
    for _ in range(_MOST_STEPS):
        distance = np.abs(weighted_plane(xyz_c, group, weight).distances(xyz_c))
        following = _tukey(distance / max(robust_spread(distance), 1e-12))
        moved = float(np.abs(following - weight).max())
        weight = following
        if moved < _SETTLED:
            break
    return weighted_plane(xyz_c, group, weight, boards)


def weighted_plane(xyz_c: Float, group: Int, weight: Float, boards: BoardErrors | None = None) -> LaserPlane:
    """Return the plane of least squared distances of points (N, 3), mm, with weights (N,).

    Parameters
    ----------
    group : (N,)
        Number of the group of each point with common errors, such as the number of its picture: 0, 1, ...
    boards : BoardErrors, optional
        The errors of the boards' poses.
    """
    centroid = weight @ xyz_c / weight.sum()
    centred = xyz_c - centroid
    axes = np.linalg.eigh((centred * weight[:, None]).T @ centred)[1]
    normal = axes[:, 0] * np.sign(axes[np.argmax(np.abs(axes[:, 0])), 0])
    residual = centred @ normal
    used = weight > 0
    return LaserPlane(
        normal,
        float(normal @ centroid),
        _covariance(xyz_c, group, weight, residual, normal, axes[:, 1:], boards),
        root_mean_square(residual[used]),
        int(np.count_nonzero(used)),
    )


def _covariance(
    xyz_c: Float,
    group: Int,
    weight: Float,
    residual: Float,
    normal: Float,
    tangents: Float,
    boards: BoardErrors | None,
) -> Float:
    """Return the covariance (4, 4) of (n, d) from the residuals' own spread and the boards' poses.

    An error of a board's pose displaces all points of its picture. The part that the plane follows leaves no
    residual, so it is taken from the poses' covariance. The covariance is scaled up if the groups' gradients
    scatter more than that.
    """
    jacobian = np.concatenate([xyz_c @ tangents, -np.ones((len(xyz_c), 1))], 1)
    inverse = np.linalg.pinv((jacobian * weight[:, None]).T @ jacobian, hermitian=True)
    variance = float(weight @ residual**2) / max(int(np.count_nonzero(weight)) - _UNKNOWNS, 1)
    spread = variance * inverse
    found = spread * _correlation_factor(jacobian * (weight * residual)[:, None], group, inverse, variance)
    if boards is not None:
        moved = np.concatenate([np.cross(boards.arm_c, normal), np.broadcast_to(normal, xyz_c.shape)], 1)
        products = (jacobian * weight[:, None])[:, :, None] * moved[:, None]
        pull = inverse @ cluster_sums(products.reshape(len(xyz_c), -1), group).reshape(-1, 3, 6)
        spread = spread + np.einsum("gip,gpq,gjq->ij", pull, boards.pose_covariance, pull)
    spread = spread * max(float(np.trace(np.linalg.pinv(spread, hermitian=True) @ found)) / _UNKNOWNS, 1.0)
    embedding = np.zeros((4, 3))
    embedding[:3, :2], embedding[3, 2] = tangents, 1.0
    return np.asarray(embedding @ spread @ embedding.T)


def _correlation_factor(gradient: Float, group: Int, inverse: Float, variance: float) -> float:
    """Return the scatter of the groups' gradients (N, 3) over that of independent points, at least 1."""
    summed = cluster_sums(gradient, group)
    groups = len(summed)
    freedom = _NUMBERS_PER_LINE * groups - _UNKNOWNS
    if groups == 1 or freedom < 1 or variance == 0:
        return 1.0
    scatter = float(np.einsum("gi,ij,gj->", summed, inverse, summed)) / variance / _UNKNOWNS
    return max(scatter * _NUMBERS_PER_LINE * groups / freedom, 1.0)


def _tukey(ratio: Float) -> Float:
    return np.asarray(np.where(ratio < TUKEY, (1 - (ratio / TUKEY) ** 2) ** 2, 0.0))
