"""The interface every camera model keeps."""

from __future__ import annotations

from typing import NamedTuple, Protocol, Self, runtime_checkable

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
