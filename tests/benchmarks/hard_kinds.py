"""Kinds of hard footage: how single pictures of a recording are changed.

A function of `PAINTED` takes (image (H, W, 3) in grey levels, whether the laser alone lights it, number of
the frame, random generator) and returns the picture that is stored. Sizes are for pictures 1200 px high.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]
Paint = Callable[[Image, bool, int, np.random.Generator], Image]
GREEN = np.array([0.25, 1.0, 0.15], np.float32)


def hot_pixels(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """One pixel in 500 is white or black, others in each frame."""
    struck = random.random(image.shape[:2])
    image[struck < 0.001] = 255.0
    image[struck > 0.999] = 0.0
    return image


def static_reflection(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """A bright spot of the laser's colour beside the line, at the same place of the image in all frames."""
    if laser:
        h, w = image.shape[:2]
        v, u = np.mgrid[:h, :w]
        away = ((u - w / 2 - 0.42 * h * 0.95) / 5) ** 2 + ((v - h / 2) / 14) ** 2
        image += (300 * np.exp(-0.5 * away))[..., None] * GREEN
    return image


def droplet(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """A drop on the window displaces what is behind it by up to four pixels."""
    return _drop(image, int(0.1 * len(image)), image.shape[1] // 2 - 45)


def sliding_drop(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """The same drop slides down the window by half a pixel a frame."""
    return _drop(image, int(0.1 * len(image)) + k // 2, image.shape[1] // 2 - 45 + k // 8)


def _drop(image: Image, top: int, left: int) -> Image:
    size = 90
    v, u = np.mgrid[:size, :size].astype(np.float32) - size / 2
    lens = 4 * np.exp(-((np.hypot(u, v) / 25) ** 2)) / np.maximum(np.hypot(u, v), 1)
    rows = np.clip(np.rint(v + size / 2 + lens * v), 0, size - 1).astype(int)
    columns = np.clip(np.rint(u + size / 2 + lens * u), 0, size - 1).astype(int)
    patch = image[top : top + size, left : left + size].copy()
    image[top : top + size, left : left + size] = patch[rows, columns]
    return image


def banding(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Exposure varies by a third over the rows, and the pattern rolls from frame to frame."""
    rows = np.arange(len(image)) / 140 + 0.37 * k
    return image * (1 + 0.33 * np.sin(2 * np.pi * rows))[:, None, None].astype(np.float32)


def interlaced(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Every second row is displaced by half a pixel."""
    image[1::2] = 0.5 * (image[1::2] + np.roll(image[1::2], 1, axis=1))
    return image


def dim_sector(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """The laser is ten times weaker over 40 degrees, and missing over 10 of these."""
    if laser:
        psi = _azimuth(image)
        image[np.abs(psi - 1.2) < np.radians(20)] *= 0.1
        image[np.abs(psi - 1.2) < np.radians(5)] *= 0.0
    return image


def second_ring(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """A reflection of the ring, a quarter as bright and 6 % smaller."""
    return image + 0.25 * _shrunk(image, 0.94) if laser else image


def text_overlay(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Date and distance burnt in, white with a black rim, across the ring's upper and lower part."""
    drawn = np.clip(image, 0, 255).astype(np.uint8)
    for text, at in (
        (f"PIPE 7  DN100  2026-11-{k // 60:02d}", (430, 215)),
        (f"{0.0234 * k:8.2f} m", (640, 1010)),
    ):
        for colour, width in (((0, 0, 0), 9), ((255, 255, 255), 3)):
            cv2.putText(drawn, text, at, cv2.FONT_HERSHEY_SIMPLEX, 1.6, colour, width, cv2.LINE_AA)
    return drawn.astype(np.float32)


def clock_and_logo(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """A running clock at the left, and at the lower right a logo that is one third transparent."""
    drawn = np.clip(image, 0, 255).astype(np.uint8)
    clock = f"{k // 1800:02d}:{k // 30 % 60:02d}.{100 * (k % 30) // 30:02d}"
    cv2.putText(drawn, clock, (290, 560), cv2.FONT_HERSHEY_DUPLEX, 1.4, (60, 220, 255), 4, cv2.LINE_AA)
    logo = np.zeros_like(drawn)
    cv2.circle(logo, (1060, 880), 75, (200, 120, 40), -1, cv2.LINE_AA)
    cv2.putText(logo, "KR", (1010, 905), cv2.FONT_HERSHEY_TRIPLEX, 2.2, (255, 255, 255), 6, cv2.LINE_AA)
    opaque = 0.67 * (logo.max(2, keepdims=True) > 0)
    return (drawn * (1 - opaque) + logo * opaque).astype(np.float32)


def cable(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """A cable at 4 o'clock hides 7 degrees of the wall; the laser draws an arc on it well inside the ring."""
    psi, away = _azimuth(image), _distance(image)
    on = np.abs(psi - 0.52) < np.radians(3.5)
    image[on] = 3.0 if laser else 90.0 + 30 * np.sin(away[on] / 9)[:, None]
    if laser:
        image[on] += 180 * np.exp(-0.5 * ((away[on] - 330) / 4) ** 2)[:, None] * GREEN
    return image


def debris(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Six flakes float through the picture; one lies in the laser's plane and shines in its colour."""
    drawn = np.clip(image, 0, 255).astype(np.uint8)
    for n in range(6):
        place = np.array([311.0 * n + 6.1 * k, 197.0 * n + (3.0 + n) * k]) % (image.shape[1], image.shape[0])
        near = np.linalg.norm(place - np.array(image.shape[1::-1]) / 2)
        glows = laser and abs(near - 0.34 * len(image)) < 25
        colour = 220 * GREEN if glows else np.full(3, 2.0 if laser else 170.0)
        cv2.ellipse(
            drawn, (tuple(place), (26, 14 + 3 * n), 40.0 * n + 2 * k), colour.tolist(), -1, cv2.LINE_AA
        )
    return drawn.astype(np.float32)


def black_frames(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Five pictures in a row, and two single ones, are black."""
    return image * 0 if k in (31, 70, 71, 72, 73, 74, 120) else image


def fog(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Mist removes half of the light and scatters it into a wide glow over a grey veil."""
    small = cv2.resize(image, None, fx=0.125, fy=0.125, interpolation=cv2.INTER_AREA)
    glow = cv2.resize(cv2.GaussianBlur(small, (0, 0), 6), image.shape[1::-1])
    return 0.4 * image + 0.5 * glow + 12


def grey_camera(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """A camera without colour."""
    return np.repeat(image @ np.array([0.114, 0.587, 0.299], np.float32), 3).reshape(image.shape)


def standing_water(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Still water at 6 o'clock reflects what is above it, half as bright."""
    level = int(0.5 * len(image) + 370)
    image[level:] = 0.5 * image[level - 1 : 2 * level - len(image) - 1 : -1]
    return image


def shake(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """The camera vibrates on its mount: every picture is shifted by about one pixel."""
    move = np.hstack([np.eye(2), random.normal(0, 0.8, (2, 1))]).astype(np.float32)
    return np.asarray(cv2.warpAffine(image, move, image.shape[1::-1], flags=cv2.INTER_CUBIC), np.float32)


def scale_shrinks(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """The lens warms up: the picture shrinks linearly by 0.25 % over 170 frames."""
    return _scaled(image, 1 - 0.0025 * k / 170)


def scale_grows(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """The picture grows linearly by 0.25 % over 170 frames."""
    return _scaled(image, 1 + 0.0025 * k / 170)


def scale_settles(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """The picture shrinks by 0.3 %, exponentially with a time constant of 60 frames."""
    return _scaled(image, 1 - 0.003 * (1 - np.exp(-k / 60)))


def dark_edges(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Light falls off to a tenth towards the edge."""
    away = _distance(image)[..., None] / 600
    return image * np.clip(1 - 0.9 * away**2, 0.1, 1).astype(np.float32)


def exposure_pumping(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Automatic exposure swings between a third and one and a half within 40 frames, with a delay."""
    return image * np.float32(0.9 + 0.6 * np.sin(2 * np.pi * k / 40))


def fouled_lens(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Grease over a sector of 50 degrees: blurred by five pixels, hazy, half as bright."""
    weight = np.clip((np.radians(25) - np.abs(_azimuth(image) + 2.0)) / 0.1, 0, 1)[..., None]
    greasy = 0.5 * cv2.GaussianBlur(image, (0, 0), 5) + 8
    return np.asarray(image + weight * (greasy - image), np.float32)


def greasy_half(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Grease over the lower half: blurred by four pixels."""
    lower = len(image) // 2
    image[lower:] = cv2.GaussianBlur(image, (0, 0), 4)[lower:]
    return image


def unspoilt(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """The picture is unchanged; only the codec degrades it."""
    return image


def lamp_out(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Half of the lamps are out: a quarter of the wall is nearly dark."""
    if laser:
        return image
    return image * (0.12 + 0.88 * np.clip(0.5 + np.cos(_azimuth(image) - 1.0), 0, 1))[..., None]


def laser_flicker(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """The laser's brightness is random in each frame, and it is off in one of twelve."""
    strength = random.uniform(0.15, 1.2) * (random.random() > 1 / 12)
    return image * np.float32(strength) if laser else image


def mirrored(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Left and right are exchanged, which the probe file does not state."""
    return np.ascontiguousarray(image[:, ::-1])


def half_size(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Half as many pixels each way."""
    return np.asarray(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.float32)


def enlarged(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """A careless export: reduced to a fifth of the size, coarser than the line, and enlarged again."""
    small = cv2.resize(image, None, fx=0.2, fy=0.2, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(small, image.shape[1::-1], interpolation=cv2.INTER_CUBIC), np.float32)


def sharpened(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """The camera sharpens: one and a half times the detail finer than two pixels is added."""
    return np.asarray(image + 1.5 * (image - cv2.GaussianBlur(image, (0, 0), 2)), np.float32)


def white_balance_drifts(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """Red grows by 30 % over 170 frames, and blue falls by as much."""
    share = 0.3 * k / 170
    return image * np.array([1 - share, 1, 1 + share], np.float32)


def view_drifts(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """The camera comes loose: the picture shifts by three pixels over 170 frames."""
    move = np.float32([[1, 0, 3 * k / 170], [0, 1, 0]])
    return np.asarray(cv2.warpAffine(image, move, image.shape[1::-1], flags=cv2.INTER_CUBIC), np.float32)


def outside_first(image: Image, laser: bool, k: int, random: np.random.Generator) -> Image:
    """The first 24 pictures show a room: the probe is not yet in the pipe; its lamps and laser are on."""
    if k >= 24:
        return image
    coarse = np.random.default_rng(k // 8).normal(60, 20, (60, 80)).astype(np.float32)
    room = cv2.resize(coarse, image.shape[1::-1], interpolation=cv2.INTER_CUBIC)
    return np.repeat((0.15 if laser else 1.0) * room[..., None], 3, 2)


def _azimuth(image: Image) -> NDArray[np.float64]:
    h, w = image.shape[:2]
    return np.asarray(np.arctan2(*(np.mgrid[:h, :w] - np.array([h, w])[:, None, None] / 2)))


def _distance(image: Image) -> NDArray[np.float64]:
    h, w = image.shape[:2]
    return np.asarray(np.hypot(*(np.mgrid[:h, :w] - np.array([h, w])[:, None, None] / 2)))


def _scaled(image: Image, factor: float) -> Image:
    h, w = image.shape[:2]
    centre = (np.array([w, h]) - 1) / 2
    move = np.column_stack([factor * np.eye(2), (1 - factor) * centre]).astype(np.float64)
    return np.asarray(cv2.warpAffine(image, move, (w, h), flags=cv2.INTER_CUBIC), np.float32)


def _shrunk(image: Image, factor: float) -> Image:
    h, w = image.shape[:2]
    v = np.clip(np.rint((np.arange(h) - h / 2) / factor + h / 2), 0, h - 1).astype(int)
    u = np.clip(np.rint((np.arange(w) - w / 2) / factor + w / 2), 0, w - 1).astype(int)
    return image[np.ix_(v, u)]


PAINTED: dict[str, Paint] = {
    f.__name__.replace("_", "-"): f
    for f in (
        hot_pixels, static_reflection, droplet, banding, interlaced, dim_sector, second_ring, sliding_drop,
        text_overlay, clock_and_logo, cable, debris, black_frames, fog, grey_camera, standing_water, shake,
        dark_edges, exposure_pumping, fouled_lens, greasy_half, lamp_out, laser_flicker, mirrored, half_size,
        scale_shrinks, scale_grows, scale_settles, outside_first, enlarged, sharpened,
        white_balance_drifts, view_drifts,
    )
}  # fmt: skip
