"""Scores of equations that err alike in clusters, such as neighbours on the wall or corners of one picture.

The variance of a score is that of its sums over clusters, which are taken for independent, times C / (C − 1)
for the C clusters (H. White, "Asymptotic theory for econometricians", 1984, ch. 6; A. Cameron, D. Miller, "A
practitioner's guide to cluster-robust inference", 2015).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from pipeline.arrays import Float, Int


def cluster_sums(scores: Float, cluster: Int) -> Float:
    """Return the sums (C, K) of scores (M, K) over the clusters, by ascending number of ``cluster`` (M,)."""
    place = np.unique(cluster, return_inverse=True)[1]
    count = int(place.max(initial=-1)) + 1
    member = csr_matrix((np.ones(len(place)), (place, np.arange(len(place)))), shape=(count, len(place)))
    return np.asarray(member @ scores)


def cluster_covariance(scores: Float, cluster: Int) -> Float:
    """Return the covariance (K, K) of the sum of all scores (M, K)."""
    sums = cluster_sums(scores, cluster)
    return np.asarray(sums.T @ sums * _few(len(sums)))


def cluster_variance(scores: Float, cluster: Int) -> Float:
    """Return the diagonal (K,) of `cluster_covariance`."""
    sums = cluster_sums(scores, cluster)
    return np.asarray(np.square(sums).sum(0) * _few(len(sums)))


def two_way_variance(scores: Float, cluster: Int, other: Int) -> Float:
    """Return the variance (K,) of summed scores that err alike in clusters of two kinds.

    A. Cameron, J. Gelbach, D. Miller, "Robust inference with multiway clustering", 2011.
    """
    first, second = (np.unique(x, return_inverse=True)[1] for x in (cluster, other))
    both = first * (second.max(initial=0) + 1) + second
    either = cluster_variance(scores, first) + cluster_variance(scores, second)
    return np.asarray(either - cluster_variance(scores, both))


def _few(clusters: int) -> float:
    return clusters / max(clusters - 1, 1)
