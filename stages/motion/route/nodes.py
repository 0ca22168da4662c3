"""A run's rotation at nodes along its axis: measurements of vision, an IMU and a plan, and the result."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float, Int


@dataclass(frozen=True)
class Nodes:
    """Places along the axis at which the run may be rotated.

    Attributes
    ----------
    distance_mm : (K,)
    R_pc : (K, 3, 3)
        Camera's rotations from vision.
    tangent_p : (K, 3)
        Direction of the axis.
    variance : (K - 1, 3)
        Variance of vision's rotation from each node to the next, in C, rad².
    by_drift : (K - 1, 3, 2)
        That rotation's derivatives by the camera's drift of heading about C's x and y, mm, with the camera's
        orientations in between.
    length : (K,) int
        Number of the straight length in which the node lies, −1 in a bend.
    """

    distance_mm: Float
    R_pc: Float
    tangent_p: Float
    variance: Float
    by_drift: Float
    length: Int


@dataclass(frozen=True)
class Rest:
    """A stop of the probe next to a node: the gyroscope's reading is then its bias, (3,) rad/s in C."""

    node: int
    rate_c: Float
    sigma_rad_s: float


@dataclass(frozen=True)
class Inertia:
    """Measurements of an IMU between and at the nodes, in C.

    Attributes
    ----------
    R_step : (K - 1, 3, 3)
        Rotation from node to node by the gyroscope, after subtraction of `bias_c` from its readings.
    by_bias : (K - 1, 3, 3)
        Decrease of that rotation, as a vector in C at its end, per bias, s.
    bias_c : (3,)
        Rough bias, rad/s: the usual excess of the gyroscope's rate over the camera's.
    step_s : (K - 1,)
    step_variance, walk_variance : (K - 1,)
        Variances of that rotation, rad², and of the change of the bias, rad²/s².
    force_c : (K, 3)
        Mean specific force around each node, m/s².
    force_sigma, force_bias_sigma : float
        1 σ of its variable and of its constant error, m/s².
    response_sigma : float
        1 σ of each element of the gyroscope's scale error matrix: scales and cross-axis sensitivities.
    rests : tuple of Rest
    """

    R_step: Float
    by_bias: Float
    bias_c: Float
    step_s: Float
    step_variance: Float
    walk_variance: Float
    force_c: Float
    force_sigma: float
    force_bias_sigma: float
    response_sigma: float
    rests: tuple[Rest, ...] = ()


@dataclass(frozen=True)
class PlannedTurn:
    """The angle that a plan states between one straight length and the next."""

    length: int
    angle_rad: float
    sigma_rad: float


@dataclass(frozen=True)
class Rotations:
    """The result: rotations of the run in P at the nodes, and the direction up.

    Attributes
    ----------
    turn_p : (K, 3, 3)
    covariance : (3 K, 3 K)
        Covariance of the nodes' rotations as rotation vectors in P.
    drift : (2,)
        The camera's drift of heading about its x and y, rad/mm.
    up_p : (3,) or None
        None without an IMU.
    up_covariance : (3, 3)
    turn_with_up : (3 K, 3)
        Covariance of the nodes' rotations with ``up_p``.
    """

    turn_p: Float
    covariance: Float
    drift: Float
    up_p: Float | None
    up_covariance: Float
    turn_with_up: Float

    @property
    def clock_sigma_rad(self) -> float:
        """Return 1 σ of the angle of up about P's z."""
        by_up = self._clock_by_up()
        return float(np.sqrt(by_up @ self.up_covariance @ by_up))

    def about_up(self) -> Rotations:
        """Return them with their errors after P is rotated about z until up is its −y."""
        by_up = self._clock_by_up()
        about_z = np.tile([0.0, 0.0, 1.0], len(self.turn_p))
        mixed = np.outer(self.turn_with_up @ by_up, about_z)
        own = self.clock_sigma_rad**2 * np.outer(about_z, about_z)
        return replace(self, covariance=self.covariance - mixed - mixed.T + own)

    def _clock_by_up(self) -> Float:
        """Return the derivative (3,) of the angle of up about z."""
        assert self.up_p is not None
        x, y, _ = self.up_p
        return np.asarray(np.array([-y, x, 0.0]) / (x * x + y * y))
