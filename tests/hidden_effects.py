"""Effects that are added to recorded frames, for the twin to find."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from pipeline.arrays import Float32, Int
from stages.twin.scene import Scene

Change = Callable[[int, str, Float32], Float32]


@dataclass(frozen=True)
class Hidden:
    """An effect that is added to recorded frames.

    Attributes
    ----------
    name : str
    change : callable
        Changes the grey levels above black of a frame with a light into those with the effect.
    names : tuple of str
        Names of a mismatch that are right.
    fixed_to : str
    place : dict
        The right place, as name: (value, tolerance).
    size : float or None
        True value of the mismatch's first parameter.
    """

    name: str
    change: Change
    names: tuple[str, ...]
    fixed_to: str
    place: dict[str, tuple[float, float]]
    size: float | None = None


def effects(scene: Scene, frame: Int, random: np.random.Generator) -> list[Hidden]:
    """Return the effects to add to frames (N,), two sizes of each, at random places."""
    ring, middle = scene.ring, int(np.median(frame))
    height, width = scene.polar[0].shape
    v, u = np.mgrid[0:height, 0:width].astype(np.float32)
    phi, theta = scene.polar[1], scene.polar[0]
    found = []
    for weak in (False, True):
        azimuth = float(random.uniform(-np.pi, np.pi))
        at_u, at_v = (
            c + 0.9 * ring.radius_px * f(azimuth)
            for c, f in zip(ring.centre_px, (np.cos, np.sin), strict=True)
        )
        near = np.hypot(u - at_u, v - at_v)
        here = {"u_px": (at_u, 24.0), "v_px": (at_v, 24.0)}
        deg = float(np.degrees(azimuth))
        kind = "weak" if weak else "strong"
        loss = 0.12 if weak else 0.35
        spot = (1 - loss * np.exp(-0.5 * (near / 16) ** 2)).astype(np.float32)
        found.append(Hidden(f"dust, {kind}", _times(spot), ("window_dirt",), "image", here, loss))
        share = 0.35 if weak else 0.8
        mask = (share * np.exp(-0.5 * (near / 20) ** 2)).astype(np.float32)
        found.append(Hidden(f"scatter, {kind}", _scattering(mask), ("window_scatter",), "image", here, share))
        found.append(
            Hidden(
                f"droplet, {kind}",
                _droplet(u, v, at_u, at_v, 24.0 if weak else 40.0),
                ("droplet",),
                "image",
                here,
            )
        )
        spread = 0.025 if weak else 0.08
        each = spread * random.standard_normal(int(frame.max()) + 1)
        found.append(Hidden(f"flicker, {kind}", _by_frame(1 + each), ("flicker",), "time", {}, spread))
        step = 1.06 if weak else 1.25
        when = {"frame_from": (middle, 15.0)}
        found.append(
            Hidden(f"exposure step, {kind}", _from(middle, step), ("exposure_step",), "time", when, step - 1)
        )
        found.append(
            Hidden(
                f"laser step, {kind}",
                _from(middle, 1 / step, "laser"),
                ("laser_step",),
                "time",
                when,
                1 / step - 1,
            )
        )
        lost = 0.5 if weak else 1.0
        dim = 1 - lost * led_share(theta, phi, azimuth, scene)
        found.append(
            Hidden(f"LED fails, {kind}", _from(middle, dim, "led"), ("led_dead",), "time",
                   when | {"azimuth_deg": (deg, 20.0)}, lost)
        )  # fmt: skip
        lost, half = (0.4, 20.0) if weak else (0.85, 12.0)
        away = np.abs(np.angle(np.exp(1j * (phi - azimuth)))) * 180 / np.pi
        dim = (1 - lost * 0.5 * (1 - np.tanh((away - half) / 3))).astype(np.float32)
        found.append(
            Hidden(
                f"dim sector, {kind}",
                _from(0, dim, "laser"),
                ("laser_sector",),
                "line",
                {"azimuth_deg": (deg, 10.0)},
                lost,
            )
        )
        limit = 140.0 if weak else 100.0
        found.append(
            Hidden(
                f"clipping, {kind}",
                lambda n, k, i, limit=limit: np.minimum(i, limit),
                ("saturation",),
                "image",
                {},
            )
        )
        power = 1.15 if weak else 1.4
        found.append(
            Hidden(
                f"gamma, {kind}",
                lambda n, k, i, power=power: 255 * (np.maximum(i, 0) / 255) ** (1 / power),
                ("response",),
                "image",
                {},
            )
        )
        blur = 1.0 if weak else 2.0
        found.append(
            Hidden(
                f"defocus, {kind}",
                lambda n, k, i, blur=blur: cv2.GaussianBlur(i, (0, 0), blur),
                ("defocus",),
                "image",
                {},
            )
        )
        found += _whole_pictures(kind, weak, int(frame.max()) + 1, scene, random)
    return found


def _whole_pictures(
    kind: str, weak: bool, frames: int, scene: Scene, random: np.random.Generator
) -> list[Hidden]:
    """Return effects that change whole pictures: motion, stray light, bloom, a second line."""
    blur, light, leak, ghost = (1.2, 3.0, 0.1, 0.05) if weak else (2.5, 12.0, 0.4, 0.2)
    turn = random.uniform(0, np.pi, frames)
    v, u = np.mgrid[0 : scene.polar[0].shape[0], 0 : scene.polar[0].shape[1]].astype(np.float32)
    away = np.nan_to_num(scene.polar[0])
    shade = (light * np.exp(-0.5 * ((away - 1.0) / 0.3) ** 2)).astype(np.float32)

    def moved(number: int, kind: str, image: Float32) -> Float32:
        c, s = np.cos(turn[number]), np.sin(turn[number])
        steps = blur * np.sqrt(3) * np.linspace(-1, 1, 9)
        return np.mean(
            [
                cv2.warpAffine(image, np.float32([[1, 0, d * c], [0, 1, d * s]]), image.shape[::-1])
                for d in steps
            ],
            axis=0,
        ).astype(np.float32)

    def bloomed(number: int, kind: str, image: Float32) -> Float32:
        over = np.maximum(1.6 * image - 160, 0)
        tail = np.exp(-np.abs(np.arange(-48, 49)) / 6.0)
        return np.minimum(1.6 * image + leak * cv2.sepFilter2D(over, -1, np.ones(1), tail / 2), 160)

    def doubled(number: int, kind: str, image: Float32) -> Float32:
        (cu, cv), scale = scene.ring.centre_px, np.float32(1 / 0.8)
        other = cv2.remap(image, cu + (u - cu) * scale, cv + (v - cv) * scale, cv2.INTER_LINEAR)
        return image + np.float32(ghost) * other if kind == "laser" else image

    nowhere: dict[str, tuple[float, float]] = {}
    return [
        Hidden(f"motion blur, {kind}", moved, ("motion_blur",), "time", nowhere, blur),
        Hidden(
            f"ambient light, {kind}",
            lambda n, k, i: i + shade * (k == "laser"),
            ("ambient_light", "interreflection"),
            "wall",
            nowhere,
        ),
        Hidden(f"bloom, {kind}", bloomed, ("bloom",), "image", nowhere),
        Hidden(f"second line, {kind}", doubled, ("second_line",), "line", nowhere, ghost),
    ]


def _times(factor: Float32) -> Change:
    return lambda number, light, image: factor * image


def _by_frame(factor: Any) -> Change:
    return lambda number, light, image: np.float32(factor[number]) * image


def _from(first: int, factor: Any, only: str = "") -> Change:
    return lambda number, light, image: (
        np.float32(1) * factor * image if number >= first and only in ("", light) else image
    )


def _scattering(mask: Float32) -> Change:
    return lambda number, light, image: (1 - mask) * image + mask * cv2.GaussianBlur(image, (0, 0), 25)


def _droplet(u: Float32, v: Float32, at_u: float, at_v: float, radius: float) -> Change:
    square = ((u - at_u) ** 2 + (v - at_v) ** 2) / radius**2
    scale = np.where(square < 1, 1 - 1.6 * (1 - square), 1).astype(np.float32)
    map_u, map_v = ((at + (x - at) * scale).astype(np.float32) for x, at in ((u, at_u), (v, at_v)))
    return lambda number, light, image: cv2.remap(image, map_u, map_v, cv2.INTER_LINEAR)


def led_share(theta: Float32, phi: Float32, azimuth: float, scene: Scene) -> Float32:
    """Return an LED's share of the light on a straight, round bore, each LED shining as cos of its angle."""
    lamp, radius = scene.probe.lighting, scene.surface.mean_radius_mm
    ahead = radius / np.tan(np.clip(theta, 0.2, 2.4))
    total, own = np.zeros_like(theta), np.zeros_like(theta)
    for k in range(lamp.leds):
        turn = phi - azimuth - 2 * np.pi * k / lamp.leds
        x, y, z = radius * np.cos(turn) - lamp.radius_mm, radius * np.sin(turn), ahead - lamp.z_mm
        square = x**2 + y**2 + z**2
        toward = np.maximum(radius - lamp.radius_mm * np.cos(turn), 0)
        light = toward * np.maximum(z, 0.05 * np.sqrt(square)) / square**2
        total += light
        own = light if k == 0 else own
    return np.nan_to_num(own / total).astype(np.float32)
