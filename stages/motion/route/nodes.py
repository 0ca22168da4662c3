"""What is known of a run's rotation at nodes along its axis: by vision, by an IMU, by a plan."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.arrays import Float, Int


@dataclass(frozen=True)
class Nodes:
    """Places along the axis at which the run may turn.

    Attributes
    ----------
    distance_mm : (K,)
    R_pc : (K, 3, 3)
        Camera's rotations as vision has them.
    tangent_p : (K, 3)
        Of the axis.
    variance : (K - 1, 3)
        Of vision's rotation from each node to the next, in C, rad².
    by_drift : (K - 1, 3, 2)
        That rotation's derivatives by the camera's drift of heading, mm: the way about C's x and y, as the
        camera lay on the way.
    length : (K,) int
        Which straight length the node lies in, −1 in a bend.
    """

    distance_mm: Float
    R_pc: Float
    tangent_p: Float
    variance: Float
    by_drift: Float
    length: Int


@dataclass(frozen=True)
class Rest:
    """A stop of the probe next to a node: what the gyroscope then shows is its bias, (3,) rad/s in C."""

    node: int
    rate_c: Float
    sigma_rad_s: float


@dataclass(frozen=True)
class Inertia:
    """What an IMU says between and at the nodes, in C.

    Attributes
    ----------
    R_step : (K - 1, 3, 3)
        Rotation from node to node by the gyroscope, as if it had no bias.
    step_s : (K - 1,)
    step_variance, walk_variance : (K - 1,)
        Of that rotation, rad², and of the change of the bias, rad²/s².
    force_c : (K, 3)
        Mean specific force about each node, m/s².
    force_sigma, force_bias_sigma : float
        1 σ of its changing and of its constant error, m/s².
    rests : tuple of Rest
    """

    R_step: Float
    step_s: Float
    step_variance: Float
    walk_variance: Float
    force_c: Float
    force_sigma: float
    force_bias_sigma: float
    rests: tuple[Rest, ...] = ()


@dataclass(frozen=True)
class PlannedTurn:
    """The angle that a plan states between one straight length and the next."""

    length: int
    angle_rad: float
    sigma_rad: float
