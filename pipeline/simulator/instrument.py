"""The true instrument of a scene: the stated probe and all that makes the true one differ from it.

Light is measured in full scales of the sensor: 1 is the light at which a pixel clips.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.stats import exponnorm

from pipeline.arrays import Float
from pipeline.instrument.camera import Camera
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Shutter
from pipeline.simulator.window import Window

Bgr = tuple[float, float, float]
# An exponentially modified Gaussian has a skewness below 2 (a pure exponential); 1.9 leaves a normal part.
_LARGEST_SKEWNESS = 1.9


@dataclass(frozen=True)
class LineProfile:
    """Density of light over the height above the sheet, forward positive; its mean is at height 0.

    Attributes
    ----------
    sigma_mm : float
        1 σ.
    skewness : float
        Of the sheet itself, −1.9 to 1.9: a normal and an exponential added (exponentially modified Gaussian).
    transport_mm : float
        Mean length of a one-sided exponential tail that the wall's material adds; it moves the mean.
    copy_relative, copy_mm : float
        Height of a faint copy over that of the line, and its distance.
    """

    sigma_mm: float = 0.15
    skewness: float = 0.0
    transport_mm: float = 0.0
    copy_relative: float = 0.0
    copy_mm: float = 0.0

    def density(self, height_mm: Float) -> Float:
        """Return the density (...), 1/mm, at heights (...)."""
        height = np.asarray(height_mm, float)
        copy = self.copy_relative * self._line(height - self.copy_mm) if self.copy_relative else 0.0
        return self._line(height) + copy

    def reach_mm(self) -> tuple[float, float]:
        """Return heights outside which the density is below 10⁻⁶ of the peak."""
        tail = 16 * abs(self._exponential_mm())
        low = -5.4 * self.sigma_mm - (tail if self.skewness < 0 else 0.0)
        high = 5.4 * self.sigma_mm + (tail if self.skewness > 0 else 0.0) + 16 * self.transport_mm
        moved = self.copy_mm if self.copy_relative else 0.0
        return low + min(moved, 0.0), high + max(moved, 0.0)

    def _exponential_mm(self) -> float:
        """Return the mean of the exponential part: skewness = 2 (τ/σ)³."""
        skewness = float(np.clip(self.skewness, -_LARGEST_SKEWNESS, _LARGEST_SKEWNESS))
        return float(np.cbrt(skewness / 2) * self.sigma_mm)

    def _line(self, height_mm: Float) -> Float:
        own = self._own(height_mm)
        if not self.transport_mm:
            return own
        node, weight = np.polynomial.laguerre.laggauss(24)
        parts = (w * self._own(height_mm - n * self.transport_mm) for n, w in zip(node, weight, strict=True))
        return np.asarray(sum(parts))

    def _own(self, height_mm: Float) -> Float:
        tau = self._exponential_mm()
        # Skewness is proportional to (tau / sigma)³: 1e-9 here, far below what a picture shows.
        if abs(tau) < 1e-3 * self.sigma_mm:
            bell = np.exp(-0.5 * (height_mm / self.sigma_mm) ** 2)
            return np.asarray(bell / (self.sigma_mm * np.sqrt(2 * np.pi)))
        normal = float(np.sqrt(self.sigma_mm**2 - tau**2))
        signed = np.sign(tau) * height_mm
        return np.asarray(exponnorm.pdf(signed, abs(tau) / normal, loc=-abs(tau), scale=normal))


@dataclass(frozen=True)
class TrueCamera:
    """A camera of one of the pipeline's models, and what that model leaves out.

    Attributes
    ----------
    model : Camera
        Central camera.
    aspect : float
        Ratio of pixel sides less one: u is stretched by 1 + aspect/2, v shrunk by as much, about the centre.
    decentring : (float, float)
        (p cos ψ₀, p sin ψ₀) of Brown's decentring in normalised image coordinates m = θ (cos ψ, sin ψ):
        a point moves by p (|m|² + 2 m mᵀ) towards ψ₀, 3 f p θ² in radius on that side.
    pupil_shift_mm : float
        ε of the entrance pupil's way along the axis, E(θ) = ε (θ / sin θ − 1), forward positive.
    locking_px : float
        Amplitude a by which a line at image radius ρ appears at ρ + a sin 2πρ.
    windows : tuple of Window
        Refracting surfaces between camera and wall, in the order in which a viewing ray meets them.
    """

    model: Camera
    aspect: float = 0.0
    decentring: tuple[float, float] = (0.0, 0.0)
    pupil_shift_mm: float = 0.0
    locking_px: float = 0.0
    windows: tuple[Window, ...] = ()


@dataclass(frozen=True)
class SheetWave:
    """One wave of a sheet's elevation: cosine and sine amplitude, rad, of ``order`` waves around it."""

    order: int
    cos_rad: float
    sin_rad: float


@dataclass(frozen=True)
class Sector:
    """A dimmed sector of the sheet: share of light lost, middle, and width at half of that loss."""

    lost: float
    azimuth_rad: float
    width_rad: float

    def left(self, azimuth_rad: Float) -> Float:
        """Return the remaining share of light (...) at azimuths (...)."""
        away = np.angle(np.exp(1j * (np.asarray(azimuth_rad) - self.azimuth_rad)))
        return np.asarray(1 - self.lost * 0.5 ** ((2 * away / self.width_rad) ** 8))


@dataclass(frozen=True)
class TrueLaser:
    """The true laser sheet.

    Attributes
    ----------
    sheet : LaserSheet
        Tilt, cone, decentre, waves up to the fourth. Its ``line_sigma_mm`` is not used: see ``profile``.
    waves : tuple of SheetWave
        Further waves of any order.
    profile : LineProfile
        Light across the sheet.
    power_mm : float
        Line's light integrated across the sheet, full scales × mm, on a white wall 50 mm from the axis that
        the sheet meets squarely; falls with 1/distance.
    brightness : (float, float)
        Relative first harmonic (cos, sin) of the power around the ring.
    sectors : tuple of Sector
        Where the sheet is dimmed or blocked.
    colour_bgr : Bgr
        Share of each channel; the largest is 1.
    ghost_relative : float
        Share of the line's light that a wall reflects as a mirror, to be seen across the bore.
    speckle_contrast : float
    speckle_grain_mm : float
        Size of the cells of the wall over which speckle is constant.
    windows : tuple of Window
        Refracting surfaces between laser and wall.
    """

    sheet: LaserSheet
    waves: tuple[SheetWave, ...] = ()
    profile: LineProfile = field(default_factory=LineProfile)
    power_mm: float = 0.6
    brightness: tuple[float, float] = (0.0, 0.0)
    sectors: tuple[Sector, ...] = ()
    colour_bgr: Bgr = (0.35, 1.0, 0.15)
    ghost_relative: float = 0.0
    speckle_contrast: float = 0.0
    speckle_grain_mm: float = 0.05
    windows: tuple[Window, ...] = ()


@dataclass(frozen=True)
class LedRing:
    """LEDs on a circle about the camera, facing forward.

    Attributes
    ----------
    leds, radius_mm, z_mm
        Number, circle's radius and plane in C.
    level : float
        Light of the whole ring, full scales, on a white wall that faces it squarely from 50 mm.
    lobe, even : float
        Emission even + (1 − even) cos^m about the forward direction, with exponent m = lobe; none backward.
    colour_bgr : Bgr
    pattern : tuple of float
        Light of each LED over its share of the whole; empty: all 1.
    """

    leds: int = 8
    radius_mm: float = 11.0
    z_mm: float = -1.0
    level: float = 2.0
    lobe: float = 1.0
    even: float = 0.0
    colour_bgr: Bgr = (1.0, 1.0, 1.0)
    pattern: tuple[float, ...] = ()


def lamp_azimuth_rad(leds: int) -> Float:
    """Return the azimuths (leds,) of the LEDs of a ring in C."""
    return np.asarray(2 * np.pi * (np.arange(leds) + 0.5) / leds)


@dataclass(frozen=True)
class Flicker:
    """Lights whose power is 1 + relative · sin 2πft of its mean."""

    relative: float = 0.0
    frequency_hz: float = 1.0

    def mean(self, middle_s: Float, exposure_s: float) -> Float:
        """Return the mean power (...) over exposures about moments (...)."""
        part = self.relative * np.sinc(self.frequency_hz * exposure_s)
        return np.asarray(1 + part * np.sin(2 * np.pi * self.frequency_hz * np.asarray(middle_s)))


@dataclass(frozen=True)
class Dust:
    """A spot on the front glass that absorbs the share ``attenuation``; place and 1 σ in pixels."""

    attenuation: float
    centre_px: tuple[float, float]
    sigma_px: tuple[float, float]


@dataclass(frozen=True)
class TrueSensor:
    """From light to grey levels.

    Attributes
    ----------
    full_well_e : float
        Electrons at which the sensor clips.
    read_noise_e : float
    black_level : float
        Grey level without light, of 255.
    gamma : float
        Grey = 255 · light^gamma.
    psf_sigma_px, psf_edge_px : float
        1 σ of the lens' blur in the middle, and what is added in quadrature at half the picture's smaller
        side from there, growing with the square of that way.
    veil_relative, veil_sigma_px : float
        Share of the light spread widely by glare, and 1 σ of that spread.
    vignetting : float
        Exponent k of the fall-off cos^k θ; nothing is seen beyond 90° unless it is 0.
    ambient : float
        Stray light on the wall, full scales on white, where the laser is on.
    fixed_pattern : float
        1 σ of the pixels' relative gain.
    dust : tuple of Dust
    scatter : tuple of Dust
        Spots whose ``attenuation`` is scattered, not lost.
    drops : tuple of Dust
        Drops: ``attenuation`` is their power, ``sigma_px`` their radius.
    bloom_relative, bloom_px : float
        Share of the light above full scale that leaks along columns, and its 1/e length, px.
    dark_pattern : float
        1 σ of the pixels' dark signal, full scales.
    defective_share, hot_level : float
        Share of pixels that are hot, and as many that are dead; dark signal of the hot ones, full scales.
    """

    full_well_e: float = 10000.0
    read_noise_e: float = 15.0
    black_level: float = 0.0
    gamma: float = 1.0
    psf_sigma_px: float = 0.7
    psf_edge_px: float = 0.0
    veil_relative: float = 0.0
    veil_sigma_px: float = 60.0
    vignetting: float = 0.0
    ambient: float = 0.0
    fixed_pattern: float = 0.0
    dust: tuple[Dust, ...] = ()
    scatter: tuple[Dust, ...] = ()
    drops: tuple[Dust, ...] = ()
    bloom_relative: float = 0.0
    bloom_px: float = 6.0
    dark_pattern: float = 0.0
    defective_share: float = 0.0
    hot_level: float = 0.0


@dataclass(frozen=True)
class TrueInstrument:
    """The whole true instrument at one moment."""

    camera: TrueCamera
    laser: TrueLaser
    light: LedRing = LedRing()
    sensor: TrueSensor = TrueSensor()
    shutter: Shutter = field(default_factory=Shutter)
    flicker: Flicker = Flicker()
