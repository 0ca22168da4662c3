"""Calibrates camera, laser sheet and poses from a run through a gauge of known bore."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from pipeline.adjustment.levenberg_marquardt import Watch
from pipeline.adjustment.motion_priors import LOOSE
from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.errors import UnusableError
from pipeline.geometry.rigid import transform
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Stage
from pipeline.recording.base import Illumination, Recording
from pipeline.recording.checks import CheckedFrames
from stages.calibrate.gauge import premises
from stages.calibrate.gauge.adjust import Measurements
from stages.calibrate.gauge.edges import (
    Edges,
    Sighting,
    find_fiducials,
    joined,
    measure_edges,
)
from stages.calibrate.gauge.geometry import BoreRings, Gauge
from stages.calibrate.gauge.poses import (
    PosedFrames,
    first_pose,
    frame_index,
    posed_frames,
    poses_of_all_frames,
)
from stages.calibrate.gauge.premises import require_gauge
from stages.calibrate.gauge.result import GaugeCalibration, calibration_of, warn_of_bores, warn_of_misfit
from stages.calibrate.gauge.solve import Finding, RingSource, first_unknowns, solve
from stages.calibrate.gauge.state import GaugeParameters, Unknowns
from stages.calibrate.gauge.white import brightest_grey

__all__ = ["GAUGE", "GaugeCalibration", "GaugeParameters", "calibrate_gauge", "require_gauge"]


@dataclass(frozen=True)
class MeasuredRun:
    """The measurements of a gauge run before any adjustment.

    Attributes
    ----------
    start : Unknowns
        First poses, the stated probe and a perfect gauge.
    measured : Measurements
    source : RingSource
    posed : (K,) int
        Indices in the recording of the frames whose fiducials gave a pose.
    wrong_fiducials : (J,) int
        Indices of fiducials that contradict most frames.
    overexposed : int
        Number of fiducials' edges that are left out because the white beside them is overexposed.
    """

    start: Unknowns
    measured: Measurements
    source: RingSource
    posed: Int
    wrong_fiducials: Int
    overexposed: int


def calibrate_gauge(
    recording: Recording, rings: RingSamples, probe: Probe, parameters: GaugeParameters, context: Context
) -> GaugeCalibration:
    """Estimate camera, laser sheet, poses and encoder jointly from fiducials and rings on known bore.

    Raises
    ------
    InputError
        When the recording describes no gauge.
    UnusableError
        When fiducials or rings contradict the gauge's description, or cannot determine the instrument.
    """
    run = measure_gauge(recording, rings, probe, parameters, context)
    premises.require_offset(run.start.T_pc, parameters)
    gauge, wrong = run.source.gauge, run.wrong_fiducials
    finding = _solved(run, parameters, partial(context.progress, 0, 1))
    numbers = np.union1d(gauge.ids[wrong], gauge.ids[finding.wrong_fiducials])
    finding = replace(
        finding, wrong_fiducials=numbers, wrong_rings=recording.frames.frame[finding.wrong_rings],
        left_out=finding.left_out | {"edge of a fiducial beside overexposed white": run.overexposed},
    )  # fmt: skip
    result = calibration_of(recording.name, recording.frames.frame, gauge, finding)
    _require_determined(result, parameters)
    warn_of_misfit(result, context)
    warn_of_bores(result, gauge, context)
    return result


def _posed(
    recording: Recording, gauge: Gauge, probe: Probe, parameters: GaugeParameters, context: Context
) -> PosedFrames:
    """Return the frames in which fiducials give a pose."""
    sightings = _sightings(recording, gauge, context)
    premises.require_fiducials(recording, gauge, sightings, parameters)
    first = [first_pose(s, gauge, probe.camera, context.random) for s in sightings]
    posed = posed_frames(recording, sightings, first)
    premises.require_poses(recording, posed, sightings, gauge, probe.camera, parameters)
    return posed


def measure_gauge(
    recording: Recording, rings: RingSamples, probe: Probe, parameters: GaugeParameters, context: Context
) -> MeasuredRun:
    """Measure a gauge run: return first poses and the measurements for the adjustment.

    Raises
    ------
    InputError
        When the recording describes no gauge.
    UnusableError
        When fiducials or rings contradict the gauge's description.
    """
    gauge = premises.require_gauge(recording)
    posed = _posed(recording, gauge, probe, parameters, context)
    wrong = premises.outvoted_fiducials(posed, gauge)
    T_pc = poses_of_all_frames(recording, posed, rings, probe)
    source = RingSource(rings, frame_index(recording, rings.frame), gauge)
    on_bore = source.on_bore(T_pc, probe, parameters)
    _require_bores(on_bore, T_pc, probe, gauge, parameters)
    edges, overexposed = _edges(recording, posed, wrong, gauge, probe, parameters, context)
    time_s, encoder = recording.frames.time_s, recording.encoder
    measured = Measurements(edges, on_bore, time_s, encoder, gauge.radius_sigma_mm, LOOSE)
    start = first_unknowns(T_pc, posed.index, gauge, measured, probe, parameters)
    return MeasuredRun(start, measured, source, posed.index, wrong, overexposed)


def _solved(run: MeasuredRun, parameters: GaugeParameters, watch: Watch) -> Finding:
    try:
        # More threads gain nothing on blocks this small, and stall when the machine is busy.
        with threadpool_limits(1):
            return solve(run.start, run.measured, run.source, run.posed, parameters, watch)
    except np.linalg.LinAlgError as error:
        raise UnusableError("calibrate", f"the run does not determine the instrument ({error})") from error


def _sightings(recording: Recording, gauge: Gauge, context: Context) -> list[Sighting]:
    lit = recording.frames.of(Illumination.LED, Illumination.BOTH)
    found = []
    for sighting, _ in find_fiducials(recording.read(lit, "grey"), gauge):
        found.append(sighting)
        context.progress(len(found), 2 * len(lit))
    return found


def _edges(
    recording: Recording,
    posed: PosedFrames,
    wrong: Int,
    gauge: Gauge,
    probe: Probe,
    parameters: GaugeParameters,
    context: Context,
) -> tuple[Edges, int]:
    """Measure the borders of the consistent fiducials in all posed frames; count overexposed edges."""
    parts, overexposed = [], 0
    frames = recording.frames.frame[posed.index]
    white = brightest_grey(recording, frames)
    for k, (_, image) in enumerate(recording.read(frames, "grey")):
        context.progress(len(posed.index) + k + 1, 2 * len(posed.index))
        if image is None:
            continue
        sighting, pose = posed.sightings[k], posed.poses[k]
        marker = sighting.marker[pose.fits & ~np.isin(sighting.marker, wrong)]
        index = int(posed.index[k])
        edges, left_out = measure_edges(
            image, index, marker, pose.T_pc, probe.camera, gauge, parameters, white
        )
        parts.append(edges)
        overexposed += left_out
    edges = joined(parts)
    premises.warn_of_overexposed(overexposed, len(edges.uv), context)
    return edges, overexposed


def _require_bores(
    rings: BoreRings, T_pc: Float, probe: Probe, gauge: Gauge, parameters: GaugeParameters
) -> None:
    """Refuse a run with too few rings on known bore, or with a bore of another diameter than stated."""
    premises.require_rings(len(np.unique(rings.frame)), parameters)
    xyz_p = transform(T_pc[rings.frame], probe.triangulate(rings.uv))
    error = np.hypot(xyz_p[:, 0], xyz_p[:, 1]) - rings.radius_mm
    premises.require_bores(gauge, rings.section, error)


def _require_determined(result: GaugeCalibration, parameters: GaugeParameters) -> None:
    widest = max(result.radii, key=lambda r: r.radius_mm)
    names = " with ".join(result.weak[0].change)
    premises.require_determined(float(widest.sigma_mm.max()), names, parameters)


def _calibrate_run(
    recording: Recording,
    frames: CheckedFrames,
    rings: RingSamples,
    probe: Probe,
    parameters: GaugeParameters,
    context: Context,
) -> GaugeCalibration:
    """Calibrate with frames and encoder as corrected by the stage premises: see `calibrate_gauge`."""
    return calibrate_gauge(frames.applied_to(recording), rings, probe, parameters, context)


GAUGE = Stage(
    "gauge", "14", GaugeParameters, _calibrate_run, "fiducials and rings on known bore to camera and sheet"
)
