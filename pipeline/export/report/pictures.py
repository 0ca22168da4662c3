"""The report's pictures of the wall: whole and around each finding, with marks, ticks and colour bars.

Distance runs to the right, 12 o'clock is in the middle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.arrays import Byte, Float
from pipeline.artefacts.findings import Defect
from pipeline.artefacts.measured import WallTexture
from pipeline.artefacts.model import Overlay, Overlays
from pipeline.export.report.page import Flat, Legend, Mark, Strip, Tick, round_ticks
from pipeline.export.report.tables import RunSummary
from pipeline.pages import data_uri

TOP_RAD = -1.5 * np.pi  # 6 o'clock, a turn below +π/2
# Pixels of one picture of the whole wall, and of one about a finding: the page stays below 8 MB.
_PIXELS, _CROP_PX = 1_100_000, 180
_PAPER = 235
_FINENESS = 0.25  # px of the shrunk picture: of rows that would lie closer, some are left out beforehand


@dataclass(frozen=True)
class Gallery:
    """All pictures that there are of a wall.

    Attributes
    ----------
    photo : FlatImage or None
    overlays : tuple of (Overlay, FlatImage)
        The first is the deviation.
    strips : tuple of Window
        How the whole wall is shown.
    defects : tuple of Defect
        Marked in every picture of the whole wall.
    radius_mm : float
    """

    photo: FlatImage | None
    overlays: tuple[tuple[Overlay, FlatImage], ...]
    strips: tuple[Window, ...]
    defects: tuple[Defect, ...]
    radius_mm: float

    def flats(self) -> tuple[Flat, ...]:
        """Return the pictures of the whole wall, the photo first."""
        out = []
        if self.photo is not None:
            out.append(Flat("The wall, unrolled", self._strips(self.photo, "photo of the wall"), None))
        for overlay, image in self.overlays:
            out.append(Flat(overlay.title, self._strips(image, overlay.title), _legend(overlay)))
        return tuple(out)

    def crops(self, defect: Defect) -> tuple[str, str]:
        """Return photo and deviation around a defect as data URIs; empty where there is none."""
        window = window_about(defect, self.radius_mm, _CROP_PX)
        deviation = self.overlays[0][1] if self.overlays else None
        shown = [jpeg_uri(seen_through(i, window)) if i is not None else "" for i in (self.photo, deviation)]
        return shown[0], shown[1]

    def _strips(self, image: FlatImage, what: str) -> tuple[Strip, ...]:
        return tuple(_strip(image, window, what, self.defects) for window in self.strips)


def gallery(summary: RunSummary) -> Gallery:
    """Return the pictures that can be made of a run."""
    image = photo(summary.texture) if summary.texture is not None else None
    shown = summary.overlays
    overlays = tuple((o, overlay_image(shown, o)) for o in shown.pictures) if shown is not None else ()
    found = summary.defects.items if summary.defects is not None else ()
    rows = np.zeros(0)
    radius = summary.recording.pipe.nominal_diameter_mm / 2
    if summary.wall is not None:
        seen = np.isfinite(summary.wall.radius_map.radius_mm)
        rows = summary.wall.radius_map.distance_mm[seen.any(1)]
        radius = float(np.median(summary.wall.radius_map.radius_mm[seen])) if seen.any() else radius
    strips = windows(float(rows[0]), float(rows[-1]), radius, _PIXELS) if len(rows) > 1 else ()
    return Gallery(image, overlays, strips, found, radius)


def _strip(image: FlatImage, window: Window, what: str, found: tuple[Defect, ...]) -> Strip:
    first, last = window.distance_from_mm, window.distance_to_mm
    inside = [d for d in found if first <= d.distance_to_mm and d.distance_from_mm <= last]
    ticks = tuple(Tick(window.x_percent(float(v)), f"{v:g}") for v in round_ticks(first, last, 8))
    return Strip(
        picture=jpeg_uri(seen_through(image, window)),
        description=f"{what}, {first:.0f} to {last:.0f} mm",
        aspect=window.width_px / window.height_px,
        marks=tuple(_mark(d, window) for d in inside),
        ticks=ticks,
    )


def _mark(defect: Defect, window: Window) -> Mark:
    first, last = float(defect.outline[:, 1].min()), float(defect.outline[:, 1].max())
    turn = 2 * np.pi * np.floor((0.5 * (first + last) - window.azimuth_from_rad) / (2 * np.pi))
    ends = [window.x_percent(s) for s in (defect.distance_from_mm, defect.distance_to_mm)]
    left, right = (float(np.clip(e, 0, 100)) for e in ends)
    top, bottom = (float(np.clip(window.y_percent(a - turn), 0, 100)) for a in (first, last))
    if last - first > np.pi:
        top, bottom = 0.0, 100.0
    return Mark(defect.id, left, top, right - left, bottom - top)


def _legend(overlay: Overlay) -> Legend:
    stops = ", ".join("rgb({2},{1},{0})".format(*overlay.palette_bgr[k]) for k in range(1, 256, 16))
    middle = (overlay.low_mm + overlay.high_mm) / 2
    note = f"{100 * overlay.beyond:.1f} % of the wall lies beyond the ends" if overlay.beyond > 0 else ""
    low, mid, high = (f"{v:.3g} mm".replace("-", "−") for v in (overlay.low_mm, middle, overlay.high_mm))
    return Legend(stops, low, mid, high, note)


@dataclass(frozen=True)
class FlatImage:
    """A picture of the wall, rows along distance and columns along azimuth, and where its pixels lie.

    ``stored`` becomes BGRA for the screen by ``shown``, a part at a time: it may be larger than memory.
    """

    stored: Byte
    shown: Callable[[Byte], Byte]
    distance_from_mm: float
    mm_per_px: float
    azimuth_from_rad: float
    rad_per_px: float
    nearest: bool = False


@dataclass(frozen=True)
class Window:
    """A part of the wall as shown: distances, azimuths (the top one first), and pixels."""

    distance_from_mm: float
    distance_to_mm: float
    azimuth_from_rad: float
    azimuth_to_rad: float
    width_px: int
    height_px: int

    def x_percent(self, distance_mm: float) -> float:
        """Return the place of a distance from the left, %."""
        span = self.distance_to_mm - self.distance_from_mm
        return 100 * (distance_mm - self.distance_from_mm) / span

    def y_percent(self, azimuth_rad: float) -> float:
        """Return the place of an azimuth from the top, %."""
        return 100 * (azimuth_rad - self.azimuth_from_rad) / (self.azimuth_to_rad - self.azimuth_from_rad)


def photo(texture: WallTexture) -> FlatImage:
    """Return the wall's photo, encoded for the screen."""
    return FlatImage(
        texture.bgra, np.asarray, texture.distance_from_mm, texture.mm_per_px, texture.azimuth_from_rad,
        texture.rad_per_px,
    )  # fmt: skip


def overlay_image(overlays: Overlays, overlay: Overlay) -> FlatImage:
    """Return an overlay's error colours."""
    s, psi = overlays.distance_mm, overlays.azimuth_rad
    return FlatImage(
        overlay.level, overlay.colours_of, float(s[0]), float(s[1] - s[0]), float(psi[0]),
        float(psi[1] - psi[0]), nearest=True,
    )  # fmt: skip


def windows(from_mm: float, to_mm: float, radius_mm: float, pixels: int) -> tuple[Window, ...]:
    """Cut a wall into strips that lie below each other, all together of about ``pixels`` pixels."""
    around = 2 * np.pi * radius_mm
    count = int(np.clip(np.ceil((to_mm - from_mm) / (4 * around)), 1, 6))
    length = (to_mm - from_mm) / count
    scale = np.sqrt(pixels / count / (length * around))
    width = int(np.clip(round(length * scale), 64, 1600))
    height = int(np.clip(round(around * scale), 64, 1000))
    return tuple(
        Window(from_mm + k * length, from_mm + (k + 1) * length, TOP_RAD, TOP_RAD + 2 * np.pi, width, height)
        for k in range(count)
    )


def window_about(defect: Defect, radius_mm: float, width_px: int) -> Window:
    """Return the surroundings of a defect; for a weld a quarter of the circumference about 12 o'clock."""
    first, last = float(defect.outline[:, 1].min()), float(defect.outline[:, 1].max())
    if last - first > np.pi:
        first, last = -0.75 * np.pi, -0.25 * np.pi
    half = 0.5 * max(1.6 * defect.length_mm, 1.6 * (last - first) * radius_mm, 12.0)
    along, about = (defect.distance_from_mm + defect.distance_to_mm) / 2, (first + last) / 2
    turn = half / radius_mm
    return Window(along - half, along + half, about - turn, about + turn, width_px, width_px)


def seen_through(image: FlatImage, window: Window) -> Byte:
    """Return the part of a picture that a window shows, (H, W, 3) BGR on a light ground."""
    s = np.linspace(window.distance_from_mm, window.distance_to_mm, 2 * window.width_px + 1)[1::2]
    psi = np.linspace(window.azimuth_from_rad, window.azimuth_to_rad, 2 * window.height_px + 1)[1::2]
    row = (s - image.distance_from_mm) / image.mm_per_px
    turn = 2 * np.pi / image.rad_per_px
    column = np.mod((psi - image.azimuth_from_rad) / image.rad_per_px, turn)
    shrink = window.width_px / max(1.0, float(np.ptp(row)))
    every = max(int(_FINENESS / shrink), 1)
    margin = 3 + int(np.ceil(2 / shrink))
    first = max(0, int(np.floor(row.min())) - margin)
    last = max(first + 1, int(np.ceil(row.max())) + margin)
    part = image.shown(np.asarray(image.stored[first:last:every]))
    wide = np.concatenate([part, part[:, :2]], 1)
    x, y = np.meshgrid(column, (row - first) / every, indexing="ij")
    bgra = _remapped(wide, x, y, image.nearest, (shrink, shrink * every))
    alpha = bgra[..., 3:].astype(float) / 255
    return np.asarray(np.round(alpha * bgra[..., :3] + (1 - alpha) * _PAPER), np.uint8)


def _remapped(image: Byte, x: Float, y: Float, nearest: bool, shrink: tuple[float, float]) -> Byte:
    """Return ``image`` at (x, y), blurred first where it is shrunk (around, along)."""
    if shrink[0] < 0.5 and not nearest:
        sigma_x, sigma_y = (0.35 / s for s in shrink)
        image = cv2.GaussianBlur(image, (0, 0), sigma_x, None, sigma_y)  # type: ignore[assignment]
    first, last = max(0, int(np.floor(y.min())) - 2), int(np.ceil(y.max())) + 3
    part = np.ascontiguousarray(image[first : max(first + 1, last)])
    mode = cv2.INTER_NEAREST if nearest else cv2.INTER_LINEAR
    return np.asarray(
        cv2.remap(
            part, x.astype(np.float32), (y - first).astype(np.float32), mode, borderMode=cv2.BORDER_CONSTANT
        ),
        np.uint8,
    )


def jpeg_uri(bgr: Byte, quality: int = 82) -> str:
    """Return a picture (H, W, 3) BGR or (H, W) grey as the data URI of a JPEG.

    Raises
    ------
    OSError
        When it cannot be encoded.
    """
    encoded, jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not encoded:
        raise OSError("a picture of the page cannot be encoded as JPEG")
    return data_uri(jpeg.tobytes())
