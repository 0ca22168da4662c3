"""A small fisheye camera in a drawn pipe: every pixel's ray meets the cylinder in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.axis import straight_axis
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.recording.base import FrameTable, PipeFacts, Recording
from tests.synthetic_wall import wall_of

RADIUS = 50.0
BASELINE = 22.0
_KEPT_POSES = 24
_IN_VIEW = {}


@dataclass(frozen=True)
class DrawnFrames:
    """A frame source over a list of images (None: cannot be decoded)."""

    images: tuple[np.ndarray | None, ...]
    image_size: tuple[int, int]

    def read(self, frames, planes):
        for frame in frames:
            yield int(frame), self.images[int(frame)]


def small_probe(scale=4.0):
    camera = KannalaBrandt(
        (int(1600 / scale), int(1200 / scale)), (360 / scale,) * 2, (800 / scale, 600 / scale)
    )
    return Probe(camera, LaserSheet(BASELINE), np.zeros((20, 20)))


def reflectance(s, psi):
    """Return the wall's colours (..., 3) between 0.2 and 0.8, with wavelengths of 12 mm and more."""
    wave = 0.5 + 0.15 * np.sin(0.5 * s + 2 * psi) + 0.12 * np.cos(5 * psi - 0.23 * s)
    return np.stack([wave, wave, 0.8 * wave + 0.05 * np.cos(psi)], -1)


def poses(count, step_mm=2.0, roll_rad=0.01):
    T = np.tile(np.eye(4), (count, 1, 1))
    k = np.arange(count)
    c, s = np.cos(roll_rad * k), np.sin(roll_rad * k)
    T[:, 0, 0], T[:, 0, 1], T[:, 1, 0], T[:, 1, 1] = c, -s, s, c
    T[:, 0, 3], T[:, 1, 3], T[:, 2, 3] = 1.5 * np.sin(0.4 * k), 1.0 * np.cos(0.3 * k), step_mm * k
    return T


def wall_hits(probe, T_pc):
    """Return points (H, W, 3) in P where the pixels' rays meet the cylinder."""
    width, height = probe.camera.image_size
    uv = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).astype(float)
    ray = probe.camera.unproject(uv).ray @ T_pc[:3, :3].T
    o = T_pc[:3, 3]
    a = ray[..., 0] ** 2 + ray[..., 1] ** 2
    b = ray[..., 0] * o[0] + ray[..., 1] * o[1]
    t = (-b + np.sqrt(b * b + a * (RADIUS**2 - o[0] ** 2 - o[1] ** 2))) / np.maximum(a, 1e-12)
    return o + t[..., None] * ray


def led_light(probe, T_pc, xyz_p):
    """Return the light on the wall from the LED ring by the plain formula: the sum of cos cos

    d² over the LEDs.
    """
    total = 0.0
    lamp = probe.lighting
    for n in range(lamp.leds):
        turn = 2 * np.pi * n / lamp.leds
        led = (
            T_pc[:3, :3] @ [lamp.radius_mm * np.cos(turn), lamp.radius_mm * np.sin(turn), lamp.z_mm]
            + T_pc[:3, 3]
        )
        d = xyz_p - led
        length = np.linalg.norm(d, axis=-1)
        at_led = np.clip((d @ T_pc[:3, 2]) / length, 0, None)
        inward = -xyz_p[..., :2] / RADIUS
        at_wall = np.clip(-(d[..., 0] * inward[..., 0] + d[..., 1] * inward[..., 1]) / length, 0, None)
        total = total + at_led * at_wall / length**2
    return total


def _wall_in_view(probe, T_pc):
    """Return polar angle, LED light and reflectance per pixel; those of the last poses are cached."""
    key = repr(probe.camera), repr(probe.lighting), T_pc.tobytes()
    if key not in _IN_VIEW:
        xyz = wall_hits(probe, T_pc)
        psi = np.arctan2(xyz[..., 1], xyz[..., 0])
        xyz_c = (xyz - T_pc[:3, 3]) @ T_pc[:3, :3]
        theta = np.arctan2(np.hypot(xyz_c[..., 0], xyz_c[..., 1]), xyz_c[..., 2])
        while len(_IN_VIEW) >= _KEPT_POSES:
            del _IN_VIEW[next(iter(_IN_VIEW))]
        _IN_VIEW[key] = theta, led_light(probe, T_pc, xyz), reflectance(xyz[..., 2], psi)
    return _IN_VIEW[key]


def draw(probe, T_pc, *, exposure=1.0, vignetting=0.0, laser=False):
    """Return the image (H, W, 3) uint8; with ``vignetting`` its light falls as cos^n of θ

    2.
    """
    theta, led, colour = _wall_in_view(probe, T_pc)
    light = led * np.cos(theta / 2) ** vignetting
    image = colour * (light * 1.8e5 * exposure)[..., None]
    if laser:
        across = (theta - np.arctan2(RADIUS, BASELINE)) * probe.camera.focal_px[0]
        image[..., 1] += 250 * np.exp(-0.5 * (across / 0.8) ** 2)
    return np.clip(np.round(np.where(theta[..., None] < 1.5, image, 0)), 0, 255).astype(np.uint8)


def recording_of(images, kind="led"):
    table = FrameTable(np.arange(len(images)), np.arange(len(images)) / 30, np.array([kind] * len(images)))
    first = next(i for i in images if i is not None)
    source = DrawnFrames(tuple(images), (first.shape[1], first.shape[0]))
    return Recording(
        "drawn", "inspection", Path("drawn"), table, None, PipeFacts(2 * RADIUS), 30.0, source, None, "k"
    )


def trajectory_of(T_pc):
    count = len(T_pc)
    axis = straight_axis(-50.0, T_pc[:, 2, 3].max() + 100)
    covariance = np.zeros((count, 6, 6))
    return Trajectory(
        np.arange(count), np.arange(count) / 30, T_pc, covariance, axis, RADIUS, 1.0, 0.0, 0.0, ()
    )


def seen_wall(T_pc):
    """Return the wall that the ring passed."""
    z = T_pc[:, 2, 3] + BASELINE
    distance = np.arange(z.min(), z.max(), 0.5)
    azimuth = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    return wall_of(distance, azimuth, np.full((len(distance), 360), RADIUS))
