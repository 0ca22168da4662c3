"""Banding: rows of single frames that are brighter or darker, in lit wall and along the laser line."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t

from pipeline.arrays import Bool, Float
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.cells import SECTORS, Cells, sector_azimuth_rad, sigmas
from stages.twin.locate import FALSE_ALARM
from stages.twin.reference import FEWEST_FRAMES, SHOWN_PX, BlockSamples
from stages.twin.scene import Ring
from stages.twin.significance import significance_over_frames

_LEAST = 0.01
"""Smallest relative change of rows that is reported: photos of the wall err by as much from row to row."""
_ORDERS = 2
"""Harmonics around the line that a displaced or tilted probe, or an oval bore, makes; taken out of each
frame."""
_BESIDE = SECTORS // 8
"""Sectors about the most varied one that bands must do without; a quarter of the picture, chosen."""
_MIRRORED = (np.arange(SECTORS)[:, None] - 1 - np.arange(SECTORS)) % SECTORS
"""(A, S) the sector at the same place of the other half of the picture, for halves along each axis."""
_OPPOSITE = _MIRRORED[SECTORS // 2]
"""(S,) the same for the halves left and right: the sector in the same rows."""


def banding(samples: BlockSamples) -> tuple[Mismatch, ...]:
    """Return bands along rows of lit wall that change from frame to frame."""
    everywhere = np.ones(len(samples.change), bool)
    if samples.frame.max() + 1 < FEWEST_FRAMES or samples.fixed_to(everywhere) != "rows":
        return ()
    frames = np.unique(samples.frame)
    each = samples.common_in_rows()[frames]
    chance = float(t.sf(sigmas(samples.explained("rows", everywhere)[frames]), len(frames) - 1))
    size = _rms(each)
    if size.value < _LEAST:
        return ()
    nan = float("nan")
    said = (
        f"Rows of single frames are brighter or darker by {100 * size.value:.1f} % (1 σ): banding, as by "
        "lamps that flicker within the exposure of a rolling shutter."
    )
    look = samples.look(everywhere, 2 * SHOWN_PX)
    return (Mismatch("banding", "intensity", "rows", (), (size,), chance, nan, nan, said, look),)


def banding_of_line(cells: Cells, ring: Ring) -> tuple[Mismatch, ...]:
    """Return bands along rows of laser frames: the line is bright or dark alike on both sides of a row.

    One side of each frame predicts the other one. Wall is not alike on both sides, and no other effect of the
    library makes it so beyond the second harmonic. What lasts for several frames may be alike by chance: no
    two halves of the picture along another axis may be more alike. Bands cross the whole picture: they must
    also show away from where the line varies most, as at a hole of the wall below or above.
    """
    away = _away_from_worst(cells)
    bands, aside = _bands(cells, SECTORS / 2), _bands(away, (away.pixels > 0).any(0).sum() / 2)
    if bands is None or aside is None or not _most_alike(bands.rest):
        return ()
    size, alike = bands.size, bands.alike
    said = (
        f"Along rows of single frames, the line is brighter or darker by at least {100 * size.value:.1f} % "
        "(1 σ), alike on both sides of the picture: banding, as by a laser whose power changes within the "
        "exposure of a rolling shutter."
    )
    return (Mismatch(
        "banding", "line", "rows", (), (size,), bands.chance,
        *_chi2(cells, bands.rest, alike.mean() * bands.other), said,
        ring.whole(int(cells.frame[bands.frames.argmax()])),
    ),)  # fmt: skip


@dataclass(frozen=True)
class _Bands:
    """Brightness that both sides of a row share.

    Attributes
    ----------
    rest, other : (F, S)
        Brightness beside the low harmonics, and that of the sector in the same row; the latter is 0 where
        only one side is known.
    frames : (F,) bool
        Frames in which enough is known of both sides.
    alike : (N,)
        Share of one side's brightness that the other one predicts, in those frames.
    size : NamedFigure
    chance : float
    """

    rest: Float
    other: Float
    frames: Bool
    alike: Float
    size: NamedFigure
    chance: float


def _bands(cells: Cells, fewest: float) -> _Bands | None:
    """Return what both sides of rows have in common; None where it may be chance or is too small.

    Frames count with ``fewest`` sectors of which both sides are known.
    """
    rest = _beside_harmonics(cells)
    both = np.isfinite(rest * rest[:, _OPPOSITE])
    both[both.sum(1) < fewest] = False
    frames = np.asarray(both.any(1))
    if frames.sum() < FEWEST_FRAMES:
        return None
    one, other = (np.where(both, a, 0.0) for a in (rest, rest[:, _OPPOSITE]))
    alike = (one * other).sum(1)[frames] / np.maximum((one**2).sum(1)[frames], 1e-12)
    chance = significance_over_frames(alike)[1]
    size = _rms((one * other).sum(1)[frames] / both.sum(1)[frames])
    if chance > FALSE_ALARM or size.value < _LEAST:
        return None
    return _Bands(rest, other, frames, alike, size, chance)


def _away_from_worst(cells: Cells) -> Cells:
    """Return sectors beyond an eighth of the picture from where brightness varies most, on either side."""
    worst = int(np.argmax(np.nansum(_beside_harmonics(cells) ** 2, 0)))
    sector, keep = np.arange(SECTORS), np.ones(SECTORS, bool)
    for at in (worst, _OPPOSITE[worst]):
        away = np.abs(sector - at)
        keep &= np.minimum(away, SECTORS - away) > _BESIDE
    return replace(cells, pixels=cells.pixels * keep)


def _most_alike(rest: Float) -> bool:
    """Return whether brightness (F, S) is more alike on both sides of a row than of any other axis."""
    along = [float(np.nansum(rest * rest[:, other])) for other in _MIRRORED]
    return int(np.argmax(along)) == SECTORS // 2


def _beside_harmonics(cells: Cells) -> Float:
    """Return brightness (F, S) beside each sector's mean and each frame's low harmonics; NaN if unusable."""
    rest = np.where(cells.usable, cells.log_ratio, np.nan)
    seen = cells.usable.sum(0)
    rest = rest - np.where(cells.usable, cells.log_ratio, 0.0).sum(0) / np.maximum(seen, 1)
    order = np.arange(1, _ORDERS + 1)[:, None] * sector_azimuth_rad()
    around = np.concatenate([np.ones((1, SECTORS)), np.cos(order), np.sin(order)])
    for one in rest:
        known = np.isfinite(one)
        one[known] -= around[:, known].T @ np.linalg.lstsq(around[:, known].T, one[known], rcond=None)[0]
    return np.asarray(rest)


def _chi2(cells: Cells, rest: Float, predicted: Float) -> tuple[float, float]:
    """Return χ² per pixel without and with what the other sides of frames predict (F, S) of ``rest``."""
    known = cells.log_ratio - np.nan_to_num(rest)
    total = max(float(cells.counted.sum()), 1.0)
    return float(cells.chi2(known).sum()) / total, float(cells.chi2(known + predicted).sum()) / total


def _rms(square: Float) -> NamedFigure:
    """Return the r.m.s. change of rows from its square in frames (F,), 0 where that is negative."""
    size = float(np.sqrt(max(square.mean(), 0.0)))
    sd = float(square.std(ddof=1)) / np.sqrt(len(square)) / max(2 * size, 1e-9)
    return NamedFigure("change", size, sd, "relative")
