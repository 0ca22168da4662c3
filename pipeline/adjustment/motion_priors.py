"""Priors of a motion: it is smooth, and the encoder's slip hardly changes from frame to frame.

The prior of smooth motion is a random process: the third differences of position and rotation from frame to
frame are independent and normal, 1 σ ``sigma``. Acceleration is then a random walk, and jerk is white.

``sigma`` is estimated from the frames of a run whose poses are well known, say every h-th. The third
difference over h frames is that of every frame, summed three times over h frames in a row,

    (1 − L^h)³ = (1 + L + … + L^(h−1))³ (1 − L)³    (L takes the value of the frame before),

so its variance is ``sigma``² times the sum of squares of the cube's coefficients (for h = 2 these are
1, 3, 3, 1, and the sum is 20). The cube reads the same backwards, so the sum is the middle coefficient of its
square, ((1 − L^h) / (1 − L))⁶, which the binomial series gives:

    C(3h + 2, 5) − 6 C(2h + 2, 5) + 15 C(h + 2, 5) = (11 h⁵ + 5 h³ + 4 h) / 20.

For large h the 1 σ grows as 0.74 h^2.5, the law of jerk that is white in continuous time; at h = 2 it is
4.47 times as large, between 2² and 2^2.5.
"""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.elimination import BLOCK
from pipeline.adjustment.robust import Cauchy, robust_spreads
from pipeline.adjustment.rows import Rows
from pipeline.arrays import Float, Int
from pipeline.geometry.rigid import vector_from_rotation

LOOSE = np.array([0.3, 0.3, 0.3, 0.01, 0.01, 0.01])
"""1 σ (6,) of a third difference, mm and rad, before anything is known of the motion."""

_SMOOTHEST = np.array([1e-4] * 3 + [1e-6] * 3)
"""Smallest 1 σ, mm and rad, of third differences: far below that of any pose."""
_JERK_SIGMAS = 5.0
"""Third differences of so many σ have half their weight: probes also jerk. Not measured."""
_FEWEST_FRAMES = 8
"""Known frames below which the smoothness of the motion is not estimated. Not measured."""
TREMBLING_GROWTH = np.sqrt(20.0)
"""1 σ of third differences of independent values over that of the values: the root of 1 + 9 + 9 + 1."""


def third_difference_growth(stride: Float | float) -> Float:
    """Return the ratio (...) of the 1 σ of third differences over ``stride`` (...) frames to that over 1."""
    return np.asarray(np.sqrt((11 * stride**5 + 5 * stride**3 + 4 * stride) / 20))


def third_difference_sigma(T_pc: Float, time_s: Float, known: Int) -> Float:
    """Return the robust 1 σ (6,) of the third differences of position, mm, and turn, rad.

    With fewer than eight frames of known pose it is `LOOSE`.

    Parameters
    ----------
    T_pc : (N, 4, 4)
        Poses of all frames.
    time_s : (N,)
        The differences are divided ones, so that uneven spacing does not matter.
    known : (K,) int
        Frames whose poses are measured; the median of their gaps counts as their stride.
    """
    if len(known) < _FEWEST_FRAMES:
        return LOOSE
    growth = third_difference_growth(float(np.median(np.diff(known))))
    return np.asarray(
        np.maximum(
            robust_spreads(_third_difference_of_poses(T_pc, time_s, known, 1), axis=0) / growth, _SMOOTHEST
        )
    )


def local_third_difference_sigma(T_pc: Float, time_s: Float, known: Int) -> Float:
    """Return the 1 σ (N − 3, 6) of each third difference, mm and rad: as a rule, or as the poses around show.

    It is that of `third_difference_sigma`, or what the known frames whose span covers a part of the
    difference show, if that is larger. A probe that is pulled faster, stops, or turns back jerks a hundred
    times as much as in steady motion: with one 1 σ for the whole run, the prior outweighs the measurements
    of these frames, which then count as outliers.

    A third of its span counts as the stride of a difference across frames of unknown pose, where jerk grows
    for longer (after three frames in a row, exact to 5 %); at least the usual stride does, since in a shorter
    one noise of the poses would count as jerk.
    """
    as_a_rule = third_difference_sigma(T_pc, time_s, known)
    out = np.tile(as_a_rule, (max(len(T_pc) - 3, 0), 1))
    if len(known) < _FEWEST_FRAMES:
        return out
    stride = np.maximum((known[3:] - known[:-3]) / 3, np.median(np.diff(known)))
    third = _third_difference_of_poses(T_pc, time_s, known, 1)
    shown = np.abs(third) / third_difference_growth(stride)[:, None]
    for first, last, own in zip(known[:-3], known[3:], shown, strict=True):
        covered = slice(max(first - 2, 0), last)
        out[covered] = np.maximum(out[covered], own)
    return out


def trembling(T_pc: Float, time_s: Float, known: Int) -> Float:
    """Return the 1 σ (6,) of position, mm, and turn, rad, that changes independently from frame to frame.

    Third differences over one and over two gaps distinguish it from motion: those of white jerk grow with the
    gap as `third_difference_growth`, those of trembling have a variance of 1 + 9 + 9 + 1 at any gap. Errors
    of the poses that change from frame to frame count as trembling. With fewer than sixteen frames it is 0.

    Parameters
    ----------
    T_pc : (N, 4, 4)
        Poses of all frames.
    time_s : (N,)
        The differences are divided ones, so that uneven spacing does not matter.
    known : (K,) int
        Frames whose poses are measured; the median of their gaps counts as their stride.
    """
    near, far = (_third_difference_of_poses(T_pc, time_s, known, n) for n in (1, 2))
    return _trembling(near, far, known)


def trembling_of_places(place: Float, known: Int) -> Float:
    """Return the 1 σ (D,) of the trembling of places (K, D) in frames ``known`` (K,); see `trembling`."""
    near, far = (
        place[3 * n :] - 3 * place[2 * n : -n] + 3 * place[n : -2 * n] - place[: -3 * n] for n in (1, 2)
    )
    return _trembling(near, far, known)


def most_trembling_of_places(place: Float) -> Float:
    """Return an upper bound of the 1 σ (D,) by which places (K, D) tremble, as if none of it were motion.

    `trembling` gives 0 also where jerks hide the trembling; this bound is large there.
    """
    third = place[3:] - 3 * place[2:-1] + 3 * place[1:-2] - place[:-3]
    return np.asarray(robust_spreads(third, axis=0) / TREMBLING_GROWTH)


def _trembling(near: Float, far: Float, known: Int) -> Float:
    """Return the 1 σ (D,) of trembling by third differences (M, D) over one and over two gaps."""
    if len(known) < 2 * _FEWEST_FRAMES:
        return np.zeros(near.shape[1])
    variance = [robust_spreads(third, axis=0) ** 2 for third in (near, far)]
    gap = float(np.median(np.diff(known)))
    growth = [third_difference_growth(n * gap) ** 2 for n in (1, 2)]
    jerk = np.maximum(variance[1] - variance[0], 0) / (growth[1] - growth[0])
    return np.asarray(np.sqrt(np.maximum(variance[0] - growth[0] * jerk, 0) / TREMBLING_GROWTH**2))


def _third_difference_of_poses(T_pc: Float, time_s: Float, known: Int, gaps: int) -> Float:
    """Return third differences (M, 6) over so many gaps between known frames."""
    window = known[np.arange(max(len(known) - 3 * gaps, 0))[:, None] + gaps * np.arange(4)]
    coefficient = third_difference_coefficients(time_s[window])
    return np.asarray(np.einsum("nk,nki->ni", coefficient, _position_and_turn(T_pc[window])))


def jerking_sigma(T_pc: Float, time_s: Float, sigma: Float) -> Float:
    """Return the 1 σ (N − 3, 6) of each third difference: ``sigma`` (6,), or its own size if larger.

    A probe that stops or turns back jerks a hundred times as much as in steady motion. A prior that does not
    allow for this pulls the poses to one side, and an effect that fits the pull may seem to exist.

    Parameters
    ----------
    T_pc : (N, 4, 4)
        Measured poses.
    time_s : (N,)
    sigma : (6,)
    """
    return np.asarray(np.hypot(sigma, _third_differences(T_pc, time_s)[2]))


def smooth_motion_rows(T_pc: Float, time_s: Float, sigma: Float, border: int) -> Rows:
    """Return the equations: third differences of position and rotation from frame to frame are 0 ± ``sigma``.

    Parameters
    ----------
    T_pc : (N, 4, 4)
    time_s : (N,)
        The differences are divided ones, so that uneven spacing does not matter.
    sigma : (6,) or (N − 3, 6)
        1 σ for even spacing, mm and rad; of all, or of each.
    border : int
        Number of global unknowns.
    """
    frame, coefficient, residual = _third_differences(T_pc, time_s)
    by_frame = np.zeros((len(frame), 6, 4, BLOCK))
    for i in range(6):
        by_frame[:, i, :, i] = coefficient
    none = np.zeros((6 * len(frame), border))
    return Rows(
        np.repeat(frame, 6, 0), by_frame.reshape(-1, 4, BLOCK), none, residual.ravel(),
        np.broadcast_to(sigma, residual.shape).ravel(), Cauchy(_JERK_SIGMAS),
    )  # fmt: skip


def _third_differences(T_pc: Float, time_s: Float) -> tuple[Int, Float, Float]:
    """Return frames and coefficients (N − 3, 4) of third differences, and their values (N − 3, 6)."""
    frame = np.arange(max(len(time_s) - 3, 0))[:, None] + np.arange(4)
    coefficient = third_difference_coefficients(time_s[frame])
    return frame, coefficient, np.einsum("mk,mki->mi", coefficient, _position_and_turn(T_pc[frame]))


def slip_drift_rows(slip: Float, sigma_mm: float, border: int) -> Rows:
    """Return the equations: slip (N,), mm, changes by 0 ± ``sigma_mm`` per frame; jumps weigh little."""
    count = len(slip) - 1
    pair = np.stack([np.arange(count), np.arange(1, count + 1)], -1)
    by_pair = np.zeros((count, 2, BLOCK))
    by_pair[:, 0, 6], by_pair[:, 1, 6] = -1, 1
    return Rows(pair, by_pair, np.zeros((count, border)), np.diff(slip), np.full(count, sigma_mm), Cauchy())


def third_difference_coefficients(time_s: Float) -> Float:
    """Return coefficients (M, 4) of the third divided difference at times (M, 4); −1, 3, −3, 1 when even."""
    t = 3 * (time_s - time_s[:, :1]) / np.maximum(time_s[:, 3:] - time_s[:, :1], 1e-12)
    gap = t[:, :, None] - t[:, None, :] + np.eye(4)
    return np.asarray(6 / np.prod(gap, -1))


def _position_and_turn(T_pc: Float) -> Float:
    """Return position and turn (M, 4, 6), the turn from the second of four poses (M, 4, 4, 4)."""
    turn = vector_from_rotation(np.swapaxes(T_pc[:, 1:2, :3, :3], -1, -2) @ T_pc[..., :3, :3])
    return np.concatenate([T_pc[..., :3, 3], turn], -1)
