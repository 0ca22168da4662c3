"""Gauge runs simulated as ring samples and fiducial edges, without pictures; the true probe is drawn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.adjustment.motion_priors import LOOSE
from pipeline.arrays import Float, Image, Int
from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.geometry.rigid import from_parts, inverse, rotation_from_vector, transform
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.recording.base import (
    BoreSection,
    Encoder,
    Fiducials,
    FrameTable,
    Marker,
    PipeFacts,
    Planes,
    Recording,
)
from stages.calibrate.gauge import MeasuredRun
from stages.calibrate.gauge.adjust import Measurements
from stages.calibrate.gauge.edges import Edges, Sighting, joined, predicted_edges
from stages.calibrate.gauge.geometry import Gauge, gauge_of
from stages.calibrate.gauge.poses import FirstPose, PosedFrames, poses_of_all_frames
from stages.calibrate.gauge.result import GaugeCalibration, calibration_of
from stages.calibrate.gauge.solve import RingSource, first_unknowns, solve
from stages.calibrate.gauge.state import GaugeParameters

USUAL = GaugeParameters.model_validate({"ring_bins": 120})
RING_PX, EDGE_PX = 0.1, 0.1
_NEAREST, _FARTHEST = 10.0, 55.0


@dataclass(frozen=True)
class GaugeRun:
    """What was measured in a simulated run, and the true probe."""

    recording: Recording
    gauge: Gauge
    rings: RingSamples
    edges: Edges
    posed: PosedFrames
    stated: Probe
    true: Probe


class NoImages:
    """A frame source without images."""

    image_size = (1600, 1200)

    def read(self, frames: Sequence[int], planes: Planes) -> Iterator[tuple[int, Image | None]]:
        yield from ((int(f), None) for f in frames)


def stated_probe() -> Probe:
    camera = KannalaBrandt((1600, 1200), (366.0, 366.0), (799.0, 597.0), (-0.012, 0.001, -0.0008, 0.0))
    probe = Probe(camera, LaserSheet(23.5), np.zeros((20, 20)))
    sigma = dict(zip(probe.parameter_names, np.zeros(20), strict=True))
    sigma |= {"cx": 0.06, "cy": 0.06, "k1": 2e-4, "k2": 2e-4, "k3": 1e-4, "baseline_mm": 0.008}
    sigma |= {"tilt_x": 1e-4, "tilt_y": 1e-4, "cone_rad": 1e-4}
    covariance = np.diag(np.array(list(sigma.values())) ** 2)
    covariance[:2, :2] = 0.06**2
    return Probe(camera, probe.laser, covariance)


def facts() -> PipeFacts:
    markers = []
    for row, (distance, count) in enumerate([(11, 9), (31, 9), (53, 9), (73, 9), (95, 7), (115, 7)]):
        turn = -180 + 180 / count * (row % 2)
        markers += [Marker(len(markers) + k, distance, turn + 360 / count * k) for k in range(count)]
    fiducials = Fiducials("DICT_4X4_100", 9.0, "+azimuth", "+distance", tuple(markers))
    bore = tuple(BoreSection(42.0, d) for d in (101.6, 84.0, 70.0))
    return PipeFacts(101.6, None, bore, 0.01, fiducials)


def made_run(seed: int, frames: int = 120, misdrawn_mm: float = 0.0) -> GaugeRun:
    """Return a run whose camera is drawn within its stated σ and whose sheet is drawn with a larger one.

    The radius of the second of three bores is ``misdrawn_mm`` larger than stated.
    """
    random = np.random.default_rng(seed)
    stated = stated_probe()
    draw = random.multivariate_normal(stated.parameters, stated.covariance)
    draw[8:12] = stated.parameters[8:12] + random.normal(size=4) * [0.3, 0.005, 0.005, 0.003]
    true = stated.with_parameters(draw, stated.covariance)
    gauge = gauge_of(facts(), facts().fiducials)
    radius_mm = gauge.radius_mm + random.normal(0, gauge.radius_sigma_mm, 3) + [0, misdrawn_mm, 0]
    gauge_as_made = Gauge(gauge.start_mm, radius_mm, 0.0, gauge.fiducials)
    T_pc = driven(frames, random)
    time = np.arange(frames) / 30.0
    lit = np.arange(frames) % 4 == 3
    encoder = Encoder(time, (T_pc[:, 2, 3] + 22 + random.normal(0, 0.05, frames)) / 1.001)
    table = FrameTable(np.arange(frames), time, np.where(lit, "led", "laser"))
    recording = Recording(
        "made", "gauge", Path("made"), table, encoder, facts(), 30.0, NoImages(), None, "made"
    )
    rings = rings_of(T_pc, np.flatnonzero(~lit), true, gauge_as_made, random)
    edges, posed = fiducials_of(T_pc, np.flatnonzero(lit), true.camera, gauge, random)
    return GaugeRun(recording, gauge, rings, edges, posed, stated, true)


def driven(frames: int, random: np.random.Generator) -> Float:
    """Return the camera's poses (N, 4, 4) on a drive through the gauge, off-centre, with wobble and roll."""
    t = np.linspace(0, 1, frames)
    phase = random.uniform(0, 2 * np.pi, 4)
    wave = [np.sin(2 * np.pi * k * t + p) for k, p in zip((2, 3, 2.5, 1.5), phase, strict=True)]
    place = np.stack([4 * wave[0], 4 * wave[1], -22 + 130 * t], -1)
    tilt = rotation_from_vector(np.stack([0.02 * wave[2], 0.02 * wave[3], 0 * t], -1))
    roll = rotation_from_vector(np.stack([0 * t, 0 * t, 5.0 * t], -1))
    return from_parts(tilt @ roll, place)


def driven_as(run: GaugeRun) -> Float:
    """Return the true poses of run 1, whose drive is drawn after the probe."""
    random = np.random.default_rng(1)
    stated = stated_probe()
    random.multivariate_normal(stated.parameters, stated.covariance)
    random.normal(size=4)
    random.normal(0, 1, 3)
    return driven(len(run.recording.frames.frame), random)


def ring_uv(T_pc: Float, probe: Probe, gauge: Gauge, azimuth_rad: Float) -> Float:
    """Return where the sheet's rays (A,) meet the bore of one pose, in pixels (A, 2)."""
    direction = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad), probe.laser.slope(azimuth_rad)], -1)
    start = np.stack([0 * azimuth_rad, 0 * azimuth_rad, probe.laser.height(azimuth_rad)], -1)
    d_p, s_p = direction @ T_pc[:3, :3].T, transform(T_pc, start)
    radius = np.full(len(azimuth_rad), gauge.radius_mm[0])
    for _ in range(4):
        a, b = np.sum(d_p[:, :2] ** 2, 1), np.sum(d_p[:, :2] * s_p[:, :2], 1)
        q = (-b + np.sqrt(b * b - a * (np.sum(s_p[:, :2] ** 2, 1) - radius**2))) / a
        radius = gauge.radius_mm[gauge.section(s_p[:, 2] + q * d_p[:, 2])]
    return probe.camera.project(start + q[:, None] * direction).uv


def rings_of(T_pc: Float, index: Int, probe: Probe, gauge: Gauge, random: np.random.Generator) -> RingSamples:
    """Return the rings of frames ``index`` with white noise."""
    grid = -np.pi + np.arange(720) * 2 * np.pi / 720
    fine = np.linspace(-np.pi, np.pi, 2880, endpoint=False)
    centre = stated_probe().camera.centre_px
    radius = np.empty((len(index), len(grid)), np.float32)
    for row, k in enumerate(index):
        off = ring_uv(T_pc[k], probe, gauge, fine) - centre
        angle = np.arctan2(off[:, 1], off[:, 0])
        order = np.argsort(angle)
        radius[row] = np.interp(grid, angle[order], np.hypot(*off[order].T), period=2 * np.pi)
    radius += random.normal(0, RING_PX, radius.shape).astype(np.float32)
    alike = np.full(radius.shape, RING_PX, np.float32)
    valid = np.full(radius.shape, RingValidity.VALID, np.uint8)
    return RingSamples(index, grid, centre, radius, alike, 10 * alike, 1000 * alike, valid)


def fiducials_of(
    T_pc: Float, index: Int, camera: KannalaBrandt, gauge: Gauge, random: np.random.Generator
) -> tuple[Edges, PosedFrames]:
    """Return edges seen in frames ``index`` with white noise and print errors, and rough poses."""
    parameters = GaugeParameters.model_validate({})
    printed = random.normal(0, 0.03, (len(gauge.ids), 4))
    parts, known, sightings, poses = [], [], [], []
    for k in index:
        centre = np.array([m.distance_mm for m in gauge.fiducials.markers]) - T_pc[k, 2, 3]
        marker = np.flatnonzero((centre > _NEAREST) & (centre < _FARTHEST))
        if len(marker) < 3:
            continue
        edges, width, _ = predicted_edges(int(k), marker, T_pc[k], camera, gauge, parameters)
        edges = edges.select(width > parameters.least_border_px)
        shifted = edges.xyz_p + printed[edges.marker, edges.side][:, None] * edges.outward_p
        uv = camera.project(transform(inverse(T_pc[k]), shifted)).uv
        uv = uv + random.normal(0, EDGE_PX, len(uv))[:, None] * edges.normal
        sigma = np.full(len(uv), EDGE_PX)
        parts.append(Edges(**(vars(edges) | {"uv": uv, "sigma_px": sigma})))
        rough = from_parts(
            T_pc[k, :3, :3] @ rotation_from_vector(random.normal(0, 5e-4, 3)),
            T_pc[k, :3, 3] + random.normal(0, 0.03, 3),
        )
        known.append(k)
        nothing = np.zeros((len(marker), 4, 2))
        sightings.append(Sighting(int(k), marker, nothing, np.zeros(0, np.int64)))
        poses.append(FirstPose(rough, np.ones(len(marker), bool)))
    return joined(parts), PosedFrames(np.array(known), tuple(sightings), tuple(poses))


def calibrated(run: GaugeRun, parameters: GaugeParameters | None = None) -> GaugeCalibration:
    """Return the result of calibrating with a run."""
    parameters = parameters or USUAL
    given = measured_run(run, parameters)
    finding = solve(given.start, given.measured, given.source, given.posed, parameters)
    return calibration_of("made", run.recording.frames.frame, run.gauge, finding)


def measured_run(run: GaugeRun, parameters: GaugeParameters = USUAL) -> MeasuredRun:
    """Return a run in the form in which the calibration receives it."""
    T_pc = poses_of_all_frames(run.recording, run.posed, run.rings, run.stated)
    source = RingSource(run.rings, run.rings.frame, run.gauge)
    measured = Measurements(
        run.edges, source.on_bore(T_pc, run.stated, parameters), run.recording.frames.time_s,
        run.recording.encoder, run.gauge.radius_sigma_mm, LOOSE,
    )  # fmt: skip
    start = first_unknowns(T_pc, run.posed.index, run.gauge, measured, run.stated, parameters)
    return MeasuredRun(start, measured, source, run.posed.index, np.zeros(0, np.int64), 0)


def in_sigma(run: GaugeRun, result: GaugeCalibration) -> dict[str, float]:
    """Return the error of each parameter over its own σ; fx and fy count once."""
    sigma = np.sqrt(np.diag(result.probe.covariance))
    off = result.probe.parameters - run.true.parameters
    names = result.probe.parameter_names
    return {n: float(off[k] / sigma[k]) for k, n in enumerate(names) if sigma[k] > 0 and n != "fy"}
