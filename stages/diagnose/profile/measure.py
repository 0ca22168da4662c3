"""Every laser frame of a recording -> profiles of the line by frame and azimuth sector."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Float, Float32, Image, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.recording.base import Illumination, Planes, Recording
from stages.diagnose.profile.kernels import stack_frame
from stages.rings.noise import clip_level_of
from stages.rings.sectors import Sectors, cut_sectors

SECTORS = 72
REACH_PX, STEP_PX = 60.0, 0.5
FIT_WIDTHS, CORE_WIDTHS = 5.0, 4.5
_TRUSTED = 0.97
_MOST = 0.5
_TILE_PX, _DARK_PERCENT = 32, 2.0
_SLOPE_SECTORS = 6
_TURNS = 10
_BOTH_PLANES: tuple[Planes, ...] = ("grey", "bgr")


@dataclass(frozen=True)
class LineProfiles:
    """The line across itself, by frame and azimuth sector.

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
        Sums of grey level above the background, and of the line's height, over the same pixels: their
        ratio is the profile, 1 at the line's middle.
    samples : (F, S)
        Azimuths with a line.
    clipped : (F, S)
        Share of them whose middle clips.
    highest : (F, S)
        Largest grey level on the line.
    background : (F,)
        Mean grey level, above black, 40 to 60 px away from the line; NaN where the wall is lit.
    gain : (2, 2, N) float64
        For two halves of the frames in turns: sums of residual × model and of model² in every pixel.
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
    highest: Float
    background: Float
    gain: Float


def measure_profiles(recording: Recording, rings: RingSamples) -> LineProfiles:
    """Stack the pixels about the line, line-centred, in every frame lit by the laser alone.

    Frames in which the wall is lit too are left out: its texture is brighter than what is looked for.
    """
    sectors = cut_sectors(recording.source.image_size, rings.centre_px, len(rings.azimuth_rad))
    rows = np.flatnonzero(np.isin(rings.frame, recording.frames.of(Illumination.LASER)) & rings.valid.any(1))
    count, bins = len(rows), round(2 * REACH_PX / STEP_PX)
    light = np.zeros((count, SECTORS, bins), np.float32)
    height, share = np.zeros_like(light), np.zeros((count, SECTORS, 3))
    background = np.zeros(count)
    gain = np.zeros((2, 2, recording.source.image_size[0] * recording.source.image_size[1]))
    trusted = _TRUSTED * _clip_level(recording, rings, rows, sectors)
    step = rings.azimuth_rad[1] - rings.azimuth_rad[0]
    dark = np.nan
    for k, (_, image) in enumerate(recording.read(rings.frame[rows], "grey")):
        if image is None:
            continue
        dark = _dark_level(image) if np.isnan(dark) else dark
        line, width = _line(rings, rows[k])
        slope = (np.roll(line, -_SLOPE_SECTORS) - np.roll(line, _SLOPE_SECTORS)) / (2 * _SLOPE_SECTORS * step)
        beside = _far_level(image, sectors, line)
        background[k] = beside - dark
        stack_frame(
            image.ravel(), sectors.start, sectors.pixel, sectors.radius_px, sectors.offset_rad, line, slope,
            width, rings.valid[rows[k]], beside, trusted, FIT_WIDTHS, CORE_WIDTHS, REACH_PX, STEP_PX,
            light[k], height[k], share[k], gain[k // _TURNS % 2],
        )  # fmt: skip
    offset: Float = -REACH_PX + STEP_PX * (np.arange(bins, dtype=np.float64) + 0.5)
    middle: Float = -np.pi - step / 2 + 2 * np.pi / SECTORS * (np.arange(SECTORS, dtype=np.float64) + 0.5)
    return LineProfiles(
        rings.frame[rows], rows, _times(recording, rings.frame[rows]), middle, offset,
        light, height, share[..., 0], share[..., 1] / np.maximum(share[..., 0], 1), share[..., 2],
        background, gain,
    )  # fmt: skip


def _line(rings: RingSamples, row: int) -> tuple[Float, Float]:
    """Return radius and width (A,) of a frame's line, bridged around the circle."""
    good = np.flatnonzero(rings.valid[row])
    every, turn = np.arange(len(rings.azimuth_rad)), len(rings.azimuth_rad)
    radius = np.interp(every, good, rings.radius_px[row, good], period=turn)
    width = np.interp(every, good, rings.width_px[row, good], period=turn)
    return radius, np.clip(width, 0.5 * np.median(width), 2 * np.median(width))


def _dark_level(image: Image) -> float:
    """Return the grey level of the darkest place: tiles are averaged first, so that noise does not decide."""
    size = (image.shape[1] // _TILE_PX, image.shape[0] // _TILE_PX)
    tiles = cv2.resize(image.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return float(np.percentile(tiles, _DARK_PERCENT))


def _far_level(image: Image, sectors: Sectors, line: Float) -> float:
    return float(image.ravel()[sectors.pixels_near(line, 40.0, REACH_PX)].mean())


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
