"""Laser lines with hidden light effects for tests of the profile channel: closed forms, small images.

A gauge of three bores is seen by an equidistant camera of half resolution. Every pixel near the ring gets the
light of an exponentially modified Gaussian at its distance from the line. No code is shared with the program.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import exponnorm

from pipeline.instrument.camera.fisheye import Equidistant
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from tests.ring_images import memory_recording

SIZE, CENTRE, FOCAL = (800, 600), (402.3, 297.6), 183.0
BASELINE, SIGMA_MM, BLUR_PX = 22.0, 0.3, 0.65
BORES_MM, FRAMES_A_BORE = (50.8, 42.0, 35.0), 24
BLACK, FULL = 16.0, 219.0
REACH_PX = 18.0


@dataclass(frozen=True)
class Hidden:
    """The changes of the light against a Gaussian line; lengths mm, angles rad."""

    skewness: float = 0.0
    transport_mm: float = 0.0
    ghost: float = 0.0
    tilt_x: float = 0.0
    tilt_y: float = 0.0
    cone: float = 0.0
    copy: float = 0.0
    copy_mm: float = 0.0
    line_scale: float = 1.0
    gamma: float = 1.0
    exposure_s: float = 0.0
    dust: float = 0.0
    stray: float = 0.0
    locking_px: float = 0.0
    pixel_gain: float = 0.0
    peak: float = 0.55


def probe() -> Probe:
    camera = Equidistant(SIZE, (FOCAL, FOCAL), CENTRE)
    size = len(camera.parameter_names) + len(LaserSheet.PARAMETER_NAMES)
    return Probe(camera, LaserSheet(BASELINE, line_sigma_mm=SIGMA_MM), 1e-6 * np.eye(size))


def recording(hidden: Hidden, seed: int = 1):
    random = np.random.default_rng(seed)
    v, u = np.mgrid[: SIZE[1], : SIZE[0]].astype(float)
    du, dv = u - CENTRE[0], v - CENTRE[1]
    rho, psi = np.hypot(du, dv), np.arctan2(dv, du)
    gains = 1 + hidden.pixel_gain * random.normal(size=rho.shape)
    count = FRAMES_A_BORE * len(BORES_MM)
    images = {k: _image(hidden, k, rho, psi, gains, random) for k in range(count)}
    return memory_recording(images, ["laser"] * count, SIZE)


def _image(hidden, frame, rho, psi, gains, random):
    bore = BORES_MM[frame // FRAMES_A_BORE]
    time = frame / 30.0
    ring, _, _ = _line(hidden, bore, np.linspace(-np.pi, np.pi, 90), time)
    near = (rho > ring.min() - REACH_PX) & (rho < ring.max() + REACH_PX)
    r, p = rho[near], psi[near]
    line, scale, radius_mm = _line(hidden, bore, p, time)
    before, after = (_line(hidden, bore, p, time + s)[0] for s in (-0.005, 0.005))
    blurred = (hidden.exposure_s * (after - before) / 0.01) ** 2 / 12
    line = line + hidden.locking_px * np.sin(2 * np.pi * line)
    light = _profile(hidden, r - line, scale, blurred)
    if hidden.ghost:
        apart = 4 * radius_mm * (hidden.tilt_x * np.cos(p) + hidden.tilt_y * np.sin(p))
        apart = apart - 2 * radius_mm * hidden.cone
        light = light + hidden.ghost * _profile(hidden, r - line - scale * apart, scale, blurred)
    if hidden.copy:
        light = light + hidden.copy * _profile(hidden, r - line + scale * hidden.copy_mm, scale, blurred)
    light = light * hidden.peak * _reflectance(p, random)
    light = light * (1 - hidden.dust * np.exp(-0.5 * ((np.degrees(p) - 60) / 4) ** 2))
    grey = np.full(rho.shape, hidden.stray * hidden.peak)
    grey[near] += light * gains[near]
    grey = FULL * np.clip(grey, 0, 1) ** hidden.gamma
    noise = random.standard_normal(grey.shape, np.float32)
    return np.clip(np.rint(BLACK + grey + noise * np.sqrt(0.1 + 0.02 * grey)), 0, 255).astype(np.uint8)


def _line(hidden, bore, psi, time):
    """Image radius of the line, px per mm along the axis, and radius in mm, at azimuths psi."""
    e = 3.0 * np.array([np.cos(5.0 * time), np.sin(3.1 * time)]) + 0.2 * np.array([np.sin(33 * time), 0.0])
    along = e[0] * np.cos(psi) + e[1] * np.sin(psi)
    across = -e[0] * np.sin(psi) + e[1] * np.cos(psi)
    radius = along + np.sqrt(bore**2 - across**2)
    height = BASELINE + radius * (hidden.tilt_x * np.cos(psi) + hidden.tilt_y * np.sin(psi) + hidden.cone)
    return FOCAL * np.arctan2(radius, height), FOCAL * radius / (radius**2 + height**2), radius


def _profile(hidden, outward_px, scale, blurred):
    """Light at distances from the line, 1 at the peak of a Gaussian line, forward skewness positive."""
    sigma = hidden.line_scale * SIGMA_MM
    tau = np.cbrt(abs(hidden.skewness) / 2) * sigma
    side = np.sign(hidden.skewness) if hidden.skewness else 1.0
    normal = np.sqrt((sigma**2 - tau**2) * scale**2 + BLUR_PX**2 + blurred)
    forward = -outward_px
    if hidden.transport_mm:
        normal, tau, side = np.sqrt(sigma**2 * scale**2 + BLUR_PX**2 + blurred), hidden.transport_mm, -1.0
    if not tau:
        return np.exp(-0.5 * (outward_px / normal) ** 2)
    start = -tau * scale if hidden.skewness else 0.0
    density = exponnorm.pdf(side * forward, tau * scale / normal, loc=start, scale=normal)
    return density * normal * np.sqrt(2 * np.pi)


def _reflectance(psi, random):
    """A wall that has moved on by more than the grain of its texture from frame to frame."""
    grain = random.normal(size=180)
    smooth = np.convolve(np.concatenate([grain[-2:], grain, grain[:2]]), [0.25, 0.5, 0.25], "same")[2:-2]
    return np.exp(0.15 * np.interp(psi, np.linspace(-np.pi, np.pi, 180), smooth, period=2 * np.pi))
