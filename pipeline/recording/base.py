"""The result of every reader: a `Recording`, whose frames are selected by number."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Bool, Float, Image, Int
from pipeline.files.disk import InputFile
from pipeline.system.parallel import in_threads

Planes = Literal["grey", "bgr"]
Item = TypeVar("Item")
Made = TypeVar("Made")
_THREADS = 2


def ascending(frames: Sequence[int] | Int) -> Int:
    """Return frame numbers as an array; raises ValueError unless they ascend from 0 or more."""
    wanted = np.asarray(frames, np.int64)
    if wanted.size and (np.any(np.diff(wanted) <= 0) or wanted[0] < 0):
        raise ValueError("frame numbers must ascend and not be negative")
    return wanted


def complete(wanted: Int, found: Iterator[tuple[int, Item]]) -> Iterator[tuple[int, Item | None]]:
    """Yield every wanted frame in order, None for those that are missing in ``found`` (ascending, too)."""
    pending = iter(wanted.tolist())
    due = next(pending, None)
    for number, item in found:
        while due is not None and due < number:
            yield due, None
            due = next(pending, None)
        if number == due:
            yield number, item
            due = next(pending, None)
        if due is None:
            return
    while due is not None:
        yield due, None
        due = next(pending, None)


def decoded_ahead(
    items: Iterator[tuple[int, Item]], decode: Callable[[Item], Made]
) -> Iterator[tuple[int, Made]]:
    """Yield (number, decoded item) in order, decoding a few ahead on other threads."""
    return in_threads(lambda item: (item[0], decode(item[1])), items, _THREADS)


Pairs = Iterator[tuple[int, Item]]
Coming = Future[tuple[int, Item] | None]


def in_background(items: Pairs[Item], ahead: int) -> Pairs[Item]:
    """Return ``items`` in order; one thread makes up to ``ahead`` of them in advance.

    It starts at once. An exception while making an item is raised in the item's place.
    """
    pool = ThreadPoolExecutor(1)
    return _as_made(items, pool, deque(pool.submit(next, items, None) for _ in range(ahead)))


def _as_made(items: Pairs[Item], pool: ThreadPoolExecutor, coming: deque[Coming[Item]]) -> Pairs[Item]:
    try:
        while (item := coming.popleft().result()) is not None:
            coming.append(pool.submit(next, items, None))
            yield item
    finally:
        pool.shutdown(cancel_futures=True)


class Illumination(StrEnum):
    """Illumination of the wall in a frame."""

    LASER = "laser"
    LED = "led"
    BOTH = "both"


@dataclass(frozen=True)
class FrameTable:
    """One row for each frame: number (N,), time in s (N,) and illumination (N,) of `Illumination` values."""

    frame: Int
    time_s: Float
    illumination: NDArray[np.str_]

    def of(self, *kinds: Illumination) -> Int:
        """Return the numbers of the frames lit in one of the ways named."""
        return np.asarray(self.frame[np.isin(self.illumination, [k.value for k in kinds])])


@dataclass(frozen=True)
class Encoder:
    """Cable payout ``distance_mm`` (M,) on its own clock ``time_s`` (M,)."""

    time_s: Float
    distance_mm: Float


@dataclass(frozen=True)
class Imu:
    """Readings of an inertial measurement unit on its own clock, in its own frame I.

    Attributes
    ----------
    time_s : (M,)
    rate_rad_s : (M, 3)
        Angular rate of I, by the gyroscope.
    force_m_s2 : (M, 3)
        Specific force, by the accelerometer: at rest it points up and is 9.81 m/s² long.
    """

    time_s: Float
    rate_rad_s: Float
    force_m_s2: Float


@dataclass(frozen=True)
class BoreSection:
    """A stretch of known bore in a gauge."""

    length_mm: float
    diameter_mm: float


@dataclass(frozen=True)
class Marker:
    """An ArUco marker's centre on the gauge wall."""

    id: int
    distance_mm: float
    azimuth_deg: float


@dataclass(frozen=True)
class Fiducials:
    """Markers of one dictionary and size on the gauge wall."""

    dictionary: str
    size_mm: float
    columns_along: str
    rows_along: str
    markers: tuple[Marker, ...]


@dataclass(frozen=True)
class PlannedPiece:
    """A planned straight length (``bend_deg`` 0) or bend of a pipe; NaN where not stated."""

    length_mm: float
    bend_deg: float = 0.0
    radius_mm: float = float("nan")


@dataclass(frozen=True)
class PipeFacts:
    """Stated facts of the pipe; for gauge runs also bores and fiducials."""

    nominal_diameter_mm: float
    wall_thickness_mm: float | None = None
    bore: tuple[BoreSection, ...] = ()
    bore_tolerance_mm: float = 0.0
    fiducials: Fiducials | None = None
    plan: tuple[PlannedPiece, ...] = ()


@dataclass(frozen=True)
class InspectionFacts:
    """Facts of an inspection that a report must state and that cannot be measured; empty if not stated.

    Attributes
    ----------
    client, site, asset, line : str
        Client, place, and pipe.
    operator, date : str
        Operator of the probe, and date (ISO 8601).
    procedure : str
        The written procedure that was followed.
    equipment, calibration : str
        Serial number of the probe, and its calibration certificate.
    """

    client: str = ""
    site: str = ""
    asset: str = ""
    line: str = ""
    operator: str = ""
    date: str = ""
    procedure: str = ""
    equipment: str = ""
    calibration: str = ""


class FrameSource(Protocol):
    """Delivers images on demand and in order."""

    def read(self, frames: Sequence[int] | Int, planes: Planes) -> Iterator[tuple[int, Image | None]]:
        """Yield (frame number, image) for ascending frame numbers; None where a frame cannot be decoded.

        ``grey`` gives (H, W) luma, ``bgr`` (H, W, 3). The array may be reused: copy it to keep it.
        """

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height, px."""


@dataclass(frozen=True)
class Recording:
    """A recorded run, opened; pixels are read on demand.

    Attributes
    ----------
    name, kind
        ``kind`` is ``inspection`` or ``gauge``.
    path
        The opened folder or file.
    frames, encoder, pipe
    frame_rate : float
        Nominal, 1/s.
    source
        Delivers the images.
    probe_file
        File of the stated probe, if the recording names one.
    content_key
        Hash of everything that determines the content (files' bytes, not their times).
    warnings
        Problems that the reader noticed and corrected, for the report.
    files
        Its files in their state at opening: see `pipeline.recording.checks.refuse_changed`.
    listed
        All rows of the table of frames, also those without pictures; None without such a table.
    inspection
        Facts of the inspection, for the report.
    imu
        None without an IMU.
    stays : (h, w) bool or None
        Pixels of the lit pictures, reduced by a whole factor, at which something stays while the wall moves;
        None if there are none, or if they were not examined.
    predicted : bool
        Whether a codec may repeat light of other pictures: not if each is coded alone, or without loss.
    """

    name: str
    kind: str
    path: Path
    frames: FrameTable
    encoder: Encoder | None
    pipe: PipeFacts
    frame_rate: float
    source: FrameSource
    probe_file: Path | None
    content_key: str
    warnings: tuple[str, ...] = ()
    files: tuple[InputFile, ...] = ()
    listed: FrameTable | None = None
    inspection: InspectionFacts = InspectionFacts()
    imu: Imu | None = None
    stays: Bool | None = None
    predicted: bool = False

    def read(self, frames: Sequence[int] | Int, planes: Planes) -> Iterator[tuple[int, Image | None]]:
        """See `FrameSource.read`."""
        return self.source.read(frames, planes)
