"""A laser knocked in mid-run, told from a pipe that steps, and taken out.

A laser or camera that is knocked makes the rings jump from one to the next, all round at once and for good,
and the texture does not follow. A pipe that steps in width or across, at a joint, makes the rings jump too;
but the landmarks on its wall, seen before and after, lie where the rings do. Columns for both are added to
the equations at their optimum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pipeline.adjustment.robust import robust_spreads
from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import LaserKnock, RingPoints
from pipeline.geometry.axis import to_pipe
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from stages.motion.bore import Bore, rings_of_length
from stages.motion.bundle_adjustment.equations import Measurements
from stages.motion.bundle_adjustment.extra_columns import ExtraColumns, RingsInPipe
from stages.motion.bundle_adjustment.solver import Estimate
from stages.motion.rings import RingCircles
from stages.motion.tracking.landmarks import TrackedPoses

_SIDE = 3
"""Rings on either side through which a line is laid; the jump is that of the lines between the two. With five
the sway of open-1's probe counts four times as much."""
_SUSPECT, _LEAST_MM = 10.0, 0.1
"""Jump that is looked into, in spreads of such differences and in mm: good recordings show 3 to 4 (open-1,
a01, a10), a weld 168 (open-2), after which the radius is what it was. A choice."""
_LARGEST_JUMP = 0.1
"""Share of the radius beyond which a jump is another bore: in gauges and reducers they differ by a fifth
(a01) or more, and no laser moves so far. A choice."""
_SURE = float(np.log(1000))
"""Least log odds for a knock with which it is certain, and against one with which it is ruled out. Drawn runs
without a knock, or with a joint, have -9 and less; a09, knocked by .35°, has 9."""
_WELD = 0.3
"""By what share of the jump the lasting change of radius may differ from it: more is the edge of a weld."""
_USUAL_MM = 1.0
"""1 σ of each part of the jump that a knock or a joint is expected to make. It sets how much the freedom of
either costs, equally for both. A choice."""
_LARGEST = 0.2
"""1 σ of any change beforehand, as a share of the radius or as a slope: it keeps the equations regular."""
_LASER = 3
"""Parameters of the sheet that may change: baseline and two slopes. A cone's change is a baseline's where the
pipe has one diameter."""

LASER_AND_JOINT = np.repeat([True, False], _LASER)
"""Which of six sizes are the laser's change (`LaserKnock.change`); the others are how far the pipe lies aside
(x, y) and how much wider it is behind a joint, mm."""


@dataclass(frozen=True)
class RingJump:
    """Rings that jump between two frames.

    Attributes
    ----------
    frame : int
        First frame behind it.
    jump_mm : (3,)
        Of the circle's centre, x and y of C, and its radius.
    by_laser : (3, 3)
        Jump per change of the laser (`LaserKnock.change`).
    at_mm : float
        Where the rings lie that jump.
    bore : Bore
        The pipe's, if the laser made the jump.
    """

    frame: int
    jump_mm: Float
    by_laser: Float
    at_mm: float
    bore: Bore

    @staticmethod
    def of(frame: int, jump_mm: Float, xyz_c: Float, probe: Probe, at_mm: float, bore: Bore) -> RingJump:
        """Return the jump (3,) before a frame whose ring lies at points (A, 3); NaN where it is not seen."""
        xyz_c = xyz_c[np.isfinite(xyz_c).all(1)].astype(float)
        outward = xyz_c * [1, 1, 0] / np.linalg.norm(xyz_c[:, :2], axis=1)[:, None]
        by_sheet = probe.laser.intersect_jacobian(xyz_c)[1][..., :_LASER]
        circle = np.column_stack([outward[:, :2], np.ones(len(outward))])
        by_laser = -np.linalg.lstsq(circle, np.einsum("ai,aik->ak", outward, by_sheet), rcond=None)[0]
        return RingJump(frame, jump_mm, by_laser, at_mm, bore)

    @property
    def guess(self) -> LaserKnock:
        """Return the knock that would make all of the jump."""
        change = np.asarray(np.linalg.solve(self.by_laser, self.jump_mm), np.float64)
        return LaserKnock(self.frame, change, np.zeros((_LASER, _LASER)))

    def likelihood_of_size(self, size: Float, covariance: Float, free: Bool) -> float:
        """Return what the freedom of those of `LASER_AND_JOINT` that are ``free`` (6,) costs, as a logarithm.

        It is Laplace's approximation of the prior's part in a marginal likelihood (D. MacKay, "Information
        theory, inference and learning algorithms", 2003, ch. 28): jumps are N(0, `_USUAL_MM`).
        """
        by_size = np.kron(np.eye(2), np.eye(_LASER))
        by_size[:_LASER, :_LASER] = self.by_laser
        jump = by_size[:, free] / _USUAL_MM
        information, made = jump.T @ jump, jump @ size[free]
        logdet = np.linalg.slogdet(information)[1] + np.linalg.slogdet(covariance)[1]
        return float(logdet - made @ made) / 2


def find_jump(circles: RingCircles, at_mm: Float, points: RingPoints, probe: Probe) -> RingJump | None:
    """Return where the rings, at distances (F,), jump most; None where they do not."""
    shape = np.column_stack([circles.centre_c, circles.radius_mm])
    seen = np.isfinite(shape).all(1)
    shape, frame, at_seen = shape[seen], circles.frame[seen], at_mm[seen]
    if len(shape) < 4 * _SIDE:
        return None
    weight, sway = _jump_of_lines(frame)
    jump = np.einsum("nci,ni->nc", sliding_window_view(shape, 2 * _SIDE, axis=0), weight)
    # Rings of a picture that stands still are the same: then only rounding differs.
    usual = np.maximum(robust_spreads(jump, axis=0), np.finfo(np.float32).eps)
    spreads = np.linalg.norm(jump / usual, axis=1) / sway
    most = int(np.argmax(spreads))
    size, times, first = jump[most], float(spreads[most]), most + _SIDE
    most_mm = _LARGEST_JUMP * circles.usual_radius_mm
    if times < _SUSPECT or not _LEAST_MM < np.linalg.norm(size) < most_mm:
        return None
    if abs(_lasting(shape[:, 2], at_seen, first) - size[2]) > _WELD * np.linalg.norm(size):
        return None
    behind = int(frame[first])
    ring = points.xyz_c[int(np.searchsorted(points.frame, behind))]
    bore = Bore.of(circles.radius_mm - size[2] * (circles.frame >= behind), at_mm)
    place_mm = float(at_seen[first - 1] + at_seen[first]) / 2
    return RingJump.of(behind, size, ring, probe, place_mm, bore)


def texture_breaks(jump: RingJump, ring_frame: Int, poses: TrackedPoses) -> bool:
    """Return whether texture is lost beside the jump of rings (F,): it cannot tell a knock from a cut."""
    place = int(np.searchsorted(ring_frame, jump.frame))
    first, last = ring_frame[max(place - 1, 0)], ring_frame[min(place + 1, len(ring_frame) - 1)]
    lost = poses.frames[poses.lost]
    return bool(np.any((first < lost) & (lost < last)))


@dataclass(frozen=True)
class KnockTest:
    """A laser's knock as rings, texture and encoder show it.

    Attributes
    ----------
    knock : LaserKnock
    better : float
        By how much likelier the rings, texture and encoder are with a knock than without, as a logarithm.
    jump : RingJump
    time_s : float
    """

    knock: LaserKnock
    better: float
    jump: RingJump
    time_s: float

    @property
    def told(self) -> bool:
        """Whether the laser must have been knocked."""
        return self.better > _SURE

    @property
    def ambiguous(self) -> bool:
        """Whether the laser may have been knocked, but something else may have made the jump."""
        return not self.told and self.better > -_SURE

    def warn(self, context: Context) -> None:
        """Warn of a knocked laser, or of a jump that may be due to one."""
        x, y, radius = self.jump.jump_mm
        where = f"at {self.time_s:.2f} s (frame {self.jump.frame}, at {self.jump.at_mm:.0f} mm)"
        jump = f"{where} the rings jump by {np.hypot(x, y):.2f} mm across and {radius:+.2f} mm of radius"
        if self.told:
            tilt_deg, baseline_mm = np.degrees(np.hypot(*self.knock.change[1:])), self.knock.change[0]
            sigma = np.sqrt(np.diagonal(self.knock.covariance))
            zoomed = " (or the picture's scale changed)" if abs(radius) > np.hypot(x, y) else ""
            by = f"{tilt_deg:.2f} ± {np.degrees(sigma[1:].max()):.2f}°"
            context.warn(
                f"{jump}, all round at once and permanently, while the texture does not: laser and "
                f"camera were knocked against each other, by {by} and "
                f"{baseline_mm:+.3f} ± {sigma[0]:.3f} mm of the baseline{zoomed}. This is corrected from "
                "there on, and σ includes what remains. What to do: fix laser and camera, calibrate anew"
            )
        elif self.ambiguous:
            context.warn(
                f"{jump}. This recording does not tell for sure whether laser and camera were knocked "
                "against each other or the pipe steps there: nothing is corrected, and radii and distances "
                "may be off by more than their σ on one side of it. What to do: pass the place again; a "
                "step of the pipe is found at the same place"
            )


def by_laser_and_joint(
    estimate: Estimate, measured: Measurements, first_behind: int, at_mm: float
) -> ExtraColumns:
    """Return what `LASER_AND_JOINT` change: the laser from a frame on, the pipe from a place on."""
    state = estimate.state
    rings = RingsInPipe.of(state, measured)
    by_sheet = measured.probe.laser.intersect_jacobian(rings.xyz_c)[1][..., :_LASER]
    behind = (measured.rings.frame >= first_behind)[:, None]
    laser = np.einsum("mi,mik->mk", rings.normal_c, by_sheet) * behind
    joint = _joint(rings.span_mm > at_mm, rings.azimuth_rad)
    span, azimuth, _ = to_pipe(state.axis, state.xyz_p)
    landmarks = np.concatenate([np.zeros((len(span), _LASER)), _joint(span > at_mm, azimuth)], 1)
    sigma = _LARGEST * np.array([state.nominal_radius_mm, 1.0, 1.0, *[state.nominal_radius_mm] * 3])
    pixels = np.zeros((*measured.tracks.uv.shape, len(sigma)))
    return ExtraColumns(np.concatenate([laser, joint], 1), pixels, landmarks, sigma)


def _joint(behind: Bool, azimuth_rad: Float) -> Float:
    shape = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad), np.ones(len(behind))], -1)
    return np.asarray(-shape * behind[:, None])


def _lasting(radius_mm: Float, at_mm: Float, first: int) -> float:
    """Return by how much radii (F,) differ from ring ``first`` on, over a length that no weld has."""
    n = rings_of_length(radius_mm, at_mm)
    return float(np.median(radius_mm[first : first + n]) - np.median(radius_mm[max(first - n, 0) : first]))


def _jump_of_lines(frame: Int) -> tuple[Float, Float]:
    """Return what rings in frames (F,) weigh in the jump between lines through those on either side.

    Returns
    -------
    weight : (N, 2 n)
        Of each 2 n rings in a row, by least squares.
    sway : (N,)
        How many times more of the probe's sway remains where rings are missing in between. Compared is the
        third power of time, the lowest that lines on both sides do not follow.
    """
    at = sliding_window_view(frame / np.median(np.diff(frame)), 2 * _SIDE)
    at = np.vstack([np.arange(2 * _SIDE), at - at[:, :1]])
    at = at - at[:, _SIDE - 1 : _SIDE + 1].mean(1, keepdims=True)
    weight = np.concatenate([-_start_of_line(at[:, :_SIDE]), _start_of_line(at[:, _SIDE:])], 1)
    left = np.einsum("ni,ni->n", weight, at**3)
    return weight[1:], left[1:] / left[0]


def _start_of_line(at: Float) -> Float:
    """Return the weights (N, n) of values at places (N, n) in their fitted line's value at 0."""
    first, second = (np.sum(at**k, 1, keepdims=True) for k in (1, 2))
    return np.asarray((second - first * at) / (_SIDE * second - first**2))
