"""Parts of a trajectory: events of the motion, pieces of the pipe, and a knock of the laser.

Lengths are in mm, angles in rad, times in s; frames C (camera) and P (pipe) as in `measured`.
"""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.arrays import Float
from pipeline.geometry.axis import PipeAxis


@dataclass(frozen=True)
class MotionEvent:
    """An event of the motion: slip, stop, reversal, dropped or duplicated frame, lost track."""

    kind: str
    frame_from: int
    frame_to: int
    size: float
    unit: str
    note: str


@dataclass(frozen=True)
class Displaced:
    """A stretch of a run in which the walls in texture and in the rings differ smoothly from place to place.

    Attributes
    ----------
    frame_from, frame_to : int
        Frames in which the laser passes it.
    size_mm : float
        1 σ by which they differ over places of some millimetres; 0 if they agree within their error, or could
        not be compared.
    certain : bool
        Whether chance is excluded as the cause.
    """

    frame_from: int
    frame_to: int
    size_mm: float
    certain: bool


@dataclass(frozen=True)
class Rival:
    """The motion if some stated parameters of the probe are wrong, and as the pictures demand them.

    Attributes
    ----------
    T_pc : (N, 4, 4)
    axis : PipeAxis
    instrument : (P,)
        The probe's parameters.
    """

    T_pc: Float
    axis: PipeAxis
    instrument: Float


@dataclass(frozen=True)
class PipePiece:
    """A straight length or a bend of the pipe, found in its axis.

    Attributes
    ----------
    kind : str
        ``straight``, ``bend``, or ``undecided`` where the way is too short to tell them apart.
    from_mm, to_mm : float
        Distances along the axis.
    sigma_mm : float
        1 σ of each of these limits; for the ends of the run, of the distance between them.
    angle_rad, angle_sigma_rad : float
        Angle by which the piece turns the pipe; 0 for a straight length, NaN where undecided.
    toward_rad : float
        Azimuth in P toward which a bend turns; NaN for a straight length.
    radius_mm, radius_sigma_mm : float
        Radius of the bend's axis; NaN for a straight length.
    standard : str
        Name of the one standard radius that fits, such as ``1.5 D``; empty if none or several fit.
    """

    kind: str
    from_mm: float
    to_mm: float
    sigma_mm: float
    angle_rad: float = 0.0
    angle_sigma_rad: float = 0.0
    toward_rad: float = float("nan")
    radius_mm: float = float("nan")
    radius_sigma_mm: float = float("nan")
    standard: str = ""


@dataclass(frozen=True)
class LaserKnock:
    """A permanent displacement of the laser relative to the camera between two rings.

    Attributes
    ----------
    frame : int
        First frame after it.
    change : (3,)
        Change of the sheet's baseline, mm, and of its slopes along x and y of C.
    covariance : (3, 3)
    """

    frame: int
    change: Float
    covariance: Float
