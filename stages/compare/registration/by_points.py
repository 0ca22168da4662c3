"""Registers a run's wall points on a reference mesh or cloud: a pose in space, by distances along normals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float
from pipeline.errors import UnusableError
from pipeline.geometry.rigid import from_parts, rotation_from_vector, transform
from pipeline.system.native import open3d
from stages.compare.reference import ReferenceSurface, WallPoints

# Points used in the fit, and in the trial of each start: bounds on time alone.
_FIT_POINTS, _TRIAL_POINTS = 5000, 800
# Starts every 30°, so that the nearest is at most 15° off; whether all converge from there was not measured.
_ROLLS = 12
# Twice the six coefficients of the quadric that is fitted to them.
_NEIGHBOURS = 12
# Surfaces that stay this share of their size apart do not belong to one pipe: no run comes near it.
_FARTHEST = 0.05


@dataclass(frozen=True)
class PointsPose:
    """Pose ``T_rp`` (4, 4) of the run in the reference, and the remaining weighted distances, mm."""

    T_rp: Float
    rms_mm: float


def register_points(points: WallPoints, reference: ReferenceSurface) -> PointsPose:
    """Return the pose of least squared distances along the wall's normals, robustly.

    The fit is started from the run's own frame, and with the long axes of both aligned, in either direction,
    at twelve rolls each. A pipe without features determines neither roll nor shift: then any is valid.

    Raises
    ------
    UnusableError
        If the surfaces do not come together.
    """
    chosen = np.random.default_rng(0).choice(
        len(points.xyz_p), min(_FIT_POINTS, len(points.xyz_p)), replace=False
    )
    nearest = NearestPoints(reference)
    xyz, outward = points.xyz_p[chosen], points.outward_p[chosen]
    few = slice(None, None, max(1, len(chosen) // _TRIAL_POINTS))
    starts = [np.eye(4), *_axis_starts(points.xyz_p, reference.vertices)]
    rough = [_refined(xyz[few], outward[few], nearest, start, 12) for start in starts]
    best = min(rough, key=lambda r: r.rms_mm)
    found = _refined(xyz, outward, nearest, best.T_rp, 60)
    size = float(np.linalg.norm(np.ptp(xyz, axis=0)))
    if found.rms_mm > _FARTHEST * size:
        raise UnusableError(
            "verify", f"run and reference stay {found.rms_mm:.3g} mm apart",
            limit=f"{_FARTHEST * size:.3g} mm",
            hint="check the reference's unit (--reference-unit) and that it shows this pipe",
        )  # fmt: skip
    return found


class NearestPoints:
    """Finds the closest points of a mesh, or of quadrics through the neighbours in a cloud."""

    def __init__(self, reference: ReferenceSurface) -> None:
        self.reference = reference
        if len(reference.triangles):
            o3d = open3d()
            self.scene = o3d.t.geometry.RaycastingScene()
            self.scene.add_triangles(
                o3d.core.Tensor(reference.vertices.astype(np.float32)),
                o3d.core.Tensor(reference.triangles.astype(np.uint32)),
            )
        else:
            self.tree = cKDTree(reference.vertices)

    def __call__(self, xyz: Float) -> Float:
        """Return the closest points (N, 3) to points (N, 3)."""
        if len(self.reference.triangles):
            answer = self.scene.compute_closest_points(open3d().core.Tensor(xyz.astype(np.float32)))
            return np.asarray(answer["points"].numpy(), float)
        found = self.tree.query(xyz, k=_NEIGHBOURS)
        distance, index = np.asarray(found[0]), np.asarray(found[1])
        patch = self.reference.vertices[index]
        size = np.linalg.norm(np.ptp(patch, axis=1), axis=-1)
        far = distance[:, 0] > 4 * size
        return np.where(far[:, None], patch[:, 0], _on_quadric(xyz, patch))


def _on_quadric(xyz: Float, patch: Float) -> Float:
    """Return points (N, 3) projected along the normal onto the quadric through their patch (N, K, 3).

    A plane would lie inside a pipe's wall by the sagitta of the patch.
    """
    arm = patch - patch.mean(1, keepdims=True)
    frame = np.linalg.eigh(np.einsum("nki,nkj->nij", arm, arm))[1]
    normal, across = frame[..., 0], frame[..., 1:]
    local = patch - xyz[:, None]
    x, y = np.moveaxis(np.einsum("nki,nij->nkj", local, across), -1, 0)
    height = np.einsum("nki,ni->nk", local, normal)
    design = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], -1)
    square = np.einsum("nki,nkj->nij", design, design) + 1e-9 * np.eye(6)
    right = np.einsum("nki,nk->ni", design, height)
    rise = np.linalg.solve(square, right[..., None])[:, 0, 0]
    return np.asarray(xyz + rise[:, None] * normal)


def _axis_starts(xyz: Float, vertices: Float) -> list[Float]:
    middle_p, frame_p = _long_axis(xyz)
    middle_r, frame_r = _long_axis(vertices)
    starts = []
    for way in (np.eye(3), np.diag([1.0, -1.0, -1.0])):
        for k in range(_ROLLS):
            roll = rotation_from_vector(np.array([2 * math.pi * k / _ROLLS, 0.0, 0.0]))
            rotation = frame_r @ way @ roll @ frame_p.T
            starts.append(from_parts(rotation, middle_r - rotation @ middle_p))
    return starts


def _long_axis(xyz: Float) -> tuple[Float, Float]:
    """Return the middle and a right-handed frame (3, 3) whose first column is the longest direction."""
    middle = xyz.mean(0)
    vectors = np.linalg.eigh(np.cov((xyz - middle).T))[1][:, ::-1].copy()
    # in a short wide pipe the axis is the direction that differs from the other two
    values = np.linalg.eigvalsh(np.cov((xyz - middle).T))[::-1]
    if values[0] - values[1] < values[1] - values[2]:
        vectors = vectors[:, ::-1].copy()
    vectors[:, 2] = np.cross(vectors[:, 0], vectors[:, 1])
    return middle, vectors


def _refined(xyz: Float, outward: Float, nearest: NearestPoints, start: Float, steps: int) -> PointsPose:
    """Gauss-Newton on distances along the normals, Cauchy weights at twice their spread."""
    T, rms = start, math.inf
    for _ in range(steps):
        here, normal = transform(T, xyz), outward @ T[:3, :3].T
        error = np.sum((here - nearest(here)) * normal, -1)
        spread = robust_spread(error) + 1e-9
        weight = 1 / (1 + (error / (2 * spread)) ** 2)
        pivot = here.mean(0)
        design = np.concatenate([np.cross(here - pivot, normal), normal], -1)
        root = np.sqrt(weight)[:, None]
        # a smooth pipe determines neither roll nor shift: do not change such directions
        move = np.linalg.lstsq(design * root, -error * root[:, 0], rcond=1e-3)[0]
        rotation = rotation_from_vector(move[:3])
        T = from_parts(rotation, move[3:] + pivot - rotation @ pivot) @ T
        rms = float(np.sqrt(np.average(error**2, weights=weight)))
        if np.abs(move[3:]).max() < 1e-6 and np.abs(move[:3]).max() < 1e-8:
            break
    return PointsPose(T, rms)
