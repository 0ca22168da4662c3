"""Brightness of the line, its surroundings and the lit wall: dust, stray light, clipping, beam, fall-off."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.stats import norm

from pipeline.adjustment.robust import robust_spread, robust_spreads
from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Illumination, Recording
from stages.diagnose.profile.cells import Cells, LineGeometry
from stages.diagnose.profile.finding import Finding, Regression, Size, finding, regress, untestable
from stages.diagnose.profile.measure import LineProfiles
from stages.texture.light import irradiance

# Light beside the line, relative to its height, that an error of the black level and compression may leave.
# Debt: data/debts.md.
STRAY_FLOOR = 2e-4
# Change of ln brightness by paint, gloss and markers at one azimuth. Debt: data/debts.md.
DUST_FLOOR = 0.05
# Change of ln brightness in a pipe that reflects more on one side. Debt: data/debts.md.
DECENTRE_FLOOR = 0.05
_SMOOTH_ORDER = 6
_WIDTHS_DEG = (1.0, 2.0, 4.0, 8.0)
_INDEPENDENT = 2.0
# Errors of exponent and fall-off. The pipe's reflectance may change along it. LEDs shine as cos^m of the
# angle from their axis, and no recording states m: with half of the light at 45° to 75° it is 2.0 to 0.5, by
# which the lit wall falls off by k = -0.5 to +1.0 as against Lambert's m = 1. Debt: data/debts.md.
EXPONENT_FLOOR, FALLOFF_FLOOR = 0.05, 0.50
_LOW_DEG, _HIGH_DEG, _STEP_DEG = 24.0, 64.0, 1.0
_FRAMES, _GROUPS, _EVERY_PX = 48, 8, 3
_BRIGHT = 215.0


def vignetting_finding(recording: Recording, probe: Probe) -> Finding:
    """Return the finding of `vignetting`; it also measures the exponent of the response.

    In a straight pipe of known bore, the stated lights illuminate every depth by a known law E(θ), over an
    eightfold range: ln grey = γ ln E + k ln cos θ + constant.
    """
    frames = recording.frames.of(Illumination.LED)
    if recording.kind == "gauge" or len(frames) < 2 * _GROUPS:
        return untestable("vignetting", "This needs lit frames of a pipe of one bore.")
    theta = np.radians(np.arange(_LOW_DEG, _HIGH_DEG, _STEP_DEG) + _STEP_DEG / 2)
    grey = _grey_by_theta(recording, probe, frames[:: max(1, len(frames) // _FRAMES)], theta)
    light = _log_light(probe, recording.pipe.nominal_diameter_mm / 2, theta)
    fit = _fitted(grey, light, theta)
    test = fit.test(1, FALLOFF_FLOOR)
    if test is None:
        return untestable("vignetting", "The lit wall is too dark or too bright to follow into the depth.")
    sigma = float(np.hypot(fit.sigma[0], EXPONENT_FLOOR))
    exponent, falloff = (float(c) for c in fit.coefficient[:2])
    return finding(
        "vignetting", test.z, test.p_value, (Size("falloff", "", falloff, test.sigma),),
        f"The lit wall's grey follows the light to the power {exponent:.2f} and falls off as cos^k θ with "
        f"k = {falloff:+.2f}.",
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
        # If more than 2 % of the pixels clip, or hardly any light is left, the mean is biased (chosen).
        rows.append(np.where((clipped < 0.02) & (value > 2), value, np.nan))
    return np.array(rows).reshape(-1, len(theta))


def _black(recording: Recording) -> float:
    """Return the grey level without light: most of a laser frame has it; 16 without laser frames."""
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
    return regress(design, value, group)


def dust_finding(rings: RingSamples, profiles: LineProfiles, cells: Cells) -> Finding:
    """Return the finding of `dust`: a dip of the line's brightness at one azimuth of C in all frames."""
    if len(cells.frames) < 4:
        return untestable("dust", "Too few frames to distinguish a spot on the lens from one on the wall.")
    courses = np.array([_course(rings, profiles.row[rows]) for rows in cells.frames])
    known = np.isfinite(courses)
    middle = np.nanmedian(courses, axis=0)
    sigma = robust_spreads(courses - middle, axis=0) / np.sqrt(np.maximum(known.sum(0), 1))
    depth, width, at = _deepest(middle)
    azimuth = float(np.degrees(rings.azimuth_rad[at]))
    around = np.abs((np.arange(len(middle)) - at + len(middle) // 2) % len(middle) - len(middle) // 2)
    near = around * 360 / len(middle) < width
    spot = float(np.hypot(DUST_FLOOR, np.nanmedian(sigma[near]) / np.sqrt(_INDEPENDENT)))
    z = depth / spot
    tries = len(rings.azimuth_rad) / 4 * len(_WIDTHS_DEG)
    p = float(min(1.0, tries * 2 * norm.sf(z))) if z > 0 else 1.0
    sizes = (
        Size("attenuation", "", float(-np.expm1(-depth)), float(np.exp(-depth) * spot)),
        Size("azimuth_deg", "deg", azimuth, width / max(z, 1.0)),
        Size("width_deg", "deg", width, 0.3 * width),
    )  # fmt: skip
    return finding(
        "dust", z, p, sizes,
        f"At {azimuth:.0f}° the line is {100 * -np.expm1(-depth):.0f} % darker in all frames.",
        alike=("fixed_pattern",),
    )  # fmt: skip


def stray_finding(profiles: LineProfiles, geometry: LineGeometry) -> Finding:
    """Return the finding of `ambient_light`: light beside the line in frames lit by the laser alone.

    A nonlinear camera amplifies the faintest light: a grey level of 1 in 255 becomes 20 under a response I^(1
    / 2.2). Therefore this name never stands alone.
    """
    height = np.nanmedian(geometry.height, axis=1)
    used = geometry.steady & np.isfinite(height)
    if not used.any():
        return untestable("ambient_light", "No frame shows the line against the dark.")
    share = profiles.background[used] / height[used]
    worst = float(np.percentile(share, 90))
    sigma = float(np.hypot(STRAY_FLOOR, profiles.background_sigma / np.median(height[used])))
    z = worst / sigma
    return finding(
        "ambient_light", z, float(2 * norm.sf(abs(z))), (Size("relative", "", worst, sigma),),
        f"Beside the line there is light of up to {100 * worst:.2f} % of its height.",
        alike=("gamma",),
    )  # fmt: skip


def decentre_finding(geometry: LineGeometry, cells: Cells) -> Finding:
    """Return the finding of `beam_decentre` from the first harmonic of the brightness, fixed in C."""
    psi = np.broadcast_to(geometry.azimuth_rad, geometry.height.shape)
    group = cells.block_of_frames(len(psi))
    blocks = [(group == k)[:, None] * np.ones_like(psi) for k in range(len(cells.frames))]
    design = np.stack([np.cos(psi), np.sin(psi), np.log(geometry.radius_mm), *blocks], axis=-1)
    fit = regress(design, np.log(geometry.height), group)
    test = fit.test_wave(DECENTRE_FLOOR)
    if test is None:
        return untestable("beam_decentre", "The line's brightness is not seen all round.")
    size = float(np.hypot(*fit.coefficient[:2]))
    direction = float(np.degrees(np.arctan2(fit.coefficient[1], fit.coefficient[0])))
    seen = f"Brightness varies around the ring by ±{100 * size:.0f} %, and is largest at {direction:.0f}°."
    return finding("beam_decentre", test.z, test.p_value, (), seen)


def clip_finding(profiles: LineProfiles, cells: Cells, geometry: LineGeometry) -> Finding:
    """Return the finding of `saturation`: a longer foot along the columns where the line clips.

    A clipped line alone is ordinary; a sensor that overflows spills charge along its columns.
    """
    open_foot = np.abs(cells.offset_px) > 5
    foot = np.nanmean(np.where(open_foot & (np.abs(cells.offset_px) < 20), cells.profile, np.nan), axis=1)
    share = np.array([profiles.clipped[rows].mean(0) for rows in cells.frames]).ravel()
    along = np.cos(2 * cells.azimuth_rad)
    design = np.stack([np.ones_like(share), along, share, -share * along], axis=1)
    fit = regress(design, foot, cells.block)
    clipped = float(np.mean(profiles.clipped[geometry.steady])) if geometry.steady.any() else 0.0
    test = fit.test(3, 2 * STRAY_FLOOR)
    # One cell in twenty (chosen): with fewer, the slope of the spill depends on few frames.
    if clipped < 0.05 or test is None:
        return untestable("saturation", f"{100 * clipped:.1f} % of the line is clipped: too little to test.")
    return finding(
        "saturation", test.z, test.p_value, (),
        f"{100 * clipped:.0f} % of the line is clipped; there its foot is {100 * fit.coefficient[3]:+.2f} % "
        "of its height brighter along the sensor's columns than all round.", alike=("gamma",),
    )  # fmt: skip


def _course(rings: RingSamples, rows: Int) -> Float:
    """Return ln brightness (A,) of the block without its slow change around the ring; NaN where unseen."""
    height = np.where(rings.valid[rows], rings.amplitude[rows], np.nan).astype(float)
    log = np.log(np.maximum(height, 1e-3))
    seen = np.isfinite(log)
    # Azimuths seen in less than 0.3 of the frames have no reliable median (chosen).
    good = seen.mean(0) > 0.3
    median = np.nanmedian(np.where(good, log, 0.0), axis=0)
    waves = np.outer(rings.azimuth_rad, np.arange(1, _SMOOTH_ORDER + 1))
    basis = np.concatenate([np.ones((len(waves), 1)), np.cos(waves), np.sin(waves)], axis=1)
    weight = good.astype(float)
    for _ in range(6):
        fit = np.linalg.lstsq(basis * weight[:, None], np.where(good, median, 0) * weight, rcond=None)[0]
        rest = np.where(good, median - basis @ fit, 0.0)
        scale = robust_spread(rest[good]) if good.any() else 1.0
        weight = good * np.maximum(1 - (rest / (3 * max(scale, 1e-3))) ** 2, 0.0)
    return np.where(good, rest, np.nan)


def _deepest(course: Float) -> tuple[float, float, int]:
    """Return depth, width in degrees and index of the Gaussian dip that explains most of the course."""
    step = 360.0 / len(course)
    filled = np.where(np.isfinite(course), course, 0.0)
    best, most = (0.0, _WIDTHS_DEG[0], 0), 0.0
    for width in _WIDTHS_DEG:
        smooth = gaussian_filter1d(filled, width / step, mode="wrap")
        weight = np.sqrt(np.pi) * width / step
        total = -smooth * np.sqrt(2 * np.pi) * width / step
        at = int(np.argmax(total))
        if total[at] / np.sqrt(weight) > most:
            best, most = (float(total[at] / weight), width, at), float(total[at] / np.sqrt(weight))
    return best
