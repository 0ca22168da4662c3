"""The unknowns of the bundle adjustment."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import BSpline

from pipeline.arrays import Float, Int
from pipeline.geometry.axis import PipeAxis, axis_through, frames_at, from_pipe, to_pipe
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from stages.motion.bore import ONE_BORE, Bore

GLOBALS = 4
ENCODER_SCALE = GLOBALS - 1
AXIS_STEP_MM = 2.0
"""Spacing of the axis' points. Between them the axis is straight, which in a bend of radius R errs by
AXIS_STEP_MM² / 8 R: 0.01 mm for R = 50 mm."""
_DEGREE = 3


@dataclass(frozen=True)
class State:
    """Poses, encoder slip, landmarks, and the pipe.

    Attributes
    ----------
    T_pc : (N, 4, 4)
    slip : (N,)
        Encoder's accumulated slip, mm.
    xyz_p : (L, 3)
        Landmarks.
    globals : (4,)
        Radius, second-harmonic cosine and sine of the radius (ovality), mm, and encoder scale.
    axis : PipeAxis
        Current axis; the adjustment's axis unknowns are deflections from it.
    curve : (2, knots)
        Sum of the deflections so far, as spline coefficients along x and y of the sections.
    knot_mm, nominal_radius_mm : float
    instrument : (Q,)
        Corrections of the instrument along its principal uncertainties, then of texture matching, in σ.
    bore : Bore
        Widths of the pipe as measured by the rings; not an unknown.
    guess_mm : (N,)
        Camera distances with which the places of the rings in the bore were computed; empty: the current
        ones.
    """

    T_pc: Float
    slip: Float
    xyz_p: Float
    globals: Float
    axis: PipeAxis
    curve: Float
    knot_mm: float
    nominal_radius_mm: float
    instrument: Float
    bore: Bore = ONE_BORE
    guess_mm: Float = field(default_factory=lambda: np.zeros(0))

    @property
    def knots(self) -> int:
        """Number of spline coefficients along each direction."""
        return int(self.curve.shape[1])

    @property
    def border_size(self) -> int:
        """Number of global unknowns: the border of the normal equations."""
        return GLOBALS + 2 * self.knots + len(self.instrument)

    @property
    def shared(self) -> Float:
        """Parameters (S,) that all windows of a run share: encoder scale and instrument."""
        return np.append(self.globals[ENCODER_SCALE], self.instrument)

    @property
    def shared_columns(self) -> Int:
        """Indices (S,) of `shared` in the border."""
        return np.asarray(np.r_[ENCODER_SCALE, self.border_size - len(self.instrument) : self.border_size])

    def with_shared(self, shared: Float) -> State:
        """Return the state with other encoder scale and instrument (S,)."""
        globals_ = np.append(self.globals[:ENCODER_SCALE], shared[0])
        return replace(self, globals=globals_, instrument=shared[1:])

    def axis_basis(self, distance_mm: Float) -> Float:
        """Return the spline basis (M, knots) at distances (M,), clamped to the axis."""
        if not len(distance_mm):
            return np.zeros((0, self.knots))
        knots = self._knot_vector()
        s = np.clip(distance_mm, knots[_DEGREE], knots[-_DEGREE - 1] - 1e-9)
        return np.asarray(BSpline.design_matrix(s, knots, _DEGREE).toarray())

    def section_frames(self, distance_mm: Float) -> Float:
        """Return the axis' frames (M, 3, 3) in P at distances (M,)."""
        return frames_at(self.axis, distance_mm)[1]

    def with_bore_in_place(self, ahead_mm: float) -> State:
        """Return the state with a reducer moved to its rings' current place, ``ahead_mm`` of the camera."""
        if not self.bore.reduces or not len(self.guess_mm):
            return self
        now = to_pipe(self.axis, self.T_pc[:, :3, 3])[0]
        order = np.argsort(self.guess_mm, kind="stable")
        guess = self.guess_mm[order]
        moved = np.interp(self.bore.rings_mm - ahead_mm, guess, now[order] - guess)
        rings_mm = np.maximum.accumulate(self.bore.rings_mm + moved)
        return replace(self, bore=replace(self.bore, rings_mm=rings_mm), guess_mm=now)

    def step(self, frames: Float, border: Float, landmarks: Float) -> State:
        """Return the state after a step of the frames (N, 7), the border (B,) and the landmarks (L, 3)."""
        deflection = border[GLOBALS : GLOBALS + 2 * self.knots].reshape(2, -1)
        return replace(
            self,
            T_pc=moved(self.T_pc, frames[:, :6]),
            slip=self.slip + frames[:, 6],
            xyz_p=self.xyz_p + landmarks,
            globals=self.globals + border[:GLOBALS],
            axis=self._deflected(deflection),
            curve=self.curve + deflection,
            instrument=self.instrument + border[GLOBALS + 2 * self.knots :],
        )

    def _deflected(self, deflection: Float) -> PipeAxis:
        x, y = (self.axis_basis(self.axis.distance_mm) @ deflection.T).T
        origin = from_pipe(self.axis, self.axis.distance_mm, np.arctan2(y, x), np.hypot(x, y))
        return axis_through(origin, self.axis.R_pa[0, :, 0], float(self.axis.distance_mm[0]))

    def _knot_vector(self) -> Float:
        first = self.axis.distance_mm[0] - _DEGREE * self.knot_mm
        return np.asarray(first + self.knot_mm * np.arange(self.knots + _DEGREE + 1))


def moved(T_pc: Float, step: Float) -> Float:
    """Return poses [R exp(w), t + d] (..., 4, 4) for steps (..., 6) = (d, w) of poses [R, t]."""
    turn = rotation_from_vector(step[..., 3:])
    return from_parts(T_pc[..., :3, :3] @ turn, T_pc[..., :3, 3] + step[..., :3])


def straight_start(
    T_pc: Float,
    xyz_p: Float,
    from_mm: float,
    to_mm: float,
    radius_mm: float,
    knot_mm: float,
    corrections: int,
) -> State:
    """Return the state of a straight pipe from first guesses of poses and landmarks.

    ``corrections`` is the number of corrections of the instrument and of texture matching.
    """
    steps = max(int(np.ceil((to_mm - from_mm) / AXIS_STEP_MM)), 2)
    z = np.linspace(from_mm, to_mm, steps + 1)
    axis = axis_through(np.stack([0 * z, 0 * z, z], -1), np.array([1.0, 0, 0]), from_mm)
    knots = int(np.ceil((to_mm - from_mm) / knot_mm)) + _DEGREE
    return State(
        T_pc, np.zeros(len(T_pc)), xyz_p, np.array([radius_mm, 0.0, 0.0, 1.0]), axis,
        np.zeros((2, knots)), knot_mm, radius_mm, np.zeros(corrections),
    )  # fmt: skip
