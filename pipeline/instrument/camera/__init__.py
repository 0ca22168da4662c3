"""Fisheye-native camera models behind one interface."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, Self, runtime_checkable

import numpy as np

from pipeline.arrays import Bool, Float


class Projection(NamedTuple):
    """Pixels ``uv`` (..., 2) and ``valid`` (...): inside the model's domain (not: inside the image)."""

    uv: Float
    valid: Bool


class Rays(NamedTuple):
    """Unit viewing directions ``ray`` (..., 3) in C and ``valid`` (...)."""

    ray: Float
    valid: Bool


class ProjectionJacobian(NamedTuple):
    """``by_point`` (..., 2, 3) and ``by_parameters`` (..., 2, P) of `Camera.project`."""

    by_point: Float
    by_parameters: Float


class RaysJacobian(NamedTuple):
    """``by_pixel`` (..., 3, 2) and ``by_parameters`` (..., 3, P) of `Camera.unproject`."""

    by_pixel: Float
    by_parameters: Float


@runtime_checkable
class Camera(Protocol):
    """A central camera. Immutable; its methods never change their arguments; invalid results are NaN."""

    @property
    def model(self) -> str:
        """Name used in probe.yaml, e.g. ``kannala_brandt``."""

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height in pixels."""

    @property
    def centre_px(self) -> Float:
        """(2,) principal point (u, v)."""

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `parameters`."""

    @property
    def parameters(self) -> Float:
        """(P,) parameter vector."""

    def with_parameters(self, parameters: Float) -> Self:
        """Return the same model with other parameters."""

    def project(self, xyz_c: Float) -> Projection:
        """Project points (..., 3) in C, also beyond 90° where the model allows."""

    def unproject(self, uv: Float) -> Rays:
        """Return unit rays of pixels (..., 2)."""

    def project_jacobian(self, xyz_c: Float) -> ProjectionJacobian:
        """Return analytic derivatives of `project`."""

    def unproject_jacobian(self, uv: Float) -> RaysJacobian:
        """Return analytic derivatives of `unproject`."""


# Bisection alone reaches 1e-12 of the range in 40 steps; Newton's steps need about five.
_MOST_STEPS = 40
# Step, relative to the range, at which the inversion stops: a few hundred roundings.
_RELATIVE_STEP = 1e-13
# Coefficients below this are zero: dividing by them would overflow.
_NEGLIGIBLE = 1e-100


def invert_increasing(
    function: Callable[[Float], Float], slope: Callable[[Float], Float], value: Float, nodes: Float
) -> Float:
    """Return x (...) with ``function(x) = value`` (...), by Newton steps kept inside shrinking brackets.

    Parameters
    ----------
    function, slope
        An increasing function of x and its derivative.
    value
        Clipped to the function's range over ``nodes``; NaN gives NaN.
    nodes : (N,)
        Increasing; the first and last bound x, those between give the start.
    """
    table = function(nodes)
    value = np.clip(np.asarray(value, float), table[0], table[-1])
    low, high = np.full(value.shape, nodes[0]), np.full(value.shape, nodes[-1])
    x = np.interp(value, table, nodes)
    for _ in range(_MOST_STEPS):
        excess = function(x) - value
        high, low = np.where(excess > 0, x, high), np.where(excess <= 0, x, low)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = x - excess / slope(x)
        following = np.where((step >= low) & (step <= high), step, (low + high) / 2)
        moved = np.abs(following - x)
        x = following
        if not np.any(moved > _RELATIVE_STEP * nodes[-1]):
            break
    return np.asarray(np.where(np.isnan(value), np.nan, x))


def smallest_positive_root(coefficients: list[float]) -> float:
    """Return the smallest positive real root of Σ cᵢ xⁱ (lowest power first), or infinity.

    Coefficients that are not finite give 0: a model made of them maps nothing.
    """
    values = np.array(coefficients, float)
    if not np.all(np.isfinite(values)):
        return 0.0
    values[np.abs(values) < _NEGLIGIBLE] = 0.0
    roots = np.polynomial.Polynomial(np.trim_zeros(values, "b")).roots()
    real = roots.real[(np.abs(roots.imag) <= 1e-9 * np.abs(roots)) & (roots.real > 0)]
    return float(real.min()) if real.size else float("inf")


def rays_jacobian(forward: ProjectionJacobian) -> RaysJacobian:
    """Return the derivatives of ``unproject`` from those of ``project`` at the unit rays it returns.

    With J = ∂uv/∂ray on unit rays, whose null space is the ray itself, the implicit function theorem gives
    ∂ray/∂uv = J⁺ = Jᵀ(JJᵀ)⁻¹ and ∂ray/∂parameters = −J⁺ ∂uv/∂parameters.
    """
    transposed = np.swapaxes(forward.by_point, -1, -2)
    by_pixel = transposed @ _inverse_2x2(forward.by_point @ transposed)
    return RaysJacobian(by_pixel, -by_pixel @ forward.by_parameters)


def _inverse_2x2(matrix: Float) -> Float:
    a, b, c, d = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 0], matrix[..., 1, 1]
    adjugate = np.stack([np.stack([d, -b], -1), np.stack([-c, a], -1)], -2)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(adjugate / (a * d - b * c)[..., None, None])
