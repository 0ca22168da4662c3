"""Makes a linear step at the adjustment's optimum, with further unknowns that change rings and texture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from pipeline.adjustment.bordered import BorderedSystem
from pipeline.adjustment.elimination import BLOCK
from pipeline.adjustment.rows import Rows
from pipeline.arrays import Bool, Float
from pipeline.geometry.axis import to_pipe
from pipeline.geometry.rigid import transform
from stages.motion.bundle_adjustment import residuals
from stages.motion.bundle_adjustment.equations import LEAST_REACH, Measurements, factorised
from stages.motion.bundle_adjustment.solver import Estimate
from stages.motion.bundle_adjustment.unknowns import State


@dataclass(frozen=True)
class ExtraColumns:
    """Derivatives of the residuals by K further unknowns, and the prior 1 σ of these.

    Attributes
    ----------
    rings : (M, K)
        Derivatives of the residuals of the rings' bins.
    pixels : (O, 2, K)
        Derivatives of the residuals of texture.
    landmarks : (L, K)
        Derivatives of the residuals of landmarks relative to the smooth pipe.
    sigma : (K,)
        Prior 1 σ of the unknowns.
    """

    rings: Float
    pixels: Float
    landmarks: Float
    sigma: Float

    def some(self, which: Bool) -> ExtraColumns:
        """Return some (K,) of the unknowns."""
        pixels = self.pixels[..., which]
        return ExtraColumns(self.rings[:, which], pixels, self.landmarks[:, which], self.sigma[which])

    def solved(self, estimate: Estimate) -> tuple[Float, Float]:
        """Return the unknowns (K,) at the minimum of the linear equations, and their covariance (K, K)."""
        equations, count = estimate.adjusted.equations, len(self.sigma)
        texture, border = equations.texture, equations.rings.by_border.shape[1]
        texture = replace(
            texture,
            by_instrument=np.concatenate([texture.by_instrument, self.pixels], 2),
            surface_by_border=np.concatenate([texture.surface_by_border, self.landmarks], 1),
        )
        system = BorderedSystem(equations.frames, border + count, max(texture.reach, LEAST_REACH))
        for rows in equations.rows:
            system.add(_with(rows, np.zeros((len(rows.residual), count))))
        system.add(_with(equations.rings, self.rings))
        system.add(self._beforehand(border))
        system.add_landmarks(texture)
        factor = factorised(system)
        return factor.step()[1][border:], factor.border_covariance()[border:, border:]

    def _beforehand(self, border: int) -> Rows:
        count = len(self.sigma)
        by_border = np.concatenate([np.zeros((count, border)), np.eye(count)], 1)
        none = np.zeros((count, 0), np.int64)
        return Rows(none, np.zeros((count, 0, BLOCK)), by_border, np.zeros(count), self.sigma)


@dataclass(frozen=True)
class RingsInPipe:
    """The rings' bins at an estimate.

    Attributes
    ----------
    xyz_c : (M, 3)
    span_mm, azimuth_rad : (M,)
        Distance along the pipe, and azimuth.
    normal_c : (M, 3)
        Normals of the wall in C.
    """

    xyz_c: Float
    span_mm: Float
    azimuth_rad: Float
    normal_c: Float

    @staticmethod
    def of(state: State, measured: Measurements) -> RingsInPipe:
        """Return the rings' bins at a state."""
        rings, T = measured.rings, state.T_pc[measured.rings.frame]
        xyz_c = rings.xyz_c + rings.by_instrument @ state.instrument[: rings.by_instrument.shape[2]]
        xyz_p = transform(T, xyz_c)
        moved_mm = residuals.camera_moved(state)[1][rings.frame]
        normal = residuals.surface(state, xyz_p, moved_mm)[1]
        span, azimuth, _ = to_pipe(state.axis, xyz_p)
        return RingsInPipe(xyz_c, span, azimuth, np.einsum("mi,mij->mj", normal, T[:, :3, :3]))


def chance(value: Float, covariance: Float) -> float:
    """Return the probability that values (K,) lie as far from 0 by chance, or farther."""
    return float(chdtrc(len(value), value @ np.linalg.solve(covariance, value)))


def _with(rows: Rows, more: Float) -> Rows:
    return replace(rows, by_border=np.concatenate([rows.by_border, more], 1))
