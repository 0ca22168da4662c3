"""Linearised residuals of a least-squares problem of frames, landmarks and a few global numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pipeline.adjustment.robust import Loss, Squares
from pipeline.arrays import Float, Int


@dataclass(frozen=True)
class Rows:
    """Scalar residual equations that touch some frames and the border, but no landmark.

    Attributes
    ----------
    frame : (M, F) int
        The F frames of each equation.
    by_frame : (M, F, 7)
        Derivatives of the residuals by the unknowns of these frames.
    by_border : (M, B)
        Derivatives by the unknowns of the border.
    residual, sigma : (M,)
    loss : Loss
    """

    frame: Int
    by_frame: Float
    by_border: Float
    residual: Float
    sigma: Float
    loss: Loss = field(default_factory=Squares)

    @property
    def weight(self) -> Float:
        """Return the weights (M,)."""
        return self.loss.weight(self.residual, self.sigma)

    @property
    def cost(self) -> float:
        """Return the total cost."""
        return float(np.sum(self.loss.cost(self.residual, self.sigma)))

    def decrease(self, step: Step) -> float:
        """Return by how much a step would lower the weighted squares, if the equations were linear."""
        change = np.einsum("mfi,mfi->m", self.by_frame, step.frames[self.frame])
        change += self.by_border @ step.border
        return _decrease(self.residual, change, self.weight)


@dataclass(frozen=True)
class LandmarkRows:
    """Texture observations and the landmarks' surface equations.

    Attributes
    ----------
    start : (L + 1,) int
        Observations of landmark l are ``start[l]:start[l + 1]``.
    frame : (M,) int
    by_pose : (M, 2, 6)
    by_point : (M, 2, 3)
    by_instrument : (M, 2, Q)
        By the last Q numbers of the border.
    residual : (M, 2)
    sigma : (M,)
        Of each coordinate; the loss judges both together. Infinite where an observation has no ray.
    surface_by_point : (L, 3)
    surface_by_border : (L, B)
    surface_residual, surface_sigma : (L,)
    loss : Loss
        Of texture and surface.
    """

    start: Int
    frame: Int
    by_pose: Float
    by_point: Float
    by_instrument: Float
    residual: Float
    sigma: Float
    surface_by_point: Float
    surface_by_border: Float
    surface_residual: Float
    surface_sigma: Float
    loss: Loss = field(default_factory=Squares)

    @cached_property
    def weight(self) -> Float:
        """Return the weights (M,) of the observations."""
        return self.loss.weight(np.linalg.norm(self.residual, axis=1), self.sigma)

    @property
    def surface_weight(self) -> Float:
        """Return the weights (L,) of the surface equations."""
        return self.loss.weight(self.surface_residual, self.surface_sigma)

    @property
    def cost(self) -> float:
        """Return the total cost."""
        texture = self.loss.cost(np.linalg.norm(self.residual, axis=1), self.sigma)
        return float(np.sum(texture) + np.sum(self.loss.cost(self.surface_residual, self.surface_sigma)))

    @property
    def reach(self) -> int:
        """Return the longest span of frames of one landmark."""
        seen = np.flatnonzero(np.diff(self.start))
        first, last = self.frame[self.start[seen]], self.frame[self.start[seen + 1] - 1]
        return int(np.max(last - first, initial=0))

    def decrease(self, step: Step) -> float:
        """Return by how much a step would lower the weighted squares, if the equations were linear."""
        landmark = np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))
        change = self.change_by_view(step.frames, step.border)
        change += np.einsum("mij,mj->mi", self.by_point, step.landmarks[landmark])
        relief = self.surface_by_border @ step.border
        relief += np.einsum("lj,lj->l", self.surface_by_point, step.landmarks)
        texture = _decrease(self.residual, change, self.weight[:, None])
        return texture + _decrease(self.surface_residual, relief, self.surface_weight)

    def change_by_view(self, frames: Float, border: Float) -> Float:
        """Return the change (M, 2) of the residuals by a step of frames (N, 7) and border (B,)."""
        count = self.by_instrument.shape[2]
        by_frames = np.einsum("mij,mj->mi", self.by_pose, frames[self.frame, :6])
        by_instrument = self.by_instrument.reshape(-1, count) @ border[len(border) - count :]
        return np.asarray(by_frames + by_instrument.reshape(-1, 2))


@dataclass(frozen=True)
class Step:
    """A step of the frames (N, 7), the border (B,) and the landmarks (L, 3)."""

    frames: Float
    border: Float
    landmarks: Float


def _decrease(residual: Float, change: Float, weight: Float) -> float:
    return float(-np.sum(weight * change * (residual + 0.5 * change)))
