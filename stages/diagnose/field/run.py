"""A field recording, or a stretch of it, adjusted with the stated instrument, and its measured points."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingPoints, RingSamples, Trajectory
from pipeline.geometry.axis import frames_at, to_pipe
from pipeline.geometry.rigid import inverse, transform
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.recording.base import Recording
from stages.diagnose.effects.base import ImagePoints
from stages.diagnose.gauge.points import SHARP, Moving, rates, runs_across, way_per_px, widths_at
from stages.motion import (
    MATCH_BIASES,
    EncoderReadings,
    Equations,
    KnockTest,
    Measurements,
    MotionParameters,
    State,
    adjust_at_once,
    encoder_at_frames,
    measure_run,
    ring_bins,
    with_steady_laser,
)


@dataclass(frozen=True)
class Adjusted:
    """A field recording at the optimum with the stated instrument, without what it was made from.

    Attributes
    ----------
    measured : Measurements
        Without encoder.
    equations : Equations
        At ``state``, with the final robust weights.
    trajectory : Trajectory
        In P.
    ring_frames : (F,) int
        Indices of the ring frames in the frame table.
    """

    measured: Measurements
    state: State
    equations: Equations
    trajectory: Trajectory
    encoder: EncoderReadings | None
    ring_frames: Int
    parameters: MotionParameters


@dataclass(frozen=True)
class FieldRun(Adjusted):
    """An adjusted field recording with the recording, the stated probe and the rings it was made from."""

    recording: Recording
    probe: Probe
    rings: RingSamples

    @property
    def adjusted(self) -> Adjusted:
        """The run without what it was made from."""
        return Adjusted(**{f.name: getattr(self, f.name) for f in fields(Adjusted)})


def field_run(
    recording: Recording, probe: Probe, rings: RingSamples, points: RingPoints, parameters: MotionParameters,
    context: Context,
) -> FieldRun:  # fmt: skip
    """Measure the texture of a recording and adjust poses, pipe and wall to rings and texture.

    The encoder is not used, so that it can be compared with the visual distance.

    Raises
    ------
    UnusableError
        When rings and texture alone do not determine the motion.
    """
    run = measure_run(recording, probe, rings, points, parameters, context, use_encoder=False)
    warn_of_knock(with_steady_laser(run, parameters, partial(context.progress, 0, 1))[1], context)
    grid, frames = run.texture.grid, recording.frames
    measured = run.measured(run.whole, parameters)
    start = run.start(run.whole, measured, parameters)
    encoder = encoder_at_frames(recording, parameters.encoder_sigma_mm, grid.far_mm, context)
    found = adjust_at_once(start, measured, frames, grid.radius_mm, parameters, context)
    return FieldRun(
        found.measured, found.state, found.equations, found.trajectory, encoder, run.ring_place, parameters,
        recording, probe, rings,
    )  # fmt: skip


def warn_of_knock(knock: KnockTest | None, context: Context) -> None:
    """Warn of a laser that was, or may have been, knocked during the run; the run is examined as it is."""
    if knock is None or not (knock.certain or knock.ambiguous):
        return
    x, y, radius = knock.jump.jump_mm
    context.warn(
        f"at {knock.time_s:.2f} s (frame {knock.jump.frame}) the inspection's rings jump by "
        f"{np.hypot(x, y):.2f} mm across and {radius:+.2f} mm of radius: laser and camera were knocked "
        f"against each other{'' if knock.certain else ', or the pipe steps there'}. The inspection is "
        "examined as if nothing had moved. What to do: fix laser and camera, and record both runs anew"
    )


def with_probe(run: FieldRun, probe: Probe, context: Context) -> FieldRun:
    """Return the run adjusted again with another probe, from the same ring samples and texture tracks.

    Raises
    ------
    UnusableError
        When rings and texture do not determine the motion with that probe.
    """
    parameters, before, frames = run.parameters, run.measured, run.recording.frames
    bins = ring_bins(run.rings, run.ring_frames, probe, parameters.ring_bins, parameters.surface_sigma_mm)
    measured = Measurements.of(before.tracks, bins, before.time_s, None, probe)
    # Convergence is judged by the pipe's radius; that of the stated probe is close enough.
    radius_mm = float(run.state.globals[0])
    start = replace(run.state, instrument=np.zeros(measured.unsure.shape[1] + MATCH_BIASES))
    found = adjust_at_once(start, measured, frames, radius_mm, parameters, context)
    return replace(
        run, probe=probe, measured=found.measured, state=found.state, equations=found.equations,
        trajectory=found.trajectory,
    )  # fmt: skip


def ring_points(run: FieldRun) -> ImagePoints:
    """Return the ring bins at the place of the smooth pipe.

    The measured places are not used: derivatives that follow a measurement's error correlate with its
    residual.
    """
    frame, found_c = run.measured.rings.frame, run.measured.rings.xyz_c
    uv = run.probe.camera.project(found_c).uv
    away = uv - run.probe.camera.centre_px
    outward = away / np.linalg.norm(away, axis=1)[:, None]
    along_ray = way_per_px(run.probe, uv, outward)
    inclined = np.einsum("mi,mi->m", _wall_at(run, frame, found_c)[0], along_ray)
    uv = uv - (run.equations.rings.residual / inclined)[:, None] * outward
    xyz_c = run.probe.triangulate(uv)
    normal_c, along_c, azimuth, distance = _wall_at(run, frame, xyz_c)
    passing = _passing(run, frame, xyz_c)
    rate = np.einsum("mi,mi->m", normal_c, passing) / np.einsum("mi,mi->m", normal_c, along_ray)
    at = run.rings, run.ring_frames, frame, uv - run.rings.centre_px
    return ImagePoints(
        run.probe, frame, run.measured.time_s[frame], uv, xyz_c, normal_c, along_c, rate[:, None] * outward,
        speed_mm_s(run)[frame], True, widths_at(*at), azimuth, distance,
        per_px_c=way_per_px(run.probe, uv, outward), across_px=runs_across(*at, run.parameters.ring_bins),
    )  # fmt: skip


def texture_points(run: FieldRun) -> ImagePoints:
    """Return the landmark observations at the places predicted by the state's poses and landmarks."""
    tracks, state = run.measured.tracks, run.state
    xyz_c = transform(inverse(state.T_pc[tracks.frame]), state.xyz_p[tracks.landmark])
    normal_c, along_c, azimuth, distance = _wall_at(run, tracks.frame, xyz_c)
    by_c = run.probe.camera.project_jacobian(xyz_c).by_point
    velocity = np.einsum("mij,mj->mi", by_c, _passing(run, tracks.frame, xyz_c))
    return ImagePoints(
        run.probe, tracks.frame, run.measured.time_s[tracks.frame], run.probe.camera.project(xyz_c).uv,
        xyz_c, normal_c, along_c, velocity,
        speed_mm_s(run)[tracks.frame], False, np.full(len(tracks.uv), np.nan), azimuth, distance,
    )  # fmt: skip


def speed_mm_s(run: FieldRun) -> Float:
    """Return the camera's speed (N,) along the pipe."""
    return rates(distance_mm(run)[:, None], run.measured.time_s, SHARP)[:, 0]


def distance_mm(run: FieldRun) -> Float:
    """Return the camera's distance (N,) along the pipe's axis."""
    return to_pipe(run.state.axis, run.state.T_pc[:, :3, 3])[0]


def _wall_at(run: FieldRun, frame: Int, xyz_c: Float) -> tuple[Float, Float, Float, Float]:
    """Return outward normal and axis direction (M, 3) in C, azimuth and distance (M,) in P."""
    T = run.state.T_pc[frame]
    s, azimuth, _ = to_pipe(run.state.axis, transform(T, xyz_c))
    sections = frames_at(run.state.axis, s)[1]
    normal_p = np.cos(azimuth)[:, None] * sections[:, :, 0] + np.sin(azimuth)[:, None] * sections[:, :, 1]
    to_c = T[:, :3, :3]
    return (
        np.einsum("mij,mi->mj", to_c, normal_p), np.einsum("mij,mi->mj", to_c, sections[:, :, 2]), azimuth, s,
    )  # fmt: skip


def _passing(run: FieldRun, frame: Int, xyz_c: Float) -> Float:
    """Return the velocity (M, 3) of wall points in C, mm/s."""
    return Moving.of(run.state.T_pc, run.measured.time_s, SHARP).passing_mm_s(frame, xyz_c)
