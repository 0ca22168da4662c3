"""Light of wall, lamps and laser that no photo can predict, added to recorded frames."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.arrays import Float, Float32, Int
from stages.twin.scene import Scene
from tests.hidden_effects import Change, Hidden, led_share

_GLINTS = 5


def shining(scene: Scene, frame: Int, random: np.random.Generator) -> list[Hidden]:
    """Return effects to add to frames (N,), a strong and a weak one of each, at random places."""
    found = []
    for weak in (False, True):
        kind, azimuth = ("weak" if weak else "strong"), float(random.uniform(-np.pi, np.pi))
        deg = float(np.degrees(azimuth))
        found.append(_streak(scene, kind, azimuth, 90.0 if weak else 700.0, random))
        found.append(
            Hidden(f"laser spots, {kind}", _spots(scene, 80.0 if weak else 500.0), ("glint", ""), "time", {})
        )
        where = {"distance_mm": (_middle_mm(scene, frame), 6.0), "azimuth_deg": (deg, 8.0)}
        patch = _wet(scene, where["distance_mm"][0], azimuth, (0.12, 25.0) if weak else (0.3, 70.0))
        found.append(Hidden(f"wet patch, {kind}", patch, ("wet_patch",), "wall", where))
        lost = 0.5 if weak else 1.0
        dim = 1 - lost * led_share(*scene.polar[:2], azimuth, scene)
        place = {"azimuth_deg": (deg, 20.0)}
        found.append(
            Hidden(f"LED dead throughout, {kind}", _only("led", dim), ("led_dead",), "image", place, lost)
        )
        half = 6.0 if weak else 25.0
        away = np.abs(np.angle(np.exp(1j * (scene.polar[1] - azimuth)))) * 180 / np.pi
        open_part = (0.5 * (1 + np.tanh((away - half) / 1.5))).astype(np.float32)
        found.append(
            Hidden(f"sector blocked, {kind}", _only("laser", open_part), ("laser_sector",), "line",
                   {"azimuth_deg": (deg, 10.0)}, 1.0)
        )  # fmt: skip
        bounced = _bounced(scene, 2.5 if weak else 10.0)
        names = ("interreflection", "ambient_light")
        found.append(Hidden(f"interreflection, {kind}", bounced, names, "wall", {}))
    return found


def _middle_mm(scene: Scene, frame: Int) -> float:
    place = scene.lit(scene.pose(int(frame[len(frame) // 2]))).distance_mm
    return float(np.nanquantile(place, 0.25))


def _only(light: str, factor: Float32) -> Change:
    return lambda number, kind, image: (
        factor * image if kind != ("laser" if light == "led" else "led") else image
    )


def _streak(scene: Scene, kind: str, azimuth: float, grey: float, random: np.random.Generator) -> Hidden:
    """Return the reflection of a lamp at one place of the image, which moves from frame to frame."""
    (u, v), away = scene.ring.centre_px, 1.05 * scene.ring.radius_px
    at = np.array([u + away * np.cos(azimuth), v + away * np.sin(azimuth)])
    sway = 4.0 * random.standard_normal((100_000, 2))
    size = random.uniform(5, 14), random.uniform(14, 40)

    def change(number: int, light: str, image: Float32) -> Float32:
        if light == "laser":
            return image
        made = np.zeros_like(image)
        middle = (float(at[0] + sway[number, 0]), float(at[1] + sway[number, 1]))
        cv2.ellipse(made, (middle, size, float(np.degrees(azimuth))), grey, -1)
        return image + cv2.GaussianBlur(made, (0, 0), 2.5)

    place = {"u_px": (float(at[0]), 12.0), "v_px": (float(at[1]), 12.0)}
    return Hidden(f"streak, {kind}", change, ("glint",), "image", place)


def _spots(scene: Scene, grey: float) -> Change:
    """Return bright spots of the laser beside its line, at other places in each frame."""

    def change(number: int, light: str, image: Float32) -> Float32:
        random, made = np.random.default_rng(number), np.zeros_like(image)
        if light == "led":
            return image
        u, v = scene.ring.centre_px
        for _ in range(_GLINTS):
            angle = random.uniform(-np.pi, np.pi)
            away = scene.ring.radius_px + random.choice([-1, 1]) * random.uniform(14, 60)
            middle = float(u + away * np.cos(angle)), float(v + away * np.sin(angle))
            size = float(random.uniform(5, 9)), float(random.uniform(8, 24))
            cv2.ellipse(made, (middle, size, float(np.degrees(angle))), grey, -1)
        return image + cv2.GaussianBlur(made, (0, 0), 1.6)

    return change


def _wet(scene: Scene, distance_mm: float, azimuth: float, size: tuple[float, float]) -> Change:
    """Return a film of water: the wall beneath it is darker, and reflects the lamps at grazing angles."""
    darker, grey = size
    theta, lobe = np.nan_to_num(scene.polar[0]), np.sin(np.nan_to_num(scene.polar[0])) ** 12
    lobe = (grey * np.where(theta < np.pi / 2, lobe, 1.0)).astype(np.float32)

    def change(number: int, light: str, image: Float32) -> Float32:
        if light == "laser":
            return image
        sight = scene.lit(scene.pose(number))
        around = np.angle(np.exp(1j * (sight.azimuth_rad - azimuth))) * scene.surface.mean_radius_mm
        square = ((sight.distance_mm - distance_mm) / 9.0) ** 2 + (around / 7.0) ** 2
        film = np.nan_to_num(1 / (1 + square**4)).astype(np.float32)
        return image * (1 - np.float32(darker) * film) + film * lobe

    return change


def _bounced(scene: Scene, grey: float) -> Change:
    """Return the line's light reflected from wall to wall: each place is lit by the whole ring."""
    turn = np.linspace(0, 2 * np.pi, 361)[:-1]
    along = np.linspace(0, 6, 121)
    square = (2 - 2 * np.cos(turn)) + along[:, None] ** 2
    form: Float = ((1 - np.cos(turn)) ** 2 / np.maximum(square, 1e-6) ** 2).mean(1)
    form = grey * form / form.max()

    def change(number: int, light: str, image: Float32) -> Float32:
        if light == "led":
            return image
        T_pc = scene.pose(number)
        sight, line = scene.lit(T_pc), scene.line(T_pc)
        middle = float(np.nanmedian(line.distance_mm))
        away = np.abs(sight.distance_mm - middle) / scene.surface.mean_radius_mm
        light_on = np.interp(np.nan_to_num(away, nan=6.0), along, form)
        return image + (light_on * np.nan_to_num(sight.reflectance) / 120).astype(np.float32)

    return change
