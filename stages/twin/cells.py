"""Brightness of compared frames in sectors of image azimuth, and tests of laws on frames not used in the fit.

For each sector, every frame keeps the sums from which χ² per pixel follows for any factor on the twin: a
cause is applied through its law without rendering the frame again. A law is fitted to every second frame and
judged on the others: χ² must fall there by more than its scatter from frame to frame explains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numba
import numpy as np
from scipy.stats import t

from pipeline.arrays import Bool, Byte, Float, Float32, Int
from stages.twin.darkness import level_beside_line
from stages.twin.render import Region, TwinFrame

Angle = TypeVar("Angle", float, Float)
SECTORS = 36
_FEWEST_PIXELS, _LEAST_RATIO = 60, 0.02
"""A sector is used with at least 60 pixels; a ratio of recorded to predicted light below 0.02 counts as
0.02."""
_DRIFT_KNOTS, _FRAMES_OF_KNOT = 4, 4
"""Most knots of the slow drift of brightness that is fitted before any cause, and frames per knot: with fewer
frames a single one would pull the drift."""


@dataclass(frozen=True)
class Cells:
    """Sums over the pixels of sectors, (F, S) each.

    Attributes
    ----------
    frame : (F,) int
    square, cross, own : float
        Sums of recorded², recorded · twin and twin², in grey levels above black, over the pixels' variance.
    pixels : float
        Number of pixels.
    predicted : float
        Sum of the twin: what the photo of the wall, its place and steady lights make it.
    """

    frame: Int
    square: Float
    cross: Float
    own: Float
    pixels: Float
    predicted: Float

    @property
    def usable(self) -> Bool:
        """(F, S) sectors with enough pixels and with predicted light."""
        return (self.pixels >= _FEWEST_PIXELS) & (self.own > 0)

    @property
    def log_ratio(self) -> Float:
        """(F, S) logarithm of recorded over twin, at least that of `_LEAST_RATIO`; 0 where unusable."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.usable, np.log(np.maximum(self.cross / self.own, _LEAST_RATIO)), 0.0)

    def chi2(self, log_factor: Float) -> Float:
        """Return χ² (F,) of frames, summed over their usable pixels, with a factor (F, S) on the twin."""
        factor = np.exp(log_factor)
        each = self.square - 2 * factor * self.cross + factor**2 * self.own
        return np.asarray(np.where(self.usable, each, 0.0).sum(1))

    @property
    def counted(self) -> Float:
        """(F,) number of pixels in the usable sectors."""
        return np.asarray(np.where(self.usable, self.pixels, 0.0).sum(1))

    def on(self, log_factor: Float) -> Cells:
        """Return the sums for a twin multiplied by exp(``log_factor``) (F, S)."""
        factor = np.exp(log_factor)
        return replace(
            self, cross=self.cross * factor, own=self.own * factor**2, predicted=self.predicted * factor
        )


@dataclass
class CellsOfFrames:
    """Collects the cells of frames of one light."""

    frame: list[int] = field(default_factory=list)
    parts: list[Float] = field(default_factory=list)

    def add(self, frame: int, above: Float32, twin: TwinFrame, white: float, sector: Byte) -> None:
        """Add a frame's lit wall below ``white``, by sectors (H, W); grey levels are above black."""
        self.frame.append(frame)
        sums = self._sums(above, twin, white, sector, (Region.WALL, Region.WALL))
        self.parts.append(sums[[0, 1, 2, 3, 5]])

    def add_line(self, frame: int, above: Float32, twin: TwinFrame, white: float, sector: Byte) -> None:
        """Add the light of a laser frame within the band about the line, wherever across the line it lies.

        A line beside its predicted place, because sheet or radius are wrong, is not darker for that: sectors
        are compared by their whole light, as if the line had its twin's place and profile. Light beside the
        line, as from lamps that are not quite off, is subtracted: it is not the laser's.
        """
        sums = self._sums(above, twin, white, sector, (Region.LINE_CORE, Region.LINE_FLANK))
        own, pixels, light, predicted = sums[2:]
        light = light - pixels * level_beside_line(above, twin, sector, SECTORS)
        ratio = light / np.where(predicted > 0, predicted, np.inf)
        self.frame.append(frame)
        self.parts.append(np.stack([pixels + ratio**2 * own, ratio * own, own, pixels, predicted]))

    @staticmethod
    def _sums(above: Float32, twin: TwinFrame, white: float, sector: Byte, kinds: tuple[int, int]) -> Float:
        kind = tuple(int(k) for k in kinds)
        return np.asarray(
            _sector_sums(above, twin.level, twin.variance, twin.region, sector, np.float32(white), *kind)
        )

    def cells(self) -> Cells | None:
        """Return the cells of all frames; None without any."""
        if not self.parts:
            return None
        return Cells(np.array(self.frame), *np.stack(self.parts, 1))


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _sector_sums(above, level, variance, region, sector, white, kind, other):  # type: ignore[no-untyped-def]
    """Return Σ recorded²/σ², recorded · twin/σ², twin²/σ², pixels, recorded, twin (6, S) of two regions."""
    sums = np.zeros((6, SECTORS))
    for i in range(region.shape[0]):
        for j in range(region.shape[1]):
            r, value = region[i, j], above[i, j]
            if (r != kind and r != other) or value >= white:
                continue
            s, twin, weight = sector[i, j], level[i, j], 1 / variance[i, j]
            sums[0, s] += value * value * weight
            sums[1, s] += value * twin * weight
            sums[2, s] += twin * twin * weight
            sums[3, s] += 1
            sums[4, s] += value
            sums[5, s] += twin
    return sums


@dataclass(frozen=True)
class Law:
    """What a cause does to the logarithm of brightness, for each place where it may act.

    Attributes
    ----------
    name : str
    columns : (C, F, S)
        Change per unit of size.
    places : (C, P)
        Place of each column, for example a frame and an azimuth.
    """

    name: str
    columns: Float
    places: Float


@dataclass(frozen=True)
class Fitted:
    """A law with its best place and size.

    Attributes
    ----------
    law : Law
    column : int
        Index of the best place.
    size, sd : float
        Size and its 1 σ, by the spread from frame to frame.
    probability : float
        Probability that chance gives such a size at any of the tried places; 1 where frames outside the fit
        do not fit better.
    fall : (F,)
        Fall of χ² of each frame with sizes fitted to the half of the frames without it.
    chi2_before, chi2_after : float
        χ² per pixel without and with the law, with sizes fitted to the other half of the frames.
    """

    law: Law
    column: int
    size: float
    sd: float
    probability: float
    fall: Float
    chi2_before: float
    chi2_after: float

    @property
    def change(self) -> Float:
        """(F, S) change of the logarithm of brightness."""
        return np.asarray(self.size * self.law.columns[self.column], float)

    @property
    def place(self) -> Float:
        """The place that its column stands for."""
        return np.asarray(self.law.places[self.column])


def sectors_of(phi_rad: Float32) -> Byte:
    """Return the sectors of image azimuths; sector 0 begins at −π."""
    turn = np.nan_to_num(phi_rad + np.pi) / (2 * np.pi)
    return np.asarray((turn * SECTORS).astype(np.int64) % SECTORS, np.uint8)


def sector_azimuth_rad() -> Float:
    """Return the azimuths (S,) of the middles of the sectors."""
    return np.asarray(-np.pi + 2 * np.pi * (np.arange(SECTORS) + 0.5) / SECTORS)


def half_turn(angle_deg: Angle) -> Angle:
    """Return angles in degrees, brought into [−180°, 180°)."""
    return (angle_deg + 180) % 360 - 180


def drift(frames: int) -> Float:
    """Return columns (K, F, S) for a slow change over the frames."""
    knots = int(np.clip(frames // _FRAMES_OF_KNOT, 1, _DRIFT_KNOTS))
    x = np.linspace(0, knots - 1, frames)
    hats = np.maximum(0.0, 1 - np.abs(x[None] - np.arange(knots)[:, None]))
    return np.asarray(np.repeat(hats[..., None], SECTORS, 2), float)


def fitted(cells: Cells, base: Float, use: Bool) -> Float:
    """Return the change (F, S) predicted by columns (K, F, S) fitted to the frames in ``use`` (F,)."""
    inside = cells.usable & use[:, None]
    size = np.linalg.lstsq(base[:, inside].T, cells.log_ratio[inside], rcond=None)[0]
    return np.asarray(np.tensordot(size, base, 1), float)


def try_law(cells: Cells, base: Float, law: Law, places: int) -> Fitted:
    """Return a law's best place and size beyond base columns (K, F, S), and how other frames support it.

    ``places`` is the number of independent places of this and of the other laws: chance has as many tries.
    """
    frames = np.arange(len(cells.frame))
    fall, before = np.zeros(len(frames)), np.zeros(len(frames))
    # Half of the frames leave open between which two neighbours a step lies: all frames give the place.
    column, size, sd = best_column(cells, base, law, np.ones(len(frames), bool))
    for half in (frames % 2 == 0, frames % 2 == 1):
        without = fitted(cells, base, half)
        with_it = fitted(cells, np.concatenate([base, law.columns[column][None]]), half)
        left = cells.chi2(without)
        before[~half], fall[~half] = left[~half], (left - cells.chi2(with_it))[~half]
    # A law that frames outside the fit contradict is chance, however significant the fit is.
    freedom = max(len(frames) - 1 - _DRIFT_KNOTS, 1)
    chance = float(2 * places * t.sf(abs(size) / max(sd, 1e-12), freedom)) if fall.sum() > 0 else 1.0
    pixels = max(float(cells.counted.sum()), 1.0)
    return Fitted(
        law, column, size, sd, min(1.0, chance), fall, float(before.sum()) / pixels,
        float((before - fall).sum()) / pixels,
    )  # fmt: skip


def best_column(cells: Cells, base: Float, law: Law, use: Bool) -> tuple[int, float, float]:
    """Return a law's best column beyond ``base`` (K, F, S) in frames ``use`` (F,), its size and its σ."""
    inside = cells.usable & use[:, None]
    direction = np.linalg.svd(base[:, inside].T, full_matrices=False)
    kept = direction[0][:, direction[1] > 1e-9 * max(direction[1].max(), 1e-30)]
    rest = cells.log_ratio[inside]
    rest = rest - kept @ (kept.T @ rest)
    columns = law.columns[:, inside]
    columns = columns - (columns @ kept) @ kept.T
    norm = np.einsum("cn,cn->c", columns, columns)
    norm = np.where(norm > 1e-6, norm, np.inf)
    size = columns @ rest / norm
    best = int(np.argmax(size**2 * np.where(np.isfinite(norm), norm, 0.0)))
    left = columns[best] * (rest - size[best] * columns[best])
    of_frame = np.bincount(np.nonzero(inside)[0], left, len(use))
    weight = np.bincount(np.nonzero(inside)[0], columns[best] ** 2, len(use))
    seen = weight > 0
    # A few frames of high weight make their own scatter look small: the scatter of all frames is the lower
    # bound.
    spread = max((of_frame**2).sum(), norm[best] * (of_frame[seen] ** 2 / weight[seen]).mean())
    spread *= seen.sum() / max(seen.sum() - 1 - _DRIFT_KNOTS, 1)
    return best, float(size[best]), float(np.sqrt(spread)) / float(norm[best])


def sigmas(fall: Sequence[float] | Float) -> float:
    """Return by how many σ, estimated from frame to frame, the mean of the falls (F,) is above 0."""
    if len(fall) < 2:
        return 0.0
    sd = float(np.std(fall, ddof=1)) / np.sqrt(len(fall))
    return float(np.mean(fall) / max(sd, 1e-12))


def chance_of(size: Float) -> float:
    """Return the probability that frames (F,) agree so well by chance on a size other than 0."""
    return float(2 * t.sf(abs(sigmas(size)), max(len(size) - 1, 1)))


def centred(value: Float, *groups: Int) -> Float:
    """Return values (N,) minus their means over each of the groupings (N,), iterated."""
    for _ in range(4):
        for group in groups:
            count = np.bincount(group)
            value = value - (np.bincount(group, value) / np.maximum(count, 1))[group]
    return value
