"""The camera's noise from the frames themselves, by the photon transfer model of EMVA 1288.

The variance of the residual recorded − predicted in small windows is plotted over level, less its covariance
with the next frame's residual at the same places of the wall: errors of wall and photo recur there, noise
does not. With a linear response, variance = read² + level / (electrons per grey level) + (non-uniformity ·
level)². A power response I^(1/γ) changes the shot noise's variance to level^(2 − γ), which gives γ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from pipeline.arrays import Bool, Float, Float32, Image, Int
from stages.twin.lamp_light import Figure, sd_from_parts

_WINDOW_PX = 12
"""Side of a window, px: the variance of 144 pixels is known to some 12 %, also with correlated neighbours."""
_MOST_ALIKE = 0.5
"""Share of a window's variance that may recur in the next frame: for noise alone it is 0 ± 0.08."""
_LEVELS, _FEWEST, _FEWEST_CELLS = 14, 40, 3
"""Most cells of grey level, windows in each, and fewest cells: the noise has three parts."""
_LEAST_VARIANCE = 1 / 12
"""Variance of rounding to whole grey levels."""
_RANGE_FOR_PARTS = 1.5
"""Ratio of brightest to darkest level needed to separate the noise's parts; chosen."""
_PILE = 16
"""Grey levels over which a lossy codec scatters clipped pixels: H.264 stays within eight. Chosen."""
_RANGE_FOR_GAMMA = 3.0
"""Ratio of brightest to darkest level needed to estimate the response's exponent."""


@dataclass(frozen=True)
class CameraNoise:
    """Noise of one pixel of the grey picture.

    Where grey is computed from three colours with independent noise, it has less noise than each of them, and
    its electrons are those of all three together.

    Attributes
    ----------
    black : Figure
        Grey level without light.
    white : float
        Grey level from which pixels are clipped.
    read_variance, variance_per_level, uneven : Figure
        Read noise² (grey levels²), variance per level (grey levels), and relative non-uniformity, as in EMVA
        1288.
    gamma : Figure
        Exponent γ of the response; σ is infinite where the frames cannot determine it.
    """

    black: Figure
    white: float
    read_variance: Figure
    variance_per_level: Figure
    uneven: Figure
    gamma: Figure

    def variance(self, above_black: Float32) -> Float32:
        """Return the variance (...), grey levels², of pixels at such grey levels above black."""
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
        """Return grey levels (H, W) above black, at most full scale.

        A codec leaves some clipped pixels a little above full scale, which no twin reaches.
        """
        above = image.astype(np.float32) - np.float32(self.black.value)
        return np.asarray(np.minimum(above, np.float32(self.full_scale)), np.float32)

    @property
    def polynomial(self) -> tuple[float, float, float]:
        """Coefficients of the variance as a polynomial of the level, constant first."""
        dark = max(self.read_variance.value, _LEAST_VARIANCE)
        return dark, self.variance_per_level.value, self.uneven.value**2

    @property
    def clips_black(self) -> bool:
        """Whether black lies within three σ of the read noise from grey level 0."""
        return self.black.value < 3 * float(np.sqrt(max(self.read_variance.value, _LEAST_VARIANCE)))

    @property
    def electrons_per_level(self) -> Figure:
        """Electrons per grey level from the photon transfer; infinite where no shot noise is visible."""
        k = self.variance_per_level
        return Figure(np.inf, np.inf) if k.value <= 0 else Figure(1 / k.value, k.sd / k.value**2)

    @property
    def read_levels(self) -> Figure:
        """Read noise, 1 σ, in grey levels, without rounding, which may hide all or add as much again."""
        read = float(np.sqrt(max(self.read_variance.value - _LEAST_VARIANCE, 0.0)))
        sd = float(np.hypot(self.read_variance.sd, _LEAST_VARIANCE))
        return Figure(read, _of_root(read, sd) if np.isfinite(sd) else np.inf)

    @property
    def read_electrons(self) -> Figure:
        """Read noise, 1 σ, in electrons, without rounding; infinite where the conversion is.

        Read noise and conversion come from one fit, in which one gains what the other loses: their σ are
        added.
        """
        e, read = self.electrons_per_level, self.read_levels
        if not np.isfinite(e.value):
            return Figure(np.inf, np.inf)
        sd = read.sd * e.value + read.value * e.sd if np.isfinite([read.sd, e.sd]).all() else np.inf
        return Figure(read.value * e.value, sd)


@dataclass(frozen=True)
class NoiseWindows:
    """Level above black and variance of noise alone, (N,) each, of the windows of one frame."""

    level: Float
    variance: Float


def windows_of(left_over: Float32, again: Float32, level: Float32, use: Bool) -> NoiseWindows:
    """Return the windows of a frame in which all pixels may be used, each without its mean slope.

    What recurs in the next frame at the same places of the wall is subtracted, since it is no noise. The half
    of the windows with the faintest texture is used, because errors of the poses matter least there.

    Parameters
    ----------
    left_over, level, use : (H, W)
        Recorded minus predicted, predicted above black, and which pixels may be used.
    again : (H, W)
        Recorded minus predicted in the next frame, at the wall place that each pixel shows.
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
    """Return the noise from windows of several frames; σ from leaving out one frame at a time.

    Each part of the noise is at least 0, except in the estimate of σ: parts clipped at 0 in every fit would
    have σ 0. Errors of the photo that do not recur look like non-uniformity: the truth is taken to be uniform
    between the parts fitted with and without it. Windows of one grey level determine only the sum of the
    parts, which is then read noise; with few levels, or where all frames but one have few, no σ is finite.
    """
    value, others = _fitted(_Cells.of(windows)), (windows[:k] + windows[k + 1 :] for k in range(len(windows)))
    each = [_Cells.of(some) for some in (windows, *others)]
    parted = [c.free for c in each if c is not None and c.part_the_noise]
    if len(parted) < len(each):
        return _camera_noise(value, np.full(4, np.inf), black, white)
    sd = np.nan_to_num(sd_from_parts(np.array(parted[1:])), nan=np.inf)
    apart = each[0].free - each[0].even if each[0] is not None else np.zeros(4)
    read, per_level, square, gamma = np.hypot(sd, apart / np.sqrt(3))
    uneven = _of_root(float(value[2]), float(square))
    return _camera_noise(value, np.array([read, per_level, uneven, gamma]), black, white)


def _of_root(root: float, sd: float) -> float:
    """Return the 1 σ of a root from that of its square: half of the distance to the farther end of ±2 σ."""
    ends = np.sqrt(max(root**2 - 2 * sd, 0.0)), np.sqrt(root**2 + 2 * sd)
    return float(max(root - ends[0], ends[1] - root)) / 2


def _camera_noise(value: Float, sd: Float, black: Figure, white: float) -> CameraNoise:
    read, per_level, uneven, gamma = (Figure(float(v), float(s)) for v, s in zip(value, sd, strict=True))
    if not np.isfinite(gamma.value):
        gamma = Figure(1.0, np.inf)
    return CameraNoise(black, white, read, per_level, uneven, gamma)


@dataclass(frozen=True)
class _Cells:
    """Mean level and variance (C,) over windows of similar brightness."""

    level: Float
    variance: Float

    @classmethod
    def of(cls, windows: list[NoiseWindows]) -> _Cells | None:
        """Return the cells; None with too few windows."""
        level = np.concatenate([np.zeros(0), *(w.level for w in windows)])
        variance = np.concatenate([np.zeros(0), *(w.variance for w in windows)])
        cells = min(_LEVELS, len(level) // _FEWEST)
        if cells < _FEWEST_CELLS:
            return None
        edges = np.quantile(level, np.linspace(0, 1, cells + 1))
        cell = np.clip(np.searchsorted(edges, level) - 1, 0, cells - 1)
        used = [k for k in range(cells) if (cell == k).sum() >= _FEWEST // 2]
        # Where black clips the noise, windows show none.
        floored = [max(float(variance[cell == k].mean()), _LEAST_VARIANCE) for k in used]
        return cls(np.array([level[cell == k].mean() for k in used]), np.array(floored))

    @property
    def of_one_level(self) -> bool:
        """Whether levels differ too little to separate the parts of the noise."""
        return bool(self.level.max() < _RANGE_FOR_PARTS * max(self.level.min(), 1.0))

    @property
    def part_the_noise(self) -> bool:
        """Whether levels separate the parts of the noise; equal levels leave fewer cells than planned."""
        return len(self.level) >= _FEWEST_CELLS and not self.of_one_level

    @property
    def design(self) -> Float:
        """(C, 3) parts of the noise relative to each cell's variance."""
        x = self.level
        return np.asarray(np.stack([np.ones_like(x), x, x**2], 1) / self.variance[:, None])

    @property
    def free(self) -> Float:
        """Return read variance, variance per level, squared non-uniformity (all unclipped), and γ."""
        size = np.linalg.lstsq(self.design, np.ones_like(self.level), rcond=None)[0]
        return np.array([*size, self.gamma])

    @property
    def even(self) -> Float:
        """Return the same for pixels that are all alike."""
        size = np.linalg.lstsq(self.design[:, :2], np.ones_like(self.level), rcond=None)[0]
        return np.array([*size, 0.0, self.gamma])

    @property
    def gamma(self) -> float:
        """Exponent of the response; NaN where the cells cannot determine it.

        Read noise and non-uniformity bend the variance as a response does: where a linear response with both
        fits the cells as well, it is unknown.
        """
        x, shot = np.maximum(self.level, 1.0), self.variance - _LEAST_VARIANCE
        if len(x) <= 3 or x.max() <= _RANGE_FOR_GAMMA * x.min() or not (shot > 0).all():
            return float("nan")
        power, log_size = np.polyfit(np.log(x), np.log(shot), 1)
        off = (np.exp(log_size) * x**power + _LEAST_VARIANCE) / self.variance - 1
        linear = nnls(self.design, np.ones_like(x))[1]
        return float("nan") if linear <= np.linalg.norm(off) else 2 - float(power)


def _fitted(cells: _Cells | None) -> Float:
    """Return read variance, variance per level, non-uniformity and γ."""
    if cells is None:
        return np.array([_LEAST_VARIANCE, 0.0, 0.0, np.nan])
    if cells.of_one_level:
        return np.array([cells.variance.mean(), 0.0, 0.0, np.nan])
    (read, per_level, square), _ = nnls(cells.design, np.ones_like(cells.level))
    return np.array([max(read, _LEAST_VARIANCE), per_level, np.sqrt(square), cells.gamma])


def black_and_white(images: list[Float32]) -> tuple[Figure, float]:
    """Return the level of the darkest tenth of the pixels, and the level at which pixels clip, if any."""
    # The darkest tenth: in frames of the laser alone, nine tenths of the pixels see no line.
    dark = [float(np.median(i[i <= np.quantile(i, 0.1)])) for i in images]
    sd = float(np.sqrt(np.var(dark) / len(dark) + _LEAST_VARIANCE))
    black = Figure(float(np.median(dark)), sd)
    every = [np.bincount(np.clip(i, 0, 255).astype(np.uint8).ravel(), minlength=256) for i in images]
    return black, _full_scale(np.sum(every, 0))


def _full_scale(count: Int) -> float:
    """Return the level from which pixels, counted by level (256,), are clipped; infinite where none are.

    A lossy codec spreads clipped pixels over some levels on both sides: the peak and its upper side reveal
    them.
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
