"""The equations of the bundle adjustment without landmarks: rings, smooth motion, encoder, axis and priors.

Every function returns linearised equations (`pipeline.adjustment.bordered.Rows`): residual, derivatives by
the unknowns of the frames (pose and slip) and by the border, and the σ of the residual.
"""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.elimination import BLOCK
from pipeline.adjustment.motion_priors import slip_drift_rows
from pipeline.adjustment.robust import Cauchy, Loss, Squares
from pipeline.adjustment.rows import Rows
from pipeline.arrays import Float
from pipeline.geometry.axis import to_pipe
from pipeline.geometry.rigid import skew, transform, vector_from_rotation
from stages.motion.bundle_adjustment.unknowns import AXIS_STEP_MM, ENCODER_SCALE, GLOBALS, State
from stages.motion.encoder import EncoderReadings
from stages.motion.rings import RingBins

ORIGIN_SIGMA = np.array([1e-4] * 3 + [1e-6] * 3)
"""1 σ, mm and rad, of the first pose, which defines the frame: far below the σ of any other pose."""
_HELD = 1e-3
"""Shared parameters of the whole run are held to this share of their stated σ: so tightly that a window
cannot move them, yet not exactly, so that the equations stay regular."""
_VIEW_RAD = 0.2
"""1 σ of the angle between camera and pipe: centring skids lean by less than 11°. It matters where no texture
shows rotations: extrapolated at the rate of the frames before, they came to 86°. Not measured."""


def surface(state: State, xyz_p: Float, moved_mm: Float | float = 0.0) -> tuple[Float, Float, Float]:
    """Return the residual (M,), mm, of points (M, 3) relative to the smooth pipe, with derivatives.

    The derivatives are by the point, (M, 3), and by the border, (M, B). The bore is evaluated at the points'
    distance minus ``moved_mm`` (M,), their displacement along the pipe since the bore was measured.
    """
    s, psi, rho = to_pipe(state.axis, xyz_p)
    basis = state.axis_basis(s)
    a2, b2 = state.globals[1:3]
    radius, slope = state.globals[0] + state.bore.off_at(s - moved_mm, psi), state.bore.slope_at(s - moved_mm)
    residual = rho - radius - a2 * np.cos(2 * psi) - b2 * np.sin(2 * psi)
    frame = state.section_frames(s)
    c, sn = np.cos(psi)[:, None], np.sin(psi)[:, None]
    tilt = 2 * (a2 * np.sin(2 * psi) - b2 * np.cos(2 * psi)) / rho
    gradient = frame[:, :, 0] * c + frame[:, :, 1] * sn
    gradient += tilt[:, None] * (frame[:, :, 1] * c - frame[:, :, 0] * sn)
    shape = np.stack([-np.ones_like(psi), -np.cos(2 * psi), -np.sin(2 * psi), np.zeros_like(psi)], -1)
    deflect = [-basis * c, -basis * sn]
    instrument = np.zeros((len(psi), len(state.instrument)))
    if state.bore.reduces:
        # If the axis turns toward a point, the point lies farther along it, where the bore is wider.
        ahead = (slope * rho)[:, None] * _basis_slope(state, s)
        deflect = [-basis * c - ahead * c, -basis * sn - ahead * sn]
        by_width = state.bore.width_by_instrument(state.bore.wider_at(s - moved_mm))
        residual -= by_width @ state.instrument[: by_width.shape[1]]
        instrument[:, : by_width.shape[1]] = -by_width
    by_border = np.concatenate([shape, *deflect, instrument], 1)
    if state.bore.reduces:
        gradient -= slope[:, None] * frame[:, :, 2]
        upright = 1 / np.hypot(1, slope)  # along the wall's normal
        return residual * upright, gradient * upright[:, None], by_border * upright[:, None]
    return residual, gradient, by_border


def _basis_slope(state: State, distance_mm: Float) -> Float:
    """Return the rotation of the axis (M, knots) per deflection, rad/mm, at distances (M,)."""
    ahead, behind = (state.axis_basis(distance_mm + step) for step in (AXIS_STEP_MM, -AXIS_STEP_MM))
    return (ahead - behind) / (2 * AXIS_STEP_MM)


def ring_rows(state: State, rings: RingBins, loss: Loss) -> Rows:
    """Return the equations: every ring bin lies on the pipe's smooth surface.

    In a reducer, the width at a ring's place was taken from the ring itself, so it is no evidence of the
    ring's distance along the pipe.
    """
    T = state.T_pc[rings.frame]
    along, moved_mm = camera_moved(state)
    unsure = rings.by_instrument.shape[2]
    xyz_c = rings.xyz_c + rings.by_instrument @ state.instrument[:unsure]
    residual, normal, by_border = surface(state, transform(T, xyz_c), moved_mm[rings.frame])
    normal_c = np.einsum("mi,mij->mj", normal, T[:, :3, :3])
    turn = -np.einsum("mj,mjk->mk", normal_c, skew(xyz_c))
    first = state.border_size - len(state.instrument)
    by_instrument = rings.instrument_where_expected(residual, normal_c)
    by_border[:, first : first + unsure] += np.einsum("mj,mjq->mq", normal_c, by_instrument)
    by_frame = np.zeros((len(residual), 1, BLOCK))
    if state.bore.reduces:  # the place in the bore moves with the camera
        place = to_pipe(state.axis, transform(T, xyz_c))[0] - moved_mm[rings.frame]
        slope = state.bore.slope_at(place)
        normal = normal + (slope / np.hypot(1, slope))[:, None] * along[rings.frame]
    by_frame[:, 0, :3], by_frame[:, 0, 3:6] = normal, turn
    return Rows(rings.frame[:, None], by_frame, by_border, residual, rings.sigma_mm, loss)


def camera_moved(state: State) -> tuple[Float, Float]:
    """Return the pipe's direction (N, 3) at the camera, and the camera's displacement (N,), mm, along it."""
    s = to_pipe(state.axis, state.T_pc[:, :3, 3])[0]
    moved_mm = s - state.guess_mm if len(state.guess_mm) else np.zeros(len(s))
    return state.section_frames(s)[:, :, 2], moved_mm


def turn_rows(state: State, sigma_rad: float) -> Rows:
    """Return the equations: rotations from frame to frame are small; they matter where texture is missing."""
    n = len(state.T_pc)
    rotation = state.T_pc[:, :3, :3]
    residual = vector_from_rotation(np.swapaxes(rotation[:-1], 1, 2) @ rotation[1:])
    pair = np.stack([np.arange(n - 1), np.arange(1, n)], -1)
    by_frame = np.zeros((n - 1, 3, 2, BLOCK))
    for i in range(3):
        by_frame[:, i, 0, 3 + i], by_frame[:, i, 1, 3 + i] = -1, 1
    return Rows(
        np.repeat(pair, 3, 0), by_frame.reshape(-1, 2, BLOCK), np.zeros((3 * (n - 1), state.border_size)),
        residual.reshape(-1), np.full(3 * (n - 1), sigma_rad),
    )  # fmt: skip


def view_rows(state: State) -> Rows:
    """Return the equations: the camera looks along the pipe."""
    n = len(state.T_pc)
    s = to_pipe(state.axis, state.T_pc[:, :3, 3])[0]
    slope = _basis_slope(state, s)
    section, by_border = state.section_frames(s), np.zeros((n, 2, state.border_size))
    for i in range(2):
        first = GLOBALS + i * state.knots
        by_border[:, i, first : first + state.knots] = -slope
    R_ac = np.swapaxes(section, 1, 2) @ state.T_pc[:, :3, :3]
    by_frame = np.zeros((n, 2, 1, BLOCK))
    by_frame[:, :, 0, 3], by_frame[:, :, 0, 4] = -R_ac[:, :2, 1], R_ac[:, :2, 0]
    return Rows(
        np.repeat(np.arange(n), 2)[:, None], by_frame.reshape(-1, 1, BLOCK),
        by_border.reshape(2 * n, -1), R_ac[:, :2, 2].ravel(), np.full(2 * n, _VIEW_RAD),
    )  # fmt: skip


def encoder_rows(state: State, encoder: EncoderReadings, slip_sigma_mm: float) -> tuple[Rows, Rows]:
    """Return the equations: distance = scale × encoder + slip, and slip changes little between frames."""
    n = len(encoder.distance_mm)
    origin = state.T_pc[:, :3, 3]
    s = to_pipe(state.axis, origin)[0]
    scale = state.globals[ENCODER_SCALE]
    by_frame = np.zeros((n, 1, BLOCK))
    by_frame[:, 0, :3], by_frame[:, 0, 6] = state.section_frames(s)[:, :, 2], -1
    by_border = np.zeros((n, state.border_size))
    by_border[:, ENCODER_SCALE] = -encoder.distance_mm
    residual = s - scale * encoder.distance_mm - state.slip
    sigma = np.where(encoder.known, encoder.sigma_mm, np.inf)
    reading = Rows(np.arange(n)[:, None], by_frame, by_border, residual, sigma)
    return reading, slip_drift_rows(state.slip, slip_sigma_mm, state.border_size)


def no_slip_rows(state: State) -> Rows:
    """Return the equations that replace those of a missing encoder: slip is zero."""
    n = len(state.slip)
    by_frame = np.zeros((n, 1, BLOCK))
    by_frame[:, 0, 6] = 1
    return Rows(np.arange(n)[:, None], by_frame, np.zeros((n, state.border_size)), state.slip, np.ones(n))


def origin_rows(state: State, held: int = 0) -> Rows:
    """Return the equations: the frame ``held`` is fixed; it defines the coordinate frame of the estimate."""
    by_frame = np.zeros((6, 1, BLOCK))
    by_frame[np.arange(6), 0, np.arange(6)] = 1
    return Rows(np.full((6, 1), held), by_frame, np.zeros((6, state.border_size)), np.zeros(6), ORIGIN_SIGMA)


def axis_rows(state: State, bend_sigma: float) -> Rows:
    """Return the equations: the axis' curvature changes little, and no pipe bends sharper than its radius."""
    knots, h2 = state.knots, state.knot_mm**2
    third = np.diff(np.eye(knots), 3, axis=0)
    second = np.diff(np.eye(knots), 2, axis=0)
    slope = np.diff(np.eye(knots), axis=0)[:1]
    sigma = [bend_sigma * h2] * len(third) + [h2 / state.nominal_radius_mm] * len(second)
    sigma += [_VIEW_RAD * state.knot_mm]
    one = np.concatenate([third, second, slope])
    by_border = np.zeros((2 * len(one), state.border_size))
    by_border[: len(one), GLOBALS : GLOBALS + knots] = one
    by_border[len(one) :, GLOBALS + knots : GLOBALS + 2 * knots] = one
    residual = np.concatenate([one @ state.curve[0], one @ state.curve[1]])
    return _border_only(by_border, residual, np.array(2 * sigma), Cauchy())


def prior_rows(
    state: State, encoder_sigma: float, radius_sigma_mm: float, shared: Float | None = None
) -> Rows:
    """Return the equations of the priors of the pipe, the encoder scale and the instrument.

    ``shared`` (S,) are encoder scale and instrument of the whole run; they are then held almost fixed.
    """
    size, corrections = state.border_size, len(state.instrument)
    pipe = state.globals[:3] - np.array([state.nominal_radius_mm, 0.0, 0.0])
    mean = np.concatenate([[1.0], np.zeros(corrections)]) if shared is None else shared
    residual = np.concatenate([pipe, state.shared - mean])
    stated = np.array([encoder_sigma] + [1.0] * corrections) * (1.0 if shared is None else _HELD)
    sigma = np.concatenate([[radius_sigma_mm] * 3, stated])
    of_border = np.r_[0:GLOBALS, size - corrections : size]
    return _border_only(np.eye(size)[of_border], residual, sigma, Squares())


def _border_only(by_border: Float, residual: Float, sigma: Float, loss: Loss) -> Rows:
    count = len(residual)
    none = np.zeros((count, 0), np.int64)
    return Rows(none, np.zeros((count, 0, BLOCK)), by_border, residual, sigma, loss)
