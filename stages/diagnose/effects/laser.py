"""Effects of the laser: its sheet displaces the line on the wall, its light the line's centroid."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from stages.diagnose.effects.base import Amplitude, EffectModel, Factored, ImagePoints, Product, Shape
from stages.diagnose.effects.kinds import Directed, Periodic, Scalar, Worded, cosine, sine_and_cosine_at

_ORDERS = (2, 3, 4, 5, 6)
_DEG_PER_MRAD = float(np.degrees(0.001))  # a unit


class AlbedoBias(Worded, name="albedo_bias"):
    """The line's centroid is displaced toward brighter wall; the amplitude is the line's variance, mm²."""

    amplitudes = (Amplitude("line_sigma_mm squared", "mm²", 0.05),)
    words = (
        "The line, {line_sigma_mm:.3f} mm wide (1 σ) on the wall, is drawn toward brighter wall by σ² times "
        "the slope of the albedo's logarithm."
    )

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return σ_z² ∂_z ln A, mm; zero where the albedo is unknown."""
        slope = points.albedo_slope_per_mm
        return np.zeros(len(points.uv)) if slope is None else np.asarray(amplitude[0] * slope)

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the line's 1 σ, mm; negative where the variance came out negative."""
        return {"line_sigma_mm": float(np.sign(amplitude[0]) * np.sqrt(abs(amplitude[0])))}


class Subsurface(Scalar, name="subsurface", plausible=0.2):
    """The line's light returns, on average, from one transport length away.

    The shape is 0 for deeper in the wall and 1 for farther along it: this depends on how the light enters.
    """

    words = "The line's light travels {transport_mm:+.3f} mm within the wall before it returns."

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return both directions: deeper, and farther along."""
        return ((0.0,), (1.0,))

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the transport length into the wall for the line, zero for texture, mm."""
        return np.full(len(points.uv), float(amplitude[0]) * (1 - shape[0]) if points.on_line else 0.0)

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the transport length along the wall, mm."""
        return np.full(len(points.uv), float(amplitude[0]) * shape[0])


class LineSkew(Scalar, name="line_skew", plausible=0.3):
    """The sheet's profile is asymmetric: its peak is before its mean."""

    words = "The sheet's own profile is asymmetric, with a skewness of {skewness:+.3f}."

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return −σ × skewness, mm: how far the peak is before the mean."""
        return np.full(len(points.uv), -float(amplitude[0]) * points.probe.laser.line_sigma_mm)


class Vignetting(Scalar, name="vignetting", plausible=0.5):
    """Light falls off as cos^k θ and displaces the line's centroid inward."""

    words = (
        "Light falls off as cos^k θ, k {falloff:.3f} [above|below] the stated: the line is drawn "
        "[inward|outward]."
    )

    def line_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return σ_px² ∂ ln V/∂ρ = −k σ_px² tan θ / (dρ/dθ), px; σ is the sheet's before lens blur."""
        sigma_px = points.probe.laser.line_sigma_mm * points.ring.read_move(points.ring.per_sheet_c)
        return np.asarray(-amplitude[0] * sigma_px**2 * np.tan(points.theta) / _px_per_rad(points))


def _px_per_rad(points: ImagePoints) -> Float:
    """Return (M,) dρ/dθ of the stated camera."""
    theta, psi = points.theta, points.azimuth_rad
    away = np.stack([np.cos(theta) * np.cos(psi), np.cos(theta) * np.sin(psi), -np.sin(theta)], axis=1)
    turn = np.einsum("mij,mj->mi", points.ring.by_point, away)
    return np.asarray(np.linalg.norm(turn, axis=1) * np.linalg.norm(points.xyz_c, axis=1))


PHOTOMETRIC_MODELS: tuple[EffectModel, ...] = (AlbedoBias(), Subsurface(), LineSkew(), Vignetting())


class LaserTilt(Directed, name="laser_tilt", plausible=0.1):
    """The sheet is tilted forward by tan φ per mm toward ψ₀."""

    words = (
        "The laser sheet is tilted by {tilt_deg:.3f}° more than stated, leaning forward toward azimuth "
        "{direction_deg:.1f}°."
    )

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return q tan φ cos(ψ − ψ₀)."""
        tilt = np.radians(amplitude)
        stretch = np.tan(np.hypot(*tilt)) / max(float(np.hypot(*tilt)), 1e-300)
        return np.asarray(points.radius_mm * cosine(points.azimuth_rad, tilt * stretch))


class LaserCone(Scalar, name="laser_cone", plausible=0.1):
    """The sheet is a cone: its rays are inclined by ε₀."""

    words = (
        "The laser's rays lean {cone_deg:.3f}° more [forward|back] than stated, all round: the sheet "
        "is a cone."
    )

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return q (tan(ε + ε₀) − tan ε) with the stated elevation ε."""
        stated = points.probe.laser.cone_rad
        steeper = np.tan(stated + np.radians(amplitude[0])) - np.tan(stated)
        return np.asarray(points.radius_mm * steeper)


class Baseline(Scalar, name="baseline", plausible=0.1):
    """The sheet is farther from the camera."""

    words = "The laser sheet stands {baseline_mm:.3f} mm [farther from|nearer to] the camera than stated."

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return δl."""
        return np.full(len(points.uv), float(amplitude[0]))


class BeamDecentre(Directed, name="beam_decentre", plausible=0.05):
    """The sheet's rays leave the axis at heights that vary once around."""

    words = (
        "The laser's beam is decentred: its rays start {height_mm:.3f} mm farther forward toward azimuth "
        "{direction_deg:.1f}° and as much back on the other side."
    )

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return h cos(ψ − ψ₀)."""
        return cosine(points.azimuth_rad, amplitude)


class SheetWaviness(Directed, name="sheet_waviness"):
    """The inclination of the sheet's rays varies m times around the ring; the shape is m."""

    repeats = True
    amplitudes = (Amplitude("cosine", "mrad", 0.3), Amplitude("sine", "mrad", 0.3))
    words = (
        "The laser sheet is wavy: its rays rise and fall by {amplitude_mrad:.2f} mrad {order:.0f} times "
        "around the ring, with a crest at azimuth {direction_deg:.1f}°."
    )

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return the orders."""
        return tuple((float(m),) for m in _ORDERS)

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return q ε_m cos m(ψ − ψ_m)."""
        wave = cosine(points.azimuth_rad, 1e-3 * np.asarray(amplitude), int(shape[0]))
        return np.asarray(points.radius_mm * wave)

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return amplitude, order and direction of a crest."""
        size = super().quantities(shape, amplitude)
        direction = size.pop("direction_deg") / shape[0]
        return {**size, "order": shape[0], "direction_deg": direction}


class LaserRocking(Periodic, Product, name="laser_rocking", plausible=1.0):
    """The sheet's tilt oscillates at one frequency."""

    words = (
        "The laser sheet rocks by ±{amplitude_mrad:.2f} mrad at {frequency_hz:.2f} Hz (or an alias of it) "
        "toward azimuth {direction_deg:.1f}°."
    )

    def factored(self, points: ImagePoints, shape: Shape) -> Factored:
        """Return sine and cosine, and the law of a tilt in degrees."""
        sine, cosine = sine_and_cosine_at(points.time_s, shape[0])
        return (_DEG_PER_MRAD * sine, _DEG_PER_MRAD * cosine), LaserTilt(), ()


LASER_MODELS: tuple[EffectModel, ...] = (
    LaserTilt(), LaserCone(), Baseline(), BeamDecentre(), SheetWaviness(), LaserRocking(),
)  # fmt: skip
