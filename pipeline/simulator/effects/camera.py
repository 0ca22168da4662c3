"""Effects of the camera: its projection, its shutter, and what warms up with time."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from pipeline.errors import InputError
from pipeline.instrument.camera import Camera
from pipeline.simulator.instrument import TrueInstrument
from pipeline.simulator.truth import SceneTruth, cartesian, with_camera


@dataclass(frozen=True)
class Warming:
    """An exponential approach to a final state: 1 − exp(−(t − start)/t₀)."""

    time_constant_s: float
    start_s: float

    def share(self, time_s: float) -> float:
        """Return the share of the final change that is reached at a time; 0 before the start."""
        return -math.expm1(-max(time_s - self.start_s, 0.0) / self.time_constant_s)


@dataclass(frozen=True)
class BaselineDrift:
    """The baseline grows by up to ``drift_mm``."""

    drift_mm: float
    warming: Warming

    def __call__(self, instrument: TrueInstrument, time_s: float) -> TrueInstrument:
        """See `pipeline.simulator.truth.Change`."""
        sheet = instrument.laser.sheet
        grown = replace(sheet, baseline_mm=sheet.baseline_mm + self.drift_mm * self.warming.share(time_s))
        return replace(instrument, laser=replace(instrument.laser, sheet=grown))


@dataclass(frozen=True)
class FocalDrift:
    """The focal length grows by up to a share of ``relative``."""

    relative: float
    warming: Warming

    def __call__(self, instrument: TrueInstrument, time_s: float) -> TrueInstrument:
        """See `pipeline.simulator.truth.Change`."""
        model = magnified(instrument.camera.model, self.relative * self.warming.share(time_s))
        return replace(instrument, camera=replace(instrument.camera, model=model))


@dataclass(frozen=True)
class CentreDrift:
    """The optical axis wanders in the image by up to ``shift_px``."""

    shift_px: float
    direction_deg: float
    warming: Warming

    def __call__(self, instrument: TrueInstrument, time_s: float) -> TrueInstrument:
        """See `pipeline.simulator.truth.Change`."""
        gone = self.shift_px * self.warming.share(time_s)
        model = shifted(instrument.camera.model, gone, self.direction_deg)
        return replace(instrument, camera=replace(instrument.camera, model=model))


def principal_point(truth: SceneTruth, shift_px: float, direction_deg: float) -> SceneTruth:
    """Shift the optical axis in the image."""
    model = shifted(truth.instrument.camera.model, shift_px, direction_deg)
    return with_camera(truth, model=model)


def focal_scale(truth: SceneTruth, relative: float) -> SceneTruth:
    """Lengthen the focal length."""
    return with_camera(truth, model=magnified(truth.instrument.camera.model, relative))


def radial_distortion(truth: SceneTruth, k: float) -> SceneTruth:
    """Add to the coefficient of θ³ in the image radius."""
    return with_camera(truth, model=_with_added(truth.instrument.camera.model, "radial_distortion", k1=k))


def sensor_tilt(truth: SceneTruth, p: float, direction_deg: float) -> SceneTruth:
    """Tilt the sensor, or decentre a lens: Brown's decentring, largest towards ``direction_deg``."""
    x, y = cartesian(p, direction_deg)
    before = truth.instrument.camera.decentring
    return with_camera(truth, decentring=(before[0] + x, before[1] + y))


def pixel_aspect(truth: SceneTruth, relative: float) -> SceneTruth:
    """Make pixels rectangular: the image is stretched along u and shrunk along v."""
    return with_camera(truth, aspect=truth.instrument.camera.aspect + relative)


def pupil_shift(truth: SceneTruth, shift_mm: float) -> SceneTruth:
    """Let the entrance pupil wander along the axis with the angle of view."""
    return with_camera(truth, pupil_shift_mm=truth.instrument.camera.pupil_shift_mm + shift_mm)


def rolling_shutter(truth: SceneTruth, readout_s: float) -> SceneTruth:
    """Read the rows one after the other; a frame's time stays that of its middle row."""
    shutter = replace(truth.instrument.shutter, kind="rolling", readout_s=readout_s)
    return replace(truth, instrument=replace(truth.instrument, shutter=shutter))


def motion_blur(truth: SceneTruth, exposure_s: float) -> SceneTruth:
    """Expose longer than stated with the same light in all; a frame's time is the exposure's middle."""
    shutter = truth.instrument.shutter
    longer = replace(shutter, exposure_s=shutter.exposure_s + exposure_s)
    moments = max(truth.rendering.time_samples, _BLUR_MOMENTS)
    rendering = truth.rendering.model_copy(update={"time_samples": moments})
    return replace(truth, instrument=replace(truth.instrument, shutter=longer), rendering=rendering)


def baseline_drift(truth: SceneTruth, drift_mm: float, time_s: float) -> SceneTruth:
    """Change the baseline while the holder between camera and laser warms up."""
    change = BaselineDrift(drift_mm, _warming(truth, time_s))
    return replace(truth, changes=(*truth.changes, change))


def focal_drift(truth: SceneTruth, relative: float, time_s: float) -> SceneTruth:
    """Change the focal length while the lens warms up."""
    return replace(truth, changes=(*truth.changes, FocalDrift(relative, _warming(truth, time_s))))


def centre_drift(truth: SceneTruth, shift_px: float, direction_deg: float, time_s: float) -> SceneTruth:
    """Move the optical axis in the image while the sensor's holder warms up."""
    change = CentreDrift(shift_px, direction_deg, _warming(truth, time_s))
    return replace(truth, changes=(*truth.changes, change))


def pixel_locking(truth: SceneTruth, amplitude_px: float) -> SceneTruth:
    """Draw a line at image radius ρ at ρ + a sin 2πρ: what a sensor that undersamples does to a line."""
    return with_camera(truth, locking_px=truth.instrument.camera.locking_px + amplitude_px)


def shifted(model: Camera, shift_px: float, direction_deg: float) -> Camera:
    """Return the camera with its principal point moved."""
    x, y = cartesian(shift_px, direction_deg)
    return _with_added(model, "principal_point", cx=x, cy=y)


def magnified(model: Camera, relative: float) -> Camera:
    """Return the camera with its focal length larger by a share."""
    names = dict(zip(model.parameter_names, model.parameters.tolist(), strict=True))
    return _with_added(model, "focal_scale", **{n: relative * names.get(n, 0.0) for n in ("fx", "fy")})


# Fewest moments of an exposure at which a longer exposure is rendered. Debt: data/debts.md.
_BLUR_MOMENTS = 8


def _with_added(model: Camera, effect: str, **added: float) -> Camera:
    """Return the camera with numbers added to parameters of those names, if its model has them."""
    if not set(added) <= set(model.parameter_names):
        raise InputError(
            "scene", f"{effect} has no parameter in a {model.model} camera", place="probe.camera.model",
            expected=f"a model with {', '.join(added)}, such as kannala_brandt",
        )  # fmt: skip
    parameters = model.parameters.copy()
    for name, value in added.items():
        parameters[model.parameter_names.index(name)] += value
    return model.with_parameters(parameters)


def _warming(truth: SceneTruth, time_s: float) -> Warming:
    return Warming(time_s, float(truth.frames.time_s[0]))
