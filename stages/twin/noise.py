"""The camera's noise from the frames themselves, by EMVA 1288's model of the photon transfer.

Variance over level of what the twin leaves over in small windows, less what it leaves over alike in the next
frame at the same places of the wall: errors of wall and photo come back, noise does not. With an even
response variance = read² + level / (electrons per grey level) + (non-uniformity · level)². A power response
I^(1/γ) makes the shot noise's variance go with level^(2 − γ) instead, which gives γ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from pipeline.adjustment.robust import left_out_sd
from pipeline.arrays import Bool, Float, Float32, Image, Int
from stages.twin.lamp_light import Figure

_WINDOW_PX = 12
"""Side of a window: the variance of 144 pixels is known to some 12 %, also where neighbours are alike."""
_MOST_ALIKE = 0.5
"""Share of a window's variance that may come back in the next frame: noise alone gives 0 ± 0.08."""
_LEVELS, _FEWEST, _FEWEST_CELLS = 14, 40, 3
"""Most cells of grey level, windows that each has, and fewest cells: noise has three figures."""
_LEAST_VARIANCE = 1 / 12
"""Of rounding to whole grey levels."""
_RANGE_FOR_PARTS = 1.5
"""Ratio of brightest to darkest level needed to tell the noise's parts from each other; chosen."""
_PILE = 16
"""Grey levels within which a lossy codec leaves clipped pixels: H.264 leaves them within eight. Chosen."""
_RANGE_FOR_GAMMA = 3.0
"""Ratio of brightest to darkest level needed to tell the response's exponent."""


@dataclass(frozen=True)
class CameraNoise:
    """Noise of one pixel of the grey picture.

    Where grey is made of three colours whose noise is apart, it has less noise than each of them, and its
    electrons are those of all three together.

    Attributes
    ----------
    black : Figure
        Grey level without light.
    white : float
        Grey level from which pixels are clipped.
    read_variance, variance_per_level, uneven : Figure
        Of EMVA 1288's model, in grey levels squared, grey levels, and relative.
    gamma : Figure
        Exponent γ of the response; σ is infinite where the frames cannot tell.
    """

    black: Figure
    white: float
    read_variance: Figure
    variance_per_level: Figure
    uneven: Figure
    gamma: Figure

    def variance(self, above_black: Float32) -> Float32:
        """Return the variance (...) of pixels so many grey levels above black."""
        dark, shot, square = (np.float32(c) for c in self.polynomial)
        level = np.maximum(above_black, np.float32(0))
        out = np.multiply(level, square)
        out += shot
        out *= level
        out += dark
        return out

    @property
    def full_scale(self) -> float:
        """Grey levels above black from which pixels are clipped."""
        return self.white - self.black.value

    def above_black(self, image: Image | Float32) -> Float32:
        """Return grey levels (H, W) above black.

        A codec leaves clipped pixels a little above full scale, where no twin can be.
        """
        above = image.astype(np.float32) - np.float32(self.black.value)
        return np.asarray(np.minimum(above, np.float32(self.full_scale)), np.float32)

    @property
    def polynomial(self) -> tuple[float, float, float]:
        """Coefficients of the variance over the level, from the constant on."""
        dark = max(self.read_variance.value, _LEAST_VARIANCE)
        return dark, self.variance_per_level.value, self.uneven.value**2

    @property
    def clips_black(self) -> bool:
        """Whether black lies within three σ of the read noise of grey level 0."""
        return self.black.value < 3 * float(np.sqrt(max(self.read_variance.value, _LEAST_VARIANCE)))

    @property
    def electrons_per_level(self) -> Figure:
        """Conversion of the photon transfer; infinite where no shot noise shows."""
        k = self.variance_per_level
        return Figure(np.inf, np.inf) if k.value <= 0 else Figure(1 / k.value, k.sd / k.value**2)

    @property
    def read_electrons(self) -> Figure:
        """Read noise, 1 σ, in electrons of the conversion above, rounding taken off; infinite as that is.

        One fit gives read noise and conversion: what one gains the other loses, so that their σ add. Of
        noise below a grey level rounding may show none, or as much again as its own.
        """
        e, variance = self.electrons_per_level, max(self.read_variance.value - _LEAST_VARIANCE, 0.0)
        if not np.isfinite(e.value):
            return Figure(np.inf, np.inf)
        read, sd = float(np.sqrt(variance)), float(np.hypot(self.read_variance.sd, _LEAST_VARIANCE))
        if not np.isfinite([sd, e.sd]).all():
            return Figure(read * e.value, np.inf)
        return Figure(read * e.value, _of_root(read, sd) * e.value + read * e.sd)


@dataclass(frozen=True)
class NoiseWindows:
    """Level above black and variance of noise alone, (N,) each, of the windows of one frame."""

    level: Float
    variance: Float


def windows_of(left_over: Float32, again: Float32, level: Float32, use: Bool) -> NoiseWindows:
    """Return the windows of a frame in which all pixels may be used, slopes taken out of each.

    What the next frame shows alike at the same places of the wall is no noise, and is taken off. Of the
    windows, the half with the faintest texture counts: there poses that err leave least.

    Parameters
    ----------
    left_over, level, use : (H, W)
        Recorded less predicted, predicted above black, and which pixels count.
    again : (H, W)
        Recorded less predicted of the next frame, where that shows the wall of each pixel.
    """
    rows, columns = (n // _WINDOW_PX for n in left_over.shape)

    def cut(values: Float32) -> Float32:
        inside = values[: rows * _WINDOW_PX, : columns * _WINDOW_PX]
        shape = (rows, _WINDOW_PX, columns, _WINDOW_PX)
        return inside.reshape(shape).transpose(0, 2, 1, 3).reshape(-1, _WINDOW_PX**2)

    whole = cut(use.astype(np.float32)).all(1)
    side = np.arange(_WINDOW_PX) - (_WINDOW_PX - 1) / 2
    plane = np.stack([np.ones(_WINDOW_PX**2), np.repeat(side, _WINDOW_PX), np.tile(side, _WINDOW_PX)], 1)
    plane /= np.linalg.norm(plane, axis=0)
    mean = cut(np.nan_to_num(level))[whole].mean(1).astype(float)
    rest, other, texture = (cut(np.nan_to_num(a))[whole].astype(float) for a in (left_over, again, level))
    rest, other, texture = (a - (a @ plane) @ plane.T for a in (rest, other, texture))
    square, alike = ((rest * a).sum(1) / (_WINDOW_PX**2 - 3) for a in (rest, other))
    contrast = texture.std(1) / np.maximum(mean, 1.0)
    quiet = (alike < _MOST_ALIKE * square) | (square < _LEAST_VARIANCE)
    quiet &= contrast <= np.median(contrast) if len(contrast) else False
    return NoiseWindows(mean[quiet], (square - alike)[quiet])


def photon_transfer(windows: list[NoiseWindows], black: Figure, white: float) -> CameraNoise:
    """Return the noise that windows of several frames show; σ from leaving out one frame at a time.

    Each part of the noise is 0 at least, but not where σ is told: it would be 0 for parts that are 0 in every
    fit. Windows of one grey level show the sum of the parts alone, which is then read noise; of few levels,
    or where all frames but one have few, every σ is infinite.
    """
    value, others = _fitted(_Cells.of(windows)), (windows[:k] + windows[k + 1 :] for k in range(len(windows)))
    each = [_Cells.of(some) for some in (windows, *others)]
    parted = [c.free for c in each if c is not None and c.part_the_noise]
    if len(parted) < len(each):
        return _camera_noise(value, np.full(4, np.inf), black, white)
    read, per_level, square, gamma = np.nan_to_num(left_out_sd(np.array(parted[1:])), nan=np.inf)
    uneven = _of_root(float(value[2]), float(square))
    return _camera_noise(value, np.array([read, per_level, uneven, gamma]), black, white)


def _of_root(root: float, sd: float) -> float:
    """Return the 1 σ of a root whose square has a σ: half the way, by two of these, to the farther end."""
    ends = np.sqrt(max(root**2 - 2 * sd, 0.0)), np.sqrt(root**2 + 2 * sd)
    return float(max(root - ends[0], ends[1] - root)) / 2


def _camera_noise(value: Float, sd: Float, black: Figure, white: float) -> CameraNoise:
    read, per_level, uneven, gamma = (Figure(float(v), float(s)) for v, s in zip(value, sd, strict=True))
    if not np.isfinite(gamma.value):
        gamma = Figure(1.0, np.inf)
    return CameraNoise(black, white, read, per_level, uneven, gamma)


@dataclass(frozen=True)
class _Cells:
    """Mean level and variance (C,) of cells of windows that are alike bright."""

    level: Float
    variance: Float

    @classmethod
    def of(cls, windows: list[NoiseWindows]) -> _Cells | None:
        """Return the cells; None where windows are too few."""
        level = np.concatenate([np.zeros(0), *(w.level for w in windows)])
        variance = np.concatenate([np.zeros(0), *(w.variance for w in windows)])
        cells = min(_LEVELS, len(level) // _FEWEST)
        if cells < _FEWEST_CELLS:
            return None
        edges = np.quantile(level, np.linspace(0, 1, cells + 1))
        cell = np.clip(np.searchsorted(edges, level) - 1, 0, cells - 1)
        used = [k for k in range(cells) if (cell == k).sum() >= _FEWEST // 2]
        # Where black cuts noise off, windows show none at all.
        floored = [max(float(variance[cell == k].mean()), _LEAST_VARIANCE) for k in used]
        return cls(np.array([level[cell == k].mean() for k in used]), np.array(floored))

    @property
    def of_one_level(self) -> bool:
        """Whether levels differ too little to part the noise."""
        return bool(self.level.max() < _RANGE_FOR_PARTS * max(self.level.min(), 1.0))

    @property
    def part_the_noise(self) -> bool:
        """Whether levels tell the noise's parts from each other; equal levels leave fewer cells than made."""
        return len(self.level) >= _FEWEST_CELLS and not self.of_one_level

    @property
    def design(self) -> Float:
        """(C, 3) parts of the noise over each cell's variance."""
        x = self.level
        return np.asarray(np.stack([np.ones_like(x), x, x**2], 1) / self.variance[:, None])

    @property
    def free(self) -> Float:
        """Read variance, variance per level and square of unevenness, below 0 if need be, and γ."""
        size = np.linalg.lstsq(self.design, np.ones_like(self.level), rcond=None)[0]
        return np.array([*size, self.gamma])

    @property
    def gamma(self) -> float:
        """Exponent of the response; NaN where cells cannot tell."""
        x, shot = self.level, self.variance - _LEAST_VARIANCE
        if len(x) <= 3 or x.max() <= _RANGE_FOR_GAMMA * max(x.min(), 1.0) or not (shot > 0).all():
            return float("nan")
        return 2 - float(np.polyfit(np.log(np.maximum(x, 1.0)), np.log(shot), 1)[0])


def _fitted(cells: _Cells | None) -> Float:
    """Return read variance, variance per level, unevenness and γ."""
    if cells is None:
        return np.array([_LEAST_VARIANCE, 0.0, 0.0, np.nan])
    if cells.of_one_level:
        return np.array([cells.variance.mean(), 0.0, 0.0, np.nan])
    (read, per_level, square), _ = nnls(cells.design, np.ones_like(cells.level))
    return np.array([max(read, _LEAST_VARIANCE), per_level, np.sqrt(square), cells.gamma])


def black_and_white(images: list[Float32]) -> tuple[Figure, float]:
    """Return the level of the darkest tenth of the pixels, and the level at which pixels pile up, if any."""
    # The darkest tenth: in pictures of the laser alone nine tenths see no line.
    dark = [float(np.median(i[i <= np.quantile(i, 0.1)])) for i in images]
    sd = float(np.sqrt(np.var(dark) / len(dark) + _LEAST_VARIANCE))
    black = Figure(float(np.median(dark)), sd)
    every = [np.bincount(np.clip(i, 0, 255).astype(np.uint8).ravel(), minlength=256) for i in images]
    return black, _full_scale(np.sum(every, 0))


def _full_scale(count: Int) -> float:
    """Return the level from which pixels, counted by level (256,), are clipped; infinite where none pile up.

    A lossy codec spreads the pile over some levels to both sides: its peak and its upper side tell it.
    """
    top = int(np.flatnonzero(count)[-1])
    first = max(top - _PILE, 1)
    peak = first + int(np.argmax(count[first : top + 1]))
    before = count[max(peak - _PILE, 0) : max(peak - _PILE // 2, 1)]
    if not before.size or count[peak] <= 2 * max(float(before.max()), 1.0):
        return float(np.inf)
    above = np.arange(top + 1 - peak)
    spread = float(np.sqrt(np.average(above**2, weights=count[peak : top + 1])))
    return float(np.floor(peak - 2 * spread))
