"""Effects of the camera: they shift the image of every wall point, on the line or off it."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from pipeline.instrument.camera import Camera
from stages.diagnose.effects.base import EffectModel, ImagePoints, Shape
from stages.diagnose.effects.courses import Drifting
from stages.diagnose.effects.kinds import Directed, Scalar
from stages.diagnose.effects.laser import Baseline

_NEAR_AXIS = 1e-4
_STEPS = 6


class PrincipalPoint(Directed, name="principal_point", plausible=0.5):
    """The optical axis meets the image at another point than stated."""

    words = (
        "The optical axis meets the image {shift_px:.3f} px off the stated place, at {direction_deg:.1f}°."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the same shift everywhere."""
        return np.tile(np.asarray(amplitude, float), (len(points.uv), 1))


class FocalScale(Scalar, name="focal_scale", plausible=1e-3):
    """The whole image is larger than stated."""

    words = (
        "The focal length is {relative:.3%} [longer|shorter] than stated, and the image that much "
        "[larger|smaller]."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return κ (uv − centre)."""
        return np.asarray(amplitude[0] * (points.uv - points.probe.camera.centre_px))


class RadialDistortion(Scalar, name="radial_distortion", plausible=1e-3):
    """The image radius is larger by k f θ³."""

    words = (
        "The lens shows everything farther [out|in] than stated: by {k:.2e} θ³ focal lengths at an angle θ."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return f k θ³ outward."""
        focal = focal_px(points.probe.camera)
        return np.asarray(amplitude[0] * (points.theta**3)[:, None] * focal * _heading(points))


class SensorTilt(Directed, name="sensor_tilt", plausible=5e-4):
    """Brown's decentring by the angle: a sensor not perpendicular to the axis, or decentred lenses."""

    words = (
        "The sensor is tilted or the lenses are decentred: p = {p:.2e} beyond the stated, toward "
        "{direction_deg:.1f}°."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return f θ² (p + 2 (p · u) u) with u the azimuth's direction: 3 f p θ² on the crest."""
        heading, p = _heading(points), np.asarray(amplitude, float)
        pull = p + 2 * (heading @ p)[:, None] * heading
        return np.asarray((points.theta**2)[:, None] * focal_px(points.probe.camera) * pull)


class PixelAspect(Scalar, name="pixel_aspect", plausible=1e-3):
    """Pixels are not square as stated: the image is wider by √(1 + a) and lower by the same factor."""

    words = "The image is {relative:.3%} [wider|narrower] against its height than stated."

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return (√(1+a) − 1) x and (1/√(1+a) − 1) y."""
        widen = np.sqrt(1 + amplitude[0])
        stretch = np.array([widen - 1, 1 / widen - 1])
        return np.asarray(stretch * (points.uv - points.probe.camera.centre_px))


class PupilShift(Scalar, name="pupil_shift", plausible=0.3):
    """The entrance pupil moves forward along the axis with the field angle, by E = ε (θ/sin θ − 1)."""

    words = (
        "The lens's entrance pupil moves [forward|back] with the angle, by {shift_mm:.3f} mm × (θ/sin θ − 1) "
        "beyond the stated."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image from the moved viewpoint minus that from the stated one."""
        seen, theta = points.xyz_c.copy(), points.theta
        for _ in range(_STEPS):
            seen[:, 2] = points.xyz_c[:, 2] - amplitude[0] * (1 / np.sinc(theta / np.pi) - 1)
            theta = np.arctan2(points.radius_mm, seen[:, 2])
        return image_shift(points, seen)


class RollingShutter(Scalar, name="rolling_shutter", plausible=0.01):
    """Rows are exposed one after another; the time of a row counts from that of the middle row."""

    # The rates of the motion are those of the fitted poses: where these err, as those of pictures without
    # fiducials do near a turn of the travel, the size comes out too small. Nine simulated cases (ring level,
    # .018 to .030 s) came out between 9 % too small and 1 % too large; rms beyond noise 3 %.
    law_sigma = 0.03
    words = "The shutter is rolling: the last row is exposed {readout_s:.4f} s after the first."

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image motion between the middle row's time and the row's own time."""
        height = points.probe.camera.image_size[1]
        row_s = amplitude[0] * ((points.uv[:, 1] + 0.5) / height - 0.5)
        return np.asarray(row_s[:, None] * points.velocity_px)


class BaselineDrift(Drifting, name="baseline_drift", plausible=0.05):
    """The baseline grows while the probe warms up."""

    static = Baseline()
    words = (
        "The baseline gets [longer|shorter], by {at_first:#.3g} mm in the first {first}, with a time "
        "constant of {time_s:.1f} s."
    )


class FocalDrift(Drifting, name="focal_drift", plausible=1e-3):
    """The focal length grows while the probe warms up."""

    static = FocalScale()
    words = (
        "The focal length gets [longer|shorter], by {at_first:.4%} in the first {first}, with a time "
        "constant of {time_s:.1f} s."
    )


class CentreDrift(Drifting, name="centre_drift", plausible=0.5):
    """The optical axis wanders while the probe warms up."""

    static, parts = PrincipalPoint(), Directed.parts
    words = (
        "The optical axis drifts toward {direction_deg:.1f}°, by {at_first:#.3g} px in the first {first}, "
        "with a time constant of {time_s:.1f} s."
    )


class PixelLocking(Scalar, name="pixel_locking", plausible=0.02):
    """The measured line is displaced by a sine of its position within a pixel."""

    # It is computed with the stated centre: a centre wrong by σ px leaves J₀(2πσ) of the wave, .90 at .1 px.
    # Simulated cases came out 1, 17 and 17 % too small (ring level, .085, .06 and .03 px).
    law_sigma = 0.17
    words = "The line is found displaced by {amplitude_px:+.3f} px × sin 2πρ, with its image radius ρ in px."

    def line_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return a sin 2πρ."""
        return np.asarray(amplitude[0] * points.fraction[:, 1])


def image_shift(points: ImagePoints, seen_c: Float) -> Float:
    """Return the image shift (M, 2), px, when the points appear at ``seen_c`` (M, 3), mm, instead."""
    camera = points.probe.camera
    return np.asarray(camera.project(seen_c).uv - points.projected_uv)


def focal_px(camera: Camera) -> Float:
    """Return px per rad (2,) along u and v at the axis."""
    towards = np.array([[_NEAR_AXIS, 0, 1.0], [0, _NEAR_AXIS, 1.0]])
    return np.asarray(np.diag(camera.project(towards).uv - camera.centre_px) / _NEAR_AXIS)


def _heading(points: ImagePoints) -> Float:
    return np.stack([np.cos(points.azimuth_rad), np.sin(points.azimuth_rad)], axis=1)


CAMERA_MODELS: tuple[EffectModel, ...] = (
    PrincipalPoint(), FocalScale(), RadialDistortion(), SensorTilt(), PixelAspect(), PupilShift(),
    RollingShutter(), BaselineDrift(), FocalDrift(), CentreDrift(), PixelLocking(),
)  # fmt: skip
