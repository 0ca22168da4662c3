"""The graph of rotations along a run, with measurements of vision, straight lengths, gyroscope and gravity.

The unknowns are a small rotation of the run at nodes along the axis, the direction of each straight length,
the camera's constant drift of heading, and the biases of the IMU. R. Hartley et al., "Rotation averaging",
IJCV 2013; C. Forster et al., "On-manifold preintegration for real-time visual-inertial odometry", 2017.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import chdtri

from pipeline.arrays import Float, Int
from pipeline.geometry.rigid import rotation_from_vector, skew, vector_from_rotation
from stages.motion.route.alignment import HEADING_DRIFT
from stages.motion.route.nodes import Inertia, Nodes, PlannedTurn, Rotations

_Parts = list[tuple[Int, Float | float]]

STRAIGHTNESS_RAD = 2e-3
"""1 σ of the direction of a tube relative to its straight line: a bow of 0.0015 of the length, which EN
10217-1 allows, deviates by 3.5 mrad rms; as the limit of a uniform distribution, by 2 mrad."""
STRAIGHT_MM = 3000.0
"""Length over which this deviation is constant: half of a tube of 6 m, the usual length. A choice."""
STANDARD_GRAVITY = 9.80665
"""m/s², by definition; on Earth gravity differs from it by less than 0.3 %."""
_GRAVITY_SIGMA = 0.03
_BIAS_RAD_S = 0.2
"""Prior 1 σ of a gyroscope's bias: consumer chips state up to ±10 °/s uncalibrated."""
_ROUNDS = 4
"""Gauss-Newton steps: each squares the rest, so that these suffice from half a radian."""
_ORIGIN_RAD = 1e-6
"""1 σ of the first node, whose pose defines the frame."""
_CHANCE = 1e-3
"""Probability with which a straight pipe is taken for bent if there is an IMU. A choice."""
_DIRECTION_SIGMA = 10.0
"""Prior 1 σ of a length's direction: nothing is known."""
_LEAST_FREE = 10.0
"""With fewer degrees of freedom, the variance of vision is not scaled up. A choice."""


@dataclass(frozen=True)
class _State:
    """Unknowns.

    Rotations (K, 3, 3), drift (2,), directions (L, 3), biases beyond the rough one (K, 3), the gyroscope's
    scale error matrix (3, 3), the accelerometer's constant error (3,), up (3,).
    """

    turn: Float
    drift: Float
    direction: Float
    bias: Float
    response: Float
    force: Float
    up: Float

    def columns(self) -> dict[str, Int]:
        """Return the columns of each unknown's step."""
        sizes = [self.turn.shape[0] * 3, 2, self.direction.size, self.bias.size, 9, 3, 3]
        ends = np.cumsum([0, *sizes])
        names = ("turn", "drift", "direction", "bias", "response", "force", "up")
        return {n: np.arange(a, b) for n, a, b in zip(names, ends[:-1], ends[1:], strict=True)}

    @property
    def size(self) -> int:
        """Return the number of unknowns."""
        return sum(len(c) for c in self.columns().values())

    def moved(self, step: Float) -> _State:
        """Return the state after a step (S,)."""
        at = self.columns()
        return _State(
            rotation_from_vector(step[at["turn"]].reshape(-1, 3)) @ self.turn,
            self.drift + step[at["drift"]],
            self.direction + step[at["direction"]].reshape(-1, 3),
            self.bias + step[at["bias"]].reshape(-1, 3),
            self.response + step[at["response"]].reshape(3, 3),
            self.force + step[at["force"]],
            self.up + step[at["up"]],
        )


class _Equations:
    """Normal equations and the sum of squares."""

    def __init__(self, size: int) -> None:
        self.normal, self.right, self.cost = np.zeros((size, size)), np.zeros(size), 0.0

    def add(self, residual: Float, variance: Float | float, parts: _Parts) -> None:
        """Add equations (n, m) with derivatives (n, m, w), or a factor of one, by columns (n, w) of each."""
        size = residual.shape[1]
        columns = np.concatenate([c for c, _ in parts], 1)
        whole = [np.eye(size) * b if np.ndim(b) == 0 else np.asarray(b) for _, b in parts]
        by = np.concatenate([np.broadcast_to(b, (len(residual), *b.shape[-2:])) for b in whole], 2)
        weight = 1 / np.broadcast_to(variance, residual.shape)
        self.cost += float(np.sum(weight * residual**2))
        weighted = np.swapaxes(by * weight[..., None], 1, 2)
        np.add.at(self.normal, (columns[:, :, None], columns[:, None, :]), weighted @ by)
        np.add.at(self.right, columns, -(weighted @ residual[..., None])[..., 0])


@dataclass(frozen=True)
class RotationGraph:
    """The measurements and priors of the rotations along a run."""

    nodes: Nodes
    inertia: Inertia | None = None
    planned: tuple[PlannedTurn, ...] = ()

    def solve(self) -> Rotations:
        """Return the rotations at the optimum.

        Vision's variance is scaled by its residuals: if a long straight pipe shows larger errors than stated,
        vision gets less weight.
        """
        if self._is_bent():
            free = replace(self.nodes, length=np.full(len(self.nodes.length), -1))
            return replace(self, nodes=free, planned=()).solve()
        excess = self._excess()
        graph = replace(self, nodes=replace(self.nodes, variance=self.nodes.variance * excess))
        state = graph._minimum()
        factor = cho_factor(graph._equations(state).normal)
        at = state.columns()
        covariance = cho_solve(factor, np.eye(len(factor[0])))
        turn, up = at["turn"], at["up"]
        size = float(np.linalg.norm(state.up))
        return Rotations(
            state.turn, covariance[np.ix_(turn, turn)], state.drift,
            None if self.inertia is None else state.up / size,
            covariance[np.ix_(up, up)] / size**2, covariance[np.ix_(turn, up)] / size,
        )  # fmt: skip

    def _is_bent(self) -> bool:
        """Return whether an IMU contradicts that the lengths are straight.

        With straight lengths, the equations cost more than without by about two for each node, and seldom by
        much more.
        """
        straight = self.nodes.length >= 0
        if self.inertia is None or not straight.any():
            return False
        free = replace(self, nodes=replace(self.nodes, length=np.full(len(straight), -1)), planned=())
        excess = free._excess()
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
        return _State(
            turn,
            np.zeros(2),
            direction.reshape(-1, 3),
            np.zeros((count, 3)),
            np.zeros((3, 3)),
            np.zeros(3),
            up,
        )

    def _excess(self) -> float:
        """Return the ratio of vision's squared errors to their remaining variance, at least 1."""
        state, variance = self._minimum(), self.nodes.variance
        if not len(variance):
            return 1.0
        covariance = cho_solve(cho_factor(self._equations(state).normal), np.eye(state.size))
        at = state.columns()
        columns, by = self._vision_parts(state, at)
        own = covariance[columns[:, :, None], columns[:, None, :]]
        fitted = np.einsum("kiw,kwv,kiv->ki", by, own, by)
        free = float(np.sum(1 - np.minimum(fitted / variance, 1.0)))
        return max(1.0, float(np.sum(self._vision_error(state) ** 2 / variance)) / max(free, _LEAST_FREE))

    def _equations(self, state: _State) -> _Equations:
        at = state.columns()
        out = _Equations(state.size)
        turn = at["turn"].reshape(-1, 3)
        out.add(vector_from_rotation(state.turn[:1]), _ORIGIN_RAD**2, [(turn[:1], 1.0)])
        out.add(state.drift[None], HEADING_DRIFT**2, [(at["drift"][None], 1.0)])
        out.add(self._vision_error(state), self.nodes.variance, [self._vision_parts(state, at)])
        self._add_lengths(out, state, turn, at)
        self._add_inertia(out, state, turn, at)
        return out

    def _vision_error(self, state: _State) -> Float:
        seen = np.swapaxes(self.nodes.R_pc[:-1], 1, 2) @ self.nodes.R_pc[1:]
        R = state.turn @ self.nodes.R_pc
        error = vector_from_rotation(np.swapaxes(seen, 1, 2) @ np.swapaxes(R[:-1], 1, 2) @ R[1:])
        return np.asarray(error - self.nodes.by_drift @ state.drift)

    def _vision_parts(self, state: _State, at: dict[str, Int]) -> tuple[Int, Float]:
        """Return the columns (K - 1, 8) of rotations and drift, and vision's derivatives (K - 1, 3, 8)."""
        turn, to_c = at["turn"].reshape(-1, 3), np.swapaxes(state.turn @ self.nodes.R_pc, 1, 2)[1:]
        drift = np.broadcast_to(at["drift"], (len(to_c), 2))
        columns = np.concatenate([turn[1:], turn[:-1], drift], 1)
        return columns, np.concatenate([to_c, -to_c, -self.nodes.by_drift], 2)

    def _add_lengths(self, out: _Equations, state: _State, turn: Int, at: dict[str, Int]) -> None:
        nodes, of_length = self.nodes, at["direction"].reshape(-1, 3)
        out.add(np.zeros(of_length.shape), _DIRECTION_SIGMA**2, [(of_length, 1.0)])
        at_node, step = np.flatnonzero(nodes.length >= 0), np.gradient(nodes.distance_mm)
        length = nodes.length[at_node]
        tangent = np.einsum("kij,kj->ki", state.turn[at_node], nodes.tangent_p[at_node])
        variance = STRAIGHTNESS_RAD**2 * np.maximum(STRAIGHT_MM / step[at_node], 1.0)
        lean: _Parts = [(turn[at_node], -skew(tangent)), (of_length[length], -1.0)]
        out.add(tangent - state.direction[length], variance[:, None], lean)
        for plan in self.planned:
            one, other = state.direction[plan.length], state.direction[plan.length + 1]
            cosine = float(one @ other / np.linalg.norm(one) / np.linalg.norm(other))
            sine = max(float(np.sqrt(1 - min(cosine**2, 1.0))), 1e-3)
            angle = np.array([[np.arccos(np.clip(cosine, -1, 1)) - plan.angle_rad]])
            here, there = of_length[[plan.length]], of_length[[plan.length + 1]]
            turns: _Parts = [(here, -other[None, None] / sine), (there, -one[None, None] / sine)]
            out.add(angle, plan.sigma_rad**2, turns)

    def _add_inertia(self, out: _Equations, state: _State, turn: Int, at: dict[str, Int]) -> None:
        inertia, bias = self.inertia, at["bias"].reshape(-1, 3)
        if inertia is None:
            for name in ("bias", "response", "force", "up"):  # nothing depends on them
                out.add(np.zeros((1, len(at[name]))), 1.0, [(at[name][None], 1.0)])
            return
        force, up = at["force"][None], at["up"][None]
        out.add(state.bias[:1], _BIAS_RAD_S**2, [(bias[:1], 1.0)])
        out.add(state.force[None], inertia.force_bias_sigma**2, [(force, 1.0)])
        size = float(np.linalg.norm(state.up))
        out.add(np.array([[size - STANDARD_GRAVITY]]), _GRAVITY_SIGMA**2, [(up, state.up[None, None] / size)])
        R = state.turn @ self.nodes.R_pc
        back, rate = np.swapaxes(R, 1, 2), vector_from_rotation(inertia.R_step) / inertia.step_s[:, None]
        error = vector_from_rotation(np.swapaxes(inertia.R_step, 1, 2) @ back[:-1] @ R[1:])
        false_rate = state.bias[:-1] + rate @ state.response.T
        error = error + np.einsum("kij,kj->ki", inertia.by_bias, false_rate)
        response = np.broadcast_to(at["response"], (len(rate), 9))
        out.add(state.response.reshape(1, 9), inertia.response_sigma**2, [(response[:1], 1.0)])
        by_response = np.einsum("kij,kl->kijl", inertia.by_bias, rate).reshape(-1, 3, 9)
        by: _Parts = [(turn[1:], back[1:]), (turn[:-1], -back[1:])]
        by += [(bias[:-1], inertia.by_bias), (response, by_response)]
        out.add(error, inertia.step_variance[:, None], by)
        walk = np.diff(state.bias, axis=0)
        out.add(walk, inertia.walk_variance[:, None], [(bias[1:], 1.0), (bias[:-1], -1.0)])
        for rest in inertia.rests:
            shift = inertia.bias_c + state.bias[rest.node] - rest.rate_c
            out.add(shift[None], rest.sigma_rad_s**2, [(bias[[rest.node]], 1.0)])
        shown = np.einsum("kij,kj->ki", R, inertia.force_c - state.force)
        each = np.ones((len(R), 1), np.int64)
        by = [(turn, -skew(shown)), (force * each, -R), (up * each, -1.0)]
        out.add(shown - state.up, inertia.force_sigma**2, by)
