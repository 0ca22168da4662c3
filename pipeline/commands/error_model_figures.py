"""The paper's Fig. 4 (ring in 3D and the error around it) and Fig. 5 (largest error over tilt)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.axes3d import Axes3D

from pipeline.commands.figure import rendered, tidy
from pipeline.instrument.misalignment import (
    MisalignedScan,
    MisreadRing,
    implied_baselines_mm,
    misalignment_error,
    misread_ring,
    paper_error,
)

INCH_MM = 25.4
_TRUE, _READ, _DISTANCE, _MUTED = "#0a5ea8", "#b04a00", "#1d6f42", "#5b6875"
_STYLES = ((_DISTANCE, ":"), (_READ, "--"), (_TRUE, "-"))


def ring_figure(scan: MisalignedScan) -> Figure:
    """Return Fig. 4: the ring and the triangulated ring in 3D, and the error around the ring."""
    ring = misread_ring(scan)
    figure = Figure(figsize=(12, 5.2), layout="constrained")
    _draw_rings(figure.add_subplot(1, 2, 1, projection="3d"), ring)
    _draw_around(figure.add_subplot(1, 2, 2), scan, ring)
    figure.suptitle(
        f"{scan.diameter_mm:g} mm pipe ({scan.diameter_mm / INCH_MM:.3g} inch), "
        f"sheet tilted {scan.tilt_deg:g}°, baseline {scan.baseline_mm:.4g} mm"
    )
    return figure


def tilt_figure(scan: MisalignedScan, accuracy_mm: float) -> Figure:
    """Return Fig. 5: the largest error over tilt in 2, 3 and 4 inch pipes, the probe in their middle."""
    figure = Figure(figsize=(8.5, 5.5), layout="constrained")
    axes = figure.add_subplot()
    reach = np.degrees(np.arctan(scan.baseline_mm / (2 * INCH_MM)))
    largest_tilt_deg = min(1.0, 0.9 * float(reach))
    tilts = np.linspace(0, largest_tilt_deg, 41)
    for inches, (colour, line) in zip((2, 3, 4), _STYLES, strict=True):
        pipe = replace(scan, diameter_mm=inches * INCH_MM, tilt_deg=0.0, offset_x_mm=0.0, offset_y_mm=0.0)
        exact = [misalignment_error(replace(pipe, tilt_deg=t)).max_radial_mm for t in tilts]
        paper = [float(paper_error(pipe.radius_mm, pipe.baseline_mm, np.radians(t))) for t in tilts]
        axes.plot(tilts, exact, line, color=colour, label=f"{inches} inch, exact")
        axes.plot(
            tilts, paper, line, color=colour, lw=0.8, alpha=0.75, label=f"{inches} inch, paper's equation"
        )
    axes.axhline(accuracy_mm, color=_MUTED, lw=1, ls=(0, (1, 2)), label=f"{accuracy_mm:g} mm")
    _finish(axes, "tilt of the sheet φ, °", "largest radial error, mm")
    radial, euclidean = implied_baselines_mm(4 * INCH_MM, 0.05, 0.1)
    axes.set_title(
        f"Largest error over tilt at baseline {scan.baseline_mm:.4g} mm\n"
        f"(the paper's 0.1 mm at 0.05° in 4 inch implies {radial:.1f} mm, Euclidean {euclidean:.1f} mm)",
        fontsize=11,
    )
    axes.set(xlim=(0, largest_tilt_deg), ylim=(0, None))
    return figure


def save_figure(figure: Figure, folder: Path, name: str) -> None:
    """Write ``name``.png and ``name``.svg; the same figure gives the same bytes."""
    for kind in ("png", "svg"):
        (folder / f"{name}.{kind}").write_bytes(rendered(figure, kind, dpi=150, salt=name))


def _draw_rings(axes: Axes3D, ring: MisreadRing) -> None:
    for points, line, colour, label in (
        (ring.xyz_c, "-", _TRUE, "on the wall"),
        (ring.xyz_assumed_c, "--", _READ, "triangulated with the plane z = l"),
    ):
        x, y, z = np.concatenate([points, points[:1]]).T
        axes.plot(x, z, -y, line, color=colour, label=label)
    axes.set(xlabel="x, mm", ylabel="z, mm", zlabel="−y, mm")
    axes.set_box_aspect((1, 0.6, 1), zoom=0.92)
    axes.view_init(elev=16, azim=-62)
    axes.yaxis.set_major_locator(MaxNLocator(3))
    axes.legend(loc="upper left", fontsize=9)


def _draw_around(axes: Axes, scan: MisalignedScan, ring: MisreadRing) -> None:
    azimuth = np.degrees(ring.azimuth_rad) - scan.tilt_direction_deg
    paper = paper_error(scan.radius_mm, scan.baseline_mm, np.radians(scan.tilt_deg), np.radians(azimuth))
    axes.plot(azimuth, -ring.radial_mm, color=_TRUE, label="radial error, exact (true − triangulated)")
    axes.plot(azimuth, paper, "--", color=_READ, label="paper's equation at every azimuth")
    axes.plot(azimuth, ring.euclidean_mm, ":", color=_DISTANCE, label="distance of the points, eq. (3)")
    for at in (int(np.argmax(-ring.radial_mm)), int(np.argmin(-ring.radial_mm))):
        axes.annotate(
            f"{abs(ring.radial_mm[at]):.3f} mm", (azimuth[at], -ring.radial_mm[at]),
            xytext=(8, 8 if ring.radial_mm[at] < 0 else -14), textcoords="offset points",
        )  # fmt: skip
    axes.axhline(0, color=_MUTED, lw=0.8)
    axes.set(xlim=(0, 360), xticks=range(0, 361, 45))
    _finish(axes, "azimuth from the side toward which the sheet leans, °", "error, mm")
    axes.legend(fontsize=9, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)


def _finish(axes: Axes, x_label: str, y_label: str) -> None:
    axes.set(xlabel=x_label, ylabel=y_label)
    tidy(axes)
