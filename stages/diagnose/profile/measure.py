"""Measure the line's profiles by frame and azimuth sector in every laser frame, in compiled loops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from scipy.stats import norm

from pipeline.arrays import Float, Float32, Image, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.recording.base import Illumination, Planes, Recording
from stages.rings.kernels import first_at_least
from stages.rings.noise import clip_level_of
from stages.rings.sectors import Sectors, sectors_of

SECTORS = 72
REACH_PX, STEP_PX = 60.0, 0.5
# Light beside the line begins here: farther away than a blurred line's skirt (chosen).
_BESIDE_PX = 40.0
FIT_WIDTHS, CORE_WIDTHS = 5.0, 4.5
_TRUSTED = 0.97
_MOST = 0.5
_TILE_PX, _DARK_PERCENT = 32, 2.0
_SLOPE_SECTORS = 6
_TURNS = 10
_BOTH_PLANES: tuple[Planes, ...] = ("grey", "bgr")


@numba.njit(cache=True, nogil=True)
def fit_height(image, pixel, radius, offset, low, high, line, slope, width, trusted, out):  # type: ignore[no-untyped-def]
    """Fit height and background (``out``) of a Gaussian of known place and width, without clipped pixels.

    Returns the largest grey level near the line's middle.
    """
    n0 = n1 = n2 = v0 = v1 = top = 0.0
    for k in range(low, high):
        x = (radius[k] - line - slope * offset[k]) / width
        y = image[pixel[k]]
        if abs(x) < 1.0 and y > top:
            top = y
        if y > trusted:
            continue
        e = np.exp(-0.5 * x * x)
        n0 += 1.0
        n1 += e
        n2 += e * e
        v0 += y
        v1 += e * y
    det = n0 * n2 - n1 * n1
    if det <= 1e-6 * max(n0 * n2, 1e-12):
        out[0], out[1] = np.nan, np.nan
        return top
    out[0] = (n0 * v1 - n1 * v0) / det
    out[1] = (n2 * v0 - n1 * v1) / det
    return top


@numba.njit(cache=True, nogil=True)
def stack_frame(  # type: ignore[no-untyped-def]
    image, start, pixel, radius, offset, line, slope, width, usable, dark, trusted,
    fit_widths, core_widths, reach, step, light, height, share, gain,
):  # fmt: skip
    """Add one frame's pixels, in coordinates centred on the line, to its sectors' profiles.

    ``light`` and ``height`` (S, B) accumulate grey levels above the background, and the line's height, for
    every pixel that cannot have clipped; ``share`` (S, 2) counts samples and clipped samples;
    ``gain`` (2, H·W) accumulates residual × model and model² of the line's bright pixels. ``dark`` is
    the grey level without light.
    """
    azimuths, sectors = start.size - 1, light.shape[0]
    fit = np.empty(2)
    for a in range(azimuths):
        if not usable[a]:
            continue
        s = a * sectors // azimuths
        half = fit_widths * width[a]
        low = first_at_least(radius, start[a], start[a + 1], line[a] - half)
        high = first_at_least(radius, low, start[a + 1], line[a] + half)
        top = fit_height(image, pixel, radius, offset, low, high, line[a], slope[a], width[a], trusted, fit)
        share[s, 0] += 1.0
        if np.isnan(fit[0]) or fit[0] <= 0:
            continue
        clipped = top > trusted or fit[0] + dark > trusted
        share[s, 1] += 1.0 if clipped else 0.0
        k = first_at_least(radius, start[a], start[a + 1], line[a] - reach - 1.0)
        while k < start[a + 1] and radius[k] < line[a] + reach + 1.0:
            t = radius[k] - line[a] - slope[a] * offset[k]
            y = image[pixel[k]]
            b = int(np.floor((t + reach) / step))
            if 0 <= b < light.shape[1] and (not clipped or abs(t) > core_widths * width[a]):
                light[s, b] += y - dark
                height[s, b] += fit[0]
                x = t / width[a]
                # Beyond 1.5 widths the line is below a third of its height and not bell-shaped (chosen).
                if abs(x) < 1.5 and not clipped:
                    m = fit[0] * np.exp(-0.5 * x * x)
                    gain[0, pixel[k]] += (y - dark - m) * m
                    gain[1, pixel[k]] += m * m
            k += 1


@numba.njit(cache=True, nogil=True)
def mean_beside(image, start, pixel, radius, line, least, most):  # type: ignore[no-untyped-def]
    """Return the mean grey level of the pixels whose distance to the line (A,) is in [least, most), px."""
    total, count = 0, 0
    for a in range(line.size):
        low = first_at_least(radius, start[a], start[a + 1], line[a] - most)
        for k in range(low, first_at_least(radius, low, start[a + 1], line[a] + most)):
            if least <= abs(radius[k] - line[a]) < most:
                total += image[pixel[k]]
                count += 1
    return total / count if count else np.nan


@dataclass(frozen=True)
class LineProfiles:
    """Profiles across the line, by frame and azimuth sector.

    Attributes
    ----------
    frame : (F,) int
        Frames lit by the laser alone.
    row : (F,) int
        Their rows in the ring samples.
    time_s : (F,)
    azimuth_rad : (S,)
        Middle of each sector, in the image.
    offset_px : (B,)
        Distance of the bins' middles from the line, outward positive.
    light, height : (F, S, B) float32
        Sums of grey level above the background, and of the line's height, over the same pixels: their ratio
        is the profile, 1 at the line's middle.
    samples : (F, S)
        Number of azimuths with a line.
    clipped : (F, S)
        Share of them whose middle clips.
    background : (F,)
        Mean grey level, minus that of the darkest place, 40 to 60 px away from the line; NaN where the wall
        is lit.
    background_sigma : float
        1 σ of the level of the darkest place, which noise and compression make too low, grey levels.
    gain : (2, 2, N) float64
        For two alternating halves of the frames: sums of residual × model and of model² in every pixel.
    """

    frame: Int
    row: Int
    time_s: Float
    azimuth_rad: Float
    offset_px: Float
    light: Float32
    height: Float32
    samples: Float
    clipped: Float
    background: Float
    background_sigma: float
    gain: Float


def measure_profiles(recording: Recording, rings: RingSamples) -> LineProfiles:
    """Stack the pixels about the line, centred on it, in every frame lit by the laser alone.

    Frames in which the wall is lit as well are left out: its texture is brighter than the effects.
    """
    sectors = sectors_of(recording.source, rings.centre_px, len(rings.azimuth_rad))
    sectors = sectors.taken or sectors
    rows = np.flatnonzero(np.isin(rings.frame, recording.frames.of(Illumination.LASER)) & rings.valid.any(1))
    count, bins = len(rows), round(2 * REACH_PX / STEP_PX)
    light = np.zeros((count, SECTORS, bins), np.float32)
    height, share = np.zeros_like(light), np.zeros((count, SECTORS, 2))
    beside, tiles = np.full(count, np.nan), []
    gain = np.zeros((2, 2, recording.source.image_size[0] * recording.source.image_size[1]))
    trusted = _TRUSTED * _clip_level(recording, rings, rows, sectors)
    for k, (_, image) in enumerate(recording.read(rings.frame[rows], "grey")):
        if image is not None:
            tiles.append(tile_means(image))
            sums = light[k], height[k], share[k], gain[k // _TURNS % 2]
            beside[k] = _stacked(image, sectors, rings, rows[k], trusted, sums)
    dark, dark_sigma = _dark_level(tiles)
    step = rings.azimuth_rad[1] - rings.azimuth_rad[0]
    offset: Float = -REACH_PX + STEP_PX * (np.arange(bins, dtype=np.float64) + 0.5)
    middle: Float = -np.pi - step / 2 + 2 * np.pi / SECTORS * (np.arange(SECTORS, dtype=np.float64) + 0.5)
    return LineProfiles(
        rings.frame[rows], rows, _times(recording, rings.frame[rows]), middle, offset,
        light, height, share[..., 0], share[..., 1] / np.maximum(share[..., 0], 1),
        beside - dark, dark_sigma, gain,
    )  # fmt: skip


def _stacked(
    image: Image, sectors: Sectors, rings: RingSamples, row: int, trusted: float, sums: tuple[Any, ...]
) -> float:
    """Add a frame to the ``sums`` of `stack_frame`; return the mean grey level beside its line."""
    at, (line, width) = (sectors.start, sectors.pixel, sectors.radius_px), _line(rings, row)
    apart = 2 * _SLOPE_SECTORS * (rings.azimuth_rad[1] - rings.azimuth_rad[0])
    slope = (np.roll(line, -_SLOPE_SECTORS) - np.roll(line, _SLOPE_SECTORS)) / apart
    beside = float(mean_beside(image.ravel(), *at, line, _BESIDE_PX, REACH_PX))
    stack_frame(
        image.ravel(), *at, sectors.offset_rad, line, slope, width, rings.valid[row], beside, trusted,
        FIT_WIDTHS, CORE_WIDTHS, REACH_PX, STEP_PX, *sums,
    )  # fmt: skip
    return beside


def _line(rings: RingSamples, row: int) -> tuple[Float, Float]:
    """Return radius, px, and width (A,), px, of a frame's line, interpolated across gaps."""
    good = np.flatnonzero(rings.valid[row])
    every, turn = np.arange(len(rings.azimuth_rad)), len(rings.azimuth_rad)
    radius = np.interp(every, good, rings.radius_px[row, good], period=turn)
    width = np.interp(every, good, rings.width_px[row, good], period=turn)
    return radius, np.clip(width, 0.5 * np.median(width), 2 * np.median(width))


def tile_means(image: Image) -> Float:
    """Return the mean grey levels (h, w) of whole tiles."""
    rows, columns = (n // _TILE_PX for n in image.shape)
    whole = image[: rows * _TILE_PX, : columns * _TILE_PX]
    of_rows = whole.reshape(rows, _TILE_PX, -1).sum(axis=1, dtype=np.uint32)
    return np.asarray(of_rows.reshape(rows, columns, _TILE_PX).mean(axis=2) / _TILE_PX)


def _dark_level(tiles: list[Float]) -> tuple[float, float]:
    """Return the grey level of the darkest place, from the means of tiles (h, w) of every frame, and its 1 σ.

    The darkest of many tiles is also dark by chance: by two of their 1 σ at the chosen percentile. That σ is
    estimated from how the darkest tiles change from frame to frame. It is not divided by the number of
    frames, because compression repeats the noise of one frame in those that follow.
    """
    if not tiles:
        return np.nan, np.nan
    stack = np.stack(tiles)
    mean = stack.mean(0)
    dark = float(np.percentile(mean, _DARK_PERCENT))
    darkest = stack[:, mean <= np.median(mean)]
    return dark, float(-norm.ppf(_DARK_PERCENT / 100) * np.median(darkest.std(0)))


def _clip_level(recording: Recording, rings: RingSamples, rows: Int, sectors: Sectors) -> float:
    """Return the grey level at which the line's strongest channel clips."""
    for row in rows[rings.valid[rows].mean(1) > _MOST][:1]:
        frame = rings.frame[row : row + 1]
        (_, grey), (_, bgr) = (next(iter(recording.read(frame, planes))) for planes in _BOTH_PLANES)
        line, width = _line(rings, row)
        if grey is not None and bgr is not None:
            return clip_level_of(grey, bgr, sectors.pixels_near(line, 0, float(np.median(width))))
    return np.inf


def _times(recording: Recording, frames: Int) -> Float:
    place = np.searchsorted(recording.frames.frame, frames)
    return np.asarray(recording.frames.time_s[place] - recording.frames.time_s[0])
