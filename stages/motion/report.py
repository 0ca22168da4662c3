"""What the motion stage tells of its result: figures, and warnings where it may be off by more than its σ."""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.motion_priors import trembling
from pipeline.arrays import Float
from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.axis import distance_along
from pipeline.machine.stage import Context
from stages.motion.bundle_adjustment.solver import trembles
from stages.motion.tracking.landmarks import TrackedPoses
from stages.motion.tracking.tracker import TrackedTexture
from stages.motion.windows.sliding_window import RunEstimate

_MOST_LOST = 0.05
"""Share of the lit frames without enough texture that is told; sound recordings have none. Not measured."""
_MOST_EXCESS = 4.4
"""Reprojection error in σ of matching that is told: 2.9 in open-1, 3.4 in open-3, 4.0 with seven glints in
each frame, 4.9 at crf 30, where distance errs by 2.8 σ: the middle of the last two."""


def report_motion(
    context: Context, estimate: RunEstimate, texture: TrackedTexture, trajectory: Trajectory
) -> None:
    """Report the figures of a motion, and warn where it may be off by more than its σ."""
    report_steps(context, estimate.trials, estimate.unsettled)
    context.report("landmarks", texture.store.landmarks, "")
    context.report("texture observations", texture.store.spool.count, "")
    context.report("lit frames without enough texture", int(texture.poses.lost[1:].sum()), "frames")
    context.report("median reprojection error", estimate.reprojection_px, "px")
    context.report("reprojection error against the σ of matching", estimate.excess, "times")
    _warn_of_texture(estimate.excess, texture.poses, context)
    _warn_of_trembling(trembling(trajectory.T_pc, texture.poses.frames), context)
    context.report("pipe radius", trajectory.radius_mm, "mm")
    context.report("encoder scale", trajectory.encoder_scale, "")
    travelled = float(np.ptp(distance_along(trajectory.axis, trajectory.T_pc)))
    context.report("distance travelled", travelled, "mm")
    context.report("1 σ of distance at the end", trajectory.distance_sigma_mm, "mm")


def report_steps(context: Context, steps: int, unsettled: int) -> None:
    """Report how many steps an adjustment took, and warn of parts of it that stopped too early."""
    context.report("steps of the joint adjustment", steps, "")
    if unsettled:
        context.warn(
            "the adjustment of the motion stopped after its largest number of steps, before it had settled: "
            "poses may be off by more than their σ. What to do: raise motion.iterations"
        )


def _warn_of_texture(excess: float, tracked: TrackedPoses, context: Context) -> None:
    """Warn where texture was lost, or where its matches contradict each other more than is usual."""
    lost = tracked.frames[1:][tracked.lost[1:]]
    if len(lost) > _MOST_LOST * len(tracked.frames):
        context.warn(
            f"in {len(lost)} of {len(tracked.frames)} lit frames too little texture was found, first in "
            f"frame {lost[0]}: there the motion rests on rings, encoder and smoothness. What to do: look at "
            "these pictures; more light, a sharper lens or a slower pull show more texture"
        )
    if excess > _MOST_EXCESS:
        context.warn(
            f"matches of texture contradict each other by {excess:.1f} times their σ, where sound recordings "
            "have 3 to 4: reflections, compression or lights that move with the probe are taken for the "
            "wall. Distance and roll may be off by more than their σ. What to do: compare the distance with "
            "the encoder or a tape, record with less compression"
        )


def _warn_of_trembling(shaken: Float, context: Context) -> None:
    """Warn where the camera's turn differs from frame to frame by more than poses err by: ``shaken`` (6,)."""
    turn = float(shaken[3:5].max())
    context.report("trembling of the camera, 1 σ", 1e3 * turn, "mrad")
    if trembles(shaken):
        context.warn(
            f"the camera trembles: from one frame to the next it turns by {np.degrees(turn):.2g}° and moves "
            f"by {shaken[:2].max():.2g} mm (1 σ). If the whole probe trembles, the measurements hold. If the "
            "camera is loose on its mount, or the pictures were stabilised afterwards, radii and distances "
            "may be off by more than their σ; the recording cannot tell which. What to do: look whether the "
            "camera sits tight, switch stabilisation off, and compare a diameter with one that is known"
        )
