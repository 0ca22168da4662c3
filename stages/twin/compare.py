"""Differences between recorded and re-rendered frames over the noise: χ² by region, maps, and views."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numba
import numpy as np

from pipeline.arrays import Bool, Float, Float32
from pipeline.artefacts.twin import NamedFigure, RegionFit, TwinView
from pipeline.recording.base import Illumination
from stages.twin.noise import CameraNoise
from stages.twin.render import Region, TwinFrame

BLOCK_PX = 8
"""Side of the blocks, px, in which differences are sought that stay at one place of the image."""
_LEVELS = (0, 10, 20, 40, 80, 120, 160, 200)
_FULL_SCALE, _STRAY = 255.0, 5.0
CLIPPED_WALL = 0.01
"""Share of pixels of lit wall above which clipping is reported."""
_SILENT = 0.92
"""Share of pixels at one grey level from which on noise is below that of rounding, 1/√12: erf(√1.5)."""
_DARK, _WALL, _CORE, _EDGE = (int(r) for r in (Region.DARK, Region.WALL, Region.LINE_CORE, Region.EDGE))
_AT_BLACK = 0.5
"""Region numbers for the compiled sums; a pixel within half a grey level of black is at black."""
_COUNTED = (Region.LINE_CORE, Region.LINE_FLANK, Region.WALL)


@dataclass
class Comparison:
    """Sums over compared frames.

    Attributes
    ----------
    pixels, before, after : (6,)
        Per `Region`: pixels, and χ² before and after the named causes are applied.
    square, noise, lit : float
        Of lit wall: squared differences, their variance by the noise, and pixels.
    camera : float
        Of lit wall: squared differences over the variance of the camera's noise alone.
    stray : float
        Dark pixels brighter than their twin by more than five σ.
    clipped : bool
        Whether black is so low that the noise of dark pixels is clipped at grey level 0.
    still : float
        Dark pixels that are at black to the grey level.
    seen, view : float
        Pixels whose wall is known, and all pixels within the view, in lit frames; wall too dark to be
        compared counts in neither.
    dim, border : float
        Pixels of such dark wall, and pixels at the edge of the view, in lit frames.
    clipped_wall : float
        Pixels of lit wall at the level where grey levels clip.
    views : list of TwinView
    by_level : (2, L)
        Of lit wall, by the brightness of the twin: pixels, and squares of z.
    """

    pixels: Float = field(default_factory=lambda: np.zeros(len(Region)))
    before: Float = field(default_factory=lambda: np.zeros(len(Region)))
    after: Float = field(default_factory=lambda: np.zeros(len(Region)))
    square: float = 0.0
    noise: float = 0.0
    lit: float = 0.0
    camera: float = 0.0
    stray: float = 0.0
    clipped: bool = False
    still: float = 0.0
    seen: float = 0.0
    view: float = 0.0
    dim: float = 0.0
    border: float = 0.0
    clipped_wall: float = 0.0
    views: list[TwinView] = field(default_factory=list)
    by_level: Float = field(default_factory=lambda: np.zeros((2, len(_LEVELS))))

    def add(
        self, frame: int, light: Illumination, above_black: Float32, before: TwinFrame, after: TwinFrame,
        noise: CameraNoise,
    ) -> None:  # fmt: skip
        """Add a frame; ``above_black`` are its grey levels (H, W) above black."""
        z, sums, of_wall, by_level = _differences(
            before.region, above_black, *_pair(before), *_pair(after), np.array(noise.polynomial),
            np.float32(noise.full_scale), np.array(_LEVELS, np.float32), _STRAY,
        )  # fmt: skip
        (size, before_sum, after_sum), counted = sums[:3], [int(r) for r in _COUNTED]
        self.pixels += size
        self.before += before_sum
        self.after += after_sum
        self.clipped = noise.clips_black
        self.stray, self.still = self.stray + sums[3, 0], self.still + sums[3, 1]
        if light != Illumination.LASER:
            self.lit += float(size[Region.WALL])
            self.square, self.camera, self.noise, self.clipped_wall = (
                float(a + b)
                for a, b in zip(
                    (self.square, self.camera, self.noise, self.clipped_wall), of_wall, strict=True
                )
            )
            self.by_level += by_level
            known = float(size[counted].sum()) + sums[3, 3]
            self.seen, self.view = self.seen + known, self.view + known + float(size[Region.UNSEEN])
            self.dim, self.border = self.dim + sums[3, 2], self.border + sums[3, 3]
        chi2 = after_sum[counted].sum() / max(size[counted].sum(), 1.0)
        self.views.append(_view(frame, light, chi2, above_black, after, z, noise.black.value))

    def regions(self) -> tuple[RegionFit, ...]:
        """Return χ² per pixel by region; NaN where pixels are counted but not compared.

        At the edge of the view a pixel is part wall, part mask, in unknown shares. The noise of dark pixels
        is unknown where it is clipped at black or suppressed by a codec.
        """
        return tuple(
            RegionFit(
                r.name.lower(), int(self.pixels[r]), self._mean(self.before, r), self._mean(self.after, r)
            )
            for r in Region
            if r != Region.UNSEEN
        )

    def levels(self) -> tuple[NamedFigure, ...]:
        """Return χ² per pixel of lit wall for ranges of brightness."""
        return tuple(
            NamedFigure(f"from {low}", square / count, float(np.sqrt(2 / count)))
            for low, count, square in zip(_LEVELS, *self.by_level.tolist(), strict=True)
            if count
        )

    def _mean(self, total: Float, region: Region) -> float:
        left_out = region == Region.EDGE or (region == Region.DARK and self.silent)
        compared = self.pixels[region] and not left_out
        return float(total[region] / self.pixels[region]) if compared else float("nan")

    @property
    def silent(self) -> bool:
        """Whether dark pixels show no noise: it is cut off at black, or less than rounding."""
        return bool(self.clipped or self.still > _SILENT * self.pixels[Region.DARK])

    @property
    def clipped_share(self) -> float:
        """Share of pixels of lit wall at the level where grey levels clip."""
        return self.clipped_wall / max(self.lit, 1.0)

    @property
    def compared_share(self) -> float:
        """Share of the pixels of lit frames that show known wall, dark or not, that is compared."""
        return (self.seen - self.border) / max(self.seen + self.dim, 1.0)

    @property
    def wall_is_clipped(self) -> bool:
        """Whether so much lit wall clips that it is reported."""
        return self.clipped_share > CLIPPED_WALL

    @property
    def chi2_camera(self) -> float:
        """χ² per pixel of lit wall with the camera's noise alone; NaN without lit wall."""
        return self.camera / self.lit if self.lit else float("nan")

    @property
    def stray_share(self) -> float:
        """Share of dark pixels that are brighter than noise explains."""
        return self.stray / max(float(self.pixels[Region.DARK]), 1.0)

    def psnr_db(self, without_noise: bool) -> float:
        """Return 20 log₁₀ of full scale over the RMS difference of lit wall, dB; NaN without lit wall."""
        left = self.square - (self.noise if without_noise else 0.0)
        if not self.lit:
            return float("nan")
        return float(10 * np.log10(_FULL_SCALE**2 * self.lit / left)) if left > 0 else float("inf")


def _pair(twin: TwinFrame) -> tuple[Float32, Float32]:
    return twin.level, twin.variance


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _differences(  # type: ignore[no-untyped-def]
    region, above, level, variance, level_after, variance_after, noise, white, levels, stray
):
    """Return z (H, W) after, and per region pixels and χ² before and after.

    The last row counts stray, still and dim dark pixels, and those of the edge within the view. Then, of lit
    wall: squared differences, those over the camera's noise alone, variances and clipped pixels; last, pixels
    and squares of z by brightness (2, L).
    """
    z, sums = np.empty_like(above), np.zeros((4, 6))
    of_wall, by_level = np.zeros(4), np.zeros((2, len(levels)))
    for i in range(region.shape[0]):
        for j in range(region.shape[1]):
            r, value, twin = region[i, j], above[i, j], level_after[i, j]
            rest = value - level[i, j]
            one = (value - twin) / np.sqrt(variance_after[i, j])
            z[i, j] = one
            sums[0, r] += 1
            sums[1, r] += rest * rest / variance[i, j]
            sums[2, r] += one * one
            if r == _EDGE:
                sums[3, 3] += level[i, j] > 0  # beyond the view, no wall is lit
            elif r == _DARK:
                sums[3, 0] += one > stray
                sums[3, 1] += abs(value) < _AT_BLACK
                sums[3, 2] += level[i, j] > 0
            elif r == _WALL:
                bright = max(twin, 0.0)
                square = (value - twin) ** 2
                of_wall[0] += square
                of_wall[1] += square / (noise[0] + bright * (noise[1] + bright * noise[2]))
                of_wall[2] += variance_after[i, j]
                of_wall[3] += value >= white
                k = 0
                while k + 1 < len(levels) and twin >= levels[k + 1]:
                    k += 1
                by_level[0, k] += 1
                by_level[1, k] += one * one
    return z, sums, of_wall, by_level


def _view(
    frame: int, light: Illumination, chi2: float, above_black: Float32, twin: TwinFrame, z: Float32,
    black: float,
) -> TwinView:  # fmt: skip
    def half(values: Float32) -> Float32:
        small = cv2.resize(values, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        return np.asarray(small, np.float32)

    shown = np.clip(128.5 + 32 * half(np.where(twin.region == Region.UNSEEN, 0, z)), 1, 255)
    unseen = half((twin.region == Region.UNSEEN).astype(np.float32)) > 0.5
    recorded, rendered = (np.clip(half(a) + black + 0.5, 0, 255) for a in (above_black, twin.level))
    return TwinView(
        frame, light.value, float(chi2), recorded.astype(np.uint8), rendered.astype(np.uint8),
        np.where(unseen, 0, shown).astype(np.uint8),
    )  # fmt: skip


def exposure_of(above_black: Float32, twin: TwinFrame) -> float:
    """Return ln of the factor by which a frame is brighter than its twin, over line and lit wall."""
    cross, own = _exposure(above_black, twin.level, twin.variance, twin.region)
    return float(np.log(max(cross / own, 1e-3))) if own > 0 else 0.0


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _exposure(above, level, variance, region):  # type: ignore[no-untyped-def]
    """Return Σ recorded · twin/σ² and Σ twin²/σ² over the line's core and lit wall."""
    cross, own = 0.0, 0.0
    for i in range(region.shape[0]):
        for j in range(region.shape[1]):
            if region[i, j] == _WALL or region[i, j] == _CORE:
                weighted = level[i, j] / variance[i, j]
                cross += weighted * above[i, j]
                own += weighted * level[i, j]
    return cross, own


def of_blocks(values: Float32 | Bool) -> Float32:
    """Return the means (rows, columns) over whole blocks of a picture (H, W)."""
    rows, columns = (n // BLOCK_PX for n in values.shape)
    inside = values[: rows * BLOCK_PX, : columns * BLOCK_PX].astype(np.float32)
    return np.asarray(cv2.resize(inside, (columns, rows), interpolation=cv2.INTER_AREA))


def block_ratios(above_black: Float32, twin: TwinFrame, white_above_black: float) -> Float32:
    """Return recorded over predicted brightness of each block; NaN unless all of it is lit wall."""
    use = (twin.region == Region.WALL) & (above_black < white_above_black)
    level = np.where(use, twin.level, np.float32(0))
    above, below = of_blocks(level * above_black), of_blocks(level * level)
    with np.errstate(divide="ignore", invalid="ignore"):
        # 0.99: a whole block, up to rounding.
        return np.where(of_blocks(use) > 0.99, above / below, np.float32(np.nan)).astype(np.float32)
