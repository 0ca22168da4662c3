"""The report's pictures of the wall: whole and around each finding, with marks, ticks and colour bars."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.artefacts.findings import Defect
from pipeline.artefacts.model import Overlay
from pipeline.review.flat import (
    FlatImage,
    Window,
    data_uri,
    overlay_image,
    photo,
    seen_through,
    window_about,
    windows,
)
from pipeline.review.page import Flat, Legend, Mark, Strip
from pipeline.review.plots import Tick, round_ticks
from pipeline.review.summary import RunSummary

_PIXELS = 1_100_000
_CROP_PX = 180


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
        """Return photo and deviation around a defect, as addresses; empty where there is none."""
        window = window_about(defect, self.radius_mm, _CROP_PX)
        deviation = self.overlays[0][1] if self.overlays else None
        shown = [data_uri(seen_through(i, window)) if i is not None else "" for i in (self.photo, deviation)]
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
        picture=data_uri(seen_through(image, window)),
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
    low, mid, high = (f"{v:.3g} mm" for v in (overlay.low_mm, middle, overlay.high_mm))
    return Legend(stops, low, mid, high, note)
