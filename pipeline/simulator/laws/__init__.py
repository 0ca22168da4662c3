"""The closed-form laws of the known effects, each compared with the traced or rendered result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.arrays import Float
from pipeline.geometry.axis import straight_axis
from pipeline.geometry.rigid import transform
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe, Shutter
from pipeline.recording.base import FrameTable, PipeFacts
from pipeline.simulator.instrument import LineProfile, TrueCamera, TrueInstrument, TrueLaser, TrueSensor
from pipeline.simulator.motion import Motion, Odometer, constant
from pipeline.simulator.rays import viewing_rays
from pipeline.simulator.scene import Rendering
from pipeline.simulator.sheet import sheet_table
from pipeline.simulator.truth import SceneTruth, row_late_s
from pipeline.simulator.wall.grid import Wall, WallGrid

# The instrument of the notes: baseline 22 mm, equidistant lens of 360 px/rad, 2 MP.
BASELINE_MM, FOCAL_PX = 22.0, 360.0
# Width and height of a 2 MP sensor, px.
IMAGE_SIZE = (1600, 1200)
# Width of the line on the wall (1 σ), as in the physics notes.
LINE_SIGMA_MM = 0.15
# 2, 3 and 4 inch.
RADII_MM = (25.4, 38.1, 50.8)
# Reflectance of the bench's grey wall: the default of a scene's surface.
ALBEDO = 0.4
# Extent and cells of the bench's wall. It is smooth, so that coarse cells are exact.
_FROM_MM, _TO_MM, _STEP_MM, _COLUMNS = -20.0, 120.0, 0.5, 256
# Frames a second: the default of a scene.
_FRAME_RATE = 30.0


def bench_probe(image_size: tuple[int, int] = IMAGE_SIZE) -> Probe:
    """Return the probe of the notes, without any uncertainty; its optical axis is the picture's middle."""
    middle = ((image_size[0] - 1) / 2, (image_size[1] - 1) / 2)
    camera = KannalaBrandt(image_size, (FOCAL_PX, FOCAL_PX), middle)
    laser = LaserSheet(BASELINE_MM, line_sigma_mm=LINE_SIGMA_MM)
    size = len(camera.parameter_names) + len(LaserSheet.PARAMETER_NAMES)
    return Probe(camera, laser, np.zeros((size, size)), Shutter())


def bench_truth(
    radius_mm: float, motion: Motion | None = None, frames: int = 1, image_size: tuple[int, int] = IMAGE_SIZE
) -> SceneTruth:
    """Return a scene in which the true instrument is the stated one, in a smooth pipe.

    Parameters
    ----------
    radius_mm : float
    motion : Motion, optional
        At rest on the axis at distance 0 where none is given.
    frames : int
        At 30 frames a second, from time 0.
    image_size : (int, int)
    """
    stated = bench_probe(image_size)
    instrument = TrueInstrument(
        TrueCamera(stated.camera),
        TrueLaser(stated.laser, profile=LineProfile(LINE_SIGMA_MM)),
        sensor=TrueSensor(read_noise_e=0.0),
        shutter=stated.shutter,
    )
    table = FrameTable(np.arange(frames), np.arange(frames) / _FRAME_RATE, np.full(frames, "laser"))
    facts = PipeFacts(2 * radius_mm)
    return SceneTruth(
        "bench", "inspection", 0, stated, instrument, bench_wall(radius_mm), facts,
        motion or Motion(constant(0.0)), Odometer(quantum_mm=0.0), table, _FRAME_RATE,
        Rendering.model_validate({}),
    )  # fmt: skip


def bench_wall(radius_mm: float) -> Wall:
    """Return a smooth, grey, matt pipe."""
    rows = round((_TO_MM - _FROM_MM) / _STEP_MM) + 1
    grid = WallGrid(_FROM_MM, _STEP_MM, rows, _COLUMNS)
    radius = np.full((rows, _COLUMNS), radius_mm, np.float32)
    albedo = np.full((rows, _COLUMNS, 3), ALBEDO, np.float32)
    return Wall(straight_axis(_FROM_MM, _TO_MM), grid, radius, grid, albedo)


@dataclass(frozen=True)
class Check:
    """A row of the table of agreement.

    Attributes
    ----------
    name : str
        Of the effect or state.
    mark : str
        The notes' own: ``✓`` checked there, ``○`` derived only, empty for neither.
    law : str
    of : str
        What is compared.
    predicted, computed : float
    unit : str
    tolerance : float
        Absolute, from the second-order terms that the law leaves out.
    harmonic : tuple of int, or None
        The law's and the strongest computed one.
    exponent : tuple of float, or None
        The notes' and the computed one, radius 25.4 to 50.8 mm.
    mended : str
        The law that holds, where the notes' does not.
    mended_value : float or None
        What that predicts.
    """

    name: str
    mark: str
    law: str
    of: str
    predicted: float
    computed: float
    unit: str
    tolerance: float
    harmonic: tuple[int, int] | None = None
    exponent: tuple[float, float] | None = None
    mended: str = ""
    mended_value: float | None = None

    @property
    def agrees(self) -> bool:
        """Whether size, harmonic and exponent agree with the law."""
        sized = abs(self.computed - self.predicted) <= self.tolerance
        shaped = self.harmonic is None or self.harmonic[0] == self.harmonic[1]
        grown = self.exponent is None or abs(self.exponent[0] - self.exponent[1]) <= EXPONENT_TOLERANCE
        return sized and shaped and grown

    @property
    def mended_agrees(self) -> bool:
        """Whether the law that replaces a wrong one holds."""
        return self.mended_value is not None and abs(self.computed - self.mended_value) <= self.tolerance


# The notes give exponents to two figures, some as the slope in the middle of the range.
EXPONENT_TOLERANCE = 0.03


def harmonic(azimuth_rad: Float, value: Float, order: int) -> complex:
    """Return c of Re(c e^{-imψ}) in values (A,), fitted with orders 0 to 6 and up to m.

    Its amplitude is |c|, its crest is at arg(c)/m. Values that are not finite are left out.
    """
    orders = range(max(order, 6) + 1)
    columns = [f(m * azimuth_rad) for m in orders for f in (np.cos, np.sin) if m or f is np.cos]
    known = np.isfinite(value)
    found = np.linalg.lstsq(np.stack(columns, -1)[known], value[known], rcond=None)[0]
    return complex(found[0]) if order == 0 else complex(found[2 * order - 1], found[2 * order])


def strongest(azimuth_rad: Float, value: Float) -> int:
    """Return the harmonic, 0 to 6, of the largest amplitude in values (A,)."""
    return int(np.argmax([abs(harmonic(azimuth_rad, value, m)) for m in range(7)]))


def exponent(radii_mm: Float, sizes: Float) -> float:
    """Return d ln |size| / d ln radius between the first and the last of radii (K,)."""
    return float(np.log(abs(sizes[-1] / sizes[0])) / np.log(radii_mm[-1] / radii_mm[0]))


# Number of traced directions; 500 px halved 50 times is below rounding; steps to a wall that depends on
# azimuth alone.
_TRACED_AZIMUTHS, _BISECTIONS, _WALL_STEPS = 144, 50, 8
# Image radii, px, between which the bench's ring lies in bores of 2 to 4 inch: atan(r/22 mm) × 360 px/rad.
_SEARCH_PX = (60.0, 560.0)


class TracedRing(NamedTuple):
    """A true ring and its measurement.

    Attributes
    ----------
    uv : (N, 2)
        Where the camera sees it, at evenly spaced image azimuths.
    xyz_c : (N, 3)
        The lit points of the wall.
    azimuth_rad, error_mm : (N,)
        Of the points that the stated instrument makes of ``uv``; radius about its axis, less the pipe's mean.
    """

    uv: Float
    xyz_c: Float
    azimuth_rad: Float
    error_mm: Float


def trace_ring(truth: SceneTruth, time_s: float = 0.0, azimuths: int = _TRACED_AZIMUTHS) -> TracedRing:
    """Return the ring at a moment; with a rolling shutter each row is seen at its own time."""
    instrument = truth.instrument_at(time_s)
    around = -np.pi + 2 * np.pi * np.arange(azimuths) / azimuths
    outward = np.stack([np.cos(around), np.sin(around)], -1)
    low, high = (np.full(azimuths, end) for end in _SEARCH_PX)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        ahead = (
            _height(truth, instrument, time_s, truth.stated.camera.centre_px + middle[:, None] * outward)[0]
            > 0
        )
        low, high = np.where(ahead, middle, low), np.where(ahead, high, middle)
    uv = truth.stated.camera.centre_px + (0.5 * (low + high))[:, None] * outward
    read = truth.stated.triangulate(uv)
    error = np.hypot(read[:, 0], read[:, 1]) - float(truth.wall.radius_mm[0].astype(float).mean())
    point = _height(truth, instrument, time_s, uv)[1]
    return TracedRing(uv, point, np.arctan2(read[:, 1], read[:, 0]), error)


def _height(truth: SceneTruth, instrument: TrueInstrument, time_s: float, uv: Float) -> tuple[Float, Float]:
    """Return the height above the sheet of the wall seen by pixels (N, 2), and its points (N, 3) in C."""
    origin, ray = viewing_rays(instrument.camera, uv)
    T_pc = truth.motion.pose(time_s + row_late_s(instrument, uv[:, 1]), truth.wall.axis)
    R_pc = T_pc[:, :3, :3]
    way = _to_wall(truth, transform(T_pc, origin), np.einsum("nij,nj->ni", R_pc, ray))
    point = origin + way[:, None] * ray
    table = sheet_table((instrument.laser,))
    nodes = -np.pi + 2 * np.pi * np.arange(table.height.shape[1]) / table.height.shape[1]
    psi, q = np.arctan2(point[:, 1], point[:, 0]), np.hypot(point[:, 0], point[:, 1])
    base, slope = (np.interp(psi, nodes, part[0], period=2 * np.pi) for part in (table.height, table.slope))
    return point[:, 2] - base - q * slope, point


def _to_wall(truth: SceneTruth, origin_p: Float, ray_p: Float) -> Float:
    """Return the distance (N,) along rays in P to the wall, whose radius depends on the azimuth alone."""
    nodes, radii = truth.wall.shape.azimuth_rad, truth.wall.radius_mm[0].astype(float)
    o, d = origin_p[:, :2], ray_p[:, :2]
    a, b, c = np.sum(d * d, 1), np.sum(o * d, 1), np.sum(o * o, 1)
    radius = np.full(len(o), radii.mean())
    for _ in range(_WALL_STEPS):
        way = (np.sqrt(b * b + a * (radius**2 - c)) - b) / a
        x, y = (o + way[:, None] * d).T
        radius = np.interp(np.arctan2(y, x), nodes, radii, period=2 * np.pi)
    return np.asarray(way)
