"""Unified (Mei) camera: sphere, mirror parameter ξ, plumb-bob distortion, generalised focal lengths."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.camera.plumb_bob import PlumbBobCamera


@dataclass(frozen=True)
class Unified(PlumbBobCamera):
    """Unified camera of Mei and Rives (Kalibr's omni-radtan, camodocal's MEI).

    Attributes
    ----------
    image_size : (int, int)
        Width and height, px.
    xi : float
        Mirror parameter ξ ≥ 0.
    focal_px, centre : (float, float)
        Generalised focal lengths (γ1, γ2) and principal point.
    distortion : (float, float, float, float)
        k1, k2, p1, p2.
    """

    image_size: tuple[int, int]
    xi: float
    focal_px: tuple[float, float]
    centre: tuple[float, float]
    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    model = "unified"
    parameter_names = ("xi", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")

    @property
    def parameters(self) -> Float:
        """(9,) xi, fx, fy, cx, cy, k1, k2, p1, p2."""
        return np.array([self.xi, *self.focal_px, *self.centre, *self.distortion], float)

    def with_parameters(self, parameters: Float) -> Unified:
        """Return the same camera with other parameters (9,)."""
        xi, fx, fy, cx, cy, k1, k2, p1, p2 = (float(p) for p in parameters)
        return replace(self, xi=xi, focal_px=(fx, fy), centre=(cx, cy), distortion=(k1, k2, p1, p2))

    @property
    def _mirror(self) -> float:
        return self.xi

    @property
    def _coefficients(self) -> tuple[float, float, float, float, float]:
        return (*self.distortion, 0.0)

    @property
    def _columns(self) -> slice:
        return slice(0, 9)
