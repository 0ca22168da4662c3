"""Gauge runs measured without rendering: rings and fiducials are traced ray by ray, with noise.

Shares no forward model with the diagnosis: rays, sheet, windows and motion are the simulator's. It allows
counts over many runs, of which rendered runs, at minutes each, can only check a few. The line's profile and
effects of the wall itself are not modelled: they need rendered runs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates

from pipeline.adjustment.motion_priors import LOOSE
from pipeline.arrays import Float
from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.geometry.rigid import inverse, transform
from pipeline.recording.base import Illumination, Recording
from pipeline.recording.base import Image as GreyImage
from pipeline.simulator.build import plain_truth
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.instrument import TrueInstrument
from pipeline.simulator.rays import viewing_rays
from pipeline.simulator.scene import Scene
from pipeline.simulator.sheet import SheetTable, sheet_table
from pipeline.simulator.truth import SceneTruth
from stages.calibrate.gauge import MeasuredRun
from stages.calibrate.gauge.adjust import Measurements
from stages.calibrate.gauge.edges import Edges, joined, predicted_edges
from stages.calibrate.gauge.geometry import Gauge, gauge_of
from stages.calibrate.gauge.solve import RingSource, first_unknowns
from stages.calibrate.gauge.state import GaugeParameters

_AZIMUTHS = 360
_NEWTON = 5
_BISECTIONS, _FALSE_POSITIONS = 9, 4
_RANGE_PX = (80.0, 590.0)
_GOOD_RAD = np.radians(20.0), np.radians(84.0)
_ROW_NODES = 33
_LATTICE = 200
# Linear interpolation between independent nodes leaves this share of their 1 σ, on average over both axes.
_INTERPOLATED = 2 / 3


@dataclass(frozen=True)
class Noise:
    """1 σ of the measurements: of single samples, and of errors that neighbours on the wall share."""

    ring_px: float = 0.05
    ring_cell_px: float = 0.02
    edge_px: float = 0.07
    edge_shared_px: float = 0.05
    placement_mm: float = 0.005
    cell_mm: float = 5.0


@dataclass(frozen=True)
class RingLevelRun:
    """A gauge run as it would be measured, a recording without pictures, and its truth."""

    measured: MeasuredRun
    recording: Recording
    truth: SceneTruth


@dataclass(frozen=True)
class _NoPictures:
    """A frame source without images."""

    image_size: tuple[int, int]

    def read(self, frames: object, planes: object) -> Iterator[tuple[int, GreyImage | None]]:
        """Yield nothing."""
        return iter(())


def ring_level_run(
    scene: Scene, file: Path, switches: Sequence[Switch], noise: Noise = Noise()
) -> RingLevelRun:
    """Return a scene's gauge run with effects switched on; ``file`` is where the scene was read from."""
    truth = switch_on(plain_truth(scene, file), switches)
    if truth.facts.fiducials is None:
        raise ValueError("the scene is no gauge run")
    gauge, random = gauge_of(truth.facts, truth.facts.fiducials), np.random.default_rng([scene.seed, 7])
    parameters, poses = GaugeParameters.model_validate({}), truth.poses()
    rings = _rings(truth, gauge, random, noise)
    edges = _edges(truth, gauge, poses, random, noise, parameters)
    posed = np.unique(edges.frame)
    first = poses.copy()
    first[:, :3, 3] += random.normal(0, 0.02, (len(poses), 3))
    source = RingSource(rings, rings.frame, gauge)
    measured = Measurements(
        edges, source.on_bore(first, truth.stated, parameters), truth.frames.time_s, truth.encoder(),
        gauge.radius_sigma_mm, LOOSE,
    )  # fmt: skip
    start = first_unknowns(first, posed, gauge, measured, truth.stated, parameters)
    run = MeasuredRun(start, measured, source, posed, np.zeros(0, np.int64), 0)
    return RingLevelRun(run, _recording(truth, file), truth)


def _recording(truth: SceneTruth, file: Path) -> Recording:
    return Recording(
        truth.name, "gauge", file, truth.frames, truth.encoder(), truth.facts, truth.frame_rate,
        _NoPictures(truth.stated.camera.image_size), None, "",
    )  # fmt: skip


def _rings(truth: SceneTruth, gauge: Gauge, random: np.random.Generator, noise: Noise) -> RingSamples:
    around = -np.pi + 2 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    outward = np.stack([np.cos(around), np.sin(around)], -1)
    frames = truth.frames.of(Illumination.LASER)
    radius = np.full((len(frames), _AZIMUTHS), np.nan)
    shared = random.normal(0, noise.ring_cell_px / _INTERPOLATED, (_LATTICE, _LATTICE))
    for row, frame in enumerate(frames):
        eye = Eye.at(truth, float(truth.frames.time_s[frame]))
        rho, point_p = traced_ring(eye, gauge, truth.stated.camera.centre_px, outward)
        way = np.arctan2(point_p[:, 1], point_p[:, 0]) * gauge.radius_mm.max()
        cell = map_coordinates(
            shared, [point_p[:, 2] / noise.cell_mm, way / noise.cell_mm], order=1, mode="grid-wrap"
        )
        radius[row] = rho + cell + random.normal(0, noise.ring_px, _AZIMUTHS)
    ok = np.isfinite(radius)
    wide = np.where(ok, 1.26, np.nan).astype(np.float32)
    return RingSamples(
        np.asarray(frames, np.int64), around, truth.stated.camera.centre_px, radius.astype(np.float32),
        np.where(ok, noise.ring_px, np.nan).astype(np.float32), wide, (100 * wide).astype(np.float32),
        np.where(ok, RingValidity.VALID, RingValidity.NO_LINE).astype(np.uint8),
    )  # fmt: skip


@dataclass(frozen=True)
class Eye:
    """The true instrument in one frame.

    Attributes
    ----------
    instrument : TrueInstrument
    sheet : SheetTable
    row : (K,)
        Image rows for which poses are given; one of a global shutter.
    T_pc : (K, 4, 4)
    """

    instrument: TrueInstrument
    sheet: SheetTable
    row: Float
    T_pc: Float

    @classmethod
    def at(cls, truth: SceneTruth, time_s: float) -> Eye:
        """Return the instrument at a frame's time, with its pose row by row."""
        instrument = truth.instrument_at(time_s)
        shutter, rows = instrument.shutter, instrument.camera.model.image_size[1]
        readout_s = shutter.readout_s if shutter.kind == "rolling" else 0.0
        row = np.linspace(-0.5, rows - 0.5, _ROW_NODES if readout_s else 1)
        # A longer exposure from the same start has its middle later.
        late = 0.5 * (shutter.exposure_s - truth.stated.shutter.exposure_s)
        seen_s = time_s + late + ((row + 0.5) / rows - 0.5) * readout_s
        return cls(
            instrument, sheet_table((instrument.laser,)), row, truth.motion.pose(seen_s, truth.wall.axis)
        )

    def poses(self, row: Float) -> Float:
        """Return ``T_pc`` (A, 4, 4) at image rows (A,), linear between those given; NaN at NaN."""
        if len(self.row) == 1:
            return np.broadcast_to(self.T_pc, (len(row), 4, 4))
        at = np.clip((row - self.row[0]) / (self.row[1] - self.row[0]), 0, len(self.row) - 1 - 1e-9)
        low = np.nan_to_num(at).astype(int)
        part = (at - low)[:, None, None]
        return np.asarray((1 - part) * self.T_pc[low] + part * self.T_pc[low + 1])


def traced_ring(eye: Eye, gauge: Gauge, centre: Float, outward: Float) -> tuple[Float, Float]:
    """Return image radii (A,) at which the lit wall is seen, and the lit points (A, 3) in P.

    A pixel farther out sees nearer wall, so that its sight line crosses the sheet once along the image
    radius; NaN where it does so in a jump.
    """

    def ahead(rho: Float) -> tuple[Float, Float]:
        return _ahead(eye, gauge, centre + rho[:, None] * outward)

    low, high = (np.full(len(outward), end) for end in _RANGE_PX)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        before = ahead(middle)[0] > 0
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    far, near = ahead(low)[0], ahead(high)[0]
    for _ in range(_FALSE_POSITIONS):
        rho = low + (high - low) * np.clip(far / np.where(far > near, far - near, 1.0), 0.0, 1.0)
        left, point_p = ahead(rho)
        low, far = np.where(left > 0, rho, low), np.where(left > 0, left, far)
        high, near = np.where(left > 0, high, rho), np.where(left > 0, near, left)
    rho = np.where(np.abs(left) < 1e-4, rho, np.nan)
    locking = eye.instrument.camera.locking_px
    return rho + (locking * np.sin(2 * np.pi * rho) if locking else 0.0), point_p


def _ahead(eye: Eye, gauge: Gauge, uv: Float) -> tuple[Float, Float]:
    """Return how far ahead of the sheet pixels (A, 2) see the wall, and that point (A, 3) in P."""
    origin, ray = viewing_rays(eye.instrument.camera, uv)
    T_pc = eye.poses(uv[:, 1])
    origin_p, ray_p = transform(T_pc, origin), np.einsum("nij,nj->ni", T_pc[:, :3, :3], ray)
    way = _to_bore(gauge, origin_p, ray_p)
    point = origin + way[:, None] * ray
    nodes = -np.pi + 2 * np.pi * np.arange(eye.sheet.height.shape[1]) / eye.sheet.height.shape[1]
    psi, q = np.arctan2(point[:, 1], point[:, 0]), np.hypot(point[:, 0], point[:, 1])
    base, slope = (
        np.interp(psi, nodes, part[0], period=2 * np.pi) for part in (eye.sheet.height, eye.sheet.slope)
    )
    return point[:, 2] - base - q * slope, origin_p + way[:, None] * ray_p


def _to_bore(gauge: Gauge, origin_p: Float, ray_p: Float) -> Float:
    """Return the distance (N,) along rays from within the bore to its wall or a step down in it."""
    a, b = np.sum(ray_p[:, :2] ** 2, 1), np.sum(origin_p[:, :2] * ray_p[:, :2], 1)
    c = np.sum(origin_p[:, :2] ** 2, 1)
    best = np.full(len(a), np.inf)
    ends = np.append(gauge.start_mm[1:], np.inf)
    starts = np.append(-np.inf, gauge.start_mm[1:])
    for radius, start, end in zip(gauge.radius_mm, starts, ends, strict=True):
        way = (np.sqrt(np.maximum(b * b + a * (radius**2 - c), 0)) - b) / a
        z = origin_p[:, 2] + way * ray_p[:, 2]
        best = np.where((z >= start) & (z < end), np.minimum(best, way), best)
        # The face of the step down to a narrower bore.
        face = (start - origin_p[:, 2]) / np.where(np.abs(ray_p[:, 2]) > 1e-9, ray_p[:, 2], 1e-9)
        q = np.hypot(*(origin_p[:, :2] + face[:, None] * ray_p[:, :2]).T)
        hit = (face > 0) & (q > radius) & (q < gauge.radius_mm.max()) & np.isfinite(start)
        best = np.where(hit, np.minimum(best, face), best)
    return np.where(np.isfinite(best), best, 1e3)


def _edges(
    truth: SceneTruth, gauge: Gauge, poses: Float, random: np.random.Generator, noise: Noise,
    parameters: GaugeParameters,
) -> Edges:  # fmt: skip
    out = []
    count = len(gauge.ids)
    placed = random.normal(0, noise.placement_mm, (count, 4))
    markers = np.arange(count)
    for frame in truth.frames.of(Illumination.LED):
        predicted, border_px, _ = predicted_edges(
            int(frame), markers, poses[frame], truth.stated.camera, gauge, parameters
        )
        xyz_c = transform(inverse(poses[frame]), predicted.xyz_p)
        theta = np.arctan2(np.hypot(xyz_c[:, 0], xyz_c[:, 1]), xyz_c[:, 2])
        size = np.array(truth.stated.camera.image_size)
        inside = ((predicted.uv > 8) & (predicted.uv < size - 9)).all(1)
        keep = (
            inside
            & (border_px >= parameters.least_border_px)
            & (theta > _GOOD_RAD[0])
            & (theta < _GOOD_RAD[1])
        )
        seen = np.bincount(predicted.marker[keep], minlength=count) == 4 * parameters.edge_samples
        keep &= seen[predicted.marker]
        edges = predicted.select(keep)
        at = edges.xyz_p + placed[edges.marker, edges.side][:, None] * edges.outward_p
        uv = seen_at(Eye.at(truth, float(truth.frames.time_s[frame])), at, edges.uv)
        # A fiducial is measured whole or not at all.
        hidden = np.isin(edges.marker, edges.marker[np.isnan(uv).any(1)])
        edges, uv = edges.select(~hidden), uv[~hidden]
        if len(np.unique(edges.marker)) < 3:
            continue
        shared = random.normal(0, noise.edge_shared_px, (count, 4))[edges.marker, edges.side]
        error = shared + random.normal(0, noise.edge_px, len(uv))
        out.append(replace(edges, uv=uv + error[:, None] * edges.normal, sigma_px=np.full(len(uv), 0.041)))
    return joined(out)


def seen_at(eye: Eye, xyz_p: Float, first: Float) -> Float:
    """Return pixels (M, 2) whose viewing rays pass through wall points (M, 3), by Newton's method.

    NaN for a point beyond the camera's view, such as that of a shifted dome.
    """
    uv = first.copy()
    for _ in range(_NEWTON):
        miss = _miss(eye, xyz_p, uv)
        jacobian = np.stack([(_miss(eye, xyz_p, uv + step) - miss) / 0.01 for step in 0.01 * np.eye(2)], -1)
        uv = uv - np.linalg.solve(jacobian, miss[..., None])[..., 0]
    return uv


def _miss(eye: Eye, xyz_p: Float, uv: Float) -> Float:
    """Return by how much (M, 2) rays miss the points, as tangents about the points' own direction."""
    origin, ray = viewing_rays(eye.instrument.camera, uv)
    towards = transform(inverse(eye.poses(uv[:, 1])), xyz_p) - origin
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    side = np.cross(towards, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side, axis=1)[:, None]
    up = np.cross(towards, side)
    return np.stack([np.sum(ray * side, 1), np.sum(ray * up, 1)], -1)
