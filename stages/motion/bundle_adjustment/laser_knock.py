"""Distinguishes a laser knocked in mid-run from a pipe that steps, and corrects the knock.

If laser or camera is knocked, the rings jump from one to the next, all round at once and permanently, and the
texture does not follow. If the pipe steps in width or across, at a joint, the rings jump too; but the
landmarks on its wall, seen before and after, agree with the rings. Columns for both causes are added to the
equations at their optimum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pipeline.adjustment.robust import robust_spreads
from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import RingPoints
from pipeline.artefacts.motion import LaserKnock
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
"""Rings on either side through which a line is fitted; the jump is the distance of the two lines at the
middle.
With five rings the sway of open-1's probe has four times the influence."""
_SUSPECT, _LEAST_MM = 10.0, 0.1
"""Jump that is examined, in spreads of such differences and in mm: good recordings show 3 to 4 (open-1,
a01, a10), a weld 168 (open-2), after which the radius is the same as before. A choice."""
_LARGEST_JUMP = 0.1
"""Share of the radius beyond which a jump is another bore: in gauges and reducers they differ by a fifth
(a01) or more, and no laser moves so far. A choice."""
_SURE = float(np.log(1000))
"""Least log odds for a knock with which it is certain, and against one with which it is ruled out. Drawn runs
without a knock, or with a joint, have -9 and less; a09, knocked by .35°, has 9."""
_WELD = 0.3
"""Largest difference of the permanent change of radius from the jump, as a share of the jump: at the edge of
a weld it is larger."""
_USUAL_MM = 1.0
"""Prior 1 σ of each component of the jump by a knock or a joint. It sets the penalty for the free parameters
of either, equally for both. A choice."""
_LARGEST = 0.2
"""Prior 1 σ of any change, as a share of the radius or as a slope: it keeps the equations regular."""
_LASER = 3
"""Parameters of the sheet that may change: baseline and two slopes. In a pipe of one diameter, a change of
the cone is the same as one of the baseline."""

LASER_AND_JOINT = np.repeat([True, False], _LASER)
"""Which of six sizes are the laser's change (`LaserKnock.change`); the others are the displacement of the
pipe (x, y) and its change of radius after a joint, mm."""


@dataclass(frozen=True)
class RingJump:
    """Rings that jump between two frames.

    Attributes
    ----------
    frame : int
        First frame after it.
    jump_mm : (3,)
        Jump of the circle's centre, x and y of C, and of its radius.
    by_laser : (3, 3)
        Jump per change of the laser (`LaserKnock.change`).
    at_mm : float
        Distance of the jump along the pipe.
    bore : Bore
        The pipe's bore, if the laser caused the jump.
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
        """Return the knock that would explain the whole jump."""
        change = np.asarray(np.linalg.solve(self.by_laser, self.jump_mm), np.float64)
        return LaserKnock(self.frame, change, np.zeros((_LASER, _LASER)))

    def likelihood_of_size(self, size: Float, covariance: Float, free: Bool) -> float:
        """Return the log penalty for the ``free`` (6,) parameters of `LASER_AND_JOINT`.

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
    """Return the largest jump of the rings, at distances (F,); None if there is none."""
    shape = np.column_stack([circles.centre_c, circles.radius_mm])
    seen = np.isfinite(shape).all(1)
    shape, frame, at_seen = shape[seen], circles.frame[seen], at_mm[seen]
    if len(shape) < 4 * _SIDE:
        return None
    weight, sway = _jump_of_lines(frame)
    jump = np.einsum("nci,ni->nc", sliding_window_view(shape, 2 * _SIDE, axis=0), weight)
    # Rings of a repeated picture are the same: then only rounding differs.
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
    """Return whether texture is lost at the jump of rings (F,): a knock then looks like a cut."""
    place = int(np.searchsorted(ring_frame, jump.frame))
    first, last = ring_frame[max(place - 1, 0)], ring_frame[min(place + 1, len(ring_frame) - 1)]
    lost = poses.frames[poses.lost]
    return bool(np.any((first < lost) & (lost < last)))


@dataclass(frozen=True)
class KnockTest:
    """Result of the test for a knock of the laser by rings, texture and encoder.

    Attributes
    ----------
    knock : LaserKnock
    better : float
        Log likelihood ratio of rings, texture and encoder with a knock to without.
    jump : RingJump
    time_s : float
    """

    knock: LaserKnock
    better: float
    jump: RingJump
    time_s: float

    @property
    def certain(self) -> bool:
        """Whether the laser was certainly knocked."""
        return self.better > _SURE

    @property
    def ambiguous(self) -> bool:
        """Whether the laser may have been knocked, but something else may have caused the jump."""
        return not self.certain and self.better > -_SURE

    def warn(self, context: Context) -> None:
        """Warn of a knocked laser, or of a jump that may be due to one."""
        x, y, radius = self.jump.jump_mm
        where = f"at {self.time_s:.2f} s (frame {self.jump.frame}, at {self.jump.at_mm:.0f} mm)"
        jump = f"{where} the rings jump by {np.hypot(x, y):.2f} mm across and {radius:+.2f} mm in radius"
        if self.certain:
            tilt_deg, baseline_mm = np.degrees(np.hypot(*self.knock.change[1:])), self.knock.change[0]
            sigma = np.sqrt(np.diagonal(self.knock.covariance))
            zoomed = " (or the picture's scale changed)" if abs(radius) > np.hypot(x, y) else ""
            by = f"{tilt_deg:.2f} ± {np.degrees(sigma[1:].max()):.2f}°"
            context.warn(
                f"{jump}, all round at once and permanently, while the texture does not: laser and "
                f"camera were knocked relative to each other, by {by} and "
                f"{baseline_mm:+.3f} ± {sigma[0]:.3f} mm of the baseline{zoomed}. This is corrected from "
                "there on, and σ includes the rest. What to do: fix laser and camera, calibrate again"
            )
        elif self.ambiguous:
            context.warn(
                f"{jump}. This recording does not show clearly whether laser and camera were knocked "
                "or the pipe steps there: nothing is corrected, and radii and distances "
                "may be wrong by more than their σ on one side of it. What to do: pass the place again; a "
                "step of the pipe is then found at the same place"
            )


def by_laser_and_joint(
    estimate: Estimate, measured: Measurements, first_behind: int, at_mm: float
) -> ExtraColumns:
    """Return the derivatives by `LASER_AND_JOINT`: the laser from a frame on, the pipe from a place on."""
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
    """Return the change of radii (F,), mm, from ring ``first`` on, over a length longer than any weld."""
    n = rings_of_length(radius_mm, at_mm)
    return float(np.median(radius_mm[first : first + n]) - np.median(radius_mm[max(first - n, 0) : first]))


def _jump_of_lines(frame: Int) -> tuple[Float, Float]:
    """Return weights of rings in frames (F,) that give the jump between lines through those on either side.

    Returns
    -------
    weight : (N, 2 n)
        Least-squares weights of each 2 n rings in a row.
    sway : (N,)
        Factor by which more of the probe's sway remains where rings are missing in between. It is computed
        for the third power of time, the lowest that lines on both sides do not follow.
    """
    at = sliding_window_view(frame / np.median(np.diff(frame)), 2 * _SIDE)
    at = np.vstack([np.arange(2 * _SIDE), at - at[:, :1]])
    at = at - at[:, _SIDE - 1 : _SIDE + 1].mean(1, keepdims=True)
    weight = np.concatenate([-_start_of_line(at[:, :_SIDE]), _start_of_line(at[:, _SIDE:])], 1)
    left = np.einsum("ni,ni->n", weight, at**3)
    return weight[1:], left[1:] / left[0]


def _start_of_line(at: Float) -> Float:
    """Return the weights (N, n) with which values at places (N, n) enter their fitted line's value at 0."""
    first, second = (np.sum(at**k, 1, keepdims=True) for k in (1, 2))
    return np.asarray((second - first * at) / (_SIDE * second - first**2))
