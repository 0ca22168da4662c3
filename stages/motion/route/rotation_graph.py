"""The graph of rotations along a run: what vision, straight lengths, gyroscope and gravity say of them.

Unknown are a small rotation of the run at nodes along the axis, the direction of each straight length, the
camera's constant drift of heading, and the biases of the IMU. R. Hartley et al., "Rotation averaging", IJCV
2013; C. Forster et al., "On-manifold preintegration for real-time visual-inertial odometry", 2017.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import chdtri

from pipeline.arrays import Float, Int
from pipeline.geometry.rigid import rotation_from_vector, skew, vector_from_rotation
from stages.motion.route.alignment import HEADING_DRIFT
from stages.motion.route.nodes import Inertia, Nodes, PlannedTurn

_Parts = list[tuple[Int, Float | float]]

STRAIGHTNESS_RAD = 2e-3
"""1 σ of the direction of a tube against its straight line: a bow of 0.0015 of the length, which EN 10217-1
allows, leans by 3.5 mrad rms; taken as the limit of an even distribution, by 2 mrad."""
STRAIGHT_MM = 3000.0
"""Way over which such a lean is the same: half of a tube of 6 m, the usual length. A choice."""
STANDARD_GRAVITY = 9.80665
"""m/s², by definition; on Earth gravity differs from it by less than 0.3 %."""
_GRAVITY_SIGMA = 0.03
_BIAS_RAD_S = 0.2
"""1 σ of a gyroscope's bias beforehand: consumer chips state up to ±10 °/s uncalibrated."""
_ROUNDS = 4
"""Gauss-Newton steps: each squares what is left, so that these suffice from half a radian."""
_ORIGIN_RAD = 1e-6
"""1 σ of the first node, whose pose defines the frame."""
_CHANCE = 1e-3
"""Chance with which a straight pipe is taken for bent where an IMU is there. A choice."""
_DIRECTION_SIGMA = 10.0
"""1 σ of a length's direction beforehand: nothing is known."""


@dataclass(frozen=True)
class Rotations:
    """The answer: rotations of the run in P at the nodes, and which way is up.

    Attributes
    ----------
    turn_p : (K, 3, 3)
    covariance : (3 K, 3 K)
        Of the nodes' rotations as rotation vectors in P.
    drift : (2,)
        The camera's drift of heading about its x and y, rad/mm.
    up_p : (3,) or None
        None without an IMU.
    up_sigma_rad : float
    """

    turn_p: Float
    covariance: Float
    drift: Float
    up_p: Float | None
    up_sigma_rad: float


@dataclass(frozen=True)
class _State:
    """Unknowns: rotations (K, 3, 3), drift (2,), directions (L, 3), biases (K, 3), force (3,), up (3,)."""

    turn: Float
    drift: Float
    direction: Float
    bias: Float
    force: Float
    up: Float

    def columns(self) -> dict[str, Int]:
        """Return the columns of each unknown's step."""
        sizes = [self.turn.shape[0] * 3, 2, self.direction.size, self.bias.size, 3, 3]
        ends = np.cumsum([0, *sizes])
        names = ("turn", "drift", "direction", "bias", "force", "up")
        return {n: np.arange(a, b) for n, a, b in zip(names, ends[:-1], ends[1:], strict=True)}

    def moved(self, step: Float) -> _State:
        """Return the state after a step (S,)."""
        at = self.columns()
        return _State(
            rotation_from_vector(step[at["turn"]].reshape(-1, 3)) @ self.turn,
            self.drift + step[at["drift"]],
            self.direction + step[at["direction"]].reshape(-1, 3),
            self.bias + step[at["bias"]].reshape(-1, 3),
            self.force + step[at["force"]],
            self.up + step[at["up"]],
        )


class _Equations:
    """Normal equations and the sum of squares."""

    def __init__(self, size: int) -> None:
        self.normal, self.right, self.cost = np.zeros((size, size)), np.zeros(size), 0.0

    def add(self, residual: Float, sigma: Float | float, parts: _Parts) -> None:
        """Add a few equations (m,) with derivatives (m, w), or a factor, by columns (w,)."""
        columns = np.concatenate([c for c, _ in parts])
        by = np.concatenate([np.eye(len(residual)) * b if np.ndim(b) == 0 else b for _, b in parts], 1)
        weight = (1 / np.square(np.broadcast_to(sigma, residual.shape)))[:, None]
        self.cost += float(weight[:, 0] @ residual**2)
        self.normal[np.ix_(columns, columns)] += by.T @ (weight * by)
        self.right[columns] -= (by.T @ (weight * residual[:, None]))[:, 0]


@dataclass(frozen=True)
class RotationGraph:
    """All that is known of the rotations along a run."""

    nodes: Nodes
    inertia: Inertia | None = None
    planned: tuple[PlannedTurn, ...] = ()

    def solve(self) -> Rotations:
        """Return the rotations at the optimum.

        Vision's variance is scaled by how well it fits the rest: where a long straight pipe shows that it
        errs by more than it says, it is believed less.
        """
        if self._is_bent():
            free = replace(self.nodes, length=np.full(len(self.nodes.length), -1))
            return replace(self, nodes=free, planned=()).solve()
        excess = self._excess(self._minimum())
        nodes = replace(self.nodes, variance=self.nodes.variance * excess)
        graph = replace(self, nodes=nodes)
        state = graph._minimum()
        factor = cho_factor(graph._equations(state).normal)
        at = state.columns()
        unit = np.eye(len(factor[0]))
        covariance = cho_solve(factor, unit[:, at["turn"]])[at["turn"]]
        if self.inertia is None:
            return Rotations(state.turn, covariance, state.drift, None, float("nan"))
        of_up = cho_solve(factor, unit[:, at["up"]])[at["up"]]
        size = float(np.linalg.norm(state.up))
        across = np.eye(3) - np.outer(state.up, state.up) / size**2
        sigma = float(np.sqrt(np.trace(across @ of_up @ across) / 2)) / size
        return Rotations(state.turn, covariance, state.drift, state.up / size, sigma)

    def _is_bent(self) -> bool:
        """Return whether an IMU contradicts that the lengths are straight.

        Held straight, the equations cost more than free by about two for each node, and seldom by much more.
        """
        straight = self.nodes.length >= 0
        if self.inertia is None or not straight.any():
            return False
        free = replace(self, nodes=replace(self.nodes, length=np.full(len(straight), -1)), planned=())
        excess = free._excess(free._minimum())
        cost = [
            replace(g, nodes=replace(g.nodes, variance=g.nodes.variance * excess))._least_cost()
            for g in (self, free)
        ]
        return bool(cost[0] - cost[1] > chdtri(2 * int(straight.sum()), _CHANCE))

    def _least_cost(self) -> float:
        return self._equations(self._minimum()).cost

    def _minimum(self) -> _State:
        state = self._start()
        for _ in range(_ROUNDS):
            equations = self._equations(state)
            state = state.moved(cho_solve(cho_factor(equations.normal), equations.right))
        return state

    def _start(self) -> _State:
        nodes, count = self.nodes, len(self.nodes.distance_mm)
        lengths = int(nodes.length.max(initial=-1)) + 1
        direction = np.array([nodes.tangent_p[nodes.length == j].mean(0) for j in range(lengths)])
        up = np.array([0.0, -STANDARD_GRAVITY, 0.0])
        if self.inertia is not None:
            up = nodes.R_pc[0] @ self.inertia.force_c[0]
        turn = np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
        return _State(turn, np.zeros(2), direction.reshape(-1, 3), np.zeros((count, 3)), np.zeros(3), up)

    def _excess(self, state: _State) -> float:
        """Return by how much vision's squared errors exceed their variance, at least 1."""
        error = np.array([self._vision_error(state, k) for k in range(len(self.nodes.variance))])
        return max(1.0, float(np.mean(error**2 / self.nodes.variance))) if len(error) else 1.0

    def _equations(self, state: _State) -> _Equations:
        at = state.columns()
        out = _Equations(sum(len(c) for c in at.values()))
        turn = at["turn"].reshape(-1, 3)
        out.add(vector_from_rotation(state.turn[0]), _ORIGIN_RAD, [(turn[0], 1.0)])
        out.add(state.drift, HEADING_DRIFT, [(at["drift"], 1.0)])
        self._add_vision(out, state, turn, at)
        self._add_lengths(out, state, turn, at)
        self._add_inertia(out, state, turn, at)
        return out

    def _rotation(self, state: _State, k: int) -> Float:
        return np.asarray(state.turn[k] @ self.nodes.R_pc[k])

    def _vision_error(self, state: _State, k: int) -> Float:
        seen = self.nodes.R_pc[k].T @ self.nodes.R_pc[k + 1]
        step = self.nodes.distance_mm[k + 1] - self.nodes.distance_mm[k]
        error = vector_from_rotation(seen.T @ self._rotation(state, k).T @ self._rotation(state, k + 1))
        return np.asarray(error - step * np.append(state.drift, 0.0))

    def _add_vision(self, out: _Equations, state: _State, turn: Int, at: dict[str, Int]) -> None:
        for k, variance in enumerate(self.nodes.variance):
            to_c = self._rotation(state, k + 1).T
            step = self.nodes.distance_mm[k + 1] - self.nodes.distance_mm[k]
            by = [(turn[k + 1], to_c), (turn[k], -to_c), (at["drift"], -step * np.eye(3)[:, :2])]
            out.add(self._vision_error(state, k), np.sqrt(variance), by)

    def _add_lengths(self, out: _Equations, state: _State, turn: Int, at: dict[str, Int]) -> None:
        nodes, of_length = self.nodes, at["direction"].reshape(-1, 3)
        for columns in of_length:
            out.add(np.zeros(3), _DIRECTION_SIGMA, [(columns, 1.0)])
        step = np.gradient(nodes.distance_mm)
        for k in np.flatnonzero(nodes.length >= 0):
            tangent = state.turn[k] @ nodes.tangent_p[k]
            sigma = STRAIGHTNESS_RAD * np.sqrt(max(STRAIGHT_MM / step[k], 1.0))
            by: _Parts = [(turn[k], -skew(tangent)), (of_length[nodes.length[k]], -1.0)]
            out.add(tangent - state.direction[nodes.length[k]], sigma, by)
        for plan in self.planned:
            one, other = state.direction[plan.length], state.direction[plan.length + 1]
            cosine = float(one @ other / np.linalg.norm(one) / np.linalg.norm(other))
            sine = max(float(np.sqrt(1 - min(cosine**2, 1.0))), 1e-3)
            angle = np.array([np.arccos(np.clip(cosine, -1, 1)) - plan.angle_rad])
            here, there = of_length[plan.length], of_length[plan.length + 1]
            turns: _Parts = [(here, -other[None] / sine), (there, -one[None] / sine)]
            out.add(angle, plan.sigma_rad, turns)

    def _add_inertia(self, out: _Equations, state: _State, turn: Int, at: dict[str, Int]) -> None:
        inertia, bias = self.inertia, at["bias"].reshape(-1, 3)
        if inertia is None:
            for name in ("bias", "force", "up"):  # nothing depends on them
                out.add(np.zeros(len(at[name])), 1.0, [(at[name], 1.0)])
            return
        out.add(state.bias[0], _BIAS_RAD_S, [(bias[0], 1.0)])
        out.add(state.force, inertia.force_bias_sigma, [(at["force"], 1.0)])
        size = float(np.linalg.norm(state.up))
        out.add(np.array([size - STANDARD_GRAVITY]), _GRAVITY_SIGMA, [(at["up"], state.up[None] / size)])
        for k, step_s in enumerate(inertia.step_s):
            here, there = self._rotation(state, k), self._rotation(state, k + 1)
            error = vector_from_rotation(inertia.R_step[k].T @ here.T @ there) + step_s * state.bias[k]
            by: _Parts = [(turn[k + 1], there.T), (turn[k], -there.T), (bias[k], step_s)]
            out.add(error, np.sqrt(inertia.step_variance[k]), by)
            change = state.bias[k + 1] - state.bias[k]
            out.add(change, np.sqrt(inertia.walk_variance[k]), [(bias[k + 1], 1.0), (bias[k], -1.0)])
        for rest in inertia.rests:
            shift = state.bias[rest.node] - rest.rate_c
            out.add(shift, rest.sigma_rad_s, [(bias[rest.node], 1.0)])
        for k, force in enumerate(inertia.force_c):
            shown = self._rotation(state, k) @ (force - state.force)
            by = [(turn[k], -skew(shown)), (at["force"], -self._rotation(state, k)), (at["up"], -1.0)]
            out.add(shown - state.up, inertia.force_sigma, by)
