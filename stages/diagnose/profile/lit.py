"""How the lit wall darkens with depth, against the stated lights: the sensor's response and vignetting."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Illumination, Recording
from stages.diagnose.profile.finding import Curve, Finding, Size, finding, untestable
from stages.diagnose.profile.regression import Regression, regress, tested
from stages.texture.light import irradiance

# Errors of exponent and fall-off: the pipe's reflectance may change along it, and LEDs are not perfectly
# Lambertian. Debt: data/debts.md.
EXPONENT_FLOOR, FALLOFF_FLOOR = 0.05, 0.10
_LOW_DEG, _HIGH_DEG, _STEP_DEG = 24.0, 64.0, 1.0
_FRAMES, _GROUPS, _EVERY_PX = 48, 8, 3
_BRIGHT = 215.0


def vignetting_finding(recording: Recording, probe: Probe) -> Finding:
    """Return the finding of `vignetting`; it also measures the response's exponent.

    In a straight pipe of known bore the stated lights shine on every depth by a known law E(θ), over an
    eightfold range: ln grey = γ ln E + k ln cos θ + constant.
    """
    frames = recording.frames.of(Illumination.LED)
    if recording.kind == "gauge" or len(frames) < 2 * _GROUPS:
        return untestable("vignetting", "Needs lit frames of a pipe of one bore.")
    theta = np.radians(np.arange(_LOW_DEG, _HIGH_DEG, _STEP_DEG) + _STEP_DEG / 2)
    grey = _grey_by_theta(recording, probe, frames[:: max(1, len(frames) // _FRAMES)], theta)
    light = _log_light(probe, recording.pipe.nominal_diameter_mm / 2, theta)
    fit = _fitted(grey, light, theta)
    if not np.isfinite(fit.sigma[0]):
        return untestable("vignetting", "The lit wall is too dark or too bright to follow into the depth.")
    test = tested(float(fit.coefficient[1]), float(fit.sigma[1]), FALLOFF_FLOOR, fit.groups)
    sigma = float(np.hypot(fit.sigma[0], EXPONENT_FLOOR))
    exponent, falloff = (float(c) for c in fit.coefficient[:2])
    middle = np.nanmean(np.log(grey), axis=0)
    predicted = exponent * light + falloff * np.log(np.cos(theta))
    return finding(
        "vignetting", test.z, test.p_value, (Size("falloff", "", falloff, test.sigma),),
        f"The lit wall's grey follows the light to the power {exponent:.2f} and falls off as cos^k θ with "
        f"k = {falloff:+.2f}.",
        Curve(
            "Grey of the lit wall by polar angle", "polar angle, deg", "ln of grey",
            np.degrees(theta), middle,
            np.full(len(theta), EXPONENT_FLOOR), predicted + np.nanmean(middle - predicted),
        ),
        confirms=(Size("gamma.exponent", "", exponent, sigma),), alike=("gamma",),
    )  # fmt: skip


def _grey_by_theta(recording: Recording, probe: Probe, frames: Int, theta: Float) -> Float:
    """Return mean grey above black (F, T) in rings of polar angle; NaN where much of a ring clips."""
    width, height = recording.source.image_size
    u, v = np.meshgrid(np.arange(0, width, _EVERY_PX), np.arange(0, height, _EVERY_PX))
    ray = probe.camera.unproject(np.stack([u, v], -1).reshape(-1, 2).astype(float)).ray
    polar = np.degrees(np.arctan2(np.hypot(ray[:, 0], ray[:, 1]), ray[:, 2]))
    ring = np.where(np.isfinite(polar), np.floor((polar - _LOW_DEG) / _STEP_DEG), -1).astype(int)
    inside = (ring >= 0) & (ring < len(theta))
    black = _black(recording)
    count = np.maximum(np.bincount(ring[inside], minlength=len(theta)), 1)
    rows = []
    for _, image in recording.read(frames, "grey"):
        if image is None:
            continue
        grey = image[::_EVERY_PX, ::_EVERY_PX].ravel().astype(float)
        value = np.bincount(ring[inside], grey[inside] - black, len(theta)) / count
        clipped = np.bincount(ring[inside], grey[inside] > _BRIGHT, len(theta)) / count
        rows.append(np.where((clipped < 0.02) & (value > 2), value, np.nan))
    return np.array(rows).reshape(-1, len(theta))


def _black(recording: Recording) -> float:
    """Return the grey level without light: most of a frame lit by the laser alone; 16 without such frames."""
    for frame in recording.frames.of(Illumination.LASER)[:1]:
        _, image = next(iter(recording.read([int(frame)], "grey")))
        if image is not None:
            return float(np.median(image))
    return 16.0


def _log_light(probe: Probe, radius_mm: float, theta: Float) -> Float:
    zero = np.zeros_like(theta)
    wall = np.stack([np.full_like(theta, radius_mm), zero, radius_mm / np.tan(theta)], axis=-1)
    return np.asarray(np.log(irradiance(probe.lighting, wall, np.array([-1.0, 0.0, 0.0]))))


def _fitted(grey: Float, light: Float, theta: Float) -> Regression:
    """Regress ln grey (F, T) on light, ln cos θ and a level for every frame group."""
    group = np.arange(len(grey)) * _GROUPS // max(len(grey), 1)
    levels = (group[:, None, None] == np.arange(_GROUPS)) * np.ones((1, len(theta), 1))
    slopes = np.stack([light, np.log(np.cos(theta))], axis=-1) * np.ones((len(grey), 1, 1))
    design = np.concatenate([slopes, levels], axis=-1)
    with np.errstate(invalid="ignore"):
        value = np.log(grey)
    return regress(design.reshape(-1, design.shape[-1]), value.ravel(), np.repeat(group, len(theta)))
