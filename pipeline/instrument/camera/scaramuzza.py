"""Scaramuzza's omnidirectional camera, as OCamCalib defines it.

A sensor point at distance ρ from the centre looks along (ρ cos ψ, ρ sin ψ, −(a0 + a1 ρ + … + aN ρᴺ)) of C;
with rows downward, (row, column) = [[c, d], [e, 1]] (ρ sin ψ, ρ cos ψ) + (row, column) of the centre.
D. Scaramuzza, A. Martinelli, R. Siegwart, "A toolbox for easily calibrating omnidirectional cameras",
IROS 2006. Projection inverts the direct polynomial exactly, so both directions agree to rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.polynomial import polynomial

from pipeline.arrays import Float
from pipeline.instrument.camera import invert_increasing, smallest_positive_root
from pipeline.instrument.camera.fisheye import Polar, RadialCamera

# Nodes of the table that an inversion starts from; Newton's steps do the rest.
_NODES = 256
# The polynomial is an interpolation: beyond twice the radius of the image's farthest corner it is
# meaningless.
_REACH = 2.0


@dataclass(frozen=True)
class Scaramuzza(RadialCamera):
    """Omnidirectional camera with a polynomial from image radius to viewing direction.

    Attributes
    ----------
    image_size : (int, int)
        Width and height, px.
    centre : (float, float)
        (u, v) = (column, row) of the distortion centre; OCamCalib's files name the row first.
    polynomial : tuple of float
        a0..aN in OCamCalib's sign (a0 negative) and order; a1 is 0 by construction and is never estimated.
    affine : (float, float, float)
        OCamCalib's c, d, e.
    """

    image_size: tuple[int, int]
    centre: tuple[float, float]
    polynomial: tuple[float, ...]
    affine: tuple[float, float, float] = (1.0, 0.0, 0.0)

    model = "scaramuzza"

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Centre, affine, then the polynomial without a1."""
        return ("cx", "cy", "c", "d", "e", *(f"a{i}" for i in self._powers))

    @property
    def parameters(self) -> Float:
        """(5 + N,) in the order of `parameter_names`."""
        return np.array([*self.centre, *self.affine, *(self.polynomial[i] for i in self._powers)], float)

    def with_parameters(self, parameters: Float) -> Scaramuzza:
        """Return the same camera with other parameters (5 + N,)."""
        cx, cy, c, d, e, a0, *rest = (float(p) for p in parameters)
        return replace(self, centre=(cx, cy), affine=(c, d, e), polynomial=(a0, self.polynomial[1], *rest))

    @cached_property
    def rho_max(self) -> float:
        """Image radius up to which the polar angle grows; at most twice that of the farthest corner."""
        turning = smallest_positive_root([(1 - i) * a for i, a in enumerate(self.polynomial)])
        return float(min(turning, _REACH * self._corner_rho()))

    @cached_property
    def theta_max(self) -> float:
        """Polar angle, rad, at `rho_max`."""
        return float(self._theta(np.array(self.rho_max)))

    @property
    def affine_matrix(self) -> Float:
        """(2, 2) from (column, row) on the sensor to pixels (u, v)."""
        c, d, e = self.affine
        return np.array([[1.0, e], [d, c]])

    def depth(self, rho: Float) -> Float:
        """Return z of the viewing direction whose distance from the axis is ``rho``."""
        return np.asarray(-polynomial.polyval(rho, np.array(self.polynomial)))

    @property
    def _powers(self) -> tuple[int, ...]:
        return (0, *range(2, len(self.polynomial)))

    def _corner_rho(self) -> float:
        width, height = self.image_size
        corners = np.array([[0, 0], [width, 0], [0, height], [width, height]], float)
        m = (corners - self.centre_px) @ np.linalg.inv(self.affine_matrix).T
        return float(np.hypot(m[:, 0], m[:, 1]).max())

    def _depth_slope(self, rho: Float) -> Float:
        return np.asarray(-polynomial.polyval(rho, polynomial.polyder(np.array(self.polynomial))))

    def _theta(self, rho: Float) -> Float:
        return np.asarray(np.arctan2(rho, self.depth(rho)))

    def _theta_slope(self, rho: Float) -> Float:
        z = self.depth(rho)
        return np.asarray((z - rho * self._depth_slope(rho)) / (rho * rho + z * z))

    def _rho(self, theta: Float) -> Float:
        nodes = np.linspace(0, self.rho_max, _NODES)
        return invert_increasing(self._theta, self._theta_slope, theta, nodes)

    def _slope(self, theta: Float, rho: Float) -> Float:
        return np.asarray(1 / self._theta_slope(rho))

    def _by_parameters(self, polar: Polar) -> Float:
        out = np.zeros((*polar.theta.shape, 2, len(self.parameter_names)))
        m = polar.rho[..., None] * polar.unit
        out[..., 0, 0], out[..., 1, 1] = 1, 1
        out[..., 1, 2], out[..., 1, 3], out[..., 0, 4] = m[..., 1], m[..., 0], m[..., 1]
        direction = polar.unit @ self.affine_matrix.T
        for column, power in enumerate(self._powers, start=5):
            out[..., :, column] = self._rho_by_coefficient(polar, power)[..., None] * direction
        return np.where(np.isnan(polar.theta)[..., None, None], np.nan, out)

    def _rho_by_coefficient(self, polar: Polar, power: int) -> Float:
        """dρ/da of a ray held fixed, from ρ cos θ − z(ρ) sin θ = 0."""
        sine, cosine = np.sin(polar.theta), np.cos(polar.theta)
        denominator = cosine - self._depth_slope(polar.rho) * sine
        return np.asarray(-sine * polar.rho**power / denominator)


def scaramuzza_problem(polynomial: Sequence[float], affine: Sequence[float]) -> tuple[str, str, str] | None:
    """Return (key, problem, expectation) when the numbers are not those of such a camera, else None."""
    c, d, e = affine
    if polynomial[0] >= 0:
        return "polynomial[0]", f"is {polynomial[0]}", "a0 in OCamCalib's sign, which is negative"
    if polynomial[1] != 0:
        return "polynomial[1]", f"is {polynomial[1]}", "a1 of 0: the image of the axis is smooth"
    if c - d * e <= 0:
        return "affine", "mirrors or flattens the image (c - d e is not positive)", "c near 1, d and e near 0"
    return None
