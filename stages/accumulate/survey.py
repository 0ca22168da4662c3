"""Ring samples in pipe coordinates, and a first pass that removes each ring's shift."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from pipeline.adjustment.robust import robust_spreads
from pipeline.arrays import Bool, Float, Int
from pipeline.artefacts.measured import RingPoints, RingSamples, RingValidity, Trajectory
from pipeline.artefacts.motion import LaserKnock
from pipeline.geometry.axis import frames_at, to_pipe
from pipeline.instrument.probe import Probe
from pipeline.system.parallel import in_threads

# Number of reweightings: 24 change no radius of open-1 and open-3 by 0.1 µm, 6 by 2 µm at most.
_ITERATIONS = 12
# Robust spreads at which a sample's weight falls to a quarter. Half and twice as many change radii of open-1
# and open-3 by 7 µm at most, by an eighth of their random σ in r.m.s.
_REDESCENT = 2.5
# Share of the circle that must be seen for a first harmonic to be distinguished from shape.
_FEWEST = 0.5
# Rings of the running median. Debt: data/debts.md.
_RINGS = 31
# Rings of the mean after it: 3 and 15 change no radius of open-1 and open-3 by more than 3 µm.
_SMOOTH_RINGS = 7
# Rings processed at a time, to limit memory.
_AT_ONCE = 512
# Of these, rings that one thread processes, and threads.
_SIDE_BY_SIDE, _THREADS = 32, 2
# Sectors of the image in which a ring's departure from its smooth shape is kept: a degree each.
_SECTORS = 360


@dataclass(frozen=True)
class WallSamples:
    """Every ring sample on the wall; rows are laser frames, columns image azimuths.

    Attributes
    ----------
    frame : (F,) int
    valid : (F, A) bool
    xyz_p : (F, A, 3)
    distance_mm, azimuth_rad, radius_mm : (F, A)
        Pipe coordinates.
    sigma_mm : (F, A)
        1 σ of the radius from image noise.
    misalignment_mm : (F, A)
        Radius computed as if the sheet were perpendicular to the camera's axis, minus ``radius_mm``.
    section : (F, A, 3, 3)
        The pipe's section frame at each sample.
    """

    frame: Int
    valid: Bool
    xyz_p: Float
    distance_mm: Float
    azimuth_rad: Float
    radius_mm: Float
    sigma_mm: Float
    misalignment_mm: Float
    section: Float


@dataclass
class RingsOnWall:
    """All rings of a run; samples are computed for some of them at a time."""

    probe: Probe
    rings: RingSamples
    points: RingPoints
    trajectory: Trajectory
    _last: tuple[Int, WallSamples] | None = None

    def samples(self, rows: Int) -> WallSamples:
        """Return the samples of some rings (n,); the last ones returned are cached."""
        if self._last is None or not np.array_equal(self._last[0], rows):
            self._last = None
            parts = np.array_split(rows, max(len(rows) // _SIDE_BY_SIDE, 1))
            self._last = rows, _joined(list(in_threads(self._some, parts, _THREADS)))
        return self._last[1]

    def _some(self, rows: Int) -> WallSamples:
        return wall_samples(self.probe, self.rings, self.points, self.trajectory, rows)


def _joined(parts: Sequence[WallSamples]) -> WallSamples:
    """Return samples of rings that follow each other."""
    return WallSamples(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(WallSamples)))


def in_steady_pictures(rings: RingSamples, trajectory: Trajectory) -> RingSamples:
    """Return the rings corrected to pictures of one scale, if the motion shows that the scale drifted."""
    if trajectory.image_scale is None:
        return rings
    last = len(trajectory.frame) - 1
    return rings.reduced(
        trajectory.image_scale[np.minimum(np.searchsorted(trajectory.frame, rings.frame), last)]
    )


def wall_samples(
    probe: Probe, rings: RingSamples, points: RingPoints, trajectory: Trajectory, rows: Int
) -> WallSamples:
    """Triangulate rings ``rows`` (n,) with the run's corrected probe, and transform the points to P."""
    frame, last = rings.frame[rows], len(trajectory.frame) - 1
    index = np.minimum(np.searchsorted(trajectory.frame, frame), last)
    T_pc = trajectory.T_pc[index]
    direction = np.stack([np.cos(rings.azimuth_rad), np.sin(rings.azimuth_rad)], -1)
    pixels = rings.centre_px + rings.radius_px[rows][..., None].astype(np.float64) * direction
    ray = probe.camera.unproject(pixels).ray
    xyz_p = _placed(T_pc, _on_sheet(probe, trajectory.knock, frame, ray))
    s, psi, radius = to_pipe(trajectory.axis, xyz_p)
    uncorrected = to_pipe(trajectory.axis, _placed(T_pc, probe.laser.untilted().intersect(ray)))[2]
    section = frames_at(trajectory.axis, np.where(np.isfinite(s), s, 0.0))[1]
    outward = section[..., :, 0] * np.cos(psi)[..., None] + section[..., :, 1] * np.sin(psi)[..., None]
    noise_p = np.einsum("fij,faj->fai", T_pc[:, :3, :3], points.noise_direction[rows].astype(float))
    sigma = np.abs(np.sum(outward * noise_p, -1))
    known = trajectory.frame[index] == frame
    seen = rings.validity[rows] == RingValidity.VALID
    valid = seen & known[:, None] & np.isfinite(radius) & np.isfinite(sigma)
    return WallSamples(frame, valid, xyz_p, s, psi, radius, sigma, uncorrected - radius, section)


def _on_sheet(probe: Probe, knock: LaserKnock | None, frame: Int, ray: Float) -> Float:
    """Return the points at which rays (F, A, 3) of frames (F,) meet the laser sheet, perhaps knocked."""
    xyz_c = probe.laser.intersect(ray)
    if knock is not None:
        after = frame >= knock.frame
        xyz_c[after] = probe.after(knock).laser.intersect(ray[after])
    return xyz_c


def _placed(T_pc: Float, xyz_c: Float) -> Float:
    """Return ring points (F, A, 3) of C in P."""
    return np.asarray(np.einsum("fij,faj->fai", T_pc[:, :3, :3], xyz_c) + T_pc[:, None, :3, 3])


def centred(samples: WallSamples, shift: Float) -> WallSamples:
    """Return the samples with each ring moved back across the pipe by its shift (F, 2), mm."""
    psi = np.where(samples.valid, samples.azimuth_rad, 0.0)
    outward = np.stack([np.cos(psi), np.sin(psi)], -1)
    along = np.einsum("fai,fi->fa", outward, shift)
    move = np.einsum("faij,fj->fai", samples.section[..., :2], shift)
    return replace(samples, radius_mm=samples.radius_mm - along, xyz_p=samples.xyz_p - move)


def smoothed_shift(shift: Float) -> Float:
    """Return the smoothed running median of shifts (F, 2), so that a ring across a weld keeps its shape."""
    middle = median_filter(shift, size=(min(_RINGS, len(shift)), 1), mode="nearest")
    return np.asarray(uniform_filter1d(middle, _SMOOTH_RINGS, axis=0, mode="nearest"))


def smooth_shape(samples: WallSamples) -> tuple[Float, Float]:
    """Return the first harmonic (F, 2), mm, of every ring's sound wall, and the departures from its shape.

    The harmonic is 0 where it is not determined. The departure (F, A), mm, of each sample is its distance
    from mean, first and second harmonic; NaN where it is unknown.

    The radius is measured from the pipe's own axis, so that a first harmonic of a whole ring is not shape but
    a pose error. It is fitted with Geman-McClure weights together with mean and ovality, so that a dent or a
    deposit does not shift the ring (S. Geman, D. McClure, 1987). It is 0 for rings seen over less than half
    of the circle.
    """
    psi = np.where(samples.valid, samples.azimuth_rad, 0.0)
    radius = np.where(samples.valid, samples.radius_mm, 0.0)
    design = np.stack([np.cos(psi), np.sin(psi), np.ones_like(psi), np.cos(2 * psi), np.sin(2 * psi)], -1)
    usable = samples.valid.mean(1) > _FEWEST
    weight = samples.valid.astype(float)
    ridge = 1e-6 * np.eye(design.shape[-1])  # keeps the solution finite for a ring with gaps
    shape = np.zeros((len(psi), design.shape[-1]))
    for _ in range(_ITERATIONS):
        weighted = design * weight[..., None]
        normal = np.swapaxes(weighted, 1, 2) @ design
        right = np.einsum("fai,fa->fi", weighted, radius)
        shape[usable] = np.linalg.solve(normal[usable] + ridge, right[usable][..., None])[..., 0]
        error = radius - np.einsum("fai,fi->fa", design, shape)
        spread = robust_spreads(np.where(samples.valid, error, np.nan)[usable], axis=1)
        scale = np.full(len(psi), np.inf)
        scale[usable] = _REDESCENT * np.maximum(spread, 1e-6)
        weight = samples.valid / (1 + (error / scale[:, None]) ** 2) ** 2
    error = radius - np.einsum("fai,fi->fa", design, shape)
    known = samples.valid & usable[:, None]
    return np.where(usable[:, None], shape[:, :2], 0.0), np.where(known, error, np.nan)


def _in_sectors(values: Float) -> Float:
    """Return the means (F, K) of the known values (F, A) in each sector of the image; NaN without any."""
    azimuths = values.shape[1]
    starts = np.unique(np.arange(_SECTORS) * azimuths // _SECTORS)
    known = np.isfinite(values)
    count = np.add.reduceat(known, starts, axis=1, dtype=np.int64)
    total = np.add.reduceat(np.where(known, values, 0.0), starts, axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


@dataclass(frozen=True)
class RingSurvey:
    """Properties of each ring (F,), without its samples.

    Attributes
    ----------
    shift_mm : (F, 2)
        Its offset from the axis, which is to be removed.
    nearest_mm, middle_mm, farthest_mm : (F,)
        Least, median and largest distance of its samples; NaN where it has none.
    seen : (F,)
        Share of the circle that it shows.
    count : (F,) int
        Number of its valid samples.
    roll_rad : (F,)
        Azimuth in P minus azimuth in the image.
    departure_mm : (F, K)
        Departure from its mean, first and second harmonic in sectors of the image; NaN where unknown.
    """

    shift_mm: Float
    nearest_mm: Float
    middle_mm: Float
    farthest_mm: Float
    seen: Float
    count: Int
    roll_rad: Float
    departure_mm: Float

    def near(self, first_mm: float, last_mm: float) -> Int:
        """Return the rings (n,), in the order of frames, that reach between two distances."""
        known = self.count > 0
        return np.flatnonzero(known & (self.farthest_mm >= first_mm) & (self.nearest_mm <= last_mm))


def survey_of(rings: RingsOnWall) -> RingSurvey:
    """Return the properties of all rings, computed some rings at a time."""
    every, azimuths = np.arange(len(rings.rings.frame)), len(rings.rings.azimuth_rad)
    image_rad = rings.rings.azimuth_rad
    parts = [_of(rings.samples(rows), image_rad) for rows in some_at_a_time(every)]
    harmonic, nearest, middle, farthest, count, *image = (np.concatenate(p) for p in zip(*parts, strict=True))
    share = count / azimuths
    return RingSurvey(
        smoothed_shift(harmonic), nearest, middle, farthest, share, count.astype(np.int64), *image
    )


def some_at_a_time(rows: Int) -> Iterator[Int]:
    """Yield rows in batches, to bound the memory."""
    for start in range(0, len(rows), _AT_ONCE):
        yield rows[start : start + _AT_ONCE]


def _of(samples: WallSamples, image_rad: Float) -> tuple[Float, ...]:
    harmonic, departure = smooth_shape(samples)
    turn = np.exp(1j * (np.where(samples.valid, samples.azimuth_rad, 0.0) - image_rad))
    roll = np.angle(np.where(samples.valid, turn, 0.0).sum(1))
    # Sorted once, with invalid samples last: faster than three functions that skip NaN.
    distance = np.sort(np.where(samples.valid, samples.distance_mm, np.nan), axis=1)
    ring, last = np.arange(len(distance)), np.maximum(np.isfinite(distance).sum(1), 1) - 1
    middle = (distance[ring, last // 2] + distance[ring, (last + 1) // 2]) / 2
    count = samples.valid.sum(1).astype(float)
    return harmonic, distance[:, 0], middle, distance[ring, last], count, roll, _in_sectors(departure)


def nearest(distance: Float, wanted: Float) -> Int:
    """Return for each wanted distance the index of the nearest of the distances, in any order."""
    order = np.argsort(distance, kind="stable")
    middle = (distance[order][1:] + distance[order][:-1]) / 2
    return np.asarray(order[np.searchsorted(middle, wanted)])
