"""Light of the LEDs: falloff over the polar angle, pattern around the picture, exposure of frames, with σ.

A lit pixel is  black + gain(frame) · exp(f(θ) + pattern(φ)) · E · ρ,  with E the irradiance by LEDs that emit
uniformly and ρ the wall's reflectance; f is the LEDs' lobe times the lens's vignetting, which pictures alone
cannot separate. Exposure and vignetting are separated as in direct visual odometry (J. Engel et al., "A
photometrically calibrated benchmark for monocular visual odometry", 2016); for the response see
`stages.twin.noise`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.stats import norm, t

from pipeline.adjustment.robust import left_out_sd, robust_spread
from pipeline.arrays import Float, Float32, Int
from stages.twin.scene import LitSight, Scene

_THETA_KNOTS, _HARMONICS = 24, 2
# Fewest grey levels above black at which a pixel is used to estimate the light.
DARK = 4.0
_ITERATIONS = 4
_WEAK = 1e-3
"""Weight that draws unknowns without samples to zero."""
_SAMPLES, _LEFT_OUT = 2500, 6
"""Samples of each frame. Parts of consecutive frames that are left out once for the pattern's σ."""
_INTERVAL = 0.975
"""Normal errors are within 1.96 σ in 95 %: that interval few parts must hold, too."""


@dataclass(frozen=True)
class Figure:
    """A number and its 1 σ."""

    value: float
    sd: float


@dataclass(frozen=True)
class Course:
    """A quantity of every frame, measured in some of them.

    Attributes
    ----------
    frame : (F,) int
    log_value, sd : (F,)
        Natural logarithm, relative to the mean of all, and its 1 σ.
    """

    frame: Int
    log_value: Float
    sd: Float

    def at(self, frame: int) -> float:
        """Return the logarithm at a frame, interpolated linearly between measured frames."""
        return float(np.interp(frame, self.frame, self.log_value)) if len(self.frame) else 0.0

    @property
    def spread(self) -> float:
        """Robust 1 σ of steps between samples about their mean, over √2: a steady drift does not count.

        Where brightness alternates, one of two sizes of steps is the median of an odd number of them.
        """
        if len(self.frame) < 3:
            return 0.0
        step = np.diff(self.log_value)
        return robust_spread(step - step.mean()) / float(np.sqrt(2))


@dataclass(frozen=True)
class LampLight:
    """Light of the LEDs as the lens shows it.

    Attributes
    ----------
    level : float
        Grey levels of white wall at the ring.
    theta_rad, log_falloff, falloff_sd : (K,)
        Logarithm of the LEDs' lobe times vignetting over polar angle, 0 at the ring, and its 1 σ.
    pattern : (4,)
        cos and sin of the first and second harmonic around the image; their 1 σ is ``pattern_sd``.
    gain : Course
        Exposure.
    """

    level: float
    theta_rad: Float
    log_falloff: Float
    falloff_sd: Float
    pattern: Float
    pattern_sd: Float
    gain: Course

    def factor(self, theta_rad: Float32, phi_rad: Float32) -> Float32:
        """Return the grey levels (H, W) that even light gives to wall, per unit of the photo."""
        first, step = self.theta_rad[0], self.theta_rad[1] - self.theta_rad[0]
        index = np.clip((theta_rad - np.float32(first)) / np.float32(step), 0, len(self.theta_rad) - 1)
        log = map_coordinates(self.log_falloff.astype(np.float32), [np.nan_to_num(index)], order=1)
        log += self.around(phi_rad)
        return np.asarray(np.float32(self.level) * np.exp(log), np.float32)

    def around(self, phi_rad: Float32) -> Float32:
        """Return the logarithm (...) of the light at image azimuths over its mean around the picture."""
        log = np.zeros_like(phi_rad)
        for k, (basis, m) in enumerate(_around(_HARMONICS)):
            log += np.float32(self.pattern[k]) * basis(np.float32(m) * phi_rad)
        return log


def _around(harmonics: int) -> list[tuple[np.ufunc, int]]:
    return [(basis, m) for m in range(1, harmonics + 1) for basis in (np.cos, np.sin)]


class LampSamples:
    """Collects ratios of recorded brightness to reflectance under even light, frame by frame."""

    def __init__(self, scene: Scene, black: float, white: float) -> None:
        self._scene, self._black, self._white = scene, black, white
        self._frame: list[int] = []
        self._parts: list[tuple[Float32, Float32, Float32]] = []

    def add(self, frame: int, image: Float32, sight: LitSight, random: np.random.Generator) -> None:
        """Take samples of a frame (H, W)."""
        theta, phi, _ = self._scene.polar
        rows, columns = (random.integers(0, n, 4 * _SAMPLES) for n in image.shape)
        grey = image[rows, columns] - self._black
        even = (sight.reflectance * sight.irradiance)[rows, columns]
        use = (grey > DARK) & (image[rows, columns] < self._white) & (even > DARK)
        if int(use.sum()) < _THETA_KNOTS:
            return
        self._frame.append(frame)
        self._parts.append(
            (theta[rows, columns][use], phi[rows, columns][use], np.log(grey[use] / even[use]))
        )

    def solve(self) -> LampLight | None:
        """Return the light that fits the samples; None without samples.

        The pattern's σ comes from leaving out parts of the frames in turn: pixels side by side err alike, by
        the same poses and the same photo. As independent ones they made it a fifth to a thirtieth of that. A
        single frame does not show it, and it is infinite.
        """
        if not self._parts:
            return None
        frames = np.arange(len(self._parts))
        every = np.concatenate([p[0] for p in self._parts])
        knots = np.linspace(float(every.min()), float(every.max()), _THETA_KNOTS)
        light = self._fitted(frames, knots)
        if len(frames) < 2:
            return replace(light, pattern_sd=np.full(2 * _HARMONICS, np.inf))
        parts = np.array_split(frames, min(_LEFT_OUT, len(frames)))
        without = [self._fitted(np.setdiff1d(frames, p), knots).pattern for p in parts]
        return replace(light, pattern_sd=np.hypot(light.pattern_sd, sd_from_parts(np.array(without))))

    def _fitted(self, frames: Int, knots: Float) -> LampLight:
        """Return the light that fits the samples of some frames, with σ as if all were independent."""
        chosen = [self._parts[k] for k in frames]
        theta, phi, ratio = (np.concatenate([p[k] for p in chosen]).astype(float) for k in range(3))
        view = np.repeat(np.arange(len(chosen)), [len(p[0]) for p in chosen])
        ring = np.arctan2(self._scene.surface.mean_radius_mm, self._scene.probe.laser.baseline_mm)
        hats = _hats(theta, knots) - _hats(np.array([ring]), knots)
        waves = np.stack([basis(m * phi) for basis, m in _around(_HARMONICS)], 1)
        views = np.eye(len(chosen))[view]
        solution, sd = _robust_least_squares(np.concatenate([hats, waves, views], 1), ratio)
        a, b = _THETA_KNOTS, _THETA_KNOTS + 2 * _HARMONICS
        mean = float(solution[b:].mean())
        gain = Course(np.array(self._frame)[frames], solution[b:] - mean, sd[b:])
        at_ring = float(np.interp(ring, knots, solution[:a]))
        return LampLight(
            float(np.exp(mean)), knots, solution[:a] - at_ring, sd[:a], solution[a:b], sd[a:b], gain
        )


def sd_from_parts(without: Float) -> Float:
    """Return the 1 σ (...) of a figure from its values (N, ...) without each of N parts of the frames.

    It is widened so that 1.96 σ are 95 %: N parts show their own scatter with N − 1 degrees of freedom
    (Student, 1908), by which the σ from two is too small by 6.5.
    """
    return float(t.ppf(_INTERVAL, len(without) - 1) / norm.ppf(_INTERVAL)) * left_out_sd(without)


def _hats(value: Float, knots: Float) -> Float:
    """Return hat functions (N, K) of values (N,) over uniform knots (K,)."""
    x = (value - knots[0]) / (knots[1] - knots[0])
    return np.asarray(np.maximum(0.0, 1 - np.abs(x[:, None] - np.arange(len(knots)))))


def _robust_least_squares(design: Float, value: Float) -> tuple[Float, Float]:
    """Return solution and 1 σ (U,) with Huber weights; samples count as independent."""
    weight = np.ones(len(value))
    ridge = _WEAK * np.eye(design.shape[1])
    for _ in range(_ITERATIONS):
        normal = (design.T * weight) @ design + ridge
        solution = np.linalg.solve(normal, (design.T * weight) @ value)
        rest = value - design @ solution
        spread = robust_spread(rest)
        weight = np.minimum(1, 1.345 * spread / np.maximum(np.abs(rest), 1e-9))
    return np.asarray(solution, float), spread * np.sqrt(np.diag(np.linalg.inv(normal)))
