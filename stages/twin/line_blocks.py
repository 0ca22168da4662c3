"""Pixels about the recorded line of a gauge run, in blocks of azimuth, and the line's light in them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Bool, Float, Image, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.errors import UnusableError
from pipeline.recording.base import Recording
from stages.calibrate.gauge import MeasuredRun
from stages.twin.noise import black_and_white

RING_BINS = 240
"""Blocks around the ring, as in the calibration (`GaugeParameters.ring_bins`)."""
_HALF_PX = 12.0
"""Half width of the compared band about the recorded line, px. For relevant errors, the predicted line also
lies inside it; a line predicted outside the band leaves the recorded one entirely unexplained."""
_PROFILE_WIDTHS, _CELLS, _CLASSES, _ROUNDS = 6.0, 73, 4, 3
_NEAR = 2
"""A frame is compared if one with fiducials is at most this many frames away: farther off, its pose is a
guess."""
_FEWEST_FRAMES = 4
_LEAST_VARIANCE = 1.0 / 12
"""Variance of rounding to whole grey levels."""


@dataclass(frozen=True)
class LineBlocks:
    """Pixels about the recorded line in the compared frames, in the calibration's blocks of azimuth.

    Attributes
    ----------
    frame : (F,) int
        Frame numbers in the recording.
    of_frame, azimuth_rad, measured_px, width_px : (B,)
        Of each block: index of its frame in ``frame``, image azimuth, measured radius of the ring, and the
        line's width in that frame.
    block : (N,) int
        Block of each pixel.
    offset_px, grey : (N,)
        Distance of each pixel beyond the measured ring, and its grey level.
    centre_px : (2,)
    white : float
        Grey level at which pixels clip; infinite where none do.
    """

    frame: Int
    of_frame: Int
    azimuth_rad: Float
    measured_px: Float
    width_px: Float
    block: Int
    offset_px: Float
    grey: Float
    centre_px: Float
    white: float

    @property
    def clipped(self) -> Bool:
        """(N,) pixels that are clipped."""
        return self.grey >= self.white

    def total(self, values: Float) -> Float:
        """Return sums (B,) of the pixels' values (N,) over each block."""
        return np.asarray(np.bincount(self.block, values, len(self.of_frame)), float)


@dataclass(frozen=True)
class BlockLight:
    """Profile (C,) of the line at ``x`` = offset / width (C,), and variance (N,) of each pixel about it."""

    x: Float
    profile: Float
    variance: Float


def blocks_of(recording: Recording, rings: RingSamples, run: MeasuredRun, most: int) -> LineBlocks:
    """Return the pixels about the rings' bins on plain bore, in at most ``most`` frames near fiducials.

    Raises
    ------
    UnusableError
        When too few laser frames are near frames with fiducials.
    """
    on_bore = run.measured.rings
    near = np.unique(on_bore.frame)
    near = near[np.abs(near[:, None] - run.posed).min(1) <= _NEAR]
    chosen = near[np.unique(np.linspace(0, len(near) - 1, min(most, len(near))).astype(int))]
    numbers = recording.frames.frame[chosen]
    images = [
        (p, i) for p, (_, i) in zip(chosen, recording.read(numbers, "grey"), strict=True) if i is not None
    ]
    if len(images) < _FEWEST_FRAMES:
        raise UnusableError(
            "gauge_line", f"{len(images)} laser frames lie near frames with fiducials",
            limit=f"at least {_FEWEST_FRAMES}", hint="record the gauge run with lit frames throughout",
        )  # fmt: skip
    place = np.array([p for p, _ in images])
    here = [np.flatnonzero(on_bore.frame == p) for p in place]
    kept = np.concatenate(here)
    away = on_bore.uv[kept] - rings.centre_px
    radius, azimuth = np.hypot(*away.T), np.arctan2(away[:, 1], away[:, 0])
    first = np.cumsum([0, *map(len, here)])
    parts = [
        _pixels(image, rings.centre_px, azimuth[a:b], radius[a:b], a)
        for (_, image), a, b in zip(images, first[:-1], first[1:], strict=True)
    ]
    block, offset, grey = (np.concatenate([p[k] for p in parts]) for k in range(3))
    of_frame = np.repeat(np.arange(len(place)), np.diff(first))
    width = np.array([_width(rings, int(n)) for n in recording.frames.frame[place]])
    white = black_and_white([image.astype(np.float32) for _, image in images])[1]
    return LineBlocks(
        place, of_frame, azimuth, radius, width[of_frame], block, offset, grey, rings.centre_px, white
    )


def _pixels(
    image: Image, centre_px: Float, azimuth_rad: Float, radius_px: Float, first: int
) -> tuple[Int, Float, Float]:
    """Return block, offset from the ring and grey level of the pixels about a frame's blocks (B,)."""
    v, u = np.mgrid[0 : image.shape[0], 0 : image.shape[1]]
    du, dv = u - centre_px[0], v - centre_px[1]
    rho = np.hypot(du, dv)
    near = np.flatnonzero((rho > radius_px.min() - _HALF_PX) & (rho < radius_px.max() + _HALF_PX))
    phi, rho = np.arctan2(dv.ravel()[near], du.ravel()[near]), rho.ravel()[near]
    order = np.argsort(azimuth_rad)
    ring = np.interp(phi, azimuth_rad[order], radius_px[order], period=2 * np.pi)
    cell = np.full(RING_BINS, -1)
    cell[_cell_of(azimuth_rad)] = np.arange(len(azimuth_rad))
    block = cell[_cell_of(phi)]
    keep = (block >= 0) & (np.abs(rho - ring) < _HALF_PX)
    return first + block[keep], (rho - ring)[keep], image.ravel()[near[keep]].astype(float)


def _cell_of(azimuth_rad: Float) -> Int:
    return np.asarray(((azimuth_rad + np.pi) / (2 * np.pi) * RING_BINS).astype(int) % RING_BINS)


def _width(rings: RingSamples, frame: int) -> float:
    row = int(np.flatnonzero(rings.frame == frame)[0])
    return float(np.nanmedian(rings.width_px[row][rings.valid[row]]))


def light_of(blocks: LineBlocks) -> BlockLight:
    """Return the line's profile and the scatter of pixels about it, where the line was measured.

    The scatter is that of pixels at the same offset and with the same brightness of the line. It includes
    noise, speckle, reflectance that varies within a block, and the codec.
    """
    x = np.linspace(-_PROFILE_WIDTHS, _PROFILE_WIDTHS, _CELLS)
    across = blocks.offset_px / blocks.width_px[blocks.block]
    cell = np.clip(np.round((across - x[0]) / (x[1] - x[0])).astype(int), 0, _CELLS - 1)
    light = BlockLight(x, np.exp(-0.5 * x**2), np.ones(len(across)))
    nowhere = np.zeros(len(blocks.of_frame))
    for _ in range(_ROUNDS):
        ground, height = _brightness(blocks, light, nowhere)
        above = blocks.grey - ground[blocks.block]
        use, peak = ~blocks.clipped, height[blocks.block]
        total, weight = (np.bincount(cell[use], v[use], _CELLS) for v in (above * peak, peak**2))
        profile = np.where(weight > 0, total / np.maximum(weight, 1e-9), light.profile)
        light = BlockLight(x, profile / profile.max(), light.variance)
    bright = np.searchsorted(np.quantile(height, np.linspace(0, 1, _CLASSES + 1)[1:-1]), height)
    kind = bright[blocks.block] * _CELLS + cell
    size, free = (_CLASSES, _CELLS), ~blocks.clipped
    count = np.bincount(kind[free], minlength=_CLASSES * _CELLS).reshape(size)
    for _ in range(_ROUNDS):  # the brightness of a block depends on the weights of its pixels
        total = np.bincount(kind[free], squares(blocks, light, nowhere)[free], _CLASSES * _CELLS).reshape(
            size
        )
        mean = total / np.maximum(count, 1)
        # Where all pixels clip, no noise is visible: it is at least that of the brightest ones that do not
        # clip.
        mean = np.maximum(np.where(count > 0, mean, mean.max(1, keepdims=True)), _LEAST_VARIANCE)
        light = replace(light, variance=mean.ravel()[kind])
    return light


def _shape(blocks: LineBlocks, light: BlockLight, displacement_px: Float) -> Float:
    """Return the profile (N,) at the pixels for lines displaced by (B,), px; 0 where a block has no line."""
    across = (blocks.offset_px - displacement_px[blocks.block]) / blocks.width_px[blocks.block]
    return np.interp(np.nan_to_num(across, nan=np.inf), light.x, light.profile, left=0.0, right=0.0)


def _brightness(blocks: LineBlocks, light: BlockLight, displacement_px: Float) -> tuple[Float, Float]:
    """Return background and height (B,) of the line that fit each block best; the height is not negative."""
    shape, weight = _shape(blocks, light, displacement_px), np.where(blocks.clipped, 0.0, 1 / light.variance)
    w, wp, wpp = (blocks.total(weight * shape**k) for k in range(3))
    wg, wpg = (blocks.total(weight * shape**k * blocks.grey) for k in range(2))
    spread = wpp * w - wp**2
    height = np.where(spread > 1e-9 * w**2, (wpg * w - wp * wg) / np.maximum(spread, 1e-12), 0.0)
    height = np.maximum(height, 0.0)
    return (wg - height * wp) / np.maximum(w, 1e-12), height


def squares(blocks: LineBlocks, light: BlockLight, displacement_px: Float) -> Float:
    """Return (recorded − re-rendered)² (N,), grey levels squared."""
    ground, height = _brightness(blocks, light, displacement_px)
    level = ground[blocks.block] + height[blocks.block] * _shape(blocks, light, displacement_px)
    return (blocks.grey - np.minimum(level, blocks.white)) ** 2
