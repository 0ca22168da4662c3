"""Makes the trajectory in the pipe frame P, its figures for the report, and its warnings."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.adjustment.motion_priors import most_trembling_of_places, trembling, trembling_of_places
from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import Trajectory
from pipeline.artefacts.motion import Displaced
from pipeline.geometry.axis import PipeAxis, distance_along, frames_at, to_pipe
from pipeline.geometry.rigid import from_parts, inverse, transform
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.recording.base import FrameTable
from stages.motion.bundle_adjustment.equations import MATCH_BIASES
from stages.motion.bundle_adjustment.shared_difference import WallTwice
from stages.motion.bundle_adjustment.solver import trembles
from stages.motion.stated_probe import MOST_LASTING
from stages.motion.tracking.landmarks import TrackedPoses
from stages.motion.windows.measured_run import MeasuredRun
from stages.motion.windows.sliding_window import RunEstimate
from stages.motion.windows.submap_joining import JoinedRun

_START_MM = 60.0
"""Length of pipe whose direction is the z-axis of P: two knots of the axis. Not measured."""
_MOST_LOST = 0.05
"""Share of the lit frames without enough texture that is warned of; good recordings have none. Not
measured."""
_FEWEST_CENTRES = 16
"""Fewest rings from which the trembling of their centres is estimated, as for poses."""


@dataclass(frozen=True)
class SeenCentres:
    """Centres of successive rings in the laser's plane (F, 2), mm in C.

    ``ahead_mm`` is that plane's distance from the camera.
    """

    centre_c: Float
    ahead_mm: float

    def deny_trembling(self, trajectory: Trajectory, lit: Int) -> bool:
        """Return whether the centres tremble by less than half of what the poses of ``lit`` frames imply."""
        known = np.isfinite(self.centre_c).all(1)
        if known.sum() < _FEWEST_CENTRES:
            return False
        T_pc = trajectory.T_pc[lit]
        ahead = distance_along(trajectory.axis, T_pc) + self.ahead_mm
        by_poses = transform(inverse(T_pc), frames_at(trajectory.axis, ahead)[0])[:, :2]
        at_most = np.linalg.norm(most_trembling_of_places(self.centre_c[known]))
        return bool(at_most < 0.5 * np.linalg.norm(trembling_of_places(by_poses, lit)))


def trajectory_of(run: JoinedRun, frames: FrameTable, probe: Probe, has_encoder: bool) -> Trajectory:
    """Return the trajectory in P.

    Distance 0 and roll 0 are those of the first camera; z is the direction of the pipe there.
    """
    T_po = _pipe_of_origin(run.T_pc[0], run.axis)
    first = float(to_pipe(run.axis, run.T_pc[0, :3, 3])[0])
    axis = PipeAxis(
        run.axis.distance_mm - first,
        transform(T_po, run.axis.origin_p),
        T_po[:3, :3] @ run.axis.R_pa @ _roll_of(T_po, run.axis, first),
    )
    turn = np.eye(6)
    turn[:3, :3] = T_po[:3, :3]
    own, unsure = slice(1, -MATCH_BIASES), probe.principal_uncertainties()
    found, covariance = run.shared.value[own], run.shared.covariance[own, own]
    scale_sigma = float(np.sqrt(run.shared.covariance[0, 0]))
    return Trajectory(
        frame=frames.frame,
        time_s=frames.time_s,
        T_pc=T_po @ run.T_pc,
        covariance=turn @ run.covariance @ turn.T,
        axis=axis,
        radius_mm=run.radius_mm,
        encoder_scale=float(run.shared.value[0]) if has_encoder else float("nan"),
        encoder_scale_sigma=scale_sigma if has_encoder else float("nan"),
        scale_sigma=run.radius_sigma_mm / run.radius_mm,
        distance_sigma_mm=run.distance_sigma_mm,
        events=(),
        instrument=probe.parameters + unsure @ found,
        instrument_covariance=unsure @ covariance @ unsure.T,
    )


def displaced_in(twice: WallTwice, frame: Int) -> tuple[Displaced, ...]:
    """Return what photo and line differ by in successive stretches of a run of frames (N,)."""
    stretches = twice.stretches()
    ends = [int((a.frame[-1] + b.frame[0]) / 2) for a, b in pairwise(stretches)]
    limits = [-1, *ends, len(frame) - 1]
    return tuple(
        Displaced(int(frame[min(first + 1, last)]), int(frame[last]), s.size_mm, s.is_certain)
        for s, (first, last) in zip(stretches, pairwise(limits), strict=True)
    )


def report_motion(
    context: Context,
    estimate: RunEstimate,
    run: MeasuredRun,
    trajectory: Trajectory,
    shakes: bool,
    wider: float,
) -> None:
    """Report the figures of a motion, and warn if it may be wrong by more than its σ.

    ``shakes`` is the result of `camera_trembles`; ``wider`` is the pipe's diameter over the nominal one,
    minus 1.
    """
    texture = run.texture
    _report_texture(context, estimate, run, len(trajectory.displaced))
    encoder = bool(np.isfinite(trajectory.encoder_scale))
    warn_of_lost_texture(texture.poses, texture.store.spool.count, encoder, context)
    if not run.bore.reduces:  # there texture is known to be matched less well
        _warn_of_contradictions(estimate.lasting, context)
    _warn_of_trembling(trajectory, texture.poses, shakes, context)
    context.report("pipe radius", trajectory.radius_mm, "mm")
    context.report("encoder scale", trajectory.encoder_scale, "")
    estimate.encoder.warn(context, wider)
    estimate.steady.warn(context)
    if estimate.knock is not None:
        estimate.knock.warn(context)
    travelled = float(np.ptp(distance_along(trajectory.axis, trajectory.T_pc)))
    context.report("distance travelled", travelled, "mm")
    context.report("1 σ of distance at the end", trajectory.distance_sigma_mm, "mm")


def _report_texture(context: Context, estimate: RunEstimate, run: MeasuredRun, differing: int) -> None:
    """Report the figures of texture; ``differing`` stretches of the run show another wall in it."""
    texture, twice = run.texture, estimate.wall_twice
    report_steps(context, estimate.trials, estimate.unsettled)
    context.report("landmarks", texture.store.landmarks, "")
    context.report("texture observations", texture.store.spool.count, "")
    context.report("lit frames without enough texture", int(texture.poses.lost[1:].sum()), "frames")
    context.report("median reprojection error", estimate.reprojection_px, "px")
    context.report("reprojection error against the σ of matching", estimate.excess, "times")
    context.report("part of it that lasts from picture to picture", estimate.lasting, "times")
    if len(twice.frame):
        context.report("difference of wall in photo and rings, shared", twice.size_mm, "mm")
        context.report("such a difference that noise alone may show, 1 σ", twice.noise_mm, "mm")
        context.report("stretches of the run that differ in it", differing, "")


def report_steps(context: Context, steps: int, unsettled: int) -> None:
    """Report how many steps an adjustment took, and warn of parts of it that stopped too early."""
    context.report("steps of the joint adjustment", steps, "")
    if unsettled:
        context.warn(
            "the adjustment of the motion stopped after its largest number of steps and has not converged: "
            "poses may be wrong by more than their σ. What to do: raise motion.iterations"
        )


def warn_of_lost_texture(tracked: TrackedPoses, observations: int, encoder: bool, context: Context) -> None:
    """Warn where texture was lost, and say what then gives the motion; ``encoder``: whether there is one."""
    lost = tracked.frames[1:][tracked.lost[1:]]
    known = "rings, encoder and smoothness" if encoder else "rings and smoothness"
    distance = "distance depends on the encoder alone" if encoder else "distance is not measured"
    if not observations:
        context.warn(
            f"no place of the wall was seen again from picture to picture: {distance}, and roll is not "
            "measured. What to do: pull more slowly, record lit frames more often, or light the wall better"
        )
    elif len(lost) > _MOST_LOST * len(tracked.frames):
        context.warn(
            f"in {len(lost)} of {len(tracked.frames)} lit frames too little texture was found, first in "
            f"frame {lost[0]}: there {known} give the motion. What to do: look at these pictures; more "
            "light, a sharper lens or a slower pull show more texture"
        )


def _warn_of_contradictions(lasting: float, context: Context) -> None:
    """Warn where matches of texture contradict each other more than is usual."""
    if lasting > MOST_LASTING:
        context.warn(
            f"matches of texture contradict the motion by {lasting:.1f} times their σ, in the same way in "
            "neighbouring pictures (good recordings: 0.5 at most): reflections, compression or lights that "
            "move with the probe are taken for the wall, water or glass distorts the picture, or the pipe "
            "bends sharply (an elbow). Distance and roll may err by more than their σ. σ of radii includes "
            "the correction of the probe and what photo and laser line differ by smoothly, but no error that "
            "both share. What to do: clean and dry the window, compare distance and diameter with known "
            "ones, record with less compression"
        )


def camera_trembles(trajectory: Trajectory, texture: TrackedPoses, seen: SeenCentres) -> bool:
    """Return whether the camera's direction changes from picture to picture by more than the poses' errors.

    A trembling camera moves the ring in the picture as well. If the ring stays in place, the matches of
    texture tremble instead, for example on glints.
    """
    shaken = trembling(trajectory.T_pc, trajectory.time_s, texture.frames)
    found = trembles(shaken) and not texture.mostly_lost
    return found and not seen.deny_trembling(trajectory, texture.frames)


def _warn_of_trembling(trajectory: Trajectory, texture: TrackedPoses, shakes: bool, context: Context) -> None:
    """Warn of a camera that trembles, or of matches that do; without texture neither is known."""
    shaken = trembling(trajectory.T_pc, trajectory.time_s, texture.frames)
    turn = float(shaken[3:5].max())
    context.report("trembling of the camera, 1 σ", 1e3 * turn, "mrad")
    if not trembles(shaken) or texture.mostly_lost:
        return
    moves = (
        f"from picture to picture it turns by {np.degrees(turn):.2g}° and moves by {shaken[:2].max():.2g} mm"
    )
    if not shakes:
        context.warn(
            f"the texture suggests a trembling camera: {moves} (1 σ). The laser's ring does not tremble, so "
            "the camera is steady and texture is matched wrongly: glints, reflections, blur or compression. "
            "The shape of each ring is right; its distance, roll and tilt may be wrong by more than their σ, "
            "and so are radii where the wall changes along the pipe, as ribs do. What to do: shade "
            "reflections, record with less compression"
        )
    else:
        context.warn(
            f"the camera trembles: {moves} (1 σ). If the whole probe trembles, the measurements hold. If "
            "the camera is loose on its mount, or the pictures were stabilised afterwards, radii and "
            "distances may be wrong by more than their σ; the recording cannot show which. What to do: check "
            "that the camera is tight, switch stabilisation off, and compare a diameter with a known one"
        )


def _pipe_of_origin(T_oc: Float, axis: PipeAxis) -> Float:
    """Return the transform from the estimate's frame O to P."""
    s = float(to_pipe(axis, T_oc[:3, 3])[0])
    near, far = (frames_at(axis, np.array(d))[0] for d in (s, s + _START_MM))
    origin = frames_at(axis, np.array(s))[0]
    z = (far - near) / np.linalg.norm(far - near)
    x = T_oc[:3, 0] - z * (z @ T_oc[:3, 0])
    x /= np.linalg.norm(x)
    return inverse(from_parts(np.stack([x, np.cross(z, x), z], -1), origin))


def _roll_of(T_po: Float, axis: PipeAxis, distance_mm: float) -> Float:
    """Return the rotation about the tangent that brings the sections' x closest to P's x at a distance."""
    rotation = T_po[:3, :3] @ frames_at(axis, np.array(distance_mm))[1]
    angle = np.arctan2(rotation[1, 0], rotation[0, 0])
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
