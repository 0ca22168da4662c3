"""Effects on the line's light, as far as the shift of its centroid can be predicted."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from stages.diagnose.effects.base import Amplitude, EffectModel, ImagePoints, Shape
from stages.diagnose.effects.kinds import Scalar, Worded, one


class AlbedoBias(Worded):
    """The line's centroid is drawn toward the brighter wall; the amplitude is the line's variance, mm²."""

    name = "albedo_bias"
    amplitudes = (Amplitude("line_sigma_mm squared", "mm²", 0.05),)
    words = (
        "The line, {line_sigma_mm:.3f} mm wide (1 σ) on the wall, is drawn toward brighter wall by σ² times "
        "the slope of the albedo's logarithm."
    )

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return σ_z² ∂_z ln A; none where the albedo is not known."""
        slope = points.albedo_slope_per_mm
        return np.zeros(len(points.uv)) if slope is None else np.asarray(amplitude[0] * slope)

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the line's 1 σ, negative where the variance came out so."""
        return {"line_sigma_mm": float(np.sign(amplitude[0]) * np.sqrt(abs(amplitude[0])))}


class Subsurface(Scalar):
    """The line's light comes back, on average, the transport length farther on.

    The shape is 0 where that is deeper in the wall, and 1 where it is farther along it: which, depends on how
    the light enters.
    """

    name = "subsurface"
    amplitudes = one(name, 0.2)
    words = "The line's light travels {transport_mm:+.3f} mm within the wall before it returns."

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return deeper and farther along."""
        return ((0.0,), (1.0,))

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the transport length into the wall for the line, nothing for texture."""
        return np.full(len(points.uv), float(amplitude[0]) * (1 - shape[0]) if points.on_line else 0.0)

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the transport length along the wall."""
        return np.full(len(points.uv), float(amplitude[0]) * shape[0])


class LineSkew(Scalar):
    """The sheet's profile is asymmetric: its peak lies before its mean."""

    name = "line_skew"
    amplitudes = one(name, 0.3)
    words = "The sheet's own profile is asymmetric, with a skewness of {skewness:+.3f}."

    def sheet_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return −σ × skewness, which is how far the peak lies before the mean."""
        return np.full(len(points.uv), -float(amplitude[0]) * points.probe.laser.line_sigma_mm)


class Vignetting(Scalar):
    """Light falls off as cos^k θ and draws the line's centroid inward."""

    name = "vignetting"
    amplitudes = one(name, 0.5)
    words = "Light falls off as cos^k θ with k {falloff:+.3f} beyond the stated, and draws the line inward."

    def line_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return σ_px² ∂ ln V/∂ρ = −k σ_px² tan θ / (dρ/dθ), σ of the sheet: the lens blurs later."""
        sigma_px = points.probe.laser.line_sigma_mm * points.ring.read_move(points.ring.per_sheet_c)
        return np.asarray(-amplitude[0] * sigma_px**2 * np.tan(points.theta) / _px_per_rad(points))


def _px_per_rad(points: ImagePoints) -> Float:
    """Return (M,) dρ/dθ of the stated camera."""
    theta, psi = points.theta, points.azimuth_rad
    away = np.stack([np.cos(theta) * np.cos(psi), np.cos(theta) * np.sin(psi), -np.sin(theta)], axis=1)
    turn = np.einsum("mij,mj->mi", points.ring.by_point, away)
    return np.asarray(np.linalg.norm(turn, axis=1) * np.linalg.norm(points.xyz_c, axis=1))


PHOTOMETRIC_MODELS: tuple[EffectModel, ...] = (AlbedoBias(), Subsurface(), LineSkew(), Vignetting())
