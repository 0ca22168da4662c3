"""Pictures of the reports: the whole wall with numbered findings, and four views of each finding.

Distance runs to the right and the clock downward, as in every flat picture of boresight. All are SVG.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.arrays import Float
from pipeline.artefacts.measured import Wall, WallTexture
from pipeline.artefacts.model import Overlay, Overlays
from pipeline.artefacts.wall_map import WallMap
from pipeline.export.report.page import round_ticks
from pipeline.export.report.pictures import FlatImage, Window, overlay_image, photo, seen_through, windows
from pipeline.pages import notation, rendered, tidy
from pipeline.review.decisions.replay import Finding, Outline
from pipeline.review.flat_tiles import Limits, full_range_mm, values_of
from pipeline.review.run_files import RunFiles

# Pixels of the whole wall, and of one side of a picture around a finding: sharp in print at their size.
_MAP_PX, _CROP_PX = 600_000, 300
_LEAST_HALF_MM = 8.0
_EXAGGERATION = 20.0
# Smallest value of the end colours, so that noise does not look alarming; the page has the same.
_LEAST_RANGE_MM = 0.25
_INK, _SOFT, _BLUE, _ORANGE = "#16202b", "#6b7682", "#0a5ea8", "#b34700"
_MOST_NUMBERED = 40


@dataclass(frozen=True)
class Canvas:
    """The data from which pictures of a run are drawn."""

    photo: FlatImage
    deviation: FlatImage
    legend: Overlay
    limits: Limits
    wall: WallMap
    overlays: Overlays

    @property
    def radius_mm(self) -> float:
        """Nominal radius of the pipe."""
        return self.overlays.nominal_radius_mm

    def overview(self, findings: Sequence[tuple[str, Finding]]) -> bytes:
        """Return the photo of the whole wall with every finding outlined and named."""
        seen = self.wall.distance_mm[np.isfinite(self.wall.radius_mm).any(1)]
        strips = windows(float(seen[0]), float(seen[-1]), self.radius_mm, _MAP_PX)
        shape = strips[0].height_px / strips[0].width_px
        figure = Figure(figsize=(7.0, min(7.0 * shape, 3.3) * len(strips) + 0.5), layout="constrained")
        for axes, window in zip(figure.subplots(len(strips), 1, squeeze=False)[:, 0], strips, strict=True):
            _show(axes, self.photo, window)
            _clock_axis(axes)
            for name, finding in findings:
                _outline(axes, finding.outline, name if len(findings) <= _MOST_NUMBERED else "")
            axes.set_ylabel("clock", fontsize=8)
        axes.set_xlabel("distance, mm", fontsize=8)
        return rendered(figure, "svg")

    def finding(self, finding: Finding) -> bytes:
        """Return photo, deviation, cross-section and depth of a finding, each with its scale."""
        distance, azimuth = peak(finding)
        window = _about(finding.outline, self.radius_mm)
        half = (window.distance_to_mm - window.distance_from_mm) / 2
        figure = Figure(figsize=(7.0, 2.15), layout="constrained")
        flat, error, section, depth = figure.subplots(1, 4, width_ratios=(1, 1, 1, 1.25))
        for axes, image, title in ((flat, self.photo, "Photo"), (error, self.deviation, "Deviation")):
            _show(axes, image, window)
            _outline(axes, finding.outline, "")
            _scale_bar(axes, window, self.radius_mm)
            axes.set_title(title, fontsize=8)
        self._legend(error)
        self._section(section, distance, azimuth)
        self._depth(depth, distance, azimuth, half)
        return rendered(figure, "svg")

    def _legend(self, axes: Axes) -> None:
        """Draw the colour bar of the deviations below their picture; its ends hold every measured value."""
        bar = axes.inset_axes((0.0, -0.14, 1.0, 0.07))
        bar.imshow(self.legend.palette_bgr[None, 1:, ::-1], aspect="auto", extent=(0, 1, 0, 1))
        ends = (self.limits.low_mm, self.limits.high_mm)
        labels = [f"{abs(v):.2f} mm {notation.direction(v)}" for v in ends]
        bar.set_xticks([0, 1], labels, fontsize=6)
        bar.set_yticks([])

    def _section(self, axes: Axes, distance_mm: float, azimuth_rad: float) -> None:
        """Draw the cross-section, deviations from nominal exaggerated twentyfold, 12 o'clock up."""
        nominal = self.radius_mm
        angle = np.append(self.wall.azimuth_rad, self.wall.azimuth_rad[:1])
        row = self.wall.radius_mm[self.wall.row(distance_mm)]
        for radius, colour, dashes in (
            (np.full(len(row), nominal), _SOFT, "--"),
            (self.overlays.reference_radius_mm, _BLUE, "-"),
            (row, _INK, "-"),
        ):
            shown = nominal + _EXAGGERATION * (np.append(radius, radius[:1]) - nominal)
            axes.plot(shown * np.cos(angle), shown * np.sin(angle), color=colour, ls=dashes, lw=0.8)
        tip = nominal * np.array([np.cos(azimuth_rad), np.sin(azimuth_rad)])
        axes.plot([0, tip[0]], [0, tip[1]], color=_ORANGE, lw=0.8)
        axes.plot([-_EXAGGERATION / 2, _EXAGGERATION / 2], [0.35 * nominal] * 2, color=_INK, lw=1.6)
        axes.text(0, 0.4 * nominal, "1 mm of deviation", ha="center", va="top", fontsize=6)
        axes.set_aspect("equal")
        axes.invert_yaxis()
        axes.axis("off")
        axes.set_title(f"Section at {distance_mm:.1f} mm", fontsize=8)

    def _depth(self, axes: Axes, distance_mm: float, azimuth_rad: float, half_mm: float) -> None:
        """Draw the depth along and around through the peak: deep downward, inward upward, as on the page."""
        wall, fitted = self.wall, self.overlays.reference_radius_mm
        row, column = wall.row(distance_mm), wall.column(azimuth_rad)
        rows = wall.rows(distance_mm - half_mm, distance_mm + half_mm)
        reach = max(int(half_mm / (self.radius_mm * wall.step_rad)), 2)
        steps = np.arange(-reach, reach + 1)
        columns = (column + steps) % len(fitted)
        along = wall.distance_mm[rows] - distance_mm
        around = steps * wall.step_rad * self.radius_mm
        axes.plot(along, wall.radius_mm[rows, column] - fitted[column], lw=1.0, color=_INK, label="along")
        axes.plot(around, wall.radius_mm[row, columns] - fitted[columns], lw=1.0, ls="--", color=_INK,
                  label="around")  # fmt: skip
        axes.axhline(0, color=_SOFT, lw=0.6)
        axes.set_xlabel("mm from the peak", fontsize=7)
        axes.set_title("Depth, mm: deep downward", fontsize=8)
        axes.tick_params(labelsize=6)
        axes.invert_yaxis()
        axes.yaxis.set_major_formatter(lambda value, _: f"{abs(value):g}" if abs(value) > 1e-9 else "0")
        tidy(axes)
        axes.legend(fontsize=6, frameon=False)


def canvas_of(files: RunFiles) -> Canvas:
    """Return the data from which pictures of a run are drawn.

    Raises
    ------
    InputError
        When a result of the run no longer exists.
    """
    overlays = files.artefact(Overlays)
    shown = overlays.pictures[0]
    reach = max(*np.abs(full_range_mm(files, shown.name)), _LEAST_RANGE_MM)
    limits = Limits(-reach, reach)
    level = values_of(files, shown.name).levels(limits)
    return Canvas(
        photo(files.artefact(WallTexture)), replace(overlay_image(overlays, shown), stored=level), shown,
        limits, files.artefact(Wall).radius_map, overlays,
    )  # fmt: skip


def peak(finding: Finding) -> tuple[float, float]:
    """Return distance (mm) and azimuth (rad) of a finding's peak, or of its outline's middle if unknown."""
    size = finding.size
    if np.isfinite(size.peak_distance_mm):
        return size.peak_distance_mm, float(np.radians(30 * size.peak_clock - 90))
    distance, azimuth = np.mean(np.asarray(finding.outline), axis=0)
    return float(distance), float(azimuth)


def _about(outline: Outline, radius_mm: float) -> Window:
    """Return a square window around an outline, with a margin, no wider than the circumference."""
    point = np.asarray(outline, float)
    low, high = point.min(0), point.max(0)
    span = float(max(high[0] - low[0], (high[1] - low[1]) * radius_mm))
    half = min(max(0.8 * span, _LEAST_HALF_MM), np.pi * radius_mm)
    (s, a), turn = (low + high) / 2, half / radius_mm
    return Window(s - half, s + half, a - turn, a + turn, _CROP_PX, _CROP_PX)


def _show(axes: Axes, image: FlatImage, window: Window) -> None:
    extent = (window.distance_from_mm, window.distance_to_mm, window.azimuth_to_rad, window.azimuth_from_rad)
    axes.imshow(seen_through(image, window)[..., ::-1], extent=extent, aspect="auto", interpolation="nearest")
    axes.set_autoscale_on(False)
    axes.tick_params(labelsize=6)


def _outline(axes: Axes, outline: Outline, name: str) -> None:
    """Draw an outline, also a turn further where the picture's seam cuts it, and its name beside it."""
    point = np.asarray((*outline, outline[0]), float)
    low, high = sorted(axes.get_ylim())
    for turn in (-2 * np.pi, 0.0, 2 * np.pi):
        at = point + np.array([0.0, turn])
        if at[:, 1].max() < low or at[:, 1].min() > high:
            continue
        for colour, width in (("white", 2.2), (_ORANGE, 1.0)):
            axes.plot(at[:, 0], at[:, 1], color=colour, lw=width)
        if name:
            axes.text(at[:, 0].max(), at[:, 1].min(), f" {name}", fontsize=8, color="white", va="bottom",
                      bbox={"facecolor": _INK, "edgecolor": "none", "pad": 1.2}, clip_on=True)  # fmt: skip


def _scale_bar(axes: Axes, window: Window, radius_mm: float) -> None:
    """Draw a bar of a round length; the picture has the same scale in both directions."""
    axes.axis("off")
    width = window.distance_to_mm - window.distance_from_mm
    length = float(round_ticks(0, width, 4)[1])
    x = window.distance_from_mm + 0.05 * width
    y = window.azimuth_to_rad - 0.06 * width / radius_mm
    for colour, thick in (("white", 4.0), (_INK, 1.8)):
        axes.plot([x, x + length], [y, y], color=colour, lw=thick, solid_capstyle="butt")
    axes.text(x, y - 0.02 * width / radius_mm, f"{length:g} mm", fontsize=6, va="bottom",
              bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6})  # fmt: skip


def _clock_axis(axes: Axes) -> None:
    azimuth: Float = np.radians([-270, -180, -90, 0, 90])
    axes.set_yticks(azimuth, [notation.clock(h) for h in (6, 9, 12, 3, 6)])
