"""Pinhole camera with plumb-bob distortion, as OpenCV calibrates it; below 90° only."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.camera.plumb_bob import PlumbBobCamera


@dataclass(frozen=True)
class Pinhole(PlumbBobCamera):
    """Pinhole camera.

    Attributes
    ----------
    image_size : (int, int)
        Width and height, px.
    focal_px, centre : (float, float)
        (fx, fy) and (cx, cy).
    distortion : (float, float, float, float, float)
        k1, k2, p1, p2, k3.
    """

    image_size: tuple[int, int]
    focal_px: tuple[float, float]
    centre: tuple[float, float]
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    model = "pinhole"
    parameter_names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")

    @property
    def parameters(self) -> Float:
        """(9,) fx, fy, cx, cy, k1, k2, p1, p2, k3."""
        return np.array([*self.focal_px, *self.centre, *self.distortion], float)

    def with_parameters(self, parameters: Float) -> Pinhole:
        """Return the same camera with other parameters (9,)."""
        fx, fy, cx, cy, k1, k2, p1, p2, k3 = (float(p) for p in parameters)
        return replace(self, focal_px=(fx, fy), centre=(cx, cy), distortion=(k1, k2, p1, p2, k3))

    @property
    def _mirror(self) -> float:
        return 0.0

    @property
    def _coefficients(self) -> tuple[float, float, float, float, float]:
        return self.distortion

    @property
    def _columns(self) -> slice:
        return slice(1, 10)
