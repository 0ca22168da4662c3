"""A small motion problem without pictures: a bent, oval pipe with landmarks, rings and an encoder."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float
from pipeline.geometry.axis import from_pipe
from pipeline.geometry.rigid import from_parts, inverse, rotation_from_vector, transform
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from stages.motion.bundle_adjustment.equations import MATCH_BIASES, Measurements
from stages.motion.bundle_adjustment.unknowns import GLOBALS, State, straight_start
from stages.motion.encoder import EncoderReadings
from stages.motion.rings import RingBins
from stages.motion.tracking.landmarks import TrackedPoses, Tracks

RADIUS = 50.0
ENCODER_SIGMA_MM = 0.05
SHAKE = np.array([0.1, 0.1, 0, 2e-3, 2e-3, 0])
"""1 σ of random motion from frame to frame, mm and rad."""
_SIGMA_PX = 0.1
_RING_MM_PER_PX = 1.5  # dr = b (1 + r² / b²) dθ, 90 px per radian, b = 22 mm
RING_PX = 103.0


@dataclass(frozen=True)
class Scene:
    """The true state and what was measured of it."""

    truth: State
    measured: Measurements


def probe(uncertain: bool = True) -> Probe:
    camera = KannalaBrandt((400, 300), (90.0, 90.0), (199.0, 148.0), (-0.011, 0.001, 0.0, 0.0))
    sigma = np.zeros(20)
    if uncertain:
        sigma[[0, 2, 3]], sigma[[8, 9, 10]] = 0.02, (0.008, 1e-4, 1e-4)
    return Probe(camera, LaserSheet(22.0, tilt_x=0.004), np.diag(sigma**2))


def scene(
    frames: int = 12,
    landmarks: int = 30,
    *,
    noise: float = 0.0,
    encoder: bool = True,
    seed: int = 0,
    shake: float = 0.0,
    swing_mm: float = 0.0,
    widens: float = 0.0,
    picture_grows: float = 0.0,
    joint_mm: tuple[float, float] = (0.0, 0.0),
    bins: int = 24,
    pairs_mm: float = 0.0,
) -> Scene:
    """Return a scene; ``noise`` is in units of the stated σ, ``shake`` in those of `SHAKE`.

    The distance swings by ``swing_mm`` about that of a constant speed. The pipe's radius grows by ``widens``
    times the distance, and pictures are larger at the end than at the beginning by the share
    ``picture_grows``. From a joint on (`joint_at`) the pipe is wider and lies farther along x by
    ``joint_mm``.
    Rings are condensed to so many ``bins``. Every odd frame lies nearer to the one before, by ``pairs_mm``.
    """
    random = np.random.default_rng(seed)
    instrument = probe()
    unsure = instrument.principal_uncertainties()
    k = np.arange(frames)
    turn = np.stack([0.02 * np.sin(0.3 * k), 0.015 * np.cos(0.4 * k) - 0.015, 0.01 * k], -1)
    t = np.stack(
        [1.0 * np.sin(0.2 * k), 0.8 * np.cos(0.25 * k) - 0.8, 1.2 * k + swing_mm * np.sin(k / 9)], -1
    )
    t[1::2, 2] -= pairs_mm / 2
    move = shake * SHAKE * np.random.default_rng(seed + 1000).standard_normal((frames, 6))
    turn, t = turn + move[:, 3:], t + move[:, :3]
    T_pc = from_parts(rotation_from_vector(turn), t)
    start = straight_start(
        T_pc, np.zeros((landmarks, 3)), -20.0, 1.2 * frames + 60, RADIUS, 30.0, unsure.shape[1] + MATCH_BIASES
    )
    state = _bent(replace(start, globals=np.array([RADIUS, 0.2, -0.1, 1.0])))
    wall = Wall(state, widens, joint_at(frames), joint_mm)
    truth = replace(state, xyz_p=_on_wall(wall, random, landmarks))
    tracks = _tracks(truth, instrument, noise, random)
    rings = _rings(wall, noise, random, unsure.shape[1], bins)
    larger = picture_grows * (k / (frames - 1) - 0.5)
    tracks = tracks.reduced(1 - larger, instrument.camera.centre_px)
    grown = RING_PX * larger[rings.frame, None] * rings.by_pixel
    rings = replace(rings, xyz_c=rings.xyz_c + grown)
    distance = t[:, 2] - t[0, 2] + noise * ENCODER_SIGMA_MM * random.standard_normal(frames)
    readings = EncoderReadings(distance, ENCODER_SIGMA_MM, np.ones(len(distance), bool)) if encoder else None
    sigma = np.array([0.05] * 3 + [1e-3] * 3)
    return Scene(truth, Measurements(tracks, rings, k / 30, readings, instrument, unsure, sigma))


def displaced(state: State, random: np.random.Generator, size: float = 1.0) -> State:
    """Return the state with random errors of about ``size`` times those of a first guess."""
    n, b = len(state.T_pc), state.border_size
    step = size * random.standard_normal((n, 7)) * np.array([0.05] * 3 + [0.003] * 3 + [0.01])
    step[0, :6] = 0
    border = size * random.standard_normal(b) * 0.05
    border[3] *= 0.01
    return state.step(step, border, size * 0.2 * random.standard_normal(state.xyz_p.shape))


def _bent(state: State) -> State:
    bend = np.linspace(0, 0.4, state.knots) ** 2
    border = np.zeros(state.border_size)
    border[GLOBALS : GLOBALS + 2 * state.knots] = np.concatenate([bend, -0.5 * bend])
    return state.step(np.zeros((len(state.T_pc), 7)), border, np.zeros_like(state.xyz_p))


@dataclass(frozen=True)
class Wall:
    """A pipe that may widen, and may have a joint at ``joint_at_mm``."""

    state: State
    widens: float
    joint_at_mm: float
    joint_mm: tuple[float, float]

    def at(self, s: Float, psi: Float) -> Float:
        """Return points (M, 3) of the wall at distances and azimuths (M,)."""
        r, a, b, _ = self.state.globals
        behind = s > self.joint_at_mm
        radius = r + self.widens * s + self.joint_mm[0] * behind
        xyz = from_pipe(self.state.axis, s, psi, radius + a * np.cos(2 * psi) + b * np.sin(2 * psi))
        return np.asarray(xyz + (self.joint_mm[1] * behind)[:, None] * [1.0, 0.0, 0.0])


def joint_at(frames: int) -> float:
    """Return the distance of the joint in a scene of so many frames: that of the middle frame's ring."""
    return 1.2 * (frames // 2 - 0.5) + 22.0


def _on_wall(wall: Wall, random: np.random.Generator, count: int) -> Float:
    s = random.uniform(12, 1.2 * len(wall.state.T_pc) + 30, count)
    return wall.at(s, random.uniform(-np.pi, np.pi, count))


def _tracks(state: State, instrument: Probe, noise: float, random: np.random.Generator) -> Tracks:
    frame, landmark = np.meshgrid(np.arange(len(state.T_pc)), np.arange(len(state.xyz_p)))
    frame, landmark = frame.ravel(), landmark.ravel()
    xyz_c = transform(inverse(state.T_pc[frame]), state.xyz_p[landmark])
    theta = np.arctan2(np.hypot(xyz_c[:, 0], xyz_c[:, 1]), xyz_c[:, 2])
    keep = (theta > 0.6) & (theta < 1.4)
    keep &= np.bincount(landmark, keep)[landmark] >= 3
    uv = instrument.camera.project(xyz_c[keep]).uv
    uv = uv + noise * _SIGMA_PX * random.standard_normal(uv.shape)
    index = np.unique(landmark[keep], return_inverse=True)
    if len(index[0]) != len(state.xyz_p):
        raise ValueError("a landmark is seen too seldom: choose another seed")
    n = len(state.T_pc)
    return Tracks(
        landmark[keep], frame[keep], uv, np.full(len(uv), _SIGMA_PX), state.xyz_p,
        TrackedPoses(np.arange(n), state.T_pc, np.zeros(n, bool)),
    )  # fmt: skip


def _rings(wall: Wall, noise: float, random: np.random.Generator, unsure: int, bins: int) -> RingBins:
    psi = np.linspace(-np.pi, np.pi, bins, endpoint=False)
    points, poses = [], wall.state.T_pc
    for T in poses:
        s = np.full(bins, T[2, 3] + 22.0)
        for _ in range(6):
            s = s - (transform(inverse(T), wall.at(s, psi))[:, 2] - 22.0)
        points.append(transform(inverse(T), wall.at(s, psi)))
    xyz_c = np.concatenate(points)
    outward = xyz_c * [1, 1, 0] / np.linalg.norm(xyz_c[:, :2], axis=1)[:, None]
    xyz_c = xyz_c + noise * 0.05 * random.standard_normal(len(xyz_c))[:, None] * outward
    by_instrument = random.standard_normal((len(xyz_c), 3, unsure)) * 0.01
    frame = np.repeat(np.arange(len(poses)), bins)
    by_pixel = _RING_MM_PER_PX * outward
    return RingBins(frame, xyz_c, by_instrument, by_pixel, 0 * by_instrument, np.full(len(xyz_c), 0.05))
