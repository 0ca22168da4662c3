"""The figure of one overlay: error colours with axes and a colour bar."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

from pipeline.arrays import Byte
from pipeline.artefacts.model import Overlay, Overlays

DPI = 120
_MM_PER_INCH = 30.0
_LONGEST_INCH = 100.0


def overlay_figure(overlays: Overlays, overlay: Overlay) -> Figure:
    """Return the figure of one overlay, without any global state of matplotlib."""
    distance = overlays.distance_mm
    width = float(np.clip(np.ptp(distance) / _MM_PER_INCH, 6, _LONGEST_INCH))
    figure = Figure(figsize=(width + 2, 5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    half = (distance[-1] - distance[0]) / max(len(distance) - 1, 1) / 2
    # No finer than the picture's own dots.
    every = max(len(distance) // int(_LONGEST_INCH * DPI), 1)
    rgb = overlay.palette_bgr[_twelve_in_the_middle(overlays, overlay.level[::every]), ::-1]
    axes.imshow(
        rgb.transpose(1, 0, 2),
        extent=(distance[0] - half, distance[-1] + half, -6, 6),
        origin="lower",
        aspect="auto",
        interpolation="nearest",
    )
    hours = np.arange(-6, 7, 3)
    axes.set_yticks(hours, [f"{(h + 11) % 12 + 1:d}" for h in hours])
    axes.set_xlabel("distance (mm)")
    axes.set_ylabel("clock position (h), clockwise looking forward")
    axes.set_title(overlay.title)
    _add_colour_bar(figure, overlay)
    return figure


def _twelve_in_the_middle(overlays: Overlays, level: Byte) -> Byte:
    """Return levels (S, A) with columns from 6 o'clock over 12 (azimuth −90°) to 6 o'clock."""
    clock = (overlays.azimuth_rad + np.pi / 2 + np.pi) % (2 * np.pi)
    return np.asarray(level[:, np.argsort(clock, kind="stable")])


def _add_colour_bar(figure: Figure, overlay: Overlay) -> None:
    colours = ListedColormap(overlay.palette_bgr[1:, ::-1] / 255.0)
    scale = ScalarMappable(Normalize(overlay.low_mm, overlay.high_mm), colours)
    bar = figure.colorbar(scale, ax=figure.axes[0], extend="both" if overlay.low_mm < 0 else "max", pad=0.01)
    bar.set_label(f"mm  (grey: not measured; {100 * overlay.beyond:.1f} % beyond the ends)")
