"""Synthetic ring images for tests: a Gaussian line of known position, with known noise and clipping."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from pipeline.arrays import Float, Image
from pipeline.recording.base import FrameTable, PipeFacts, Planes, Recording


def off_centre(radius_px: float, along_px: float, towards_rad: float = 0.7) -> Callable[[Float], Float]:
    """Return ρ(ψ) of a circle whose centre is ``along_px`` away from the origin of ψ."""

    def radius(psi: Float) -> Float:
        across = along_px * np.sin(psi - towards_rad)
        return along_px * np.cos(psi - towards_rad) + np.sqrt(radius_px**2 - across**2)

    return radius


def ring_light(
    size: tuple[int, int],
    centre: tuple[float, float],
    radius: Callable[[Float], Float],
    width_px: float,
    amplitude: float | Callable[[Float], Float],
) -> Float:
    """Return (H, W) light of a Gaussian line along ρ(ψ), in grey levels, without noise or background."""
    v, u = np.mgrid[: size[1], : size[0]]
    du, dv = u - centre[0], v - centre[1]
    psi = np.arctan2(dv, du)
    height = amplitude(psi) if callable(amplitude) else amplitude
    return np.asarray(height * np.exp(-0.5 * ((np.hypot(du, dv) - radius(psi)) / width_px) ** 2))


def exposed(
    light: Float, random: np.random.Generator, *, read: float = 1.0, shot: float = 0.1, black: float = 16.0
) -> Image:
    """Return the 8-bit image of ``light``: variance read² + shot × light, rounded and clipped at 255."""
    noisy = light + black + random.normal(size=light.shape) * np.sqrt(read**2 + shot * light)
    return np.asarray(np.clip(np.rint(noisy), 0, 255), np.uint8)


class MemorySource:
    """A `FrameSource` of images in memory; None stands for a frame that cannot be decoded."""

    def __init__(self, images: Mapping[int, Image | None], size: tuple[int, int]) -> None:
        self.images, self.image_size = images, size

    def read(self, frames: Sequence[int], planes: Planes) -> Iterator[tuple[int, Image | None]]:
        for frame in frames:
            image = self.images[int(frame)]
            if image is not None and planes == "bgr" and image.ndim == 2:
                image = np.repeat(image[..., None], 3, axis=2)
            yield int(frame), image


def memory_recording(
    images: Mapping[int, Image | None], illumination: Sequence[str], size: tuple[int, int]
) -> Recording:
    """Return a recording of images in memory at 30 frames/s."""
    number = np.arange(len(illumination))
    table = FrameTable(number, number / 30.0, np.array(illumination))
    return Recording(
        "memory", "inspection", Path("memory"), table, None, PipeFacts(101.6), 30.0,
        MemorySource(images, size), None, "memory",
    )  # fmt: skip
