"""Effects of the camera (projection, shutter, warming), and effects on pictures only (light, lens)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import InputError
from pipeline.instrument.camera import Camera
from pipeline.simulator.effects.surroundings import on_the_ring
from pipeline.simulator.instrument import Dust, Flicker, Sector, TrueInstrument, lamp_azimuth_rad
from pipeline.simulator.truth import SceneTruth, cartesian, with_camera, with_laser, with_sensor


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
    """Enlarge the focal length by a share."""
    return with_camera(truth, model=magnified(truth.instrument.camera.model, relative))


def radial_distortion(truth: SceneTruth, k: float) -> SceneTruth:
    """Add k to the coefficient of θ³ in the image radius."""
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
    """Move the entrance pupil along the axis, depending on the angle of view."""
    return with_camera(truth, pupil_shift_mm=truth.instrument.camera.pupil_shift_mm + shift_mm)


def rolling_shutter(truth: SceneTruth, readout_s: float) -> SceneTruth:
    """Read the rows one after the other; a frame's time is that of its middle row."""
    shutter = replace(truth.instrument.shutter, kind="rolling", readout_s=readout_s)
    return replace(truth, instrument=replace(truth.instrument, shutter=shutter))


def motion_blur(truth: SceneTruth, exposure_s: float) -> SceneTruth:
    """Lengthen the exposure from the same start with the same total light; its middle is later.

    Raises
    ------
    InputError
        When the exposure does not end before the next frame begins.
    """
    shutter = truth.instrument.shutter
    longer = replace(shutter, exposure_s=shutter.exposure_s + exposure_s)
    if longer.exposure_s > 1 / truth.frame_rate:
        raise InputError(
            "scene", f"motion_blur makes an exposure of {longer.exposure_s:.4g} s, longer than a frame",
            expected=f"no more than {1 / truth.frame_rate:.4g} s in all",
        )  # fmt: skip
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
    """Show a line of image radius ρ at ρ + a sin 2πρ, as undersampling by the pixels does."""
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


def light_flicker(truth: SceneTruth, relative: float, frequency_hz: float) -> SceneTruth:
    """Let the power of laser and LEDs oscillate together, as with an unstable supply."""
    return replace(truth, instrument=replace(truth.instrument, flicker=Flicker(relative, frequency_hz)))


def led_dead(truth: SceneTruth, lost: float, azimuth_deg: float) -> SceneTruth:
    """Dim the LED next to an azimuth."""
    ring = truth.instrument.light
    away = np.angle(np.exp(1j * (lamp_azimuth_rad(ring.leds) - math.radians(azimuth_deg))))
    pattern = list(ring.pattern or (1.0,) * ring.leds)
    pattern[int(np.argmin(np.abs(away)))] *= 1.0 - lost
    dimmed = replace(ring, pattern=tuple(pattern))
    return replace(truth, instrument=replace(truth.instrument, light=dimmed))


def laser_sector(truth: SceneTruth, lost: float, azimuth_deg: float, width_deg: float) -> SceneTruth:
    """Dim or block the sheet over a sector."""
    sector = Sector(lost, math.radians(azimuth_deg), math.radians(width_deg))
    return with_laser(truth, sectors=(*truth.instrument.laser.sectors, sector))


def bloom(truth: SceneTruth, relative: float, length_px: float) -> SceneTruth:
    """Let charge above the full well leak along columns."""
    return with_sensor(truth, bloom_relative=relative, bloom_px=length_px)


def black_level(truth: SceneTruth, grey: float) -> SceneTruth:
    """Set the grey level without light."""
    return with_sensor(truth, black_level=grey)


def defocus(truth: SceneTruth, middle_px: float, edge_px: float) -> SceneTruth:
    """Blur the picture, and its edge more than its middle."""
    sensor = truth.instrument.sensor
    blur = math.hypot(sensor.psf_sigma_px, middle_px)
    return with_sensor(truth, psf_sigma_px=blur, psf_edge_px=math.hypot(sensor.psf_edge_px, edge_px))


def window_scatter(truth: SceneTruth, share: float, azimuth_deg: float, width_deg: float) -> SceneTruth:
    """Put a spot on the front glass that scatters light instead of absorbing it."""
    centre, sigma = on_the_ring(truth, azimuth_deg, width_deg)
    spot = Dust(share, centre, (sigma, sigma))
    return with_sensor(truth, scatter=(*truth.instrument.sensor.scatter, spot))


def droplet(truth: SceneTruth, power: float, azimuth_deg: float, width_deg: float) -> SceneTruth:
    """Put a drop on the front glass; its radius is twice the width, where a spot of that width ends."""
    centre, sigma = on_the_ring(truth, azimuth_deg, width_deg)
    drop = Dust(power, centre, (2 * sigma, 2 * sigma))
    return with_sensor(truth, drops=(*truth.instrument.sensor.drops, drop))


def defective_pixels(truth: SceneTruth, share: float, level: float) -> SceneTruth:
    """Make some pixels hot and as many dead."""
    return with_sensor(truth, defective_share=share, hot_level=level)


def read_noise(truth: SceneTruth, electrons: float) -> SceneTruth:
    """Add to the noise of reading a pixel."""
    return with_sensor(truth, read_noise_e=math.hypot(truth.instrument.sensor.read_noise_e, electrons))


def full_well(truth: SceneTruth, electrons: float) -> SceneTruth:
    """Set the electrons at full scale: fewer make more shot noise."""
    return with_sensor(truth, full_well_e=electrons)


def dark_pattern(truth: SceneTruth, relative: float) -> SceneTruth:
    """Give every pixel its own constant dark signal."""
    return with_sensor(truth, dark_pattern=relative)


def interreflection(truth: SceneTruth, relative: float) -> SceneTruth:
    """Add the light that the wall reflects onto itself once."""
    return replace(truth, wall=replace(truth.wall, interreflection=relative))
