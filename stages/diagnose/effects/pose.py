"""Effects of the pose, the pipe and the encoder."""

from __future__ import annotations

import numba
import numpy as np

from pipeline.arrays import Float
from stages.diagnose.effects.base import EffectModel, ImagePoints, Shape, Travel
from stages.diagnose.effects.camera import image_shift
from stages.diagnose.effects.kinds import Directed, Periodic, Scalar, Worded, cosine, sine_and_cosine_at

_SLIP_TIMES = 64


class PipeBend(Directed, name="pipe_bend", plausible=4e-4):
    """The pipe's axis is curved: wall ahead is displaced sideways by the sagitta."""

    words = (
        "The pipe bends with a curvature of {curvature_per_mm:.2e} per mm toward azimuth "
        "{direction_deg:.1f}° of P."
    )

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the sagitta L²/8ρ of a chord twice the distance ahead, along the wall's normal, mm."""
        ahead = np.sum(points.xyz_c * points.along_c, axis=1)
        return np.asarray(ahead**2 / 2 * cosine(points.azimuth_p_rad, amplitude))


class Ovality(Directed, name="ovality", plausible=0.1):
    """The pipe's section is an oval at a constant azimuth in P."""

    order = 2
    words = (
        "The pipe is oval: its radius varies by ±{amplitude_mm:.3f} mm, longest at azimuth "
        "{direction_deg:.1f}° of P."
    )

    def wall_shift_mm(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return a₂ cos 2(ψ − ψ₀)."""
        return cosine(points.azimuth_p_rad, amplitude, self.order)


class ProbeVibration(Periodic, name="probe_vibration", plausible=0.2):
    """The camera oscillates across the pipe at one frequency; free poses absorb nearly all of it."""

    words = (
        "The probe vibrates across the pipe by ±{amplitude_mm:.3f} mm at {frequency_hz:.2f} Hz (or an alias "
        "of it) toward azimuth {direction_deg:.1f}°."
    )

    def image_shift_px(self, points: ImagePoints, shape: Shape, amplitude: Float) -> Float:
        """Return the image from the displaced camera minus the stated one; the sheet moves along."""
        waves, seen = sine_and_cosine_at(points.time_s, shape[0]), points.xyz_c.copy()
        seen[:, :2] -= np.stack(waves, 1) @ np.reshape(amplitude, (2, 2))
        return image_shift(points, seen)


class EncoderScale(Scalar, name="encoder_scale", plausible=0.005):
    """The encoder's wheel is smaller than stated."""

    words = "The encoder reads {relative:.3%} too [much|little] of every distance."

    def reading_shift_mm(self, travel: Travel, shape: Shape, amplitude: Float) -> Float:
        """Return κ s."""
        return np.asarray(amplitude[0] * travel.distance_mm)


class EncoderSlip(Worded, name="encoder_slip", plausible=2.0):
    """The encoder's wheel slips once; the shape is the slip's middle and, if it lasts, duration, s."""

    words = "The encoder's wheel slips after {time_s:.2f} s and its reading [gains|loses] {slip_mm:.2f} mm."

    def shapes(self, duration_s: float, frame_rate: float) -> tuple[Shape, ...]:
        """Return times within the recording, no closer together than frames."""
        count = int(min(_SLIP_TIMES, max(duration_s * frame_rate, 2)))
        return tuple((float(t),) for t in duration_s * np.arange(1, count) / count)

    def reading_shift_mm(self, travel: Travel, shape: Shape, amplitude: Float) -> Float:
        """Return how much of the gain has accumulated, evenly during the slip, mm."""
        time_s, *lasting_s = shape
        if not lasting_s:
            return np.asarray(amplitude[0] * (travel.time_s > time_s))
        return np.asarray(amplitude[0] * np.clip((travel.time_s - time_s) / lasting_s[0] + 0.5, 0.0, 1.0))

    def quantities(self, shape: Shape, amplitude: Float) -> dict[str, float]:
        """Return the gain and its time."""
        return {"slip_mm": float(amplitude[0]), "time_s": shape[0]}


class EncoderBacklash(Scalar, name="encoder_backlash", plausible=0.3):
    """The wheel has play: after a reversal the reading waits until the play is taken up."""

    words = "The encoder has {backlash_mm:.2f} mm of play at a reversal."

    def reading_shift_mm(self, travel: Travel, shape: Shape, amplitude: Float) -> Float:
        """Return −(b/2) sgn v, mm, with a transition while the play is taken up."""
        half = abs(float(amplitude[0])) / 2
        return np.asarray(np.sign(amplitude[0]) * _lag(np.diff(travel.distance_mm, prepend=0.0), half))


@numba.njit(cache=True, nogil=True)
def _lag(steps, half):  # type: ignore[no-untyped-def]
    """Return by how much (N,) a reading lags; the motion before the first reading does not count."""
    lag = np.zeros(len(steps))
    moving = np.flatnonzero(steps[1:])
    behind = -half * np.sign(steps[moving[0] + 1]) if len(moving) else 0.0
    lag[:1] = behind
    for k in range(1, len(steps)):
        behind = min(max(behind - steps[k], -half), half)
        lag[k] = behind
    return lag


class TimeOffset(Scalar, name="time_offset", plausible=0.02):
    """The encoder's readings are late: they give the distance at a slightly earlier time."""

    words = "The encoder's readings come {delay_s:.4f} s [late|early] against the pictures."

    def reading_shift_mm(self, travel: Travel, shape: Shape, amplitude: Float) -> Float:
        """Return s(t − τ) − s(t), mm, so that visual − encoder = v τ; beyond the ends the speed is held."""
        earlier = travel.time_s - amplitude[0]
        held = np.clip(earlier, travel.time_s[0], travel.time_s[-1])
        beyond = (earlier - held) * np.interp(held, travel.time_s, travel.speed_mm_s)
        return np.asarray(np.interp(held, travel.time_s, travel.distance_mm) + beyond - travel.distance_mm)


class MotionBlur(TimeOffset, name="motion_blur", plausible=0.005):
    """A longer exposure with the same start: all pictures are late by half of the excess.

    The free pose of every picture follows, so that rings and fiducials show nothing of it; only the encoder,
    whose readings then seem late, and the line's width do.
    """

    words = (
        "The exposure is {exposure_s:.4f} s [longer|shorter] than stated, and so is the blur of what moves."
    )

    def reading_shift_mm(self, travel: Travel, shape: Shape, amplitude: Float) -> Float:
        """Return the error of readings that are late by half the excess exposure, mm."""
        return super().reading_shift_mm(travel, shape, 0.5 * np.asarray(amplitude))


POSE_MODELS: tuple[EffectModel, ...] = (
    PipeBend(), Ovality(), ProbeVibration(), EncoderScale(), EncoderSlip(), EncoderBacklash(), TimeOffset(),
    MotionBlur(),
)  # fmt: skip
