"""Results that stages pass to each other: frozen dataclasses of arrays.

Conventions: lengths mm, angles rad, times s, pixels with integer centres. Frames: C camera (x right, y down,
z forward), P pipe (z along the pipe). ``T_pc`` maps C to P. NaN means not measured.
A field may be an array, a number, a string, a tuple of such, a nested artefact, or None:
`pipeline.machine.store` writes and reads any of these without further code.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np

from pipeline.adjustment.shared_light import NOTHING_HELD, HeldOver
from pipeline.arrays import Bool, Byte, Float, Float32, Int
from pipeline.artefacts.motion import Displaced, LaserKnock, MotionEvent, PipePiece, Rival
from pipeline.artefacts.wall_map import FixedToProbe, WallMap
from pipeline.geometry.axis import PipeAxis


class RingValidity(IntEnum):
    """Why a ring sample is or is not used."""

    VALID = 0
    NO_LINE = 1
    LOW_CONTRAST = 2
    SATURATED = 3
    GLINT = 4
    GHOST = 5
    OUTLIER = 6
    OUT_OF_VIEW = 7
    WIDTH = 8
    FRAME_REJECTED = 9


NOT_THE_LINE = (RingValidity.GLINT, RingValidity.GHOST, RingValidity.OUTLIER, RingValidity.WIDTH)
"""Reasons that say that light was found which is not the line: a glint, its rim, a second line, a splash."""


@dataclass(frozen=True)
class RingSamples:
    """Laser line positions in every laser frame, in polar coordinates about ``centre_px``.

    Attributes
    ----------
    frame : (F,) int
        Frame numbers of all frames in which the laser was on, used or not.
    azimuth_rad : (A,)
        Image azimuth atan2(v - centre_v, u - centre_u), uniform, first −π.
    centre_px : (2,)
        Origin (u, v) of the polar coordinates.
    radius_px, sigma_px, width_px, amplitude : (F, A) float32
        Line position along the azimuth; its 1 σ (noise, texture and speckle, a wrong choice among lines,
        ``moved_px`` and ``shared_px``); line width (1 σ of the profile); and height above the background in
        grey levels. NaN where no line was found.
    validity : (F, A) uint8
        `RingValidity`; a saturated but usable sample stays VALID with a larger ``sigma_px``.
    moved_px : (F, A) float32 or None
        Distance by which samples were moved inward because dirt on the window displaces the line there
        equally in all rings, 0 elsewhere; None if nothing was moved. Only a probe that rolls distinguishes
        this from a groove.
    shared_px : (A,) float32 or None
        1 σ, px, of an error that rings share at an azimuth, also part of ``sigma_px``; None without any. All
        rings are taken to share it, although those elsewhere in the picture share it only in part.
    """

    frame: Int
    azimuth_rad: Float
    centre_px: Float
    radius_px: Float32
    sigma_px: Float32
    width_px: Float32
    amplitude: Float32
    validity: Byte
    moved_px: Float32 | None = None
    shared_px: Float32 | None = None

    @property
    def valid(self) -> Bool:
        """(F, A) true where the sample may be used."""
        return np.asarray(self.validity == RingValidity.VALID)

    def pixels(self) -> Float:
        """Return (F, A, 2) pixel coordinates (u, v) of the samples."""
        return self.pixels_of(slice(None))

    def pixels_of(self, ring: int | slice) -> Float:
        """Return (A, 2) pixel coordinates (u, v) of one ring's samples, or those of several (n, A, 2)."""
        direction = np.stack([np.cos(self.azimuth_rad), np.sin(self.azimuth_rad)], -1)
        return np.asarray(self.centre_px + self.radius_px[ring][..., None].astype(np.float64) * direction)

    def some(self, rows: slice) -> RingSamples:
        """Return some of the rings: those of a slice of the F frames."""
        per_frame = ("frame", "radius_px", "sigma_px", "width_px", "amplitude", "validity")
        moved_px = None if self.moved_px is None else self.moved_px[rows]
        return replace(self, moved_px=moved_px, **{name: getattr(self, name)[rows] for name in per_frame})

    def reduced(self, times: Float) -> RingSamples:
        """Return the rings with each picture's radii divided by its relative size ``times`` (F,)."""
        return replace(self, radius_px=(self.radius_px / times[:, None]).astype(np.float32))

    def placed_in(self, points: RingPoints) -> RingSamples:
        """Return the rings without the samples that have no point on the wall."""
        lost = self.valid & np.isnan(points.xyz_c[..., 0])
        return replace(self, validity=np.where(lost, np.uint8(RingValidity.OUTLIER), self.validity))


@dataclass(frozen=True)
class RingPoints:
    """Triangulated ring samples in C; rows and columns are those of `RingSamples`.

    Attributes
    ----------
    frame : (F,) int
    azimuth_rad : (A,)
    xyz_c : (F, A, 3) float32
        Intersection of the ray with the calibrated laser sheet; NaN where invalid.
    noise_direction : (F, A, 3) float32
        Change of ``xyz_c`` for +1 σ of image noise along the line's normal: the noise covariance is its
        outer product with itself (rank one).
    """

    frame: Int
    azimuth_rad: Float
    xyz_c: Float32
    noise_direction: Float32


@dataclass(frozen=True)
class Trajectory:
    """Pose of the camera in P at every frame, the pipe's axis, and other results of the stage motion.

    Attributes
    ----------
    frame : (N,) int
        All frames of the recording that have a pose.
    time_s : (N,)
    T_pc : (N, 4, 4)
        Transform from camera to pipe.
    covariance : (N, 6, 6)
        Covariance of (translation in P, mm; rotation vector in C, rad), relative to frame 0, with
        T = [R exp(w), t + d].
    axis : PipeAxis
    radius_mm : float
        Mean radius of the pipe as used in the estimate.
    encoder_scale : float
        Estimated true distance over encoder distance; NaN without encoder.
    encoder_scale_sigma : float
    scale_sigma : float
        Relative 1 σ of the distance scale from calibration (it does not average out).
    events : tuple of MotionEvent
    instrument : (P,) or None
        The probe's parameters as estimated in this run (stated values, moved within their uncertainty);
        None if they are as stated. `Probe.as_found_in` applies them.
    instrument_covariance : (P, P) or None
        Their covariance.
    distance_sigma_mm : float
        1 σ of the distance along the axis from the first frame to the last, calibration included; NaN if
        it was not computed.
    pieces : tuple of PipePiece
        Straight lengths and bends in the order of distance; empty if they were not searched.
    image_scale, image_scale_sigma : (N,) or None
        Size of the pictures over that of the probe's camera, and its 1 σ; None if the scale did not drift.
    radius_doubt : float
        Relative 1 σ of all radii if encoder and stated diameter contradict the probe, else 0.
    knock : LaserKnock or None
        A knock of the laser in the run; ``instrument`` is the probe before it.
    cut_sigma_mm : float
        Part of ``distance_sigma_mm`` from the unknown distance travelled at cuts of the recording; 0 without
        cuts.
    rivals : tuple of Rival
        The motion with each of the probes that the pictures allow; empty if they allow the stated one.
    displaced : tuple of Displaced
        Stretches of the run, in their order, with what walls in texture and in the rings differ by.
    """

    frame: Int
    time_s: Float
    T_pc: Float
    covariance: Float
    axis: PipeAxis
    radius_mm: float
    encoder_scale: float
    encoder_scale_sigma: float
    scale_sigma: float
    events: tuple[MotionEvent, ...]
    instrument: Float | None = None
    instrument_covariance: Float | None = None
    distance_sigma_mm: float = float("nan")
    pieces: tuple[PipePiece, ...] = ()
    image_scale: Float | None = None
    image_scale_sigma: Float | None = None
    radius_doubt: float = 0.0
    knock: LaserKnock | None = None
    cut_sigma_mm: float = 0.0
    rivals: tuple[Rival, ...] = ()
    displaced: tuple[Displaced, ...] = ()

    def of_rival(self, rival: Rival) -> Trajectory:
        """Return the trajectory with another probe."""
        return replace(self, T_pc=rival.T_pc, axis=rival.axis, instrument=rival.instrument, rivals=())

    def displaced_mm(self, frame: Int) -> Float:
        """Return the size (F,), mm, of what displaces the picture from place to place in frames (F,)."""
        if not self.displaced:
            return np.zeros(len(frame))
        first = [d.frame_from for d in self.displaced[1:]]
        return np.array([d.size_mm for d in self.displaced])[np.searchsorted(first, frame, side="right")]


@dataclass(frozen=True)
class RadiusMap(WallMap):
    """A run's own map of the wall, around the pipe's axis; float32.

    Attributes
    ----------
    count : (S, A) int64
        Number of ring samples that contributed.
    misalignment_mm : (S, A) float32
        Radius without laser misalignment correction minus ``radius_mm``.
    kernel_mm : (S,) or None
        1 σ of the kernel along the pipe by which rings were smoothed; None where they were not.
    """

    count: Int
    misalignment_mm: Float32
    kernel_mm: Float | None = field(default=None, kw_only=True)

    def kernel_in(self, rows: slice = slice(None)) -> Float:
        """Return the kernel's 1 σ (n,), mm, in some rows; 0 where rings were not smoothed."""
        of_rows = self.distance_mm[rows]
        return np.zeros(len(of_rows)) if self.kernel_mm is None else np.asarray(self.kernel_mm[rows])


@dataclass(frozen=True)
class PointCloud:
    """Accumulated wall points in P.

    Attributes
    ----------
    xyz_p, normal_p : (M, 3) float32
    sigma_mm, radius_mm, distance_mm, azimuth_rad : (M,) float32
    frame : (M,) int
    """

    xyz_p: Float32
    normal_p: Float32
    sigma_mm: Float32
    radius_mm: Float32
    distance_mm: Float32
    azimuth_rad: Float32
    frame: Int


@dataclass(frozen=True)
class Wall:
    """Result of accumulation: cloud, radius map, and the axis to which both refer.

    ``fixed`` are departures that stay at one place of the image, None without any; ``held`` is the light that
    a codec carried over from ring to ring.
    """

    cloud: PointCloud
    radius_map: RadiusMap
    axis: PipeAxis
    fixed: FixedToProbe | None = None
    held: HeldOver = NOTHING_HELD


@dataclass(frozen=True)
class WallTexture:
    """The wall's photo as a flat picture.

    Attributes
    ----------
    bgra : (H, W, 4) uint8
        Grey levels in B, G, R as the camera records them at the laser ring; alpha 0 where the wall has no
        texture.
    distance_from_mm, mm_per_px : float
        Row i's centre is at ``distance_from_mm + i * mm_per_px``.
    azimuth_from_rad, rad_per_px : float
        Column j's centre is at ``azimuth_from_rad + j * rad_per_px``.
    """

    bgra: Byte
    distance_from_mm: float
    mm_per_px: float
    azimuth_from_rad: float
    rad_per_px: float
